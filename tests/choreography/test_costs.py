"""The built-in costs against their formulas, pair by pair."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from synthetic_layers import random_source

from choreograph.choreography.graph.cost import Cost, resolve_weights
from choreograph.choreography.graph.costs import (
    BUILTIN_COSTS,
    DEFAULT_WEIGHTS,
    Accents,
    Bars,
    Completeness,
    Energy,
    Genre,
    Pace,
    Phrasing,
    RepeatCost,
    Rhythm,
    Seed,
    StepsCost,
    Transition,
    Velocity,
)
from choreograph.choreography.graph.kernels import COMPILED, COMPILED_OF_PATH
from choreograph.choreography.graph.layers import changed_layer
from choreograph.choreography.graph.motif_costs import MotifTransition, Signature
from choreograph.choreography.graph.path_costs import FormCost, FrontCost, Variety
from choreograph.core.errors import ParameterError
from choreograph.motion.body import BODY_JOINTS


@pytest.fixture(params=range(3))
def layers(request):
    source, song_features = random_source(request.param)
    return source.layer(3), source.layer(4), song_features


def completeness_by_hand(a, b, i, j) -> float:
    if a.warp.segment[i] != b.warp.segment[j] or a.warp.offset[i] + 1 != b.warp.offset[j]:
        return 1.0
    last = 0.0 if math.isnan(a.warp.last_beat[i]) else float(a.warp.last_beat[i])
    first = 20.0 if math.isnan(b.warp.first_beat[j]) else float(b.warp.first_beat[j])
    gap = (20.0 - last) + first
    return 1.0 / (1.0 + math.exp(-(20.0 - gap) / 5.0))


def test_completeness_is_the_formula_pair_by_pair(layers):
    a, b, song_features = layers
    cost = Completeness().edge(a, b, song_features)
    by_hand = [[completeness_by_hand(a, b, i, j) for j in range(b.n_nodes)] for i in range(a.n_nodes)]
    assert np.allclose(cost, by_hand, atol=1e-6)
    assert (cost < 1).sum() == len(a.successors_in(b)[0]) == 12  # 4 segments of each of 3 ages continue


def test_staying_in_a_counted_take_is_complete(tracked):
    a, b, song_features = tracked
    cost = Completeness().edge(a, b, song_features)
    here, there = a.successors_in(b)
    counted = a.warp.time_map_id[here] >= 0
    assert counted.any() and (cost[here[counted], there[counted]] == 0).all()
    assert (cost[here[~counted], there[~counted]] > 0).all()
    others = np.ones(cost.shape, bool)
    others[here, there] = False
    assert (cost[others] == 1).all()


def test_transition_is_the_rms_joint_distance_and_zero_for_successors(layers):
    a, b, song_features = layers
    cost = Transition().edge(a, b, song_features)
    differences = a.last_pose_m[:, None] - b.first_pose_m[None]  # (P, N, 21, 3)
    assert np.allclose(cost, np.sqrt((differences**2).sum(-1).mean(-1)), atol=2e-3)
    here, there = a.successors_in(b)
    assert cost[here, there].max() < 5e-3
    others = np.ones(cost.shape, bool)
    others[here, there] = False
    assert cost[others].min() > 0.1


def test_velocity_is_the_rms_difference_over_the_mean_speed(layers):
    a, b, song_features = layers
    differences = a.last_velocity_m_s[:, None] - b.first_velocity_m_s[None]  # (P, N, 21, 3)
    rms = np.sqrt((differences**2).sum(-1).mean(-1))
    speeds = [np.sqrt((v**2).sum(-1).mean(-1)) for v in (a.last_velocity_m_s, b.first_velocity_m_s)]
    expected = rms / (0.5 * (speeds[0][:, None] + speeds[1]) + 0.1)
    cost = Velocity().edge(a, b, song_features)
    assert np.allclose(cost, expected, rtol=1e-3, atol=0.05)
    assert cost.min() >= 0 and cost.max() <= 2


def test_velocity_of_slower_bodies_is_not_cheaper(layers):
    a, b, song_features = layers
    ten_times = [
        replace(
            layer,
            first_velocity_m_s=10 * layer.first_velocity_m_s,
            last_velocity_m_s=10 * layer.last_velocity_m_s,
        )
        for layer in (a, b)
    ]
    slow, fast = Velocity().edge(a, b, song_features), Velocity().edge(*ten_times, song_features)
    others = np.ones(slow.shape, bool)
    others[a.successors_in(b)] = False
    assert np.allclose(slow[others], fast[others], rtol=0.2, atol=1e-3)  # zeros are rounded


def test_style_and_rhythm(layers):
    a, _, song_features = layers
    by_hand = [math.dist(style, song_features.style[3]) for style in a.style]
    assert np.allclose(Genre().node(a, song_features), by_hand, rtol=1e-5)
    assert np.allclose(Rhythm().node(a, song_features), a.warp.unmatched_beat + a.warp.density_mismatch)


@pytest.fixture(params=range(3))
def tracked(request):
    source, song_features = random_source(request.param, k=8, n_clips=10, tracked=True)
    return source.layer(3), source.layer(4), song_features


def test_beats_count_where_counts_are_not_known_and_doubt_and_accents_where_they_are(tracked):
    layer, _, song_features = tracked
    counted = layer.warp.time_map_id >= 0
    assert counted.any() and not counted.all()
    rhythm, accents = Rhythm().node(layer, song_features), Accents().node(layer, song_features)
    assert layer.count_uncertainty[counted].any() and not accents[~counted].any()
    assert np.array_equal(rhythm[counted], layer.count_uncertainty[counted])
    assert np.allclose(rhythm[~counted], (layer.warp.unmatched_beat + layer.warp.density_mismatch)[~counted])
    assert np.array_equal(accents[counted], layer.warp.unmatched_beat[counted])


def test_bars_are_the_share_of_beats_off_the_bar(layers):
    layer, _, song_features = layers
    assert np.array_equal(Bars().node(layer, song_features), layer.warp.off_bar)


def test_phrasing_is_the_mean_of_leaving_and_entering_and_free_for_successors(tracked):
    a, b, song_features = tracked
    cost = Phrasing().edge(a, b, song_features)
    here, there = a.successors_in(b)
    assert len(here) and not cost[here, there].any()
    others = np.ones(cost.shape, bool)
    others[here, there] = False
    by_hand = [[(leave + enter) / 2 for enter in b.warp.enter_penalty] for leave in a.warp.leave_penalty]
    assert np.allclose(cost[others], np.array(by_hand)[others])
    least = np.where(others, cost, np.inf).min(axis=0)
    assert (Phrasing().min_edge_costs(a, b, song_features) <= least + 1e-6).all()


def test_energy_asks_for_lively_motion_in_loud_seconds_and_quiet_motion_in_soft_ones(layers):
    layer, _, song_features = layers
    layer = replace(layer, liveliness=np.linspace(0, 1, layer.n_nodes, dtype=np.float32))
    for loud, dearest in ((1.0, 0), (0.0, -1)):  # of the second: others are at 0.5
        energy = np.full(song_features.n_seconds, 0.5, np.float32)
        energy[layer.second] = loud
        cost = Energy().node(layer, replace(song_features, energy=energy))
        away = abs(loud - energy.mean())
        assert cost[dearest] == cost.max() == pytest.approx(2 * away)
        assert cost[-1 - dearest] == cost.min() == 0.0
    assert not Energy().node(layer, song_features).any()  # a song of one loudness


def test_steps_are_dense_where_onsets_are(layers):
    layer, _, song_features = layers
    layer = replace(layer, steps=np.linspace(0, 1, layer.n_nodes))
    for density in (0.0, 0.3, 1.0):
        onset_density = np.full(song_features.n_seconds, density)
        cost = StepsCost().node(layer, replace(song_features, onset_density=onset_density))
        assert np.argmin(cost) == np.argmin(np.abs(layer.steps - density))
        np.testing.assert_allclose(cost, np.abs(layer.steps - density))


def test_pace_is_the_change_of_speed_in_octaves(layers):
    layer = layers[0].subset(np.arange(4))
    steps = np.linspace(0.0, 1.0, 21)
    speeds = np.array([1.0, 2.0, 0.5, 1.25])
    frames = 20.0 * speeds[:, None] * steps
    played = replace(layer, source_frames=frames)
    assert Pace().node(played, None) == pytest.approx(np.abs(np.log2(speeds)))
    hurried = 20.0 * np.where(steps < 0.5, steps * 2, 1 + (steps - 0.5) * 0.5)  # twice, then half as fast
    assert Pace().node(replace(layer, source_frames=np.tile(hurried, (4, 1))), None) == pytest.approx(1.0)


def _danced(source, takes, second=3):
    """A layer of a source as if each node had been reached over `takes`, one a second."""
    layer = source.layer(second)
    for take in takes:
        every = np.full(layer.n_nodes, take)
        danced = replace(layer, take=every, usage_column=every).with_take_usage(layer.path.take_usage_s)
        layer = changed_layer(layer, take_usage_s=danced.path.take_usage_s)
    return layer


def test_variety_is_the_usage_of_takes_along_the_path():
    source, song_features = random_source(0, tie_break_s=np.array([0.0, 3.0], np.float32))
    here, there = _danced(source, [0] * 12), source.layer(4)
    used_s = here.path.take_usage_s
    assert ((used_s[:, 0] > 11) & (used_s[:, 0] < 12)).all()  # decayed a little
    assert (used_s[:, 1] < 3).all()
    edges = Variety().edge(here, there, song_features)
    assert np.allclose(edges, used_s[:, there.take] / 12)
    assert (edges >= Variety().min_edge_costs(here, there, song_features) - 1e-6).all()
    assert Variety().node(there, song_features) is None
    first = source.layer(0)
    assert np.allclose(Variety().node(first, song_features), np.where(first.take == 1, 3, 0) / 12)


def test_usage_decays():
    source, _ = random_source(0, tie_break_s=np.zeros(2, np.float32))
    lately, long_ago = (
        _danced(source, takes).path.take_usage_s[0] for takes in ([1] * 600 + [0] * 20, [0] * 20 + [1] * 600)
    )
    assert lately[0] > 15
    assert long_ago[0] < 1
    assert long_ago[1] < 130  # and is bounded


def test_usage_is_not_counted_without_tie_breaks():
    source, song_features = random_source(0)
    here = _danced(source, [0, 1, 1])
    assert here.path.take_usage_s.shape == (here.n_nodes, 0)
    assert Variety().node(source.layer(0), song_features) is None
    assert Variety().edge(here, source.layer(4), song_features) is None


def front_by_hand(a, b, i, j, song_features) -> float:
    """The cost of a heading, in steps: the rotation of the take of b, then its headings in the dance."""
    rotation = a.path.turn_rad[i]
    if b.part[j] != a.next_part[i]:
        rotation = a.path.turn_rad[i] + a.join_heading_rad[i, 1] - b.join_heading_rad[j, 0]
        rotation = math.remainder(rotation, 2 * math.pi)
        rotation -= math.copysign(min(abs(rotation), b.steer_rad), rotation)
    cost = np.mean((0.5 - 0.5 * np.cos(b.heading_rad[j] + rotation)) ** 2)
    if b.part[j] != a.next_part[i]:
        cost += 4.0 * (1.0 - math.cos(rotation))
    if b.second == song_features.n_seconds - 1:  # the last pose
        pose_m = b.bank.poses_m(b.source[j : j + 1], b.source_frames[j : j + 1, -2])[0][0]
        across_m = pose_m[BODY_JOINTS.index("left_hip")] - pose_m[BODY_JOINTS.index("right_hip")]
        hips_rad = math.atan2(-across_m[2], across_m[0])  # turned against the body
        cost += 6.0 * (1.0 - math.cos(b.heading_rad[j, -2] + hips_rad + rotation))
    return cost


@pytest.mark.parametrize("tracked", [False, True])
@pytest.mark.parametrize("second", [3, 5])
def test_the_front_follows_the_heading_of_the_dance(second, tracked):
    source, song_features = random_source(second, tracked=tracked)
    a, b = source.layer(second - 1), source.layer(second)
    a = changed_layer(a, turn_rad=np.linspace(-3.0, 3.0, a.n_nodes))
    b = replace(b, steer_rad=0.25)
    by_hand = [[front_by_hand(a, b, i, j, song_features) for j in range(b.n_nodes)] for i in range(a.n_nodes)]
    assert np.allclose(FrontCost().edge(a, b, song_features), by_hand, atol=1e-5)
    jumps = np.array(by_hand)
    jumps[a.successors_in(b)] = np.inf
    assert (jumps.min(axis=0) >= FrontCost().min_edge_costs(a, b, song_features) - 1e-6).all()
    assert FrontCost().node(b, song_features) is None  # the heading depends on how it is reached


def test_a_dance_that_begins_at_the_front_is_free_and_one_at_the_back_costs_1(monkeypatch):
    for heading_rad, expected in ((0.0, 0.0), (np.pi, 1.0), (-np.pi / 2, 0.25), (2 * np.pi, 0.0)):
        source, song_features = random_source(0)
        headings = np.full((1, 1), heading_rad)
        monkeypatch.setattr(
            type(source._poses), "headings_rad", lambda _, clip, frames, h=headings: h + 0.0 * frames
        )
        assert FrontCost().node(source.layer(0), song_features) == pytest.approx(expected, abs=1e-6)


def test_a_take_turns_what_follows_it_by_what_it_turns_itself():
    """Two takes that turn by 1 rad a second, joined at every second, and steered back by 0.25 rad at most."""
    source, _ = random_source(0)
    layer = source.layer(2).subset(np.array([0]))
    layer = changed_layer(
        layer, join_heading_rad=np.array([[0.0, 1.0]]), segment=np.array([90]), steer_rad=0.25
    )
    turned = []
    for second in range(3, 8):
        following = changed_layer(layer, second=second, segment=layer.warp.segment + 1)
        layer = following.with_turn(layer, slice(None))
        turned.append(layer.path.turn_rad[0])
    assert turned == pytest.approx([0.75, 1.5, 2.25, 3.5 - 2 * np.pi, 4.75 - 2 * np.pi])  # on by the back
    goes_on = changed_layer(layer, second=layer.second + 1, offset=layer.warp.offset + 1)
    assert goes_on.with_turn(layer, np.array([0])).path.turn_rad == layer.path.turn_rad
    assert layer.with_turn(layer, slice(None)).path.turn_rad == layer.path.turn_rad
    with pytest.raises(ParameterError, match="nodes of the layer before"):
        source.layer(3).with_turn(source.layer(2), slice(None))


def test_a_seed_gives_each_part_of_a_take_a_number_of_its_own():
    source, song_features = random_source(0, tracked=True)
    here, there = source.layer(3), source.layer(4)
    numbers = Seed(1).node(here, song_features)
    assert ((numbers >= 0) & (numbers < 1)).all()
    a, b = here.successors_in(there)
    assert np.array_equal(numbers[a], Seed(1).node(there, song_features)[b])
    assert len(np.unique(numbers)) == here.n_nodes - sum(here.warp.time_map_id >= 0) + len(
        np.unique(here.warp.time_map_id[here.warp.time_map_id >= 0])
    )
    assert not np.isclose(numbers, Seed(2).node(here, song_features)).any()
    many = changed_layer(here.subset(np.zeros(5000, np.int64)), time_map_id=np.arange(5000))
    of_parts = Seed(0).node(many, song_features)
    assert np.histogram(of_parts % 0.5, 10, (0, 0.5))[0].min() > 400
    takes = changed_layer(many, take=np.arange(5000), time_map_id=np.zeros(5000, np.int64))
    assert 0.45 < (Seed(0).node(takes, song_features) >= 0.5).mean() < 0.55


def test_repeat_is_1_for_going_back_less_than_a_clip_in_one_take(layers):
    a, b, song_features = layers
    back = a.take_frames[:, 1][:, None] - b.take_frames[:, 0][None]
    by_hand = (a.take[:, None] == b.take[None]) & (back > 5) & (back < 160)
    cost = RepeatCost().edge(a, b, song_features)
    assert np.array_equal(cost, by_hand)
    assert 0 < cost.sum() < cost.size
    here, there = a.successors_in(b)
    assert not cost[here, there].any()


def test_successors_are_the_pairs_of_one_segment_one_quarter_apart(layers):
    a, b, _ = layers
    pairs = {(int(i), int(j)) for i, j in zip(*a.successors_in(b), strict=True)}
    by_hand = {
        (i, j)
        for i in range(a.n_nodes)
        for j in range(b.n_nodes)
        if a.warp.segment[i] == b.warp.segment[j] and a.warp.offset[i] + 1 == b.warp.offset[j]
    }
    assert pairs == by_hand
    # Also when nodes on either side are forbidden.
    few_a, few_b = a.subset(a.warp.offset != 1), b.subset(np.arange(b.n_nodes) % 3 == 0)
    for i, j in zip(*few_a.successors_in(few_b), strict=True):
        assert few_a.warp.segment[i] == few_b.warp.segment[j]
        assert few_a.warp.offset[i] + 1 == few_b.warp.offset[j]


def test_successors_are_the_pairs_of_one_track_too(tracked):
    a, b, _ = tracked
    by_hand = {
        (i, j)
        for i in range(a.n_nodes)
        for j in range(b.n_nodes)
        if (a.warp.time_map_id[i] == b.warp.time_map_id[j] >= 0)
        or (
            a.warp.time_map_id[i] == b.warp.time_map_id[j] == -1
            and a.warp.segment[i] == b.warp.segment[j]
            and a.warp.offset[i] + 1 == b.warp.offset[j]
        )
    }
    assert {(int(i), int(j)) for i, j in zip(*a.successors_in(b), strict=True)} == by_hand
    assert any(a.warp.segment[i] != b.warp.segment[j] for i, j in by_hand)


def test_a_layer_has_one_node_per_track(tracked):
    for layer in tracked[:2]:
        by_time_map = layer.warp.time_map_id[layer.warp.time_map_id >= 0]
        assert len(by_time_map) == len(set(by_time_map.tolist())) > 0
        assert (layer.warp.time_map_id < 0).sum() > 0


def test_motifs_are_counted_anew_where_a_goal_begins():
    source, _ = random_source(3, n_motifs=4, goal_starts=[0, 3])
    assert [source.layer(second).new_goal for second in range(6)] == [True, False, False, True, False, False]
    for second, carried in ((3, 0), (4, 5)):
        layer = source.layer(second)
        counts = layer.with_motif_counts(np.full_like(layer.path.motif_counts, 5)).path.motif_counts
        own = [np.bincount(words[words >= 0], minlength=4) for words in layer.motifs]
        assert np.array_equal(counts, carried + np.array(own))


def test_a_layer_holds_the_segments_of_its_last_four_seconds():
    source, _ = random_source(0, n_seconds=6, k=4)
    assert [source.layer(s).n_nodes for s in range(6)] == [4, 8, 12, 16, 16, 16]
    layer = source.layer(5)
    assert set(layer.warp.segment // 4) == {2, 3, 4, 5}
    assert np.array_equal(layer.warp.segment // 4 + layer.warp.offset, np.full(16, 5))
    assert layer.source_frames.shape == (16, 21)
    assert set(layer.take_names) <= {"left", "right"}


def test_a_cost_has_its_class_name_or_its_own():
    class LowPoses(Cost):
        pass

    class Another(Cost):
        name = "other"

    assert LowPoses.name == "lowposes"
    assert Another.name == "other"
    source, song_features = random_source(0)
    assert Another().node(source.layer(0), song_features) is None
    assert Another().edge(source.layer(0), source.layer(1), song_features) is None


def test_every_built_in_cost_declares_what_help_and_studio_say():
    assert list(DEFAULT_WEIGHTS) == [kind.name for kind in BUILTIN_COSTS]
    for kind in BUILTIN_COSTS:
        own = kind.__dict__
        assert own["default_weight"] == DEFAULT_WEIGHTS[kind.name] <= kind.highest_weight
        assert own["sentence"].endswith(".") and own["sentence"][0].isupper()
        assert "Raise its weight" in " ".join((kind.__doc__ or "").split())


def test_a_cost_of_ones_own_declares_nothing_and_has_defaults():
    class HighHands(Cost):
        """Prefers high hands."""

    class Dearer(HighHands):
        default_weight = 3.0

    assert (HighHands.label, HighHands.default_weight, HighHands.highest_weight) == ("highhands", 1.0, 4.0)
    assert HighHands.sentence == "Prefers high hands." and Dearer.sentence == "A cost of your own."
    assert Dearer.highest_weight == 12.0


def test_the_compiled_costs_are_in_the_order_of_their_sum():
    assert [kind for kind in BUILTIN_COSTS if kind in COMPILED] == list(COMPILED)
    assert (FrontCost, Variety, FormCost, Signature) == COMPILED_OF_PATH
    assert {MotifTransition, Completeness, RepeatCost} < set(COMPILED)


def test_weights_are_given_or_default():
    class Mine(Cost):
        default_weight = 2.0

    weights = resolve_weights({"genre": 3}, [Genre, Transition, Mine()])
    assert weights == {"genre": 3.0, "transition": Transition.default_weight, "mine": 2.0}
    with pytest.raises(ParameterError, match="'gnre'"):
        resolve_weights({"gnre": 1}, [Genre])
    with pytest.raises(ParameterError, match="the cost 'style' is called 'genre'"):
        resolve_weights({"style": 1}, [Genre, Transition])
