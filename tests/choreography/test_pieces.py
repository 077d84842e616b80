"""Pieces of takes for a part of a dance: on counts, within the slopes, and ranked."""

from __future__ import annotations

import numpy as np
import pytest

from choreograph.choreography.edits import edit_slots, slot_bounds_s
from choreograph.choreography.pieces import (
    PieceBank,
    PieceRequest,
    Surroundings,
    distinct,
    pose_distance_m,
    ranked_pieces,
)
from choreograph.core.timebase import MAX_SLOPE, MIN_SLOPE


@pytest.fixture(scope="module")
def around(made):
    return Surroundings(made.plan, made.motion, slot_bounds_s(made.plan))


@pytest.fixture(scope="module")
def bank(repertoire):
    return PieceBank(repertoire)


def everything(bank, **asked):
    return PieceRequest(range(len(bank.repertoire.takes)), **asked)


def test_pieces_are_played_count_by_count_and_ranked(around, bank):
    slots = edit_slots(4.0, 6.0, around.bounds_s)
    found = ranked_pieces(bank, around, slots, everything(bank, similar=True))
    costs = [piece.cost for piece in found]
    assert (
        len(found) > 1 and costs == sorted(costs) and min(min(piece.costs.values()) for piece in found) >= 0
    )
    for piece in found[:20]:
        take = bank.repertoire.take_index(piece.words[0].take)
        starts_s = [word.start_s for word in piece.words]
        np.testing.assert_allclose(starts_s, around.bounds_s[slots.begin : slots.end], atol=1e-6)
        sources_s = np.array([word.source_start_s for word in piece.words])
        assert np.abs(bank.counts_s[take][:, None] - sources_s).min(axis=0).max() < 1e-5
        speeds = [(w.source_end_s - w.source_start_s) / (w.end_s - w.start_s) for w in piece.words]
        assert min(speeds) >= MIN_SLOPE - 1e-3 and max(speeds) <= MAX_SLOPE + 1e-3


def test_the_piece_that_is_danced_there_joins_best(around, bank):
    """Planted: of the take that is danced, pinned, the piece is that of the dance, on the same counts."""
    slots = edit_slots(4.0, 6.0, around.bounds_s)
    name, source_s = around.source_at(float(around.bounds_s[slots.first]) + 1e-6)
    request = PieceRequest([bank.repertoire.take_index(name)], pinned=True)
    found = ranked_pieces(bank, around, slots, request)
    at_s = np.array([piece.words[slots.before].source_start_s for piece in found])
    same = int(np.abs(at_s - source_s).argmin())
    assert abs(at_s[same] - source_s) < 0.1
    assert found[same].costs["joins"] <= np.median([piece.costs["joins"] for piece in found])
    assert "from the same take" in found[same].why


def test_of_many_pieces_those_of_the_best_counts_are_compared(around, bank):
    slots = edit_slots(4.0, 6.0, around.bounds_s)
    every = ranked_pieces(bank, around, slots, everything(bank, pinned=True))
    few = ranked_pieces(bank, around, slots, everything(bank, pinned=True), most_read=5)
    assert len(few) == 5 < len(every)
    of_counts = [sum(piece.costs[name] for name in ("tempo", "count", "genre")) for piece in few]
    assert max(of_counts) <= np.median([sum(p.costs[n] for n in ("tempo", "count", "genre")) for p in every])


def test_no_piece_is_of_a_take_that_is_not_asked_for_or_too_short(around, bank):
    slots = edit_slots(4.0, 6.0, around.bounds_s)
    only = ranked_pieces(bank, around, slots, PieceRequest([1], pinned=True))
    assert {word.take for piece in only for word in piece.words} == {bank.repertoire.takes[1].name}
    assert ranked_pieces(bank, around, slots, PieceRequest([])) == []


def test_distinct_pieces_are_apart(around, bank):
    slots = edit_slots(4.0, 6.0, around.bounds_s)
    found = ranked_pieces(bank, around, slots, everything(bank, pinned=True))
    apart = distinct(found, 5, apart_m=0.05)
    assert apart[0] is found[0]
    for i, one in enumerate(apart):
        assert all(pose_distance_m(one.poses_m, other.poses_m) >= 0.05 for other in apart[:i])
