"""Losses of motion's tempo-density on synthetic models with known answers."""

import numpy as np
import pytest
import torch
from synthetic_style_takes import click_take
from torch import nn

from choreograph.nets.density import standardised
from choreograph.nets.density_training import (
    DensityOutputs,
    WarpedPairs,
    interpolate_curves,
    location_loss,
    reconstruction_loss,
    warped_pairs,
)


class SyntheticDecoder(nn.Module):
    """Decodes to clips in which every coordinate is the density plus the content."""

    def forward(self, density, content):
        return (density + content[:, :1])[:, :, None, None].expand(-1, -1, 21, 3)


def test_equation_2_is_zero_only_for_the_right_four_reconstructions():
    density, warped = torch.randn(2, 160), torch.randn(2, 160)
    content = torch.ones(2, 5)
    decode = SyntheticDecoder()
    pairs = WarpedPairs(decode(density, content), decode(warped, content), torch.zeros(2, 160))

    def loss(*outputs):
        return reconstruction_loss(decode, pairs, DensityOutputs(*outputs), content_weight=0.5).item()

    assert loss(density, warped, content, content) == pytest.approx(0.0, abs=1e-6)
    # If one content is off by 2, two reconstructions and the content term are wrong.
    assert loss(density, warped, content, content + 2) == pytest.approx(2 * 4 + 0.5 * 4, rel=1e-4)
    # If the densities are exchanged, all four reconstructions are wrong.
    expected = 4 * (density - warped).square().mean().item()
    assert loss(warped, density, content, content) == pytest.approx(expected, rel=1e-4)


def test_location_loss_is_low_only_for_the_true_map_and_a_detailed_curve():
    rng = np.random.default_rng(2)
    frames = warped_pairs([click_take(seed=3)], 4, rng).frames
    detailed = standardised(
        torch.from_numpy(rng.normal(size=(4, 40)).astype(np.float32)).repeat_interleave(4, 1)
    )
    true = location_loss(interpolate_curves(detailed, frames), detailed, frames, temperature=0.1)
    wrong = location_loss(detailed.flip(1), detailed, frames, temperature=0.1)
    flat = location_loss(torch.zeros(4, 160), torch.zeros(4, 160), frames, temperature=0.1)
    assert true < 0.5
    assert wrong > 2 * true + 1
    assert flat == pytest.approx(np.log(39), rel=0.1)  # all shifts are equally likely: chance
