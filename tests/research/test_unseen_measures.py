"""Measures that nothing was fitted to: planted answers, and shares of cells inside."""

from __future__ import annotations

import numpy as np
import pytest

from choreograph.evaluation.movement import ALL_REAL
from choreograph.evaluation.movement_measures import MEASURES, windows_of
from choreograph.motion.body import BODY_JOINTS, body_pos_m
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import canonical_skeleton
from research import unseen_measures as unseen


def standing() -> np.ndarray:
    """20 s of a body at rest, (400, 21, 3)."""
    skeleton = canonical_skeleton()
    quat = np.tile([1.0, 0.0, 0.0, 0.0], (400, skeleton.n_joints, 1))
    root = np.tile([0.0, skeleton.offsets_m[0][1], 0.0], (400, 1))
    return body_pos_m(Motion(skeleton, root, quat, 20.0))


def test_no_measure_is_one_that_dancers_were_fitted_to():
    assert not set(unseen.UNSEEN) & set(MEASURES)


def test_a_body_at_rest_is_slow_and_one_that_swings_a_wrist_has_a_faster_arm():
    still = standing()
    values = unseen.values_of(windows_of(still))
    assert values["body is slow, share"] == [1.0] and values["no foot stands, share"] == [0.0]
    assert values["one arm faster than the other"] == [0.0]
    swung = still.copy()
    swung[:, BODY_JOINTS.index("left_wrist"), 2] += 0.2 * np.sin(np.arange(400) * 2 * np.pi * 0.05)
    swung_values = unseen.values_of(windows_of(swung))
    assert swung_values["one arm faster than the other"][0] > 3.0
    assert swung_values["wrist before the shoulder, sd, m"][0] == pytest.approx(
        0.5 * 0.2 / np.sqrt(2), rel=0.01
    )


def test_a_robot_has_only_measures_of_legs():
    assert set(unseen.values_of(windows_of(standing()), is_robot=True)) <= set(unseen.OF_LEGS)


def test_shares_are_of_the_range_of_the_genre_where_there_is_one(capsys):
    name = next(iter(unseen.UNSEEN))
    values = unseen.by_genre(
        [("waltz", {name: [0.1 * i for i in range(10)]}), ("street", {name: [5.0 + i for i in range(10)]})]
    )
    ranges = unseen.ranges_of(values)
    assert ranges["waltz"][name].high < 1.0 < ranges[ALL_REAL][name].high and "street" not in ranges
    unseen.show("made", {"waltz": {name: [3.0]}, "pop": {name: [3.0]}}, ranges)
    assert "0.50 of 2 cells inside, own genre 0.00 of 1" in capsys.readouterr().out
