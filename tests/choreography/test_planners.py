"""Planners: the exact path is the cheapest of all, and forbidden nodes are never chosen."""

from __future__ import annotations

import itertools
import weakref

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from synthetic_layers import plain_costs, random_source

from choreograph.choreography.graph.cost import Cost, WeightedCost
from choreograph.choreography.graph.costs import Completeness, Phrasing
from choreograph.choreography.graph.path_costs import Variety
from choreograph.choreography.graph.planners import plan_exact, plan_greedy, plan_motion_graph
from choreograph.core.errors import NoPathError, ParameterError

BUILTIN = plain_costs()
WITHOUT_PHRASING = [weighted for weighted in BUILTIN if not isinstance(weighted.cost, Phrasing)]


class RandomCost(Cost):
    """A random cost of every node and edge, by node identity: the same for any subset of a layer."""

    def __init__(self, seed: int, low: float = 0.0, forbidden: float = 0.0) -> None:
        self.seed, self.low, self.forbidden = seed, low, forbidden

    def _table(self, layer, width):
        rng = np.random.default_rng([self.seed, layer.second])
        table = rng.uniform(self.low, 1.0, (128, width))
        table[rng.random(table.shape) < self.forbidden] = np.inf
        return table

    def node(self, layer, song_features):
        return self._table(layer, 1)[layer.segment, 0]

    def edge(self, previous, next, song_features):
        return self._table(next, 128)[np.ix_(previous.segment, next.segment)]


class Forbids(Cost):
    """Forbids nodes of a take, or all edges into a second."""

    def __init__(self, take: str | None = None, second: int | None = None, *, edges: bool = False) -> None:
        self.take, self.second, self.edges = take, second, edges

    def node(self, layer, song_features):
        if self.edges:
            return None
        hit = (layer.take_names == self.take) | (layer.second == self.second)
        return np.where(hit, np.inf, 0.0)

    def edge(self, previous, next, song_features):
        if not self.edges:
            return None
        return np.full((previous.n_nodes, next.n_nodes), np.inf if next.second == self.second else 0.0)


def cheapest_by_brute_force(source, costs, song_features) -> float:
    layers = [source.layer(second) for second in range(source.n_seconds)]
    nodes = [
        sum(w.weight * value for w in costs if (value := w.cost.node(la, song_features)) is not None)
        for la in layers
    ]
    edges = [
        sum(w.weight * w.cost.edge(a, b, song_features) for w in costs) for a, b in itertools.pairwise(layers)
    ]
    totals = [
        sum(node[i] for node, i in zip(nodes, path, strict=True))
        + sum(edge[i, j] for edge, (i, j) in zip(edges, itertools.pairwise(path), strict=True))
        for path in itertools.product(*(range(layer.n_nodes) for layer in layers))
    ]
    return min(totals)


@settings(max_examples=40, deadline=None)
@example(944500445, True)  # edges inside a segment were not quite 0, and differed by the block's size
@given(st.integers(0, 2**31), st.booleans())
def test_exact_is_never_costlier_than_greedy(seed, tracked):
    source, song_features = random_source(seed, n_seconds=8, k=5, tracked=tracked)
    costs = [*BUILTIN, WeightedCost(RandomCost(seed, low=-1.0), 0.7)]
    exact, greedy = plan_exact(source, costs, song_features), plan_greedy(source, costs, song_features)
    assert exact.total <= greedy.total + 1e-4
    for path in (exact, greedy):
        assert [node.second for node in path.nodes] == list(range(8))
        assert all(node.n_nodes == 1 for node in path.nodes)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**31), st.sampled_from([0.0, -2.0]), st.sampled_from([0.0, 0.1]))
def test_exact_is_the_best_of_all_paths(seed, low, forbidden):
    source, song_features = random_source(seed, n_seconds=5, k=2, n_clips=3)
    costs = [WeightedCost(RandomCost(seed, low, forbidden), 1.0)]
    best = cheapest_by_brute_force(source, costs, song_features)
    if np.isfinite(best):
        assert plan_exact(source, costs, song_features).total == pytest.approx(best, abs=1e-5)
    else:
        with pytest.raises(NoPathError):
            plan_exact(source, costs, song_features)


@settings(max_examples=30)
@given(st.integers(0, 2**31))
def test_exact_is_the_best_of_all_paths_where_counted_takes_play_on(seed):
    source, song_features = random_source(seed, n_seconds=5, k=2, n_clips=3, tracked=True)
    costs = [WeightedCost(cost, 1.0) for cost in (RandomCost(seed), Phrasing(), Completeness())]
    best = cheapest_by_brute_force(source, costs, song_features)
    assert plan_exact(source, costs, song_features).total == pytest.approx(best, abs=1e-5)


@pytest.mark.parametrize("tracked", [False, True])
@pytest.mark.parametrize("seed", range(20))
def test_pruning_predecessors_changes_nothing(seed, tracked):
    # Costs that differ by a constant have the same best path; the negative ones cannot be pruned.
    source, song_features = random_source(seed, n_seconds=7, k=12, n_clips=14, tracked=tracked)

    class Lowered(RandomCost):
        name = "random"

        def edge(self, previous, next, song_features):
            return super().edge(previous, next, song_features) - 5.0

    pruned = plan_exact(source, [WeightedCost(RandomCost(seed), 1.0)], song_features)
    full = plan_exact(source, [WeightedCost(Lowered(seed), 1.0)], song_features)
    assert full.total == pytest.approx(pruned.total - 6 * 5.0, abs=1e-4)
    assert [n.segment[0] for n in full.nodes] == [n.segment[0] for n in pruned.nodes]


@pytest.mark.parametrize("tracked", [False, True])
@pytest.mark.parametrize("seed", range(10))
def test_pruning_by_phrases_changes_nothing(seed, tracked):
    source, song_features = random_source(seed, n_seconds=7, k=12, n_clips=14, tracked=tracked)

    class Unbounded(Phrasing):
        name = "phrasing"
        min_jump_cost = -np.inf

        def min_edge_costs(self, previous, next, song_features):
            return -np.inf

    paths = [
        plan_exact(source, [*WITHOUT_PHRASING, WeightedCost(cost(), 4.0)], song_features)
        for cost in (Phrasing, Unbounded)
    ]
    assert paths[0].total == pytest.approx(paths[1].total, abs=1e-4)
    assert [n.segment[0] for n in paths[0].nodes] == [n.segment[0] for n in paths[1].nodes]


def test_a_negative_edge_from_an_expensive_node_is_found():
    # Only a node too expensive to come first has a negative edge: pruning it would miss the best path.
    source, song_features = random_source(1, n_seconds=2, k=40, n_clips=40)

    class Bait(Cost):
        def node(self, layer, song_features):
            return np.where(layer.segment == 39, 5.0, 0.0) if layer.second == 0 else np.zeros(layer.n_nodes)

        def edge(self, previous, next, song_features):
            return np.where(previous.segment[:, None] == 39, -10.0, np.zeros((1, next.n_nodes)))

    path = plan_exact(source, [WeightedCost(Bait(), 1.0)], song_features)
    assert path.total == pytest.approx(-5.0)
    assert path.nodes[0].segment[0] == 39


@pytest.mark.parametrize("planner", [plan_exact, plan_greedy])
def test_totals_are_the_sums_of_each_seconds_costs(planner):
    source, song_features = random_source(4)
    path = planner(source, BUILTIN, song_features)
    for second, (node, terms) in enumerate(zip(path.nodes, path.costs, strict=True)):
        for w in BUILTIN:
            value = w.cost.node(node, song_features)
            expected = 0.0 if value is None else w.weight * float(value[0])
            if second and (edge := w.cost.edge(path.nodes[second - 1], node, song_features)) is not None:
                expected += w.weight * float(edge[0, 0])
            assert terms[w.cost.name] == pytest.approx(expected, abs=2e-3)


@pytest.mark.parametrize("planner", [plan_exact, plan_greedy])
def test_takes_alternate_when_recent_usage_counts(planner):
    class Favourite(Cost):
        def node(self, layer, song_features):
            return np.where(layer.take == 0, 0.0, 1.0)

    for tie_break_s, others_s in ((None, 0), (np.zeros(2), 8)):
        source, song_features = random_source(5, n_seconds=48, n_clips=4, tie_break_s=tie_break_s)
        path = planner(source, [WeightedCost(Favourite(), 1.0), WeightedCost(Variety(), 1.0)], song_features)
        takes = [int(node.take[0]) for node in path.nodes]
        assert sum(takes) >= others_s
        assert not sum(takes) or others_s
        for second, (take, terms) in enumerate(zip(takes, path.costs, strict=True)):
            ages_s = np.array([second - 1 - s for s in range(second) if takes[s] == take])
            used_s = np.exp(-ages_s / 120).sum() if others_s else 0.0
            assert terms["variety"] == pytest.approx(used_s / 12, abs=1e-4)


@pytest.mark.parametrize("planner", [plan_exact, plan_greedy, plan_motion_graph])
def test_a_forbidden_take_is_not_chosen(planner):
    source, song_features = random_source(2, n_seconds=8)
    path = planner(source, [*BUILTIN, WeightedCost(Forbids(take="left"), 1.0)], song_features)
    assert {str(node.take_names[0]) for node in path.nodes} == {"right"}


@pytest.mark.parametrize("planner", [plan_exact, plan_greedy])
@pytest.mark.parametrize("edges", [True, False])
def test_a_second_without_allowed_nodes_is_named(planner, edges):
    source, song_features = random_source(2)
    with pytest.raises(NoPathError, match="second 3") as error:
        planner(source, [*BUILTIN, WeightedCost(Forbids(second=3, edges=edges), 1.0)], song_features)
    assert "\n" not in str(error.value)


def test_exact_avoids_a_dead_end_that_greedy_runs_into():
    source, song_features = random_source(0, n_seconds=2, k=2)

    class DeadEnd(Cost):
        def node(self, layer, song_features):
            return np.where(layer.segment == 0, 0.0, 1.0)

        def edge(self, previous, next, song_features):
            return np.where(previous.segment[:, None] == 0, np.inf, np.zeros((1, next.n_nodes)))

    costs = [WeightedCost(DeadEnd(), 1.0)]
    with pytest.raises(NoPathError):
        plan_greedy(source, costs, song_features)
    assert plan_exact(source, costs, song_features).total == pytest.approx(1.0)


@pytest.mark.parametrize("planner", [plan_exact, plan_greedy])
@pytest.mark.parametrize("method", ["node", "edge"])
@pytest.mark.parametrize("fault", ["nan", "shape"])
def test_a_faulty_cost_is_named(planner, method, fault):
    class Faulty(Cost):
        pass

    def node(self, layer, song_features):
        return np.full(layer.n_nodes, np.nan) if fault == "nan" else np.zeros(layer.n_nodes + 1)

    def edge(self, previous, next, song_features):
        shape = (previous.n_nodes, next.n_nodes)
        return np.full(shape, np.nan) if fault == "nan" else np.zeros((shape[0], shape[1] + 1))

    setattr(Faulty, method, node if method == "node" else edge)
    source, song_features = random_source(0)
    with pytest.raises(ParameterError, match="'faulty'"):
        planner(source, [*BUILTIN, WeightedCost(Faulty(), 1.0)], song_features)


@pytest.mark.parametrize("planner", [plan_exact, plan_greedy])
def test_a_weight_of_zero_leaves_a_cost_out(planner):
    source, song_features = random_source(5)
    with_it = planner(source, [*BUILTIN, WeightedCost(Forbids(second=2), 0.0)], song_features)
    without = planner(source, BUILTIN, song_features)
    assert with_it.total == pytest.approx(without.total)
    assert with_it.costs[2]["forbids"] == 0.0


def test_one_second_is_a_path():
    source, song_features = random_source(0, n_seconds=1)
    assert plan_exact(source, BUILTIN, song_features).total == pytest.approx(
        plan_greedy(source, BUILTIN, song_features).total
    )


def test_progress_is_reported_to_the_end():
    source, song_features = random_source(0)
    seen = []
    plan_exact(source, BUILTIN, song_features, report=lambda done, total: seen.append((done, total)))
    assert seen[-1] == (6, 6)


@pytest.mark.parametrize("seed", range(3))
def test_the_motion_graph_walks_on_first_seconds_only(seed):
    source, song_features = random_source(seed, n_seconds=9)
    path = plan_motion_graph(source, BUILTIN, song_features)
    assert [node.second for node in path.nodes] == list(range(9))
    assert all(node.offset[0] == 0 for node in path.nodes)
    assert all(set(terms) == {"transition"} for terms in path.costs)


def test_a_source_that_nobody_needs_is_freed_at_once():
    # Not by the next garbage collection: its time maps are most of what a long song's dance needs.
    source, _ = random_source(0)
    for second in range(source.n_seconds):
        source.layer(second)
    alive = weakref.ref(source)
    del source
    assert alive() is None
