"""Style response: planted switches, never, malformed input, chance."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from choreograph.core.errors import ParameterError
from research.style_response import (
    chance_shares,
    evaluate,
    own_genre_shares,
    part_bounds,
    seconds_to_switch,
)

WANTED = ["house"] * 18 + ["waltz"] * 18


def test_perfect():
    assert evaluate(WANTED, WANTED) == {
        "part_genre": 1.0, "part_genre_chance": 0.5, "part_genre_worst": 1.0, "switched": 1.0,
        "seconds_to_switch": 0.0,
    }  # fmt: skip


def test_one_genre_for_the_whole_song_is_chance():
    scores = evaluate(["house"] * 36, WANTED)
    assert (scores["part_genre"], scores["part_genre_chance"]) == (0.5, 0.5)
    assert (scores["part_genre_worst"], scores["switched"]) == (0.0, 0.0)
    assert np.isnan(scores["seconds_to_switch"])


def test_known_by_hand():
    danced = ["house"] * 21 + ["waltz", "house", "waltz", "waltz"] + ["tango"] * 3 + ["waltz"] * 8
    assert own_genre_shares(danced, WANTED) == [1.0, 11 / 18]
    assert chance_shares(danced, WANTED) == [22 / 36, 11 / 36]
    assert seconds_to_switch(danced, WANTED) == [3.0]  # 3 of the 4 s from there are waltz
    alternating = ["house"] * 18 + ["waltz", "house"] * 9
    assert np.isnan(seconds_to_switch(alternating, WANTED)).all()


def test_a_switch_in_the_last_seconds_of_a_part_is_none():
    assert np.isnan(seconds_to_switch(["house"] * 33 + ["waltz"] * 3, WANTED)).all()
    assert seconds_to_switch(["house"] * 32 + ["waltz"] * 4, WANTED) == [14.0]


def test_parts():
    assert part_bounds(["a", "a", "b", "a"]) == [(0, 2), (2, 3), (3, 4)]
    alone = evaluate(["a"], ["a"])
    assert alone["part_genre"] == 1.0 and np.isnan(alone["switched"])


@pytest.mark.parametrize(("danced", "wanted"), [([], []), (["a"], ["a", "b"]), ([["a"]], [["a"]])])
def test_malformed(danced, wanted):
    with pytest.raises(ParameterError):
        evaluate(danced, wanted)


@given(st.lists(st.sampled_from("abc"), min_size=8, max_size=40), st.integers(1, 7))
def test_shares_and_waits_stay_in_their_range(danced, splice):
    wanted = ["a"] * splice + ["b"] * (len(danced) - splice)
    assert all(0 <= share <= 1 for share in own_genre_shares(danced, wanted))
    waits = [w for w in seconds_to_switch(danced, wanted) if not np.isnan(w)]
    assert all(danced[splice + int(wait)] == "b" for wait in waits)
