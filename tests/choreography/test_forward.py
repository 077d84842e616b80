"""The steps of a search: their compiled edges are those of `edge_costs`, to the bit."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from synthetic_layers import random_source

from choreograph.choreography.graph.cost import Cost, WeightedCost, allowed_nodes, edge_costs
from choreograph.choreography.graph.costs import Completeness, Phrasing, RepeatCost, Transition, Velocity
from choreograph.choreography.graph.forward import SearchStep
from choreograph.choreography.graph.local_search import with_history
from choreograph.choreography.graph.motif_costs import MotifTransition, Signature
from choreograph.choreography.graph.path_costs import FrontCost, Variety
from choreograph.choreography.material import MotifGoal

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
        is_cheap = previous.segment == self.node_number
        return np.repeat(np.where(is_cheap, 0.99, 1.0)[:, None], next.n_nodes, axis=1)

    def min_edge_costs(self, previous, next, song_features):
        return self.bound


@pytest.mark.parametrize("node", [0, 5, 127, 128, 129, 255, 256, 257, 279])
@pytest.mark.parametrize("bound", [-1.0, 0.0, 0.99])
def test_a_jump_that_saves_next_to_nothing_is_found_from_any_node(node, bound):
    """Its bound may be its cost, so that a bound that is any larger leaves it out."""
    source, song_features = random_source(3, n_seconds=5, k=70, n_clips=70)
    layer, following = source.layer(3), source.layer(4)
    cost = WeightedCost(OneWay(int(layer.segment[node]), bound), 1.0)
    with ThreadPoolExecutor(1) as pool:
        best, parent = SearchStep([cost], song_features, pool)(layer, following, np.zeros(layer.n_nodes))
    assert best == pytest.approx(np.full(following.n_nodes, 0.99)) and set(parent) == {node}


@pytest.mark.parametrize("node", [0, 129, 279])
def test_a_cost_of_negative_weight_has_no_bound(node):
    source, song_features = random_source(3, n_seconds=5, k=70, n_clips=70)
    layer, following = source.layer(3), source.layer(4)
    cost = WeightedCost(OneWay(int(layer.segment[node]), 0.0), -1.0)
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
