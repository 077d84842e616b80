"""The cheapest nodes of every second: which are kept, and that long dances are planned as short ones."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic_layers import random_source

import choreograph as cg
from choreograph.choreography.graph import cheap_nodes
from choreograph.choreography.graph.cheap_nodes import cheapest, including
from choreograph.choreography.graph.kernels import arrays_of


@pytest.mark.parametrize("n_cheap", [3, 128])
def test_without_poses_the_dance_is_the_same(n_cheap, monkeypatch):
    """With three nodes a second, the path of the search has others, for which edges are evaluated again."""
    monkeypatch.setattr(cheap_nodes, "N_CHEAP", n_cheap)
    song, arguments = cg.example_songs()["house"], {"duration_s": 12.0, "seed": 2}
    plan = cg.dance(song, **arguments).plan
    kept, without_poses = [], cheap_nodes._without_poses
    monkeypatch.setattr(cheap_nodes, "_MOST_WHOLE_S", 0)
    monkeypatch.setattr(
        cheap_nodes, "_without_poses", lambda *layer: kept.append(without_poses(*layer)) or kept[-1]
    )
    assert cg.dance(song, **arguments).plan == plan
    assert len(kept) >= 12 and all(layer.last_pose_m.size == 0 for layer in kept)


@pytest.mark.parametrize("tracked", [False, True])
def test_without_poses_the_compiled_search_reads_the_same(tracked):
    source, song_features = random_source(0, n_motifs=5, tracked=tracked)
    layer = source.layer(3)
    few = cheap_nodes._without_poses(layer, song_features)
    assert few.last_pose_m.size == few.style.size == 0 and few.liveliness.strides == (0,)
    for values, others in zip(
        arrays_of(layer, None, None, song_features), arrays_of(few, None, None, song_features), strict=True
    ):
        np.testing.assert_array_equal(values, others)


def test_costs_of_others_see_the_poses_of_a_long_dance(monkeypatch):
    class Low(cg.Cost):
        of_path = True

        def edge(self, previous, following, song_features):
            heights_m = following.last_pose_m[:, 0, 1]
            return np.broadcast_to(heights_m, (previous.n_nodes, following.n_nodes))

    song, arguments = cg.example_songs()["house"], {"duration_s": 6.0, "costs": [Low()]}
    plan = cg.dance(song, **arguments).plan
    monkeypatch.setattr(cheap_nodes, "_MOST_WHOLE_S", 0)
    assert cg.dance(song, **arguments).plan == plan


def test_the_cheapest_nodes_are_those_reached_at_least_cost(monkeypatch):
    monkeypatch.setattr("choreograph.choreography.graph.cheap_nodes.N_CHEAP", 3)
    layer = random_source(0)[0].layer(4)
    reached = np.full(layer.n_nodes, np.inf)
    reached[[1, 3, 6, 7]] = 4.0, 1.0, 2.0, 3.0
    found = cheapest(reached)
    few, cost = layer.subset(found), np.arange(layer.n_nodes, dtype=float)[found]
    assert cost.tolist() == [3.0, 6.0, 7.0]
    one = layer.subset(np.array([1]))
    key = one.segment[0], one.offset[0]
    (with_node, its_cost), index = including((few, cost), *key, lambda: (one, np.array([9.0])))
    assert index == 3 and its_cost.tolist() == [3.0, 6.0, 7.0, 9.0]
    assert with_node.segment.tolist() == layer.segment[[3, 6, 7, 1]].tolist()
    assert including((few, cost), layer.segment[6], layer.offset[6], lambda: None)[1] == 1


def test_cheap_nodes_do_not_copy_what_all_nodes_of_a_second_have():
    """What a path counts has a column for every motif, take and returning moment of the song."""
    moments = [((0, 0.5),), ((1, 0.5),), *[()] * 4]
    source, _ = random_source(0, n_motifs=5, tie_break_s=np.array([0.0, 0.1]), moments=moments)
    layer = source.layer(3)
    few = layer.subset(np.array([4, 1, 2]))
    (joined, _), _ = including((few, np.zeros(3)), 999, 0, lambda: (source.node(0), np.zeros(1)))
    for nodes in (few, joined):
        for name, n_columns in (("motif_counts", 5), ("take_usage_s", 2), ("danced", 2)):
            values = getattr(nodes, name)
            assert values.shape == (nodes.n_nodes, n_columns) and values.strides[0] == 0
    np.testing.assert_array_equal(joined.clip, np.append(layer.clip[[4, 1, 2]], source.node(0).clip))
    counted = few.with_motif_counts(few.motif_counts)
    (joined, _), _ = including((counted, np.zeros(3)), 999, 0, lambda: (source.node(0), np.zeros(1)))
    np.testing.assert_array_equal(joined.motif_counts[:3], counted.motif_counts)
    assert counted.motif_counts.any() and not joined.motif_counts[3].any()
