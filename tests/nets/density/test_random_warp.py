"""Laws of the Random Time-Warper."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from choreograph.errors import ParameterError
from choreograph.nets.density.random_warp import random_time_map, random_warp, resampled


@given(
    n_frames=st.integers(2, 300),
    beats=st.lists(st.floats(0.0, 15.0), max_size=40),
    share=st.floats(0.0, 1.0),
    seed=st.integers(0, 1000),
)
def test_map_keeps_ends_and_slopes(n_frames, beats, share, seed):
    frames = random_time_map(
        n_frames, 20, np.random.default_rng(seed), beat_times_s=np.unique(beats), share=share
    )
    assert frames.shape == (n_frames,)
    assert frames[0] == 0 and frames[-1] == pytest.approx(n_frames - 1)
    slopes = np.diff(frames)
    assert slopes.min() >= 0.5 - 1e-9 and slopes.max() <= 2 + 1e-9


def test_beats_move_by_no_more_than_the_limit_and_really_move():
    beats = np.arange(0.5, 8.0, 0.5)
    moved = []
    for seed in range(50):
        frames = random_time_map(160, 20, np.random.default_rng(seed), beat_times_s=beats, share=1.0)
        inverse = np.interp(beats * 20, frames, np.arange(160)) / 20
        moved.append(np.abs(inverse - beats))
    assert np.max(moved) <= 0.5 + 1e-9
    assert np.mean(moved) > 0.1


def test_no_shift_is_the_identity_and_seeds_decide():
    beats = np.arange(0.5, 8.0, 0.5)
    still = random_time_map(160, 20, np.random.default_rng(0), beat_times_s=beats, max_shift_s=0.0)
    np.testing.assert_allclose(still, np.arange(160), atol=1e-9)
    one, two, other = (
        random_time_map(160, 20, np.random.default_rng(s), beat_times_s=beats) for s in (1, 1, 2)
    )
    assert np.array_equal(one, two) and not np.array_equal(one, other)


def test_positions_follow_the_map():
    body = np.broadcast_to(np.arange(160.0)[:, None, None], (160, 21, 3))  # every joint at its frame
    warped, frames = random_warp(body, 20, np.random.default_rng(4), beat_times_s=np.arange(0.5, 8, 0.4))
    np.testing.assert_allclose(warped[:, 3, 1], frames, atol=1e-4)
    assert warped.shape == body.shape and warped.dtype == np.float32


def test_resampling_holds_the_ends_and_takes_one_frame():
    np.testing.assert_allclose(resampled(np.array([1.0, 3.0]), [-1, 0.25, 5]), [1, 1.5, 3])
    np.testing.assert_allclose(resampled(np.array([2.0]), [0, 1]), [2, 2])


@pytest.mark.parametrize("bad", [{"n_frames": 1}, {"share": 1.5}, {"max_shift_s": -0.1}])
def test_impossible_requests_are_refused(bad):
    arguments = {
        "n_frames": 160,
        "fps": 20,
        "rng": np.random.default_rng(0),
        "beat_times_s": np.ones(1),
    } | bad
    with pytest.raises(ParameterError, match="expected two frames"):
        random_time_map(**arguments)
