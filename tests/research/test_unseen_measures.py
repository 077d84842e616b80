"""Measures that nothing was fitted to: planted answers of the first set, and shares of cells inside."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic_motions import standing_body

from choreograph.evaluation.movement import ALL_REAL, MEASURES, windows_of
from choreograph.motion.body import BODY_JOINTS
from research import unseen_measures as unseen


def test_no_measure_is_one_that_dancers_were_fitted_to_or_of_the_other_set():
    first, second = (set(unseen.measures_of([name])) for name in unseen.SETS)
    assert len(first) == len(second) == 24
    assert not (first | second) & set(MEASURES) and not first & second


def test_a_body_at_rest_is_slow_and_one_that_swings_a_wrist_has_a_faster_arm():
    still = standing_body(400)
    values = unseen.values_of(windows_of(still), ["first"])
    assert values["body is slow, share"] == [1.0] and values["no foot stands, share"] == [0.0]
    assert values["one arm faster than the other"] == [0.0]
    swung = still.copy()
    swung[:, BODY_JOINTS.index("left_wrist"), 2] += 0.2 * np.sin(np.arange(400) * 2 * np.pi * 0.05)
    swung_values = unseen.values_of(windows_of(swung), ["first"])
    assert swung_values["one arm faster than the other"][0] > 3.0
    assert swung_values["wrist before the shoulder, sd, m"][0] == pytest.approx(
        0.5 * 0.2 / np.sqrt(2), rel=0.01
    )


@pytest.mark.parametrize("name", unseen.SETS)
def test_a_robot_has_only_measures_of_legs(name):
    values = unseen.values_of(windows_of(standing_body(400)), [name], is_robot=True)
    assert values and set(values) <= set(unseen.SETS[name].of_legs)


def test_shares_are_of_the_range_of_the_genre_where_there_is_one(capsys):
    name = next(iter(unseen.measures_of(["first"])))
    values = unseen.by_genre(
        [("waltz", {name: [0.1 * i for i in range(10)]}), ("street", {name: [5.0 + i for i in range(10)]})]
    )
    ranges = unseen.ranges_of(values)
    assert ranges["waltz"][name].high < 1.0 < ranges[ALL_REAL][name].high and "street" not in ranges
    made = {"waltz": {name: [3.0]}, "pop": {name: [3.0]}}
    unseen.show("made", made, ranges, ["first"])
    assert "0.50 of 2 cells inside, own genre 0.00 of 1" in capsys.readouterr().out


def test_the_cells_outside_are_printed_only_of_the_sets_that_were_asked_for(capsys):
    names = [next(iter(unseen.measures_of([which]))) for which in unseen.SETS]
    ranges = unseen.ranges_of({"waltz": {name: [0.1 * i for i in range(10)] for name in names}})
    made = {"waltz": {name: [3.0] for name in names}}
    unseen.show("made", made, ranges, unseen.SETS)
    assert not any(name in capsys.readouterr().out for name in names)
    unseen.show("made", made, ranges, unseen.SETS, each=["first"])
    printed = capsys.readouterr().out
    assert names[0] in printed and names[1] not in printed
