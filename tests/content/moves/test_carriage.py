"""Carriage: nothing random without a generator, what an amount does, and arms out of the trunk."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
from body_capsules import depths_m

from choreograph.motion.body import BODY_JOINTS, body_pos_m
from content.moves.carriage import Carriage, _looks
from content.moves.figures import Figure
from content.moves.notation import Bounce, Move, pose, step, touch
from content.moves.sequencer import render, sequence_moves

COUNTS_S = 1.0 + 0.5 * np.arange(16)
NONE = Carriage(**{f.name: 0.0 for f in fields(Carriage) if f.name not in ("reach", "to_go", "through")})
WALK = Figure("walk", 4, "1 L 0 40, 2 R 0 40, 3 L 0 40, 4 R 0 40").move()


def joint_m(carriage: Carriage, name: str, *, seed: int | None = None) -> np.ndarray:
    rng = None if seed is None else np.random.default_rng(seed)
    rendered = render(sequence_moves([WALK] * 4), COUNTS_S, rng=rng, carriage=carriage)
    return body_pos_m(rendered.motion)[:, BODY_JOINTS.index(name)]


def test_without_a_generator_nothing_is_random() -> None:
    assert np.array_equal(joint_m(Carriage(), "head"), joint_m(Carriage(), "head"))
    assert not np.array_equal(joint_m(Carriage(), "head", seed=0), joint_m(Carriage(), "head", seed=1))


def test_hips_tilt_over_the_standing_leg() -> None:
    tilts = []
    for carriage in (NONE, replace(NONE, hip_up=8.0)):
        left, right = (joint_m(carriage, f"{side}_hip")[:, 1] for side in ("left", "right"))
        tilts.append(np.std(left - right))
    assert tilts[1] > tilts[0] + 0.008


def test_a_lean_moves_the_neck_forward() -> None:
    upright, leant = (
        joint_m(replace(NONE, lean=lean), "neck") - joint_m(replace(NONE, lean=lean), "pelvis")
        for lean in (0.0, 8.0)
    )
    assert np.median(leant[:, 2] - upright[:, 2]) > 0.03


def test_arms_swing_against_the_legs() -> None:
    carriage = replace(NONE, arm_swing=25.0)
    wrist, foot = (
        joint_m(carriage, f"left_{j}")[:, 2] - joint_m(carriage, "pelvis")[:, 2] for j in ("wrist", "foot")
    )
    assert np.corrcoef(wrist[60:-60], foot[60:-60])[0, 1] < -0.5


@pytest.mark.parametrize("reach", [0.985, 0.9965])
def test_legs_get_as_straight_as_they_may(reach: float) -> None:
    hip, knee, ankle = (joint_m(replace(NONE, reach=reach), f"left_{j}") for j in ("hip", "knee", "ankle"))
    leg = np.linalg.norm(hip - knee, axis=1) + np.linalg.norm(knee - ankle, axis=1)
    assert np.linalg.norm(hip - ankle, axis=1).max() / leg.max() == pytest.approx(reach, abs=0.012)


def test_an_arm_across_the_belly_is_moved_out_of_it() -> None:
    move = Move(
        "hug", 2, (step("left", 1), touch("right", 2)),
        {c: pose(twist=25, left="elbow_back", right="cross_low") for c in (1, 2)}, Bounce(0.0),
    )  # fmt: skip
    motion = render(sequence_moves([move, move.mirrored()] * 2), COUNTS_S[:8], rng=None).motion
    deep = {pair: depth.max() for pair, depth in depths_m(motion).items() if "torso" in pair}
    assert max(deep.values()) < 0.02


def test_looks_and_leans_rest_on_every_count() -> None:
    fps, counts = 100.0, np.arange(0.0, 60.0, 0.02)  # two counts a second
    looks = _looks(counts, fps, np.random.default_rng(0), 0.9)
    speed = np.abs(np.gradient(looks)) * fps
    on_counts = speed[::50]
    assert on_counts.max() < 0.02 < 0.5 < speed.max()
    many = np.concatenate([_looks(counts, fps, np.random.default_rng(seed), 0.9) for seed in range(20)])
    assert 0.6 < many.std() < 1.2


def test_the_pelvis_only_sinks_here_and_there() -> None:
    stands = Move("stands", 4, (), {1: pose()}, Bounce(0.0))
    level, sinking = (
        body_pos_m(
            render(
                sequence_moves([stands] * 4), COUNTS_S, rng=np.random.default_rng(0),
                carriage=replace(NONE, sinks_m=sinks, stoop_m=0.01),
            ).motion
        )[:, 0, 1]
        for sinks in (0.0, 0.03)
    )  # fmt: skip
    assert (sinking - level).max() < 0.002
    assert (level - sinking).max() > 0.02


def test_arms_are_turned_outwards() -> None:
    closed, opened = (
        joint_m(replace(NONE, arms_open=deg), "left_wrist")
        - joint_m(replace(NONE, arms_open=deg), "left_shoulder")
        for deg in (0.0, 20.0)
    )
    assert np.median(opened[:, 0] - closed[:, 0]) > 0.02
    assert np.median(opened[:, 2] - closed[:, 2]) < 0.01


def test_toes_differ_from_step_to_step_by_the_spread_of_the_carriage() -> None:
    rng = np.random.default_rng(0)
    toes = [Carriage(toes_vary=10.0, toes_sweep=20.0, toes_point=40.0).toes(rng) for _ in range(2000)]
    assert np.std([t.turn_deg for t in toes]) == pytest.approx(10.0, rel=0.15)
    assert np.std([t.sweep_deg for t in toes]) == pytest.approx(20.0, rel=0.15)
    assert np.mean([t.point_deg for t in toes]) == pytest.approx(40.0, rel=0.05)
    assert Carriage(toes_vary=10.0).toes(None).turn_deg == 0.0
