"""The second set of measures that nothing was fitted to: planted answers."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic_motions import standing_body

from choreograph.core.counts import Counts, make_counts, numbers_in_bar
from choreograph.core.timebase import NET_FPS
from choreograph.evaluation.movement import windows_of
from choreograph.motion import rotations as rot
from choreograph.motion.body import BODY_JOINTS
from research import second_unseen_measures as second
from research.unseen_measures import measures_of

N_FRAMES = 400
SECONDS = np.arange(N_FRAMES) / NET_FPS
X, Y, Z = np.eye(3)


def wave(hz: float, phase_rad: float = 0.0) -> np.ndarray:
    return np.sin(2 * np.pi * hz * SECONDS + phase_rad)


def moved(shift_of_joints_m: dict[str, np.ndarray]) -> np.ndarray:
    """A body at rest with joints moved by (T, 3). "all" are all joints."""
    body = standing_body(N_FRAMES)
    for joint, shift_m in shift_of_joints_m.items():
        body[:, slice(None) if joint == "all" else [BODY_JOINTS.index(joint)]] += shift_m[:, None]
    return body


def along(axis: np.ndarray, values: np.ndarray) -> np.ndarray:
    return values[:, None] * axis


def turned(body: np.ndarray, turn_rad: np.ndarray) -> np.ndarray:
    return rot.rotate_about_y(turn_rad[:, None], body)


def counts(bpm: float) -> Counts:
    times_s = np.arange(0.0, N_FRAMES / NET_FPS, 60.0 / bpm)
    return make_counts(times_s, numbers_in_bar(len(times_s), 4), 4)


def measure(name: str, body: np.ndarray, counted: Counts | None = None) -> float:
    [window] = windows_of(body, counted)
    return measures_of(["second"])[name](window)


def walk() -> np.ndarray:
    """A walk to the front of 0.8 m/s, with a step in 0.5 s.

    The pelvis is at its highest at each landing. The arms swing with the other legs.
    """
    body = standing_body(N_FRAMES)
    body[..., 2] += 0.8 * SECONDS[:, None]
    body[:, BODY_JOINTS.index("pelvis"), 1] += 0.03 * np.cos(2 * np.pi * 2.0 * SECONDS)
    for side, sign, after_s in (("left", 1.0, 0.0), ("right", -1.0, 0.5)):
        n_steps, part = np.divmod(SECONDS + after_s, 1.0)  # stands for half a second, then swings
        swing = (2 * part - 1).clip(min=0.0)
        forward = 0.8 * (n_steps + 3 * swing**2 - 2 * swing**3 - after_s) + 0.2 - 0.8 * SECONDS
        shift = along(Z, forward) + along(Y, 0.12 * np.sin(np.pi * swing))
        for joint in ("ankle", "foot"):
            body[:, BODY_JOINTS.index(f"{side}_{joint}")] += shift
        body[:, BODY_JOINTS.index(f"{side}_knee")] += shift / 2
        arm = along(Z, -0.2 * sign * np.cos(2 * np.pi * SECONDS)) - 0.3 * Y
        body[:, BODY_JOINTS.index(f"{side}_wrist")] += arm
    return body


def test_all_are_finite_on_a_walk():
    [window] = windows_of(walk(), counts(120.0))
    values = {name: measure(window) for name, measure in measures_of(["second"]).items()}
    assert len(values) == 24 and all(np.isfinite(value) for value in values.values()), values


def test_the_legs_and_arms_of_a_walk_alternate():
    body = walk()
    assert measure("ankles to the front together, r", body) < -0.9
    assert measure("legs mirrored later, r", body) > 0.99
    assert measure("foot is fastest, share of its swing", body) == pytest.approx(0.5, abs=0.05)
    assert measure("pelvis height as a foot lands, sd", body) > 1.0
    assert measure("arms to the front with the other legs, r", body) > 0.9
    assert measure("travel to the side, share", body) == pytest.approx(0.0, abs=0.01)


def test_legs_that_bend_in_turn_do_not_shorten_together():
    up = along(Y, 0.05 * wave(1.0))
    name = "legs shorten together, r"
    assert measure(name, moved({"left_ankle": up, "right_ankle": up})) == pytest.approx(1.0)
    assert measure(name, moved({"left_ankle": up, "right_ankle": -up})) == pytest.approx(-1.0)


def test_a_rhythm_is_told_by_its_shares_of_power():
    name = "pelvis up and down at its strongest frequency, share"
    assert measure(name, moved({"all": along(Y, 0.05 * wave(2.0))})) > 0.95
    two = 0.06 * wave(1.0) + 0.02 * wave(3.0)  # of the same speed
    assert measure(name, moved({"all": along(Y, two)})) == pytest.approx(0.5, abs=0.03)
    name = "arms below 1 Hz, share of power"
    slow, fast = (moved({"left_wrist": along(Z, 0.1 * wave(hz))}) for hz in (0.5, 2.0))
    assert measure(name, slow) > 0.95 and measure(name, fast) < 0.05
    name = "trunk at the counts, share of power"
    sways = moved({"neck": along(X, 0.05 * wave(1.0))})
    assert measure(name, sways, counts(120.0)) > 0.9 and measure(name, sways, counts(60.0)) > 0.9
    assert measure(name, sways, counts(90.0)) < 0.1 and np.isnan(measure(name, sways))


def test_entropy_is_0_of_one_alone_and_1_of_all_alike():
    assert second.entropy(np.array([3.0, 0.0, 0.0, 0.0])) == 0.0
    assert second.entropy(np.ones(5)) == pytest.approx(1.0)
    assert second.entropy(np.array([1.0, 1.0, 0.0, 0.0])) == pytest.approx(0.5)
    half = np.where(SECONDS < 10.0, -1.0, 1.0)  # below the pelvis, then above the head
    wrists = moved({f"{side}_wrist": along(Y, half) for side in ("left", "right")})
    assert measure("levels of the wrists, entropy", wrists) == pytest.approx(np.log(2) / np.log(5))
    rng = np.random.default_rng(0)
    regular, random = along(X, 0.1 * wave(1.0)), along(X, np.cumsum(rng.normal(0, 0.03, N_FRAMES)))
    name = "speed of the body, entropy of its spectrum"
    assert measure(name, moved({"all": regular})) < 0.5 < 0.85 < measure(name, moved({"all": random}))


def test_a_circle_on_the_floor_has_its_radius_and_area():
    angle = 2 * np.pi * SECONDS / 20.0
    circle = moved({"all": along(X, np.cos(angle)) + along(Z, np.sin(angle))})
    assert measure("path on the floor, curvature, median, 1/m", circle) == pytest.approx(1.0, rel=0.02)
    assert measure("floor covered, m²", circle) == pytest.approx(np.pi, rel=0.03)
    assert measure("travel to the side, share", circle) == pytest.approx(0.5, abs=0.02)
    line = moved({"all": along(X, 0.5 * SECONDS)})
    assert measure("floor covered, m²", line) == pytest.approx(0.0, abs=1e-6)
    assert measure("travel to the side, share", line) == pytest.approx(1.0, abs=0.01)
    assert np.isnan(measure("path on the floor, curvature, median, 1/m", standing_body(N_FRAMES)))


def test_turns_to_one_side_and_back_are_told_apart():
    still = standing_body(N_FRAMES)
    spins, sways = turned(still, 2 * np.pi * SECONDS / 5.0), turned(still, 0.5 * wave(0.25))
    assert measure("turning to one side, share", spins) == pytest.approx(1.0)
    assert measure("turning to one side, share", sways) < 0.05
    assert measure("facing one way", spins) < 0.02
    assert measure("facing one way", sways) == pytest.approx(0.938, abs=0.005)  # J0(0.5)
    assert measure("facing one way", still) == pytest.approx(1.0)


def test_feet_that_cross_are_on_the_wrong_side_of_each_other():
    name = "feet to the side of each other, 5th percentile, m"
    assert measure(name, standing_body(N_FRAMES)) == pytest.approx(0.17)
    crossed = moved({"left_foot": along(X, np.where(SECONDS < 4.0, -0.3, 0.0))})
    assert measure(name, crossed) == pytest.approx(-0.13)


def test_parts_of_the_body_that_move_together_and_against_each_other():
    name = "arms move at the same time, r"
    left = along(Z, 0.2 * wave(0.5))
    assert measure(name, moved({"left_wrist": left, "right_wrist": -left})) == pytest.approx(1.0)
    in_turn = moved({"left_wrist": left, "right_wrist": along(Z, 0.2 * wave(0.5, np.pi / 2))})
    assert measure(name, in_turn) < -0.8
    name = "trunk to the side with the pelvis, r"
    aside = along(X, 0.05 * wave(1.0))
    assert measure(name, moved({"pelvis": aside})) == pytest.approx(-1.0)
    assert measure(name, moved({"pelvis": aside, "neck": 2 * aside})) == pytest.approx(1.0)
    sways = moved({"head": 2 * aside, "neck": aside})
    assert measure("head sways over neck sways", sways) == pytest.approx(2.0)


def test_shapes_are_those_that_were_planted():
    assert second.hull_m2(np.array([[0, 0], [2, 0], [2, 1], [0, 1], [1, 0.5]])) == pytest.approx(2.0)
    assert second.hull_m2(np.array([[0, 0], [1, 1], [2, 2]])) == 0.0
    assert second.hull_m2(np.zeros((5, 2))) == 0.0
    still = standing_body(N_FRAMES)
    flat = still * np.array([1.0, 1.0, 0.5])
    name = "hull from above over that from the front, median"
    assert measure(name, flat) == pytest.approx(0.5 * measure(name, still))
    raised = moved({"left_wrist": along(Y, np.full(N_FRAMES, 0.24))})
    assert measure("upper body from its mirror image, median, m", still) == pytest.approx(0.0, abs=1e-9)
    # Each wrist is 0.24 m from the mirror image of the other, and ten other joints are where they would be.
    assert measure("upper body from its mirror image, median, m", raised) == pytest.approx(2 * 0.24 / 12)
    rises = along(Y, np.where(SECONDS < 3.0, 0.1, 0.0))
    tiptoe = moved({f"{side}_ankle": rises for side in ("left", "right")})
    assert measure("heel over its usual height, 95th percentile, m", tiptoe) == pytest.approx(0.1)


def test_the_path_of_a_wrist_on_a_circle_has_its_radius():
    circle = along(X, 0.3 * wave(0.4)) + along(Y, 0.3 * wave(0.4, np.pi / 2))
    found = measure("paths of the wrists, curvature, median, 1/m", moved({"left_wrist": circle}))
    assert found == pytest.approx(1 / 0.3, rel=0.05)
