"""Loop points: the nearest ends of whole bars."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from synthetic_motions import stepping

from choreograph.core.counts import NO_COUNTS, make_counts, numbers_in_bar
from choreograph.motion.body import body_pos_m
from choreograph.pipeline.counting import best_loops, pose_distances, song_distances

N = 40
FPS = 60.0


def counted(n: int = N, metre: int = 4, first: int = 1):
    numbers = numbers_in_bar(n, metre, first=first) if metre else np.zeros(n)
    return make_counts(0.5 * np.arange(n), numbers, metre)


@given(st.sampled_from([3, 4]), st.integers(1, 3), st.integers(0, 3), st.sampled_from([1, 2, 4]))
def test_the_nearest_ends_are_found_on_count_1(metre, first, start_bar, length):
    counts = counted(metre=metre, first=first)
    ones = np.flatnonzero(counts.numbers == 1)
    start, end = ones[start_bar], ones[start_bar + length]
    distances = np.random.default_rng(0).uniform(1.0, 2.0, (N, N))
    distances[start, end] = 0.5
    distances[ones[0] + 1, ones[1] + 1] = 0.0  # not on count 1
    found = {loop.n_counts: loop for loop in best_loops(distances, counts)}
    loop = found[length * metre]
    assert (loop.start_s, loop.end_s, loop.distance) == (0.5 * start, 0.5 * end, 0.5)
    assert all(other.distance >= 1.0 for n, other in found.items() if n != length * metre)


def test_without_bars_loops_last_counts():
    loops = best_loops(np.ones((N, N)), counted(metre=0))
    assert [loop.n_counts for loop in loops] == [1, 2, 4, 8, 16, 32]


def test_too_few_counts_make_no_loop():
    assert best_loops(np.zeros((0, 0)), NO_COUNTS) == ()
    assert best_loops(np.zeros((4, 4)), counted(4)) == ()


def test_poses_are_compared_where_the_dancer_stands_and_with_where_they_go():
    """Steps repeat every second count. The pose at every count is the same, but the next step is not."""
    motion = stepping(round(10 * FPS), fps=FPS, period_s=0.5)
    pos_m = body_pos_m(motion)
    times_s = np.arange(2.0, 8.0, 0.5)
    away = pose_distances(pos_m, FPS, times_s)
    assert np.allclose(away, away.T, atol=1e-9) and np.allclose(np.diag(away), 0.0)
    moved = pose_distances(pos_m + np.array([3.0, 0.0, -1.0]), FPS, times_s)
    np.testing.assert_allclose(moved, away, atol=1e-9)
    at_rest = pose_distances(np.repeat(pos_m[:1], len(pos_m), axis=0), FPS, times_s)
    np.testing.assert_allclose(at_rest, 0.0, atol=1e-9)
    assert away.max() > 0.005


def test_a_song_that_repeats_is_near_at_the_repeat():
    rng = np.random.default_rng(1)
    verse, other = rng.normal(size=(16, 87)), rng.normal(size=(8, 87))
    features = np.concatenate([verse, other, verse])  # a repeat after 24 counts
    away = song_distances(features, counted(len(features)))
    assert away.shape == (40, 40)
    assert away[4, 28] == pytest.approx(0.0, abs=1e-6)
    assert away[4, 12] > 0.5
    [loop] = [loop for loop in best_loops(away, counted(40)) if loop.n_counts == 16]
    assert loop.distance > 0.3
