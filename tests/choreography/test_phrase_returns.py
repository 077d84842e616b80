"""Phrases that return: where they return to, what the cost is, and dances to songs of planted form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from synthetic_layers import random_source

from choreograph.choreography.graph.cost import WeightedCost, allowed_nodes
from choreograph.choreography.graph.layers import MIDDLE, PhraseReturns, positions
from choreograph.choreography.graph.local_search import CheapNodes, including
from choreograph.choreography.graph.path_costs import FormCost, Variety
from choreograph.choreography.graph.planners import plan_exact, plan_greedy
from choreograph.core.counts import Counts, numbers_in_bar
from choreograph.core.errors import ParameterError
from choreograph.music.count_grids import SongGrid
from choreograph.music.form import Form, Phrase

BEAT_S = 0.48  # 125 BPM, so that no phrase is a whole number of seconds
PHRASE_S = 16 * BEAT_S


def grid(n_beats: int = 96) -> SongGrid:
    times_s = BEAT_S * np.arange(n_beats)
    found = SongGrid.of(Counts(times_s, numbers_in_bar(n_beats, 4), 4), n_beats * BEAT_S)
    assert found is not None
    return found


def form(letters: str) -> Form:
    """Phrases of four bars, one for each letter."""
    return Form(
        tuple(
            Phrase(
                i * PHRASE_S, (i + 1) * PHRASE_S, 16, i,
                letters.index(letter) if letters.index(letter) < i else None,
            )
            for i, letter in enumerate(letters)
        )
    )  # fmt: skip


def returns(letters: str, opening_s: float = 0.0) -> tuple[PhraseReturns, int]:
    end_s = len(letters) * PHRASE_S
    return PhraseReturns.of(form(letters), grid(), lambda at_s: opening_s <= at_s <= end_s), int(
        np.ceil(end_s)
    )


@pytest.mark.parametrize(("letters", "later"), [("AA", 16), ("ABA", 32), ("ABCAB", 48)])
def test_every_second_of_a_repeat_returns_to_the_same_count(letters, later):
    found, n_seconds = returns(letters)
    middles_s = found.seconds + MIDDLE
    assert np.allclose(middles_s - found.first_s, later * BEAT_S)
    assert (found.counts_later == later).all()
    inside = (np.arange(n_seconds) + MIDDLE >= later * BEAT_S) & (
        np.arange(n_seconds) + MIDDLE < len(letters) * PHRASE_S
    )
    assert found.seconds.tolist() == np.flatnonzero(inside).tolist()


def test_a_third_time_returns_to_the_first():
    found, _ = returns("ABABA")
    assert set(found.counts_later) == {32, 64}
    assert (found.first_s < 2 * PHRASE_S).all()


def test_only_the_last_four_counts_before_other_music_may_vary():
    """In ABAB, the second A continues with B as the first one does."""
    found, _ = returns("ABABC")
    assert set(found.weights[found.seconds + MIDDLE < 3 * PHRASE_S]) == {1.0}
    varied_s = (found.seconds + MIDDLE)[found.is_return & (found.weights < 1)]
    assert len(varied_s)
    assert (varied_s >= 4 * PHRASE_S - 4 * BEAT_S).all() and (varied_s < 4 * PHRASE_S).all()
    assert set(found.weights) == {0.5, 1.0}


def test_new_music_and_songs_without_phrases_have_no_returns():
    assert len(returns("ABC")[0].seconds) == 0
    assert len(PhraseReturns.of(Form.empty(), grid(), lambda at_s: True).seconds) == 0


def test_music_during_a_held_pose_is_danced_for_the_first_time_later():
    """With an opening of half a phrase, the second A is new there, and the third one returns to it."""
    opening_s = PHRASE_S / 2
    found, _ = returns("AAA", opening_s)
    assert (found.first_s >= opening_s).all()
    middles_s = found.seconds + MIDDLE
    assert (middles_s >= PHRASE_S + opening_s).all()
    early = (middles_s >= 2 * PHRASE_S) & (middles_s < 2 * PHRASE_S + opening_s)
    assert early.sum() >= 3
    assert np.allclose((middles_s - found.first_s)[early], PHRASE_S)
    assert np.allclose((middles_s - found.first_s)[middles_s >= 2 * PHRASE_S + opening_s], 2 * PHRASE_S)


def test_new_music_after_a_return_is_paired_with_what_followed_before():
    found, _ = returns("ABAC")
    new = ~found.is_return
    assert new.any() and (found.seconds[new] + MIDDLE >= 3 * PHRASE_S).all()
    assert (found.first_s[new] >= PHRASE_S).all() and (found.first_s[new] < 2 * PHRASE_S).all()
    assert returns("ABAB")[0].is_return.all() and not returns("ABCD")[0].seconds.size


def test_candidates_of_a_repeat_begin_at_the_same_count_of_the_take():
    found, n_seconds = returns("ABA")
    firsts, shifts = found.first_seconds(n_seconds), found.shifts(n_seconds, grid())
    index = grid().index_at
    new = np.setdiff1d(np.arange(n_seconds), found.seconds)
    assert (firsts[new] == new).all() and (shifts[new] == 0).all()
    again = found.seconds
    assert np.allclose(index(again * 1.0) - shifts[again] - index(firsts[again] * 1.0), 32)
    assert np.abs(shifts).max() * BEAT_S <= 0.5 + 1e-9


# Random layers of a song whose last three seconds repeat the first three.

N_SECONDS = 8
PAIRS = ((5, 0.4), (6, 1.4), (7, 2.4))  # (second, moment that it returns to)
OF_PAIRS = PhraseReturns(
    np.array([second for second, _ in PAIRS]), np.array([first_s for _, first_s in PAIRS]),
    np.ones(3, bool), np.array([1.0, 1.0, 0.5]), np.full(3, 10),
)  # fmt: skip


def source_of_returns(seed, *, usage=False):
    return random_source(
        seed, n_seconds=N_SECONDS, k=3, n_clips=4, tie_break_s=np.array([0.0, 0.1]) if usage else None,
        moments=OF_PAIRS.moments(N_SECONDS), returns=OF_PAIRS.returning(N_SECONDS),
    )  # fmt: skip


def form_by_hand(nodes) -> list[float]:
    """The cost of each second of a path, by its definition."""
    costs = [0.0] * N_SECONDS
    for (second, first_s), weight in zip(PAIRS, OF_PAIRS.weights, strict=True):
        first, node = nodes[int(first_s)], nodes[second]
        (start, end), share = first.take_frames[0], first_s - int(first_s)
        away = abs(node.take_frames[0].mean() - (start + share * (end - start)))
        costs[second] = 0.0 if node.take[0] == first.take[0] and away <= 5.0 else weight
    return costs


@pytest.mark.parametrize("plan", [plan_exact, plan_greedy])
@pytest.mark.parametrize("seed", range(5))
def test_booked_costs_are_those_of_the_paths_own_first_phrases(seed, plan):
    from choreograph.choreography.graph.costs import Genre

    source, song_features = source_of_returns(seed, usage=True)
    costs = [WeightedCost(Genre(), 1.0), WeightedCost(Variety(), 2.0), WeightedCost(FormCost(OF_PAIRS), 3.0)]
    path = plan(source, costs, song_features)
    booked = [terms["form"] for terms in path.costs]
    assert booked == pytest.approx([3.0 * cost for cost in form_by_hand(path.nodes)])


@pytest.mark.parametrize("seed", range(5))
def test_a_high_weight_repeats_and_weight_0_changes_nothing(seed):
    from choreograph.choreography.graph.costs import Genre

    source, song_features = source_of_returns(seed)
    style = [WeightedCost(Genre(), 1.0)]
    free = plan_exact(source, style, song_features)
    without = plan_exact(source, [*style, WeightedCost(FormCost(OF_PAIRS), 0.0)], song_features)
    held = plan_exact(source, [*style, WeightedCost(FormCost(OF_PAIRS), 50.0)], song_features)
    assert [n.warp.segment[0] for n in free.nodes] == [n.warp.segment[0] for n in without.nodes]
    assert sum(form_by_hand(held.nodes)) <= sum(form_by_hand(free.nodes))
    assert held.total <= sum(
        terms["genre"] + 50.0 * cost for terms, cost in zip(free.costs, form_by_hand(free.nodes), strict=True)
    )


def test_what_followed_before_costs_where_other_music_follows():
    source, song_features = source_of_returns(1)
    previous, following = source.layer(4), source.layer(5)
    danced = np.full((previous.n_nodes, 3), np.nan)
    danced[:, 0] = np.resize(positions(source.layer(0), 0.4), previous.n_nodes)
    previous = previous.with_danced(danced)
    returned = FormCost(OF_PAIRS).edge(previous, following, song_features)
    avoided = FormCost(replace(OF_PAIRS, is_return=np.zeros(3, bool))).edge(
        previous, following, song_features
    )
    assert np.array_equal(returned + avoided, np.ones_like(returned)) and 0 < avoided.mean() < 1


@pytest.mark.parametrize("seed", range(4))
def test_local_search_evaluates_a_phrase_with_its_repeats(seed):
    """The cost of one changed node is the difference between the whole paths, before and after a repeat."""
    from choreograph.choreography.graph.costs import Genre

    source, song_features = source_of_returns(seed)
    costs = [WeightedCost(Genre(), 1.0), WeightedCost(FormCost(OF_PAIRS), 4.0)]
    nodes = [allowed_nodes(source.layer(second), costs, song_features) for second in range(N_SECONDS)]
    cheap = CheapNodes.of(nodes, costs, song_features)
    path = np.array([layer.n_nodes - 1 for layer in cheap.layers])
    found = cheap._pass(path)
    for second in range(N_SECONDS):
        for node in range(cheap.layers[second].n_nodes):
            other = path.copy()
            other[second] = node
            assert cheap.cost(found) <= cheap.cost(other) + 1e-3
    best = plan_exact(source, costs, song_features)
    chosen = [
        including(those, node.warp.segment[0], node.warp.offset[0], lambda: None)[1]
        for those, node in zip(nodes, best.nodes, strict=True)
    ]
    assert best.total == pytest.approx(cheap.cost(np.array(chosen)), abs=1e-3)


def test_edges_are_not_below_their_bounds():
    source, song_features = source_of_returns(1)
    cost = FormCost(OF_PAIRS)
    previous = source.layer(4)
    danced = np.full((previous.n_nodes, 3), np.nan)
    danced[:, 0] = np.resize(positions(source.layer(0), 0.4), previous.n_nodes)
    previous, following = previous.with_danced(danced), source.layer(5)
    edges = cost.edge(previous, following, song_features)
    assert (cost.min_edge_costs(previous, following, song_features) <= edges).all()
    assert 0 < edges.mean() < 1
    assert cost.edge(source.layer(4), following, song_features) is None  # nothing was danced yet


def test_danced_positions_of_another_shape_are_refused():
    layer = source_of_returns(0)[0].layer(0)
    with pytest.raises(ParameterError, match="danced positions"):
        layer.with_danced(np.zeros((1, 1)))
    assert replace(layer, moments=()).with_danced(layer.path.danced).path.danced is layer.path.danced
