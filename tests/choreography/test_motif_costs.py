"""Motif costs: their mean is the distance of the dance to the goal, and both planners reduce it."""

from __future__ import annotations

import itertools
import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic_layers import plain_costs, random_source

from choreograph.choreography.graph.cost import Cost, WeightedCost
from choreograph.choreography.graph.motif_costs import (
    MotifTransition,
    Signature,
    node_motifs,
    song_words_s,
    words_between,
)
from choreograph.choreography.graph.planners import plan_exact, plan_greedy
from choreograph.choreography.motif_sequences import MotifGoal
from choreograph.core.counts import make_counts
from choreograph.core.numerics import chi_square_distance
from choreograph.library.vocabulary import signature

BUILTIN = plain_costs()
K = 5


def random_goal(seed: int, n_motifs: int = K) -> MotifGoal:
    rng = np.random.default_rng(seed)
    shares = rng.dirichlet(np.full(n_motifs, 0.5))
    return MotifGoal(shares, rng.dirichlet(np.full(n_motifs, 0.3), size=n_motifs))


def motifs_of(path) -> np.ndarray:
    motifs = np.concatenate([node.motifs[0] for node in path.nodes])
    return motifs[motifs >= 0].astype(int)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**31), st.sampled_from([plan_exact, plan_greedy]))
def test_the_mean_cost_is_the_distance_of_the_dance(seed, planner):
    source, song_features = random_source(seed, n_seconds=8, k=5, n_motifs=K)
    goal = random_goal(seed)
    path = planner(
        source, [*BUILTIN, WeightedCost(Signature([(0, goal)], song_features), 3.0)], song_features
    )
    paid = [costs["signature"] for costs in path.costs]
    distance = chi_square_distance(signature(motifs_of(path), K), goal.signature)
    assert np.mean(paid) / 3.0 == pytest.approx(distance, abs=1e-5)
    counts = np.bincount(motifs_of(path), minlength=K)
    assert np.array_equal(path.nodes[-1].path.motif_counts[0], counts)


def parts_of(path, split: int) -> list[np.ndarray]:
    words = [np.concatenate([n.motifs[0] for n in part]) for part in (path.nodes[:split], path.nodes[split:])]
    return [part[part >= 0].astype(int) for part in words]


@settings(max_examples=30)
@given(st.integers(0, 2**31), st.integers(1, 7), st.sampled_from([plan_exact, plan_greedy]))
def test_the_mean_cost_of_each_part_is_its_distance_to_its_own_goal(seed, split, planner):
    source, song_features = random_source(seed, n_seconds=8, k=5, n_motifs=K, goal_starts=[0, split])
    goals = [(0, random_goal(seed)), (split, random_goal(seed + 1))]
    path = planner(source, [*BUILTIN, WeightedCost(Signature(goals, song_features), 3.0)], song_features)
    paid = np.array([costs["signature"] for costs in path.costs]) / 3.0
    for words, (_, goal), of_part in zip(parts_of(path, split), goals, np.split(paid, [split]), strict=True):
        distance = chi_square_distance(signature(words, K), goal.signature)
        assert of_part.mean() == pytest.approx(distance, abs=1e-5)


@pytest.mark.parametrize("planner", [plan_exact, plan_greedy])
def test_each_half_reaches_its_own_signature(planner):
    source, song_features = random_source(0, n_seconds=24, k=30, n_clips=30, n_motifs=4, goal_starts=[0, 12])
    shares = np.array([[0.8, 0.2, 0.0, 0.0], [0.0, 0.0, 0.5, 0.5]])
    goals = [(12 * i, MotifGoal(share, np.full((4, 4), 0.25))) for i, share in enumerate(shares)]
    path = planner(source, [WeightedCost(Signature(goals, song_features), 20.0)], song_features)
    for words, share in zip(parts_of(path, 12), shares, strict=True):
        assert chi_square_distance(signature(words, 4), share) < 0.02


def test_a_word_across_the_border_of_two_parts_is_counted_in_the_one_of_its_middle():
    _, song_features = random_source(0, n_seconds=6)
    beats_s = np.arange(0.1, 6.0, 0.4)  # words with middles at 0.3, 0.7, 1.1, …; the first from 0 or 0.1 s on
    numbers = np.zeros(len(beats_s), int)
    song_features = replace(song_features, counts=make_counts(beats_s, numbers, 0))
    middles_s = (song_words_s(song_features)[:-1] + song_words_s(song_features)[1:]) / 2
    for first, stop in itertools.combinations(range(7), 2):
        within = (middles_s >= first) & (middles_s < stop)
        assert words_between(song_features, first, stop) == within.sum()


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**31), st.floats(0.1, 20.0))
def test_exact_is_never_costlier_than_greedy_with_a_signature(seed, weight):
    source, song_features = random_source(seed, n_seconds=8, k=5, n_motifs=K)
    costs = [*BUILTIN, WeightedCost(Signature([(0, random_goal(seed))], song_features), weight)]
    assert (
        plan_exact(source, costs, song_features).total
        <= plan_greedy(source, costs, song_features).total + 1e-4
    )


@pytest.mark.parametrize("seed", range(8))
def test_pruning_predecessors_changes_nothing_with_a_signature(seed):
    source, song_features = random_source(seed, n_seconds=7, k=12, n_clips=14, n_motifs=K)
    goal = random_goal(seed)

    class Unbounded(Signature):
        name = "signature"

        def min_edge_costs(self, previous, next, song_features):
            return -np.inf

    paths = [
        plan_exact(source, [*BUILTIN, WeightedCost(cost([(0, goal)], song_features), 4.0)], song_features)
        for cost in (Signature, Unbounded)
    ]
    assert paths[0].total == pytest.approx(paths[1].total, abs=1e-4)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**31))
def test_min_edge_costs_are_lower_bounds(seed):
    source, song_features = random_source(seed, n_seconds=4, n_motifs=K)
    anew, _ = random_source(seed, n_seconds=4, n_motifs=K, goal_starts=[0, 3])
    rng = np.random.default_rng(seed)
    goals = [(0, random_goal(seed)), (3, random_goal(seed + 1))]
    previous = source.layer(2)
    previous = previous.with_motif_counts(
        rng.integers(0, 4, previous.path.motif_counts.shape).astype(np.int16)
    )
    for cost, following in (
        (Signature(goals[:1], song_features), source.layer(3)),
        (Signature(goals, song_features), anew.layer(3)),
        (MotifTransition(goals[:1], song_features), source.layer(3)),
        (MotifTransition(goals, song_features), anew.layer(3)),
    ):
        least = cost.edge(previous, following, song_features).min(axis=0)
        assert (least >= cost.min_edge_costs(previous, following, song_features) - 1e-6).all()


class Wanders(Cost):
    """Prefers one motif so strongly that without a signature no other is chosen."""

    def node(self, layer, song_features):
        return 0.1 * (layer.motifs != 0).sum(axis=1)


@pytest.mark.parametrize("planner", [plan_exact, plan_greedy])
def test_a_feasible_signature_is_reached(planner):
    # 30 nodes a second with two random words each: any mix can be put together, to a word or two.
    source, song_features = random_source(0, n_seconds=24, k=30, n_clips=30, n_motifs=4)
    goal = MotifGoal(np.array([0.1, 0.5, 0.4, 0.0]), np.full((4, 4), 0.25))
    wandering = [WeightedCost(Wanders(), 1.0)]
    without = planner(source, wandering, song_features)
    assert chi_square_distance(signature(motifs_of(without), 4), goal.signature) > 0.5
    steered = planner(
        source, [*wandering, WeightedCost(Signature([(0, goal)], song_features), 20.0)], song_features
    )
    assert chi_square_distance(signature(motifs_of(steered), 4), goal.signature) < 0.005


def test_the_beam_comes_near_the_best_of_all_paths():
    regrets = []
    for seed in range(12):
        source, song_features = random_source(seed, n_seconds=6, k=1, n_clips=2, n_motifs=3)
        cost = Signature([(0, random_goal(seed, 3))], song_features)
        goal = random_goal(seed, 3)
        layers = [source.layer(second).motifs for second in range(6)]
        distances = [
            chi_square_distance(signature(words[words >= 0].astype(int), 3), goal.signature)
            for words in map(np.concatenate, itertools.product(*layers))
        ]
        found = plan_exact(source, [WeightedCost(cost, 1.0)], song_features).total / 6
        assert found >= min(distances) - 1e-5
        regrets.append(found - min(distances))
    assert np.mean(regrets) < 0.01
    assert np.mean(np.array(regrets) < 1e-5) >= 0.5


@pytest.mark.parametrize("planner", [plan_exact, plan_greedy])
def test_likely_transitions_are_chosen(planner):
    source, song_features = random_source(3, n_seconds=12, k=40, n_clips=40, n_motifs=3)
    cycle = MotifGoal(np.full(3, 1 / 3), np.roll(np.eye(3), 1, axis=1))
    path = planner(source, [WeightedCost(MotifTransition([(0, cycle)], song_features), 1.0)], song_features)
    words = motifs_of(path)
    assert np.array_equal((words[:-1] + 1) % 3, words[1:])
    assert path.total == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("planner", [plan_exact, plan_greedy])
def test_each_half_has_the_transitions_of_its_own_goal(planner):
    source, song_features = random_source(3, n_seconds=12, k=40, n_clips=40, n_motifs=3, goal_starts=[0, 6])
    cycles = [MotifGoal(np.full(3, 1 / 3), np.roll(np.eye(3), step, axis=1)) for step in (1, 2)]
    cost = MotifTransition([(0, cycles[0]), (6, cycles[1])], song_features)
    path = planner(source, [WeightedCost(cost, 1.0)], song_features)
    words = motifs_of(path)
    steps = np.repeat([1, 2], [len(parts_of(path, 6)[0]) - 1, len(parts_of(path, 6)[1])])
    assert np.array_equal((words[:-1] + steps) % 3, words[1:])
    assert path.total == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("planner", [plan_exact, plan_greedy])
def test_every_transition_between_words_is_counted_once(planner):
    source, song_features = random_source(4, n_seconds=8, n_motifs=K)
    goal = random_goal(4)
    path = planner(
        source, [*BUILTIN, WeightedCost(MotifTransition([(0, goal)], song_features), 2.0)], song_features
    )
    words = motifs_of(path)
    by_hand = np.minimum(-np.log(goal.transitions[words[:-1], words[1:]]) / np.log(1000), 1.0)
    paid = sum(costs["motif_transition"] for costs in path.costs)
    assert paid == pytest.approx(2.0 * by_hand.sum() * song_features.n_seconds / len(words), rel=1e-5)


@pytest.mark.parametrize("planner", [plan_exact, plan_greedy])
def test_weights_of_zero_leave_the_dance_as_it_was(planner):
    plain, song_features = random_source(5, n_seconds=8)
    source, _ = random_source(5, n_seconds=8, n_motifs=K)
    goal = random_goal(5)
    off = [WeightedCost(cost([(0, goal)], song_features), 0.0) for cost in (Signature, MotifTransition)]
    with_them, without = (
        planner(source, [*BUILTIN, *off], song_features),
        planner(plain, BUILTIN, song_features),
    )
    for a, b in zip(with_them.nodes, without.nodes, strict=True):
        assert a.warp.segment == b.warp.segment and a.warp.offset == b.warp.offset
    assert with_them.total == without.total


def test_a_word_belongs_to_the_node_with_its_middle():
    source, song_features = random_source(7, n_seconds=6, k=3)
    segments, clips = source._segments, source._clips
    requests = []

    def motifs_of(take, start_s, stop_s):
        requests.append((take, start_s, stop_s))
        return np.arange(take.size)

    motifs = node_motifs(segments, clips, song_words_s(song_features), motifs_of)
    [(take, start_s, stop_s)] = requests
    assert motifs.shape == (6, 3, 4, 2)
    for second, rank, offset in np.ndindex(6, 3, 4):
        clip = segments.clip[second, rank]
        origin = clips.start_frame[clip] + segments.time_maps[second, rank, 0]
        words = motifs[second, rank, offset]
        held = (0, 0.5) if second + offset < 6 else ()
        assert (words >= 0).sum() == len(held)
        for slot, t in enumerate(held):
            word = words[slot]
            assert take[word] == clips.take[clip]
            # The synthetic time maps play at original speed.
            assert start_s[word] == pytest.approx((origin + 20 * (offset + t)) / 20, abs=1e-4)
            assert stop_s[word] - start_s[word] == pytest.approx(0.5, abs=1e-4)


def test_a_word_across_a_border_belongs_to_the_side_of_its_middle():
    source, _ = random_source(8, n_seconds=4, k=2)
    bounds = np.array([0.3, 1.2, 2.4, 3.1])  # middles at 0.75, 1.8, 2.75
    motifs = node_motifs(
        source._segments, source._clips, bounds, lambda take, start_s, stop_s: np.zeros(take.size, int)
    )
    counts = (motifs >= 0).sum(axis=-1)  # (S, K, 4)
    assert counts[0].tolist() == [[1, 1, 1, 0]] * 2
    assert counts[1].tolist() == [[1, 1, 0, 0]] * 2
    assert counts[3].sum() == 0


def test_motifs_are_looked_up_in_parts_of_a_long_song(monkeypatch):
    source, song_features = random_source(7, n_seconds=9, k=3)
    sizes = []

    def motifs_of(take, start_s, stop_s):
        sizes.append(take.size)
        return (take + np.round(start_s * 7)).astype(int) % 97

    given = (source._segments, source._clips, song_words_s(song_features), motifs_of)
    whole = node_motifs(*given)
    monkeypatch.setattr(sys.modules[node_motifs.__module__], "_BLOCK_S", 4)
    assert np.array_equal(node_motifs(*given), whole)
    assert len(sizes) == 1 + 3
    assert sum(sizes[1:]) == sizes[0]
