"""Carriage: nothing random without a generator, what an amount does, and arms out of the trunk."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
from body_capsules import depths_m

from choreograph.motion.body import BODY_JOINTS, body_pos_m
from content.moves.carriage import Carriage
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
