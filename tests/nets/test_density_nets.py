"""Tempo-density networks: shapes, training, curves of takes and songs, storage."""

import numpy as np
import pytest
import torch
from synthetic_style_takes import click_take
from torch import nn

from choreograph.core.errors import ParameterError
from choreograph.nets.configs import density_config
from choreograph.nets.density import MotionDecoder, MotionDensity, MusicDensity
from choreograph.nets.density_training import (
    density_loss,
    train_motion_density,
    train_music_density,
    warped_pairs,
)
from choreograph.nets.style import centred
from choreograph.nets.training import TrainingContext

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def tiny():
    return density_config("tiny", steps=30, music_steps=20)


def test_the_published_networks_have_no_skips_velocities_or_unit_variance():
    config = density_config("tiny", skips=False, velocities=False, unit_variance=False, loss="paper")
    nets = nn.ModuleList([MotionDensity(config), MotionDecoder(config)])
    pairs = warped_pairs([click_take()], 3, np.random.default_rng(0), augmented=False)
    density_loss(nets[0], nets[1], pairs, config).backward()
    assert all(p.grad is not None and torch.isfinite(p.grad).all() for p in nets.parameters())
    # The hidden vector is all that the density is made of: what it hides, the density cannot show.
    seen = []
    nets[0].convs[-1].register_forward_hook(lambda module, given, out: torch.zeros_like(out))
    for body in (pairs.body, pairs.body.roll(40, dims=1)):
        seen.append(nets[0].eval()(body)[0])
    torch.testing.assert_close(seen[0], seen[1])
    music = MusicDensity(config).eval()
    assert music(torch.randn(2, 240, 96)).shape == (2, 80)
    curves = music.song_density(np.random.default_rng(0).normal(size=(300, 96)), 3)
    assert abs(curves.std() - 1.0) > 0.1


def test_clips_as_they_are_differ_from_their_warps_in_time_alone():
    take = click_take(duration_s=8)
    pairs = warped_pairs([take], 4, np.random.default_rng(0), augmented=False)
    for clip in pairs.body.numpy():
        np.testing.assert_array_equal(clip, centred(take.body_pos_m[None])[0])


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


def test_paper_preset_has_the_papers_sizes_and_gradients_everywhere():
    config = density_config("paper")
    nets = nn.ModuleList([MotionDensity(config), MotionDecoder(config)])
    assert config.hidden_dim == 4096
    assert nets[0].content[-1].out_features == 1024
    pairs = warped_pairs([click_take()], 2, np.random.default_rng(0))
    density_loss(nets[0], nets[1], pairs, config).backward()
    for name, parameter in nets.named_parameters():
        assert parameter.grad is not None, name
        assert torch.isfinite(parameter.grad).all(), name
    music = MusicDensity(config)
    music(torch.randn(2, 240, 96)).square().mean().backward()
    assert all(p.grad is not None for p in music.parameters())


def test_training_lowers_the_loss_and_estimates_curves_of_any_take(tiny):
    seen = []
    context = TrainingContext(device="cpu", report=seen.append)
    generator = torch.get_rng_state()
    net = train_motion_density([click_take("a"), click_take("b", seed=1)], tiny, seed=0, context=context)
    assert torch.equal(torch.get_rng_state(), generator)
    assert np.mean([p.loss for p in seen[-5:]]) < 0.8 * np.mean([p.loss for p in seen[:5]])
    curve = net.take_density(click_take(duration_s=11).body_pos_m[:-7])
    assert curve.shape == (213,)
    assert np.isfinite(curve).all()
    assert curve.std() > 0.3
    assert net.take_density(np.zeros((1, 21, 3))).shape == (1,)


def test_a_take_moved_and_rotated_has_the_same_density(tiny):
    body = click_take().body_pos_m
    net = MotionDensity(tiny)
    moved = body[..., [2, 1, 0]] * np.array([1, 1, -1], np.float32) + np.array([3, 0, -2], np.float32)
    np.testing.assert_allclose(net.take_density(moved), net.take_density(body), atol=2e-3)


def test_trained_music_density_takes_songs_of_any_length(tiny):
    motion = MotionDensity(tiny)
    net = train_music_density([click_take("a"), click_take("b", seed=1)], motion, tiny, seed=0)
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
    with pytest.raises(ParameterError, match="other shapes"):
        cls.from_arrays(arrays, config | {"width": 32})
    with pytest.raises(ParameterError, match="surprise"):
        cls.from_arrays(arrays, config | {"surprise": 1})


def test_takes_too_short_are_refused(tiny):
    with pytest.raises(ParameterError, match="a take of 8 s or more"):
        train_motion_density([click_take(duration_s=7)], tiny, seed=0)


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"loss": "x"}, "density loss"), ({"steps": 0}, "steps"), ({"width": 6}, "heads"),
        ({"music_target": "x"}, "a music target"),
        ({"music_target": "clip", "synchronise": True}, "raw targets of clips"),
    ],
)  # fmt: skip
def test_impossible_configurations_are_refused(changes, named):
    with pytest.raises(ParameterError, match=named):
        density_config("tiny", **changes)
