"""A stage with borders: its size, the cost of leaving it, and dances of every engine that keep to it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from synthetic_layers import random_source
from synthetic_motions import swaying

import choreograph as cg
from choreograph.choreography.graph.local_search import with_history
from choreograph.choreography.graph.path_costs import StageCost
from choreograph.choreography.mixer.engine import _stage_costs as stage_costs
from choreograph.choreography.mixer.words import SEARCHES, Candidates, search_words
from choreograph.core.arguments import as_stage_m
from choreograph.evaluation.metrics import front
from choreograph.motion.body import body_pos_m
from choreograph.plan.joins import MAX_STEER_RAD, steer_rad
from choreograph.render.assembly import off_stage


def test_sizes():
    assert as_stage_m("4x3") == (4.0, 3.0)
    assert as_stage_m("2.5x1") == (2.5, 1.0)
    assert as_stage_m("near") is as_stage_m("free") is None


def layers(n=2):
    """The first layers of a random source, whose nodes walk at random in their second."""
    source, song = random_source(3)
    rng = np.random.default_rng(0)
    made = [source.layer(second) for second in range(n)]
    return [replace(layer, walk_m=rng.normal(size=(layer.n_nodes, 2, 2))) for layer in made], song


def way_m(walk_m, turn_rad):
    """A way on the floor, rotated about Y: a positive angle takes +Z towards +X."""
    cosine, sine = np.cos(turn_rad), np.sin(turn_rad)
    return np.array([cosine * walk_m[0] + sine * walk_m[1], cosine * walk_m[1] - sine * walk_m[0]])


def test_places_follow_the_path_and_the_cost_is_the_distance_beyond_the_borders():
    (first, then), song = layers()
    first, then = replace(first, steer_rad=0.25), replace(then, steer_rad=0.25)
    first = with_history(first, first)
    np.testing.assert_allclose(first.path.place_m, first.walk_m[:, -1])  # from the middle, not rotated
    costs = StageCost((2.0, 1.0)).edge(first, then, song)
    assert costs.shape == (first.n_nodes, then.n_nodes)
    for i in range(0, first.n_nodes, 3):
        reached = with_history(then, first, np.full(then.n_nodes, i))
        for j in range(then.n_nodes):
            ways = [way_m(walk_m, reached.path.turn_rad[j]) for walk_m in then.walk_m[j]]
            places_m = first.path.place_m[i] + np.array(ways)
            beyond_m = np.maximum(np.abs(places_m) - [0.7, 0.25], 0.0).max(axis=1)  # 0.3 m for the feet
            assert costs[i, j] == pytest.approx(beyond_m.mean(), abs=1e-4)
            np.testing.assert_allclose(reached.path.place_m[j], places_m[-1], atol=1e-6)


def test_without_borders_no_place_is_followed():
    source, _ = random_source(3)
    layer = source.layer(0)
    assert layer.walk_m.shape == (layer.n_nodes, 0, 2)
    assert with_history(layer, layer).path.place_m.tolist() == layer.path.place_m.tolist()


def test_words_are_chosen_that_stay_on_the_stage():
    """Of two words that fit nearly equally, one leads off a stage 4 m wide."""
    poses, headings_rad = np.zeros((2, 3, 3, 21, 3)), np.zeros((3, 3))
    walk_m = np.zeros((3, 2, 2))
    walk_m[1, :, 0] = 1.5, 3.0
    here = Candidates(
        np.array([0, 2, 4]), np.arange(3), np.array([0.1, 0.0, 0.05]), *poses, headings_rad, walk_m
    )
    slots = [here.without(2, 4), here.without(0)]
    for search in SEARCHES:
        for last_slot in (None, 1):
            assert search_words(slots, search=search, last_slot=last_slot).tolist() == [0, 2]
            on_stage = search_words(slots, search=search, last_slot=last_slot, stage_m=(4.0, 3.0))
            assert on_stage.tolist() == [0, 4]


def test_the_mixer_draws_words_that_move_little_for_a_small_stage():
    walk_m = np.zeros((3, 2, 2))
    walk_m[1:, -1] = [0.3, 0.4], [0.0, 1.0]
    pool = SimpleNamespace(
        ways=lambda words: (np.zeros((3, 3)), walk_m[words]),
        vocabulary=SimpleNamespace(word_take=np.array([0, 0, 0, 1])),
        constraints=SimpleNamespace(take_wanted=np.array([[True, False]] * 5)),
    )  # word 3 is of a take that no slot is drawn from, and is not read
    slots = slice(3, 5)
    costs = stage_costs(pool, (3.0, 1.6))(slots)
    assert costs.shape == (2, 4) and (costs[:, [0, 3]] == 0.0).all()
    np.testing.assert_allclose(costs[:, 1], 1.0)  # half a metre, as far as the front of this stage
    np.testing.assert_allclose(costs[:, 2], 4.0)
    assert (stage_costs(pool, (8.0, 8.0))(slots)[:, 1:3] < 0.1).all()


def test_joins_bend_the_path_back_within_the_borders():
    ahead, place = np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, 1.0])
    assert abs(steer_rad(place, ahead, stage="4x2")) == pytest.approx(MAX_STEER_RAD)  # at the border
    assert steer_rad(place, ahead, stage="8x8") == 0.0  # near the middle
    assert steer_rad(8.0 * place, ahead, stage="free") == 0.0


def test_a_dance_that_leaves_the_stage_is_noted():
    motion = swaying(100)
    there_m = np.zeros((100, 3))
    still = replace(motion, root_pos_m=there_m + np.array([3.0, 1.0, 5.0]))  # the stage moves along
    assert off_stage(still, "4x3") == ()
    there_m[75:, 2] = 1.6
    walking = replace(motion, root_pos_m=there_m)
    assert off_stage(walking, "4x3") == ("the dancer is off the stage (4x3 m) for 25% of the time",)
    assert off_stage(walking, "4x4") == off_stage(walking, "near") == off_stage(walking, "free") == ()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("engine", "song", "n_seeds", "most"), [("graph", "cha-cha", 2, 0.3), ("mixer", "house", 4, 0.15)]
)
def test_dances_keep_to_the_stage(engine, song, n_seeds, most):
    size_m, shares = (1.2, 1.0), {}
    for stage in ("free", "1.2x1"):
        of_seeds = []
        for seed in range(n_seeds):
            dance = cg.dance(cg.example_songs()[song], duration_s=20, engine=engine, stage=stage, seed=seed)
            assert dance.plan.stage == stage
            pos_m = body_pos_m(dance.motion)
            start_m = pos_m[0, 0] * [1.0, 0.0, 1.0]
            of_seeds.append(front.outside_share(pos_m - start_m, *size_m))
            if stage != "free":
                assert np.abs(start_m).max() < 0.3  # the first pose is held there, and shifts its weight
        shares[stage] = np.mean(of_seeds)
    assert shares["1.2x1"] < shares["free"]
    assert shares["1.2x1"] < most
