"""The notation refuses impossible moves, and mirrors moves correctly."""

from __future__ import annotations

import pytest

from choreograph.core.errors import ParameterError
from content.moves.genres import GENRES
from content.moves.notation import Move, both_sides, pose, press, step, touch

MOVES = [move for genre in GENRES.values() for move in genre.moves]


def test_the_standing_foot_may_not_lift() -> None:
    with pytest.raises(ParameterError, match="lifts but carries the weight"):
        Move("wrong", 4, (step("left", 1, (0.2, 0.0)), step("left", 2), touch("right", 4)))


def test_a_move_ends_at_home() -> None:
    with pytest.raises(ParameterError, match="expected the same place"):
        Move("wrong", 4, (step("left", 1, (0.4, 0.0)), touch("right", 2)))


def test_a_move_ends_with_both_feet_facing_the_same_way() -> None:
    with pytest.raises(ParameterError, match="facing"):
        Move("wrong", 2, (step("left", 1, face=90.0), step("right", 2)))


def test_counts_outside_are_refused() -> None:
    with pytest.raises(ParameterError, match="up to 4"):
        Move("wrong", 4, (step("left", 5),))


def test_unknown_channels_and_arms_are_named() -> None:
    with pytest.raises(ParameterError, match="no channel elbow"):
        pose(elbow=4)
    with pytest.raises(ParameterError, match="no arm pose 'flap'"):
        pose(left="flap")


def test_weight_on_both_frees_either_foot() -> None:
    assert Move("stand", 4, (step("left", 1), press("right", 2, weight=0.5))).free_foot is None


def test_travel_is_where_the_standing_foot_ends() -> None:
    move = Move("walk", 2, (step("left", 1, (0.0, 0.3)), touch("right", 2, (0.0, 0.28))))
    assert move.travel == (0.0, 0.3, 0.0)
    assert (move.first_foot, move.free_foot) == ("left", "right")


def test_both_sides_repeats_in_the_mirror() -> None:
    half = Move("tap", 2, (step("left", 1), touch("right", 2)), {1: pose(twist=5, left="up")})
    whole = both_sides(half)
    assert [(s.foot, s.count) for s in whole.steps] == [("left", 1), ("right", 2), ("right", 3), ("left", 4)]
    assert whole.poses[3].values == {"twist": -5} and list(whole.poses[3].arms) == ["right"]


@pytest.mark.parametrize("move", MOVES, ids=lambda move: move.name)
def test_mirrored_twice_is_itself(move: Move) -> None:
    other = move.mirrored()
    assert other.mirrored() == move
    assert other != move
    assert other.travel == (-move.travel[0], move.travel[1], -move.travel[2])


@pytest.mark.parametrize("genre", GENRES.values(), ids=lambda genre: genre.name)
def test_a_genre_has_at_least_eight_moves_of_its_bar(genre) -> None:
    written = (*genre.moves, *genre.figures)
    assert len({move.name for move in written}) >= 8
    assert all(move.counts % (genre.bar if genre.bar == 3 else 2) == 0 for move in written)
