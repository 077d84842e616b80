"""Tempo-density networks: shapes, the losses on planted models, training, storage."""

import numpy as np
import pytest
import torch
from torch import nn

from choreograph.errors import ParameterError
from choreograph.nets.density.config import density_config
from choreograph.nets.density.model import (
    HIDDEN_FRAMES,
    MotionDecoder,
    MotionDensity,
    MusicDensity,
    standardised,
)
from choreograph.nets.density.train import (
    DensityOutputs,
    WarpedPairs,
    at_frames,
    density_loss,
    equation_2,
    location_loss,
    train_motion_density,
    warped_pairs,
)
from choreograph.nets.density.train_music import (
    synchronising_map,
    target_density,
    train_music_density,
)
from choreograph.nets.style.data import StyleTake
from choreograph.nets.training import TrainingContext


def _take(name="a", seconds=12, seed=0):
    """A body swinging irregularly to a click at every 0.5 s."""
    rng = np.random.default_rng(seed)
    n = seconds * 20
    phase = np.cumsum(rng.uniform(0.1, 0.3, n))
    reach = rng.normal(size=(21, 3)) * 0.3
    body = np.sin(phase)[:, None, None] * reach + rng.normal(size=(21, 3))
    mel = np.full((seconds * 60, 96), -10.0, np.float32)
    mel[::30] = 0.0
    beats = np.arange(0.6, seconds - 0.5, 0.5)
    return StyleTake(name, name, "", mel, np.zeros((1, 1), np.float32), body.astype(np.float32), beats)


@pytest.fixture(scope="module")
def tiny():
    return density_config("tiny", steps=30, music_steps=20)


@pytest.mark.parametrize("preset", ["tiny", "small"])
def test_shapes(preset):
    config = density_config(preset)
    estimator, decoder = MotionDensity(config), MotionDecoder(config)
    density, content = estimator(torch.randn(3, 160, 21, 3))
    assert density.shape == (3, 160)
    assert content.shape == (3, config.content_dim)
    assert decoder(density, content).shape == (3, 160, 21, 3)
    assert MusicDensity(config)(torch.randn(3, 240, 96)).shape == (3, 80)
    torch.testing.assert_close(density.mean(dim=1), torch.zeros(3), atol=1e-4, rtol=0)


def test_paper_preset_has_the_papers_sizes_and_learns_everywhere():
    config = density_config("paper")
    nets = nn.ModuleList([MotionDensity(config), MotionDecoder(config)])
    assert HIDDEN_FRAMES * config.conv_channels[-1] == 4096
    assert nets[0].content[-1].out_features == 1024
    pairs = warped_pairs([_take()], 2, np.random.default_rng(0))
    density_loss(nets[0], nets[1], pairs, config).backward()
    for name, parameter in nets.named_parameters():
        assert parameter.grad is not None, name
        assert torch.isfinite(parameter.grad).all(), name
    music = MusicDensity(config)
    music(torch.randn(2, 240, 96)).square().mean().backward()
    assert all(p.grad is not None for p in music.parameters())


class _PlantedDecoder(nn.Module):
    """Builds the clip whose every joint stands at the density plus the content."""

    def forward(self, density, content):
        return (density + content[:, :1])[:, :, None, None].expand(-1, -1, 21, 3)


def test_equation_2_is_zero_only_for_the_right_four():
    density, warped = torch.randn(2, 160), torch.randn(2, 160)
    content = torch.ones(2, 5)
    build = _PlantedDecoder()
    pairs = WarpedPairs(build(density, content), build(warped, content), torch.zeros(2, 160))
    right = DensityOutputs(density, warped, content, content)
    assert equation_2(build, pairs, right, content_weight=0.5).item() == pytest.approx(0.0, abs=1e-6)
    # A content off by 2 in one of the two costs that of two reconstructions, and the content term.
    off = DensityOutputs(density, warped, content, content + 2)
    assert equation_2(build, pairs, off, content_weight=0.5).item() == pytest.approx(
        2 * 4 + 0.5 * 4, rel=1e-4
    )
    # Densities exchanged spoil all four.
    mixed = DensityOutputs(warped, density, content, content)
    expected = 4 * (density - warped).square().mean().item()
    assert equation_2(build, pairs, mixed, content_weight=0.5).item() == pytest.approx(expected, rel=1e-4)


def test_location_loss_wants_the_true_map_and_a_curve_with_detail():
    rng = np.random.default_rng(2)
    take = _take(seed=3)
    frames = warped_pairs([take], 4, rng).frames
    detailed = standardised(
        torch.from_numpy(rng.normal(size=(4, 40)).astype(np.float32)).repeat_interleave(4, 1)
    )
    true = location_loss(at_frames(detailed, frames), detailed, frames, temperature=0.1)
    wrong = location_loss(detailed.flip(1), detailed, frames, temperature=0.1)
    flat = location_loss(torch.zeros(4, 160), torch.zeros(4, 160), frames, temperature=0.1)
    assert true < 0.5
    assert wrong > 2 * true + 1
    assert flat == pytest.approx(np.log(39), rel=0.1)  # every shift alike: chance


def test_warped_pairs_follow_their_map():
    pairs = warped_pairs([_take()], 6, np.random.default_rng(5))
    frames = pairs.frames.numpy()
    assert np.all(np.diff(frames, axis=1) >= 0.49)
    # Distances between joints do not depend on where the clip was centred.
    spread = (pairs.body[:, :, 3] - pairs.body[:, :, 15]).norm(dim=2)
    warped = (pairs.warped[:, :, 3] - pairs.warped[:, :, 15]).norm(dim=2)
    torch.testing.assert_close(at_frames(spread, pairs.frames), warped, atol=0.1, rtol=0)


def test_training_lowers_the_loss_and_only_estimates_densities(tiny):
    seen = []
    context = TrainingContext(device="cpu", report=seen.append)
    net = train_motion_density([_take("a"), _take("b", seed=1)], tiny, seed=0, context=context)
    assert np.mean([p.loss for p in seen[-5:]]) < 0.8 * np.mean([p.loss for p in seen[:5]])
    curve = net.take_density(_take(seconds=11).body_pos_m[:-7])
    assert curve.shape == (213,)
    assert np.isfinite(curve).all()
    assert curve.std() > 0.3
    assert net.take_density(np.zeros((1, 21, 3))).shape == (1,)


def test_a_take_moved_and_turned_has_the_same_density(tiny):
    body = _take().body_pos_m
    net = MotionDensity(tiny)
    turned = body[..., [2, 1, 0]] * np.array([1, 1, -1], np.float32) + np.array([3, 0, -2], np.float32)
    np.testing.assert_allclose(net.take_density(turned), net.take_density(body), atol=2e-3)


def test_music_training_and_songs_of_any_length(tiny):
    motion = MotionDensity(tiny)
    net = train_music_density([_take("a"), _take("b", seed=1)], motion, tiny, seed=0)
    for n_frames, n_seconds in ((1, 1), (600, 10), (500, 12)):
        curves = net.song_density(np.random.default_rng(0).normal(size=(n_frames, 96)), n_seconds)
        assert curves.shape == (n_seconds, 80)
        assert np.isfinite(curves).all()
    np.testing.assert_allclose(curves.mean(axis=1), 0, atol=1e-4)


@pytest.mark.parametrize("cls", [MotionDensity, MusicDensity])
def test_weights_come_back_and_others_are_refused(cls, tiny):
    net = cls(tiny)
    arrays, config = net.to_arrays()
    again = cls.from_arrays(arrays, config)
    for name, value in net.state_dict().items():
        assert torch.equal(value, again.state_dict()[name]), name
    with pytest.raises(ParameterError, match="mixes versions"):
        cls.from_arrays(arrays, config | {"width": 32})
    with pytest.raises(ParameterError, match="surprise"):
        cls.from_arrays(arrays, config | {"surprise": 1})


def test_synchronising_map_brings_near_beats_together_and_leaves_far_ones():
    motion, music = np.array([0.6, 1.1, 1.7, 3.5]), np.array([0.5, 1.0, 1.5, 2.0, 4.2])
    frames = synchronising_map(120, motion, music)
    assert np.all(np.diff(frames) > 0)
    assert frames[0] == 0
    assert frames[-1] == 119
    for beat, mine in ((0.5, 0.6), (1.0, 1.1)):
        assert np.interp(beat * 20, np.arange(120), frames) == pytest.approx(mine * 20)
    assert np.interp(4.2 * 20, np.arange(120), frames) / 20 == pytest.approx(4.2, abs=0.1)
    np.testing.assert_allclose(synchronising_map(120, np.zeros(0), music), np.arange(120), atol=1e-9)


def test_synchronised_targets_differ_from_raw_ones(tiny):
    net, take = MotionDensity(tiny), _take()
    raw = target_density(take, net, synchronise=False)
    moved = target_density(take, net, synchronise=True)
    assert raw.shape == moved.shape == (240,)
    assert not np.allclose(raw, moved)


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"loss": "x"}, "density loss"),
        ({"steps": 0}, "steps"),
        ({"width": 6}, "heads"),
        ({"wide": 1}, "wide"),
    ],
)
def test_configs_that_cannot_be_are_refused(changes, named):
    with pytest.raises(ParameterError, match=named):
        density_config("tiny", **changes)
    with pytest.raises(ParameterError, match="huge"):
        density_config("huge")
