"""Planners and the steps of their searches, whose compiled edges are those of `edge_costs`, to the bit."""

from __future__ import annotations

import itertools
import weakref
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from synthetic_layers import plain_costs, random_source

from choreograph.choreography.graph.cost import Cost, WeightedCost, allowed_nodes, edge_costs
from choreograph.choreography.graph.costs import Completeness, Phrasing, RepeatCost, Transition, Velocity
from choreograph.choreography.graph.local_search import with_history
from choreograph.choreography.graph.motif_costs import MotifTransition, Signature
from choreograph.choreography.graph.path_costs import FrontCost, Variety
from choreograph.choreography.graph.planners import SearchStep, plan_exact, plan_greedy, plan_motion_graph
from choreograph.choreography.material import MotifGoal
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
        return self._table(layer, 1)[layer.warp.segment, 0]

    def edge(self, previous, next, song_features):
        return self._table(next, 128)[np.ix_(previous.warp.segment, next.warp.segment)]


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
    assert [n.warp.segment[0] for n in full.nodes] == [n.warp.segment[0] for n in pruned.nodes]


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
    assert [n.warp.segment[0] for n in paths[0].nodes] == [n.warp.segment[0] for n in paths[1].nodes]


def test_a_negative_edge_from_an_expensive_node_is_found():
    # Only a node too expensive to come first has a negative edge: pruning it would miss the best path.
    source, song_features = random_source(1, n_seconds=2, k=40, n_clips=40)

    class Bait(Cost):
        def node(self, layer, song_features):
            return (
                np.where(layer.warp.segment == 39, 5.0, 0.0) if layer.second == 0 else np.zeros(layer.n_nodes)
            )

        def edge(self, previous, next, song_features):
            return np.where(previous.warp.segment[:, None] == 39, -10.0, np.zeros((1, next.n_nodes)))

    path = plan_exact(source, [WeightedCost(Bait(), 1.0)], song_features)
    assert path.total == pytest.approx(-5.0)
    assert path.nodes[0].warp.segment[0] == 39


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
            return np.where(layer.warp.segment == 0, 0.0, 1.0)

        def edge(self, previous, next, song_features):
            return np.where(previous.warp.segment[:, None] == 0, np.inf, np.zeros((1, next.n_nodes)))

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
    assert all(node.warp.offset[0] == 0 for node in path.nodes)
    assert all(set(terms) == {"transition"} for terms in path.costs)


def test_a_source_that_nobody_needs_is_freed_at_once():
    # Not by the next garbage collection: its time maps are most of what a long song's dance needs.
    source, _ = random_source(0)
    for second in range(source.n_seconds):
        source.layer(second)
    alive = weakref.ref(source)
    del source
    assert alive() is None


N_MOTIFS = 5


def weighted(song_features) -> list[WeightedCost]:
    """The built-in costs of edges, in the order of a dance."""
    rng = np.random.default_rng(0)
    goal = MotifGoal(np.full(N_MOTIFS, 1 / N_MOTIFS), rng.dirichlet(np.ones(N_MOTIFS), N_MOTIFS))
    of_music = Completeness(), Transition(), Velocity(), Phrasing(), FrontCost(), Variety(), RepeatCost()
    of_motifs = Signature([(0, goal)], song_features), MotifTransition([(0, goal)], song_features)
    return [WeightedCost(cost, 0.7 + 0.3 * i) for i, cost in enumerate((*of_music, *of_motifs))]


@pytest.mark.parametrize("seed", range(4))
def test_compiled_edges_are_those_of_edge_costs_to_the_bit(seed):
    source, song_features = random_source(
        seed, n_seconds=6, k=12, n_clips=14, n_motifs=N_MOTIFS, tracked=True, goal_starts=(4,),
        tie_break_s=np.array([0.0, 0.1]),
    )  # fmt: skip
    costs = weighted(song_features)
    fixed = [one for one in costs if not one.cost.of_path]
    rng = np.random.default_rng(seed)
    with ThreadPoolExecutor(1) as pool:
        step = SearchStep(costs, song_features, pool)
        layer, reached = allowed_nodes(source.layer(0), costs, song_features)
        layer = with_history(layer, layer)
        for second in range(1, source.n_seconds):
            following, node_cost = allowed_nodes(source.layer(second), costs, song_features)
            best, parent = step(layer, following, reached)
            here, there = (np.sort(rng.choice(n, n // 2, False)) for n in (layer.n_nodes, following.n_nodes))
            coming = step.fixed(here, there)
            assert coming is not None
            expected = edge_costs(layer.subset(here), following.subset(there), fixed, song_features)
            assert coming.result().tobytes() == expected.tobytes()
            node = int(rng.integers(layer.n_nodes))
            one = layer.subset(np.array([node]))
            of_one = edge_costs(one, following, costs, song_features)[0]
            np.testing.assert_allclose(step.from_one(one, node), of_one, rtol=3e-6)
            layer, reached = with_history(following, layer, parent), best + node_cost


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize(("n_clips", "weight"), [(14, 1.0), (14, 0.1), (60, 0.3)])
def test_a_step_finds_the_cheapest_way_into_every_node(n_clips, weight, compiled):
    """As the evaluation of all edges does. Of 60 clips, a second has more nodes than one block of edges."""
    source, song_features = random_source(
        n_clips, n_seconds=6, k=n_clips - 2, n_clips=n_clips, n_motifs=N_MOTIFS, tracked=True,
        tie_break_s=np.array([0.0, 0.1]), goal_starts=(4,),
    )  # fmt: skip
    costs = [WeightedCost(one.cost, weight * one.weight) for one in weighted(song_features)]
    costs = costs if compiled else costs[::-1]  # those in another order are not compiled
    n_jumps = 0
    with ThreadPoolExecutor(1) as pool:
        step = SearchStep(costs, song_features, pool)
        layer, reached = allowed_nodes(source.layer(0), costs, song_features)
        layer = with_history(layer, layer)
        for second in range(1, source.n_seconds):
            following, node_cost = allowed_nodes(source.layer(second), costs, song_features)
            best, parent = step(layer, following, reached)
            ways = reached[:, None] + edge_costs(layer, following, costs, song_features)
            np.testing.assert_allclose(best, ways.min(axis=0), rtol=0, atol=1e-4)
            np.testing.assert_allclose(ways[parent, np.arange(len(parent))], best, rtol=0, atol=1e-4)
            here, there = layer.successors_in(following)
            n_jumps += int((parent[there] != here).sum())
            layer, reached = with_history(following, layer, parent), best + node_cost
    assert n_jumps  # some nodes are reached from another segment although theirs goes on


class OneWay(Cost):
    """The edges from one node cost 0.99, and all others 1."""

    def __init__(self, node: int, bound: float) -> None:
        self.node_number, self.bound = node, bound

    def edge(self, previous, next, song_features):
        is_cheap = previous.warp.segment == self.node_number
        return np.repeat(np.where(is_cheap, 0.99, 1.0)[:, None], next.n_nodes, axis=1)

    def min_edge_costs(self, previous, next, song_features):
        return self.bound


@pytest.mark.parametrize("node", [0, 5, 127, 128, 129, 255, 256, 257, 279])
@pytest.mark.parametrize("bound", [-1.0, 0.0, 0.99])
def test_a_jump_that_saves_next_to_nothing_is_found_from_any_node(node, bound):
    """Its bound may be its cost, so that a bound that is any larger leaves it out."""
    source, song_features = random_source(3, n_seconds=5, k=70, n_clips=70)
    layer, following = source.layer(3), source.layer(4)
    cost = WeightedCost(OneWay(int(layer.warp.segment[node]), bound), 1.0)
    with ThreadPoolExecutor(1) as pool:
        best, parent = SearchStep([cost], song_features, pool)(layer, following, np.zeros(layer.n_nodes))
    assert best == pytest.approx(np.full(following.n_nodes, 0.99)) and set(parent) == {node}


@pytest.mark.parametrize("node", [0, 129, 279])
def test_a_cost_of_negative_weight_has_no_bound(node):
    source, song_features = random_source(3, n_seconds=5, k=70, n_clips=70)
    layer, following = source.layer(3), source.layer(4)
    cost = WeightedCost(OneWay(int(layer.warp.segment[node]), 0.0), -1.0)
    reached = np.zeros(layer.n_nodes)
    reached[node] = -0.5  # which is the first to be tried
    reached[(node + 140) % layer.n_nodes] = -0.505
    with ThreadPoolExecutor(1) as pool:
        best, _ = SearchStep([cost], song_features, pool)(layer, following, reached)
    assert best == pytest.approx(np.full(following.n_nodes, -1.505))


def test_edges_of_other_costs_are_not_evaluated_ahead():
    class Own(Cost):
        def edge(self, previous, next, song_features):
            return np.ones((previous.n_nodes, next.n_nodes))

    source, song_features = random_source(0, n_seconds=3)
    costs = [WeightedCost(Own(), 2.0)]
    layer, reached = allowed_nodes(source.layer(0), costs, song_features)
    following, _ = allowed_nodes(source.layer(1), costs, song_features)
    with ThreadPoolExecutor(1) as pool:
        step = SearchStep(costs, song_features, pool)
        step(layer, following, reached)
        assert step.fixed(np.arange(2), np.arange(3)) is None
        assert step.from_one(layer.subset(np.array([1])), 1).tolist() == [2.0] * following.n_nodes
