"""Local search: never a dearer path, the compiled search, and the cheap nodes that it is given."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from synthetic_layers import random_source

import choreograph as cg
from choreograph.choreography.graph import local_search
from choreograph.choreography.graph.cost import Cost, WeightedCost, allowed_nodes
from choreograph.choreography.graph.costs import Transition, Velocity
from choreograph.choreography.graph.kernels import arrays_of
from choreograph.choreography.graph.local_search import CheapNodes, _Noise, cheapest, including
from choreograph.choreography.graph.motif_costs import Signature
from choreograph.choreography.graph.path_costs import FrontCost, Variety
from choreograph.choreography.graph.planners import plan_exact
from choreograph.choreography.motif_sequences import MotifGoal
from choreograph.motion.body import BODY_JOINTS


class Preference(Cost):
    """A random cost of every node."""

    def node(self, layer, song_features):
        return np.random.default_rng(layer.second).uniform(0.0, 1.0, 64)[layer.warp.segment]


def searched(seed=0, n_seconds=5, k=2, *, n_motifs=0, usage=True):
    """Cheap nodes of a small random source, and the costs."""
    source, song_features = random_source(
        seed, n_seconds=n_seconds, k=k, n_motifs=n_motifs, tie_break_s=np.array([0.0, 0.1]) if usage else None
    )
    costs = [WeightedCost(Preference(), 1.0), WeightedCost(Variety(), 6.0), WeightedCost(FrontCost(), 0.5)]
    if n_motifs:
        goal = MotifGoal(np.full(n_motifs, 1 / n_motifs), np.full((n_motifs, n_motifs), 1 / n_motifs))
        costs.append(WeightedCost(Signature([(0, goal)], song_features), 3.0))
    nodes = [allowed_nodes(source.layer(second), costs, song_features) for second in range(n_seconds)]
    return CheapNodes.of(nodes, costs, song_features), source, costs, song_features


@pytest.mark.parametrize("n_motifs", [0, 5])
@pytest.mark.parametrize("seed", range(4))
def test_the_cheapest_of_all_paths_is_found(seed, n_motifs):
    cheap, *_ = searched(seed, n_seconds=4, n_motifs=n_motifs)
    paths = [np.array(p) for p in itertools.product(*(range(layer.n_nodes) for layer in cheap.layers))]
    costs = [cheap.cost(path) for path in paths[:: max(1, len(paths) // 500)]]
    found = cheap.improved(paths[int(np.argmax(costs)) * max(1, len(paths) // 500)])
    assert cheap.cost(found) <= np.quantile(costs, 0.01)
    assert cheap.cost(cheap.improved(found)) == pytest.approx(cheap.cost(found))


@pytest.mark.parametrize("seed", range(6))
def test_a_path_never_becomes_costlier(seed):
    cheap, *_ = searched(seed, n_seconds=8, k=4, n_motifs=4)
    rng = np.random.default_rng(seed)
    path = np.array([rng.integers(layer.n_nodes) for layer in cheap.layers])
    assert cheap.cost(cheap.improved(path)) < cheap.cost(path)


@pytest.mark.parametrize("n_motifs", [0, 4])
def test_booked_costs_are_those_of_the_path(n_motifs):
    """The plan's terms, against the cost of its path and against usage and turns added up by hand."""
    cheap, source, costs, song_features = searched(3, n_seconds=8, k=4, n_motifs=n_motifs)
    path = plan_exact(source, costs, song_features)
    nodes = [
        including(nodes, node.warp.segment[0], node.warp.offset[0], lambda: None)[1]
        for nodes, node in zip(zip(cheap.layers, cheap.node_cost, strict=True), path.nodes, strict=True)
    ]
    assert path.total == pytest.approx(cheap.cost(np.array(nodes)), abs=1e-3)
    takes = [int(node.take[0]) for node in path.nodes]
    for second, (take, terms) in enumerate(zip(takes, path.costs, strict=True)):
        at_start_s = [0.0, 0.1][take] * np.exp(-second / 120)
        ages_s = np.array([second - 1 - s for s in range(second) if takes[s] == take])
        assert terms["variety"] == pytest.approx(
            6.0 * (at_start_s + np.exp(-ages_s / 120).sum()) / 12, abs=1e-4
        )
    turned_rad = 0.0
    for before, node, terms in zip(path.nodes, path.nodes[1:], path.costs[1:], strict=False):
        joined = node.part[0] != before.next_part[0]
        if joined:
            turned_rad += before.join_heading_rad[0, 1] - node.join_heading_rad[0, 0]
        away = ((0.5 - 0.5 * np.cos(node.heading_rad[0] + turned_rad)) ** 2).mean()
        away += 4.0 * (1.0 - np.cos(turned_rad)) if joined else 0.0
        if node is path.nodes[-1]:
            pose_m = node.bank.poses_m(node.warp.clip, node.source_frames[:, -2])[0][0]
            across_m = pose_m[BODY_JOINTS.index("left_hip")] - pose_m[BODY_JOINTS.index("right_hip")]
            hips_rad = np.arctan2(-across_m[2], across_m[0])  # turned against the body
            away += 6.0 * (1.0 - np.cos(node.heading_rad[0, -2] + hips_rad + turned_rad))
        assert terms["front"] == pytest.approx(0.5 * away, abs=1e-4)


@pytest.mark.parametrize("n_motifs", [0, 5])
@pytest.mark.parametrize("seed", range(4))
def test_the_compiled_search_is_that_of_any_costs_to_the_bit(seed, n_motifs, monkeypatch):
    compiled, source, costs, song_features = searched(seed, n_seconds=8, k=6, n_motifs=n_motifs)
    costs.insert(1, costs.pop(2))  # in the order of a dance
    nodes = [allowed_nodes(source.layer(second), costs, song_features) for second in range(8)]
    compiled = CheapNodes.of(nodes, costs, song_features)
    compiled.cost(np.zeros(8, np.int64))
    monkeypatch.setattr("choreograph.choreography.graph.local_search.COMPILED_OF_PATH", ())
    of_any = CheapNodes.of(nodes, costs, song_features)
    assert type(compiled) is not type(of_any)
    rng = np.random.default_rng(seed)
    for _ in range(20):
        path = np.array([rng.integers(layer.n_nodes) for layer in compiled.layers])
        assert compiled.cost(path) == of_any.cost(path)
        noise = [_Noise.of([cost.size for cost in compiled.edge_cost]) for _ in range(2)]
        found = compiled._pass(path, noise[0]), of_any._pass(path, noise[1])
        assert found[0].tolist() == found[1].tolist()
        assert compiled.improved(path).tolist() == of_any.improved(path).tolist()


@pytest.mark.slow
@pytest.mark.parametrize(
    "changes",
    [{"weights": {"front": 2.0, "form": 6.0}}, {"warping": "dtw", "front": "free"}, {"genre": "waltz"}],
)
def test_a_dance_is_the_same_with_compiled_searches(changes, monkeypatch):
    arguments = {"duration_s": 24.0, "seed": 2, **changes}
    plan = cg.dance(cg.example_songs()["house"], **arguments).plan
    monkeypatch.setattr("choreograph.choreography.graph.local_search.COMPILED_OF_PATH", ())
    assert cg.dance(cg.example_songs()["house"], **arguments).plan == plan
    monkeypatch.setattr("choreograph.choreography.graph.planners.COMPILED", ())
    assert cg.dance(cg.example_songs()["house"], **arguments).plan == plan


def test_without_costs_of_the_path_nothing_is_searched():
    source, song_features = random_source(1)
    costs = [WeightedCost(Preference(), 1.0)]
    nodes = [allowed_nodes(source.layer(second), costs, song_features) for second in range(6)]
    path = np.zeros(6, np.int64)
    assert CheapNodes.of(nodes, costs, song_features).improved(path).tolist() == path.tolist()


def test_usage_of_the_rest_counts_as_much_as_that_of_the_beginning():
    """A beginning that the path changes costs what the whole changed path costs more."""
    cheap, *_ = searched(2, n_seconds=6, k=3, n_motifs=3)
    path = np.array([layer.n_nodes - 1 for layer in cheap.layers])
    found = cheap._pass(path)
    others = [
        replace_at(path, second, node) for second in range(6) for node in range(cheap.layers[second].n_nodes)
    ]
    assert cheap.cost(found) <= min(cheap.cost(other) for other in others) + 1e-3


def replace_at(path, second, node):
    changed = path.copy()
    changed[second] = node
    return changed


@pytest.mark.parametrize("n_motifs", [0, 4])
@pytest.mark.parametrize("seed", range(4))
def test_no_path_costs_less_than_the_bound(seed, n_motifs):
    cheap, source, costs, song_features = searched(seed, n_seconds=8, k=4, n_motifs=n_motifs)
    path = plan_exact(source, costs, song_features, with_bound=True)
    assert 0.0 < path.least_total <= path.total
    rng = np.random.default_rng(seed)
    for _ in range(200):
        other = np.array([rng.integers(layer.n_nodes) for layer in cheap.layers])
        assert cheap.cost(other) > path.least_total
    assert plan_exact(source, costs, song_features).least_total is None


def test_the_bound_of_costs_that_do_not_depend_on_the_path_is_their_optimum():
    source, song_features = random_source(1)
    path = plan_exact(source, [WeightedCost(Preference(), 1.0)], song_features, with_bound=True)
    assert path.least_total == pytest.approx(path.total)


def test_a_cost_of_the_path_without_a_lower_bound_has_no_bound():
    class Growing(Variety):
        min_path_cost = -np.inf

    source, song_features = random_source(1, tie_break_s=np.zeros(2))
    assert (
        plan_exact(source, [WeightedCost(Growing(), 1.0)], song_features, with_bound=True).least_total is None
    )


class Nothing(cg.Cost):
    """A cost of others that is 0. It could read poses."""

    of_path = True

    def edge(self, previous, next, song_features):
        return np.zeros((previous.n_nodes, next.n_nodes))


class Low(cg.Cost):
    of_path = True

    def edge(self, previous, next, song_features):
        return np.broadcast_to(next.last_pose_m[:, 0, 1], (previous.n_nodes, next.n_nodes))


def planned(source, song_features, *costs):
    path = plan_exact(source, [WeightedCost(cost, 1.0) for cost in costs], song_features)
    return [(int(node.warp.segment[0]), int(node.warp.offset[0])) for node in path.nodes]


@pytest.mark.slow
@pytest.mark.parametrize("n_cheap", [3, 128])
def test_without_poses_the_path_is_the_same(n_cheap, monkeypatch):
    """Nodes of a dance of ten minutes are kept without poses, unless a cost of others may read them.

    With three nodes a second, the path of the search has others, for which edges are evaluated again.
    """
    monkeypatch.setattr(local_search, "N_CHEAP", n_cheap)
    source, song_features = random_source(0, n_seconds=602, k=2)
    costs = Transition(), Velocity(), FrontCost(), Variety()
    path = planned(source, song_features, *costs)
    assert path == planned(source, song_features, *costs, Nothing())


@pytest.mark.parametrize("tracked", [False, True])
def test_without_poses_the_compiled_search_reads_the_same(tracked):
    source, song_features = random_source(0, n_motifs=5, tracked=tracked)
    layer = source.layer(3)
    few = local_search._without_poses(layer, song_features)
    assert few.last_pose_m.size == few.style.size == 0 and few.liveliness.strides == (0,)
    for values, others in zip(
        arrays_of(layer, None, None, song_features), arrays_of(few, None, None, song_features), strict=True
    ):
        np.testing.assert_array_equal(values, others)


def test_costs_of_others_see_the_poses_of_a_long_dance():
    source, song_features = random_source(0, n_seconds=602)
    path = planned(source, song_features, Low())
    for second, node in enumerate(path[1:], start=1):
        layer = source.layer(second)
        lowest = int(layer.last_pose_m[:, 0, 1].argmin())
        assert node == (int(layer.warp.segment[lowest]), int(layer.warp.offset[lowest]))


def test_the_cheapest_nodes_are_those_reached_at_least_cost(monkeypatch):
    monkeypatch.setattr("choreograph.choreography.graph.local_search.N_CHEAP", 3)
    layer = random_source(0)[0].layer(4)
    reached = np.full(layer.n_nodes, np.inf)
    reached[[1, 3, 6, 7]] = 4.0, 1.0, 2.0, 3.0
    found = cheapest(reached)
    few, cost = layer.subset(found), np.arange(layer.n_nodes, dtype=float)[found]
    assert cost.tolist() == [3.0, 6.0, 7.0]
    one = layer.subset(np.array([1]))
    key = one.warp.segment[0], one.warp.offset[0]
    (with_node, its_cost), index = including((few, cost), *key, lambda: (one, np.array([9.0])))
    assert index == 3 and its_cost.tolist() == [3.0, 6.0, 7.0, 9.0]
    assert with_node.warp.segment.tolist() == layer.warp.segment[[3, 6, 7, 1]].tolist()
    assert including((few, cost), layer.warp.segment[6], layer.warp.offset[6], lambda: None)[1] == 1


def test_cheap_nodes_do_not_copy_what_all_nodes_of_a_second_have():
    """What a path counts has a column for every motif, take and returning moment of the song."""
    moments = [((0, 0.5),), ((1, 0.5),), *[()] * 4]
    source, _ = random_source(0, n_motifs=5, tie_break_s=np.array([0.0, 0.1]), moments=moments)
    layer = source.layer(3)
    few = layer.subset(np.array([4, 1, 2]))
    (joined, _), _ = including((few, np.zeros(3)), 999, 0, lambda: (source.node(0), np.zeros(1)))
    for nodes in (few, joined):
        for name, n_columns in (("motif_counts", 5), ("take_usage_s", 2), ("danced", 2)):
            values = getattr(nodes.path, name)
            assert values.shape == (nodes.n_nodes, n_columns) and values.strides[0] == 0
    np.testing.assert_array_equal(
        joined.warp.clip, np.append(layer.warp.clip[[4, 1, 2]], source.node(0).warp.clip)
    )
    counted = few.with_motif_counts(few.path.motif_counts)
    (joined, _), _ = including((counted, np.zeros(3)), 999, 0, lambda: (source.node(0), np.zeros(1)))
    np.testing.assert_array_equal(joined.path.motif_counts[:3], counted.path.motif_counts)
    assert counted.path.motif_counts.any() and not joined.path.motif_counts[3].any()
