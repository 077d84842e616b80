"""Random time maps, warped pairs, and pairs of music and target density."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from synthetic_style_takes import click_take

from choreograph.core.errors import ParameterError
from choreograph.core.timebase import MAX_SLOPE, MIN_SLOPE
from choreograph.nets.configs import density_config
from choreograph.nets.density import MotionDensity
from choreograph.nets.density_training import (
    MusicDensityData,
    interpolate_curves,
    random_time_map,
    synchronising_map,
    target_density,
    warped_pairs,
)


@given(
    n_frames=st.integers(2, 300),
    beats=st.lists(st.floats(0.0, 15.0), max_size=40),
    share=st.floats(0.0, 1.0),
    seed=st.integers(0, 1000),
)
def test_time_maps_keep_their_ends_and_the_limits_of_slope(n_frames, beats, share, seed):
    frames = random_time_map(
        n_frames, 20, np.random.default_rng(seed), beat_times_s=np.unique(beats), share=share
    )
    assert frames.shape == (n_frames,)
    assert frames[0] == 0 and frames[-1] == pytest.approx(n_frames - 1)
    slopes = np.diff(frames)
    assert slopes.min() >= MIN_SLOPE - 1e-9 and slopes.max() <= MAX_SLOPE + 1e-9


def test_beats_move_but_by_no_more_than_the_limit():
    beats = np.arange(0.5, 8.0, 0.5)
    shifts = []
    for seed in range(50):
        frames = random_time_map(160, 20, np.random.default_rng(seed), beat_times_s=beats, share=1.0)
        inverse = np.interp(beats * 20, frames, np.arange(160)) / 20
        shifts.append(np.abs(inverse - beats))
    assert np.max(shifts) <= 0.5 + 1e-9
    assert np.mean(shifts) > 0.1


def test_no_shift_gives_the_identity_and_seeds_repeat():
    beats = np.arange(0.5, 8.0, 0.5)
    still = random_time_map(160, 20, np.random.default_rng(0), beat_times_s=beats, max_shift_s=0.0)
    np.testing.assert_allclose(still, np.arange(160), atol=1e-9)
    one, two, other = (
        random_time_map(160, 20, np.random.default_rng(s), beat_times_s=beats) for s in (1, 1, 2)
    )
    assert np.array_equal(one, two) and not np.array_equal(one, other)


@pytest.mark.parametrize("bad", [{"n_frames": 1}, {"share": 1.5}, {"max_shift_s": -0.1}])
def test_impossible_time_maps_are_refused(bad):
    arguments = {
        "n_frames": 160,
        "fps": 20,
        "rng": np.random.default_rng(0),
        "beat_times_s": np.ones(1),
    } | bad
    with pytest.raises(ParameterError, match="expected two frames"):
        random_time_map(**arguments)


def test_warped_pairs_follow_their_time_map():
    pairs = warped_pairs([click_take()], 6, np.random.default_rng(5))
    assert np.all(np.diff(pairs.frames.numpy(), axis=1) >= 0.49)
    # Distances between joints do not depend on where the clip was centred.
    distance = (pairs.body[:, :, 3] - pairs.body[:, :, 15]).norm(dim=2)
    warped = (pairs.warped[:, :, 3] - pairs.warped[:, :, 15]).norm(dim=2)
    torch.testing.assert_close(interpolate_curves(distance, pairs.frames), warped, atol=0.1, rtol=0)


def test_synchronising_map_aligns_near_beats_and_ignores_far_ones():
    motion, music = np.array([0.6, 1.1, 1.7, 3.5]), np.array([0.5, 1.0, 1.5, 2.0, 4.2])
    frames = synchronising_map(120, motion, music)
    assert np.all(np.diff(frames) > 0)
    assert frames[0] == 0
    assert frames[-1] == 119
    for music_beat, motion_beat in ((0.5, 0.6), (1.0, 1.1)):
        assert np.interp(music_beat * 20, np.arange(120), frames) == pytest.approx(motion_beat * 20)
    assert np.interp(4.2 * 20, np.arange(120), frames) / 20 == pytest.approx(4.2, abs=0.1)
    np.testing.assert_allclose(synchronising_map(120, np.zeros(0), music), np.arange(120), atol=1e-9)


def test_synchronised_targets_differ_from_raw_ones():
    net, take = MotionDensity(density_config("tiny")), click_take()
    raw = target_density(take, net, synchronise=False)
    synchronised = target_density(take, net, synchronise=True)
    assert raw.shape == synchronised.shape == (240,)
    assert not np.allclose(raw, synchronised)


def test_music_batches_have_segments_and_their_targets():
    net = MotionDensity(density_config("tiny"))
    data = MusicDensityData([click_take(), click_take("short", 5)], net, synchronise=False, of_clips=False)
    assert [take.name for take in data.takes] == ["a"]
    mel, target = data.batch(3, np.random.default_rng(0))
    assert mel.shape == (3, 240, 96) and target.shape == (3, 80)
    with pytest.raises(ParameterError, match="8 s of music and motion"):
        MusicDensityData([click_take("short", 5)], net, synchronise=False, of_clips=False)


def test_targets_of_clips_are_the_middles_of_their_own_densities():
    net, take = MotionDensity(density_config("tiny", unit_variance=False)), click_take()
    data = MusicDensityData([take], net, synchronise=False, of_clips=True)
    mel, target = data.batch(3, np.random.default_rng(0), augmented=False)
    rng = np.random.default_rng(0)
    rng.choice(1, 3, p=[1.0])
    for row, start in enumerate(int(rng.integers(240 - 160 + 1)) for _ in range(3)):
        of_clip = net.clip_densities(take.body_pos_m[None, start : start + 160])[0]
        np.testing.assert_allclose(target[row], of_clip[40:120], atol=1e-6)
        np.testing.assert_array_equal(mel[row], take.log_mel[3 * (start + 40) :][:240])
    averaged = target_density(take, net, synchronise=False)
    assert np.abs(of_clip[40:120] - averaged[start + 40 : start + 120]).max() > 1e-4
