"""Requests: shares of genres, planted tempi, distances of dances, nothing, malformed input."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic_motions import stepping, swaying

from choreograph.core.errors import ParameterError
from choreograph.evaluation.metrics.requests import genre_share, joint_distance_m, outside_tempi_share
from choreograph.motion.body import body_pos_m

FPS = 30.0


def test_genre_share_perfect_and_none():
    assert genre_share(["waltz", "waltz"], [2.0, 5.0], "waltz") == 1.0
    assert genre_share(["house", "salsa"], [2.0, 5.0], "waltz") == 0.0
    assert genre_share(["house", "waltz"], [3.0, 1.0], "waltz") == 0.25


def test_genre_share_of_nothing():
    assert np.isnan(genre_share([], [], "waltz"))
    assert np.isnan(genre_share(["waltz"], [0.0], "waltz"))


@pytest.mark.parametrize("lengths", [[1.0], [1.0, -1.0], [1.0, np.nan], [[1.0, 2.0]]])
def test_genre_share_malformed(lengths):
    with pytest.raises(ParameterError, match="a length") as raised:
        genre_share(["waltz", "house"], lengths, "waltz")
    assert "\n" not in str(raised.value)


def test_tempo_inside_and_outside():
    counts_s = np.arange(0.0, 20.0, 0.5)  # 120 a minute
    assert outside_tempi_share(counts_s, 100.0, 130.0) == 0.0
    assert outside_tempi_share(counts_s, 130.0, 140.0) == 1.0
    assert outside_tempi_share(counts_s, 123.0, 140.0) == 0.0  # within 4 %
    assert outside_tempi_share(counts_s, 123.0, 140.0, tolerance=0.0) == 1.0


def test_tempo_range_of_each_interval():
    counts_s = np.arange(0.0, 20.5, 0.5)  # 40 intervals
    low = np.where(np.arange(40) < 10, 150.0, 100.0)  # ten danced with takes of a faster genre
    assert outside_tempi_share(counts_s, low, 200.0) == 0.25


def test_one_count_too_many_at_a_join_is_no_tempo():
    counts_s = np.insert(np.arange(0.0, 20.0, 0.5), 10, 4.7)
    assert outside_tempi_share(counts_s, 110.0, 130.0) == 0.0


def test_tempo_of_nothing():
    assert np.isnan(outside_tempi_share([], 100.0, 130.0))
    assert np.isnan(outside_tempi_share([1.0], 100.0, 130.0))


@pytest.mark.parametrize(
    ("counts_s", "low", "high"),
    [
        ([0.0, 0.5, 0.4], 100.0, 130.0),
        ([0.0, np.nan], 100.0, 130.0),
        ([0.0, 0.5, 1.0], 130.0, 100.0),
        ([0.0, 0.5, 1.0], np.nan, 100.0),
        ([0.0, 0.5, 1.0], [100.0], 130.0),
        ([0.0, 0.5, 1.0], -1.0, 130.0),
    ],
)
def test_tempo_malformed(counts_s, low, high):
    with pytest.raises(ParameterError) as raised:
        outside_tempi_share(counts_s, low, high)
    assert "\n" not in str(raised.value)


def test_the_same_dance_elsewhere_is_no_other_dance():
    dance = swaying(90, fps=FPS)
    moved = dance.moved(yaw_rad=2.0, shift_m=np.array([1.0, 0.0, -3.0]))
    assert joint_distance_m(body_pos_m(dance), body_pos_m(moved), FPS) == pytest.approx(0.0, abs=1e-9)
    assert joint_distance_m(body_pos_m(dance), body_pos_m(stepping(90, fps=FPS)), FPS) > 0.01


def test_distance_known_by_hand():
    pos = body_pos_m(swaying(60, fps=FPS))
    arm = pos.copy()
    arm[:, 20, 1] += 0.21  # a wrist, one of 21 joints
    assert joint_distance_m(pos, arm, FPS) == pytest.approx(0.01)
    assert joint_distance_m(pos, arm[:30], FPS) == pytest.approx(0.01, rel=1e-3)  # the longer one is cut


def test_distance_malformed():
    pos = body_pos_m(swaying(10, fps=FPS))
    for one, other, fps in ((pos, pos[:0], FPS), (pos[:, :5], pos, FPS), (pos, pos, 0.0)):
        with pytest.raises(ParameterError) as raised:
            joint_distance_m(one, other, fps)
        assert "\n" not in str(raised.value)
