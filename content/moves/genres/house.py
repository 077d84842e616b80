"""House: quick, light feet under a torso that jacks, down into every kick drum. Arms are loose and low."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from content.moves.arm_poses import Arm
from content.moves.genres.street_figures import CARRIAGE, MANNER, street
from content.moves.keyframes import HOME_FWD_M, HOME_SIDE_M
from content.moves.notation import Bounce, Move, Pose, Step, ball, heel, kick, pivot, pose, press, step, touch
from content.moves.sequencer import Genre

_DOWN = Bounce(0.03, "down")

_PISTON_FWD = Arm((0.40, -0.85, 0.50), (-0.05, 0.05, 1.0), 5, 25)
_PISTON_BACK = Arm((0.45, -0.75, -0.55), (0.10, -0.05, 1.0), 5, 25)
_BRACES = Arm((0.72, -0.62, -0.05), (-0.55, 0.55, 0.62), 30, 30)  # thumbs behind the braces
_DIG = Arm((0.35, -0.80, 0.62), (-0.12, -0.35, 0.85), 5, 25)


def _jacked(poses: Mapping[float, Pose], degrees: float) -> dict[float, Pose]:
    """The jack under `poses` that stand on counts: contracted down on each, the chest rises between."""
    jacked: dict[float, Pose] = {}
    for count, down in poses.items():
        values = down.values
        bend = {"bend": values.get("bend", 0.0) + 0.7 * degrees, "arch": -0.6 * degrees}
        tuck = {"hip_tilt": values.get("hip_tilt", 0.0) - 0.5 * degrees}
        jacked[count] = replace(down, values={**values, **bend, **tuck})
        jacked[count - 0.5] = pose(
            bend=values.get("bend", 0.0) - 0.3 * degrees, arch=0.6 * degrees, hip_tilt=0.5 * degrees
        )
    return jacked


JACK = Move(
    "jack", counts=4,
    steps=(
        step("left", 1, (0.16, 0.0), toe_out=16.0),
        press("right", 2),
        touch("left", 4),
    ),
    poses=_jacked(
        {
            1: pose(twist=16, side=6, nod=6, look=10, left="elbow_back", right="pump_high"),
            2: pose(twist=-16, side=-6, hip_side=0.0, nod=6, look=-10, left="pump_high", right="elbow_back"),
            3: pose(twist=16, side=6, hip_side=0.03, nod=6, look=10, left="elbow_back", right="pump_high"),
            4: pose(twist=-16, side=-6, hip_side=0.0, nod=6, look=-10, left="pump_high", right="elbow_back"),
        },
        10,
    ),
    bounce=Bounce(0.03, "down"),
)  # fmt: skip

# Behind, side, front: quick to the right with a point out of it, slow and low to the left.
PAS_DE_BOURREE = Move(
    "pas de bourrée", counts=8,
    steps=(
        step("left", 1, (-0.24, -0.23), bow=(0.03, -0.12), toe_out=18.0),
        ball("right", 1.5, (-0.22, -0.02), bow=(0.0, 0.03)),
        step("left", 2, (-0.20, 0.0), bow=(0.06, 0.0)),
        touch("right", 3, (-0.42, 0.10), toe_out=24.0),
        touch("right", 4, (-0.20, 0.0)),
        step("right", 5, (0.0, -0.26), bow=(-0.03, -0.12), toe_out=18.0),
        step("left", 6, (0.06, 0.0)),
        step("right", 7, (0.03, 0.02), bow=(-0.06, 0.0)),
        touch("left", 8, (0.05, 0.0)),
    ),
    poses={
        1: pose(bend=8, twist=18, hip_turn=-14, side=-4, look=-12, left="low_out", right="across"),
        2: pose(bend=2, twist=-14, hip_turn=4, side=4, look=0, nod=5, left="swing_in", right="out"),
        3: pose(bend=-3, twist=14, hip_turn=-10, side=6, look=-20, left="wide_up", right="swing_in"),
        4: pose(bend=8, twist=-4, hip_turn=0, side=-3, look=0, nod=6, left="swing_back", right="low_guard"),
        5: pose(bend=14, twist=-18, hip_turn=14, side=4, look=14, left="across", right="low_out"),
        6: pose(bend=4, twist=6, hip_turn=-4, side=-4, look=20, left="low_out", right="swing_in"),
        7: pose(bend=12, twist=-14, hip_turn=6, side=3, nod=4, look=6, left="pump_high", right="swing_back"),
        8: pose(bend=4, twist=8, hip_turn=0, side=0, nod=0, look=0, left="swing_back", right="low_guard"),
    },
    bounce=Bounce(0.025, "down"),
)  # fmt: skip

HEEL_TOE = Move(
    "heel toe", counts=4,
    steps=(
        heel("left", 1, (0.14, 0.20), toe_out=28.0),
        touch("left", 2, (0.08, -0.10), toe_out=-18.0),
        heel("left", 3, (0.14, 0.20), toe_out=28.0),
        step("left", 4),
    ),
    poses=_jacked(
        {
            1: pose(twist=-14, hip_turn=10, side=-5, look=14, left="swing_back", right="pump_high"),
            2: pose(twist=12, hip_turn=-10, side=3, nod=8, look=-6, left="pump_high", right="swing_back"),
            3: pose(twist=-14, hip_turn=10, side=-5, look=14, left="swing_back", right="pump_high"),
            4: pose(twist=4, hip_turn=0, side=3, nod=5, look=0, arms="low_guard"),
        },
        7,
    ),
    bounce=_DOWN,
)  # fmt: skip

# Knees like rubber: a low kick to the side on the count, the feet change places between.
LOOSE_LEGS = Move(
    "loose legs", counts=8,
    steps=(
        kick("left", 1, (0.26, 0.12), 0.12),
        ball("left", 1.5, (0.0, -0.02)),
        kick("right", 2, (-0.26, 0.12), 0.12),
        step("right", 3, (0.0, 0.0)),
        kick("left", 4, (0.30, 0.02), 0.16),
        step("left", 5),
        kick("right", 6, (-0.26, 0.12), 0.12, swing=0.6),
        step("right", 7),
        touch("left", 8),
    ),
    poses={
        1: pose(bend=6, twist=-16, side=-8, hip_roll=4, tilt=-4, look=12, left="out", right="across"),
        2: pose(bend=6, twist=16, side=8, hip_roll=-4, tilt=4, look=-12, left="across", right="out"),
        3: pose(bend=10, twist=-4, side=0, hip_roll=0, tilt=0, look=0, nod=6, arms="low_guard"),
        4: pose(
            bend=0, twist=-10, side=-10, hip_roll=6, tilt=-5, look=16, nod=0, left="low_out", right="wide_up"
        ),
        5: pose(
            bend=10, twist=10, side=0, hip_roll=0, tilt=0, look=0, nod=6, left="low_guard", right="swing_in"
        ),
        6: pose(bend=6, twist=16, side=8, hip_roll=-4, tilt=4, look=-12, nod=0, left="across", right="out"),
        7: pose(
            bend=10, twist=-14, side=0, hip_roll=0, tilt=0, look=0, nod=6,
            left="swing_back", right="pump_high",
        ),
        8: pose(bend=4, twist=14, side=4, look=0, nod=3, left="pump_high", right="swing_back"),
    },
    bounce=Bounce(0.015, "down"),
)  # fmt: skip

# The heel digs, the spade goes in. Then the knee comes up and stamps it home.
FARMER = Move(
    "farmer", counts=8,
    steps=(
        heel("left", 1, (0.06, 0.26)),
        step("left", 2, (0.0, 0.10)),
        kick("right", 3, (-0.04, 0.30), 0.24),
        step("right", 4, (-0.02, 0.10)),
        heel("left", 5, (0.12, 0.34), toe_out=24.0),
        step("left", 6, (0.0, 0.02)),
        kick("right", 7, (-0.04, 0.20), 0.24),
        step("right", 8),
    ),
    poses={
        1: pose(bend=-4, hip_tilt=-6, twist=-8, nod=-4, look=10, arms=_BRACES),
        2: pose(bend=22, hip_tilt=6, twist=8, nod=4, look=0, drop=0.03, arms=_DIG),
        3: pose(
            bend=4, hip_tilt=-8, twist=12, nod=2, look=-8, drop=0.0, left="pump_high", right="elbow_back"
        ),
        4: pose(bend=20, hip_tilt=6, twist=-6, nod=4, look=0, drop=0.04, arms=_DIG),
        5: pose(bend=-4, hip_tilt=-6, twist=-10, nod=-4, look=14, drop=0.0, arms=_BRACES),
        6: pose(bend=22, hip_tilt=6, twist=8, nod=4, look=0, drop=0.03, arms=_DIG),
        7: pose(
            bend=4, hip_tilt=-8, twist=12, nod=2, look=-8, drop=0.0, left="pump_high", right="elbow_back"
        ),
        8: pose(bend=10, hip_tilt=2, twist=-4, nod=4, look=0, drop=0.02, arms="low_guard"),
    },
    bounce=Bounce(0.025, "down"),
)  # fmt: skip

# A gallop forward and back, the arms are the engine's rods.
TRAIN = Move(
    "train", counts=8,
    steps=(
        step("left", 1, (0.0, 0.20)),
        ball("right", 1.5, (0.0, 0.10)),
        step("left", 2, (0.0, 0.40)),
        step("right", 3, (0.0, 0.54)),
        touch("left", 4, (0.02, 0.52)),
        step("left", 5, (0.0, 0.36)),
        step("right", 6, (0.0, 0.18)),
        step("left", 7),
        step("right", 8),
    ),
    poses={
        1: pose(bend=10, twist=-14, left=_PISTON_BACK, right=_PISTON_FWD),
        2: pose(bend=12, twist=14, left=_PISTON_FWD, right=_PISTON_BACK),
        3: pose(bend=8, twist=-14, nod=2, left=_PISTON_BACK, right=_PISTON_FWD),
        4: pose(bend=-4, arch=8, twist=10, nod=-4, left=_PISTON_FWD, right=_PISTON_BACK),
        5: pose(bend=6, arch=-4, twist=-14, nod=4, left=_PISTON_BACK, right=_PISTON_FWD),
        6: pose(bend=10, arch=-4, twist=14, nod=4, left=_PISTON_FWD, right=_PISTON_BACK),
        7: pose(bend=6, twist=-14, left=_PISTON_BACK, right=_PISTON_FWD),
        8: pose(bend=-2, arch=6, twist=10, nod=-2, left=_PISTON_FWD, right=_PISTON_BACK),
    },
    bounce=Bounce(0.03, "down"),
)  # fmt: skip

SCISSORS = Move(
    "scissors", counts=4,
    steps=(
        heel("left", 1, (0.0, 0.18)),
        ball("left", 1.5, (0.0, -0.03)),
        heel("right", 2, (0.0, 0.18)),
        ball("right", 2.5, (0.0, -0.03)),
        heel("left", 3, (0.0, 0.18)),
        step("left", 4),
    ),
    poses={
        1: pose(bend=5, twist=-24, hip_turn=8, side=4, look=6, left="swing_back", right="pump_high"),
        2: pose(bend=5, twist=24, hip_turn=-8, side=-4, look=-6, left="pump_high", right="swing_back"),
        3: pose(bend=5, twist=-24, hip_turn=8, side=4, look=6, left="swing_back", right="pump_high"),
        4: pose(bend=10, twist=6, hip_turn=0, side=0, nod=5, look=0, arms="elbow_out"),
    },
    bounce=Bounce(0.01, "down"),
)  # fmt: skip

# Both heels swing out and in about the balls. The chest swings against them.
SWIRL = Move(
    "swirl", counts=4,
    steps=(
        step("left", 1, face=-24.0, weight=0.5),
        pivot("right", 1, face=-24.0),
        pivot("left", 2, face=24.0), pivot("right", 2, face=24.0),
        pivot("left", 3, face=-24.0), pivot("right", 3, face=-24.0),
        pivot("left", 4), pivot("right", 4),
    ),
    poses={
        1: pose(twist=26, hip_turn=-18, side=3, look=8, drop=0.03, left="low_out", right="across"),
        2: pose(twist=-26, hip_turn=18, side=-3, look=-8, drop=0.045, left="across", right="low_out"),
        3: pose(twist=26, hip_turn=-18, side=3, look=8, drop=0.06, left="low_out", right="across"),
        4: pose(
            twist=-14, hip_turn=8, side=-3, look=0, drop=0.02, nod=5, left="swing_in", right="swing_back"
        ),
    },
    bounce=Bounce(0.015, "down"),
)  # fmt: skip

# Wide and deep, the arms float in big circles while the weight slides from leg to leg.
LOFTING = Move(
    "lofting", counts=8,
    steps=(
        step("left", 1, (0.40, 0.0), toe_out=24.0),
        press("right", 3),
        press("left", 5),
        press("right", 7),
        touch("left", 8),
    ),
    poses={
        1: pose(side=8, twist=10, drop=0.07, look=20, left="out", right="chest"),
        2: pose(side=4, twist=4, drop=0.03, nod=-6, look=8, left="wide_up", right="up"),
        3: pose(side=-8, twist=-12, drop=0.08, nod=4, look=-18, left="across", right="low_out"),
        4: pose(side=-4, twist=-6, drop=0.04, nod=0, look=-10, left="chest", right="wide_up"),
        5: pose(side=10, twist=12, drop=0.10, nod=4, look=16, left="low_out", right="across"),
        6: pose(side=4, twist=2, drop=0.04, nod=-8, look=0, arms="wide_up"),
        7: pose(side=-6, twist=-8, drop=0.06, nod=2, look=-12, left="chest", right="out"),
        8: pose(side=0, twist=0, drop=0.0, nod=5, look=0, arms="low_guard"),
    },
    bounce=Bounce(0.02, "down"),
)  # fmt: skip


def _round_the_left_ball(degrees: float) -> tuple[float, float]:
    """Where home is, (left, forward), after the body turned about the ball of the left foot."""
    cos, sin = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    ball_left, ball_fwd = HOME_SIDE_M, HOME_FWD_M
    return ball_left - cos * ball_left - sin * ball_fwd, ball_fwd + sin * ball_left - cos * ball_fwd


def _paddle(count: int, degrees: float) -> tuple[Step, Step]:
    """The left foot turns on the spot, the right one pushes off beside it, wide until it is home."""
    wide = 0.0 if degrees == 360.0 else 0.14
    left, fwd = _round_the_left_ball(degrees)
    right = -math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    at = left + wide * right[0], fwd + wide * right[1]
    bow = 0.05 * right[0], 0.05 * right[1]
    return (
        touch("right", count, at, face=degrees, toe_out=20.0, bow=bow, swing=0.6),
        pivot("left", count, face=degrees, weight=1.0),
    )


def _paddling(look: float, *, up: bool) -> Pose:
    """Pushing off (`up` false) the hip drops to the right. Between, the arms open."""
    if up:
        return pose(bend=-2, twist=4, side=-3, hip_roll=5, look=look, left="low_guard", right="low_out")
    return pose(bend=6, twist=12, side=5, hip_roll=-6, look=look, left="low_out", right="across")


PADDLE_TURN = Move(
    "paddle turn", counts=8,
    steps=tuple(s for i in range(8) for s in _paddle(i + 1, 45.0 * (i + 1))),
    poses={i + 1: _paddling(22.0 if i < 7 else 0.0, up=i % 2 == 1) for i in range(8)},
    bounce=_DOWN,
)  # fmt: skip

HOUSE = Genre(
    "house",
    (
        JACK,
        PAS_DE_BOURREE,
        HEEL_TOE,
        LOOSE_LEGS,
        FARMER,
        TRAIN,
        SCISSORS,
        SWIRL,
        LOFTING,
        PADDLE_TURN,
    ),
    size=1.32,
    sharpness=0.45,
    bounce=1.1,
    figures=street("pas de bourrée", "scissors"),
    manner=replace(
        MANNER,
        bounce=Bounce(0.026, "down"),
        groove_deg=6.0,
        side_deg=0.0,
        look_deg=13.2,
        toe_out_deg=9.5,
        swing=0.99,
        ball_deg=21.1,
        turns_vary_deg=7.6,
    ),
    steer_deg=30.0,
    carriage=replace(
        CARRIAGE,
        lean=-0.5,
        posture=5.2,
        looks=10.0,
        reach=0.9965,
        stoop_m=-0.015,
        give_m=0.008,
        hip_out_m=0.011,
        chest_against=0.5,
        shoulders_against=-0.28,
        lean_into=0.0,
        left_behind=0.8,
        sway=0.0,
        head_still=0.29,
        arms_open=1.8,
        arm_swing=15.2,
        arm_drag_s=0.029,
        arm_play=9.0,
        toes_vary=14.8,
        toes_point=47.8,
    ),
)
