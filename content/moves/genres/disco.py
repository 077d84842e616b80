"""Disco: upright, side to side, arms that draw big lines. The bounce goes up on the count."""

from __future__ import annotations

from dataclasses import replace

from content.moves.genres.street_figures import CARRIAGE, MANNER, street
from content.moves.notation import Bounce, Move, Pose, heel, kick, pivot, pose, press, step, touch
from content.moves.sequencer import Genre

_UP = Bounce(0.035, "up")

STEP_TOUCH = Move(
    "step touch", counts=4,
    steps=(
        step("left", 1, (0.42, 0.0)),
        touch("right", 2, (0.38, 0.0)),
        step("right", 3),
        touch("left", 4),
    ),
    poses={
        1: pose(twist=10, side=5, hip_side=0.01, look=8, left="swing_out", right="swing_out"),
        2: pose(twist=-4, side=-4, hip_side=0.03, hip_roll=-5, nod=4, look=4, left="clap", right="clap"),
        3: pose(twist=-10, side=-5, hip_side=-0.01, look=-8, left="swing_out", right="swing_out"),
        4: pose(twist=4, side=4, hip_side=-0.03, hip_roll=5, nod=4, look=-4, left="clap", right="clap"),
    },
    bounce=_UP,
)  # fmt: skip


GRAPEVINE = Move(
    "grapevine", counts=8,
    steps=(
        step("left", 1, (0.30, 0.0)),
        step("right", 2, (0.42, -0.17), bow=(0.0, -0.07), toe_out=20.0),
        step("left", 3, (0.56, 0.0)),
        touch("right", 4, (0.52, 0.02)),
        step("right", 5, (0.26, 0.0)),
        step("left", 6, (0.14, -0.17), bow=(0.0, -0.07), toe_out=20.0),
        step("right", 7, (0.0, 0.0)),
        touch("left", 8),
    ),
    poses={
        1: pose(twist=-6, look=18, side=2, left="low_out", right="swing_in"),
        2: pose(twist=-14, hip_turn=-12, look=18, drop=0.015, left="swing_in", right="low_out"),
        3: pose(twist=-4, look=12, side=-3, left="low_out", right="swing_in"),
        4: pose(twist=8, side=5, hip_roll=-6, look=0, nod=6, left="clap", right="clap"),
        5: pose(twist=6, look=-18, side=-2, left="swing_in", right="low_out"),
        6: pose(twist=14, hip_turn=12, look=-18, drop=0.015, left="low_out", right="swing_in"),
        7: pose(twist=4, look=-12, side=3, left="swing_in", right="low_out"),
        8: pose(twist=-8, side=-5, hip_roll=6, look=0, nod=6, left="clap", right="clap"),
    },
    bounce=_UP,
)  # fmt: skip

# The right arm draws the line from the left hip to the ceiling. The hips answer.
POINT = Move(
    "point to the sky", counts=4,
    steps=(
        step("right", 1, (-0.30, 0.0), toe_out=18.0),
        press("left", 2),
        press("right", 3, weight=0.5),
        touch("right", 4),
    ),
    poses={
        0.5: pose(left="hip"),
        1: pose(hip_side=-0.05, hip_roll=8, side=6, twist=-12, look=-25, nod=-14, right="point_up"),
        2: pose(hip_side=0.05, hip_roll=-8, side=-3, twist=16, look=15, nod=12, right="point_down"),
        3: pose(hip_side=-0.06, hip_roll=8, side=6, twist=-12, look=-25, nod=-14, right="point_up"),
        4: pose(hip_side=0.03, hip_roll=-6, side=-3, twist=16, look=15, nod=12, right="point_down"),
    },
    bounce=Bounce(0.03, "down"),
)  # fmt: skip

_CIRCLE = ("roll_high", "roll_far", "roll_low", "roll_near")


def _rolling(start: int, bend: float, look: float) -> dict[float, Pose]:
    """Hands rolling round each other for three counts, chest over them, a clap on the fourth."""
    poses: dict[float, Pose] = {}
    for half in range(5):
        arms = {"left": _CIRCLE[half % 4], "right": _CIRCLE[(half + 2) % 4]}
        poses[start + half / 2] = pose(**arms, flow=half % 2)  # type: ignore[arg-type]
    for i, turn in enumerate((8.0, -8.0, 8.0)):
        values = {"bend": bend, "twist": turn, "look": look, "hip_turn": -turn}
        poses[start + i] = replace(poses[start + i], values=values)
    poses[start + 3] = pose(bend=-2, twist=0, nod=-5, look=0, hip_turn=0, side=4, arms="clap")
    return poses


ROLL_WALK = Move(
    "rolling walk", counts=8,
    steps=(
        step("left", 1, (0.0, 0.26)),
        step("right", 2, (0.0, 0.50)),
        step("left", 3, (0.0, 0.70)),
        touch("right", 4, (0.02, 0.68)),
        step("right", 5, (0.0, 0.44)),
        step("left", 6, (0.0, 0.20)),
        step("right", 7, (0.0, 0.0)),
        touch("left", 8),
    ),
    poses={**_rolling(1, 12, 0), **_rolling(5, 4, 8)},
    bounce=Bounce(0.03, "down"),
)  # fmt: skip

THREE_STEP_TURN = Move(
    "three step turn", counts=4,
    steps=(
        step("left", 1, (0.20, 0.10), face=90.0),
        pivot("left", 2, face=200.0),
        step("right", 2, (0.62, 0.12), face=250.0, bow=(0.0, 0.24)),
        pivot("right", 3, face=320.0),
        step("left", 3, (0.74, 0.0), face=360.0, bow=(0.0, 0.18)),
        touch("right", 4, (0.72, 0.0), face=360.0),
    ),
    poses={
        1: pose(twist=12, look=25, left="low_out", right="swing_in"),
        2: pose(twist=6, look=30, left="chest", right="chest", drop=-0.01),
        3: pose(twist=-4, look=8, left="low_out", right="low_out", drop=0.01),
        4: pose(twist=-6, side=5, hip_roll=-6, nod=4, look=0, left="clap", right="clap"),
    },
    bounce=Bounce(0.02, "up"),
)  # fmt: skip

HIP_BUMP = Move(
    "hip bump", counts=4,
    steps=(
        step("left", 1, (0.18, 0.0), toe_out=18.0),
        press("right", 3),
        touch("left", 4),
    ),
    poses={
        1: pose(hip_side=0.06, hip_roll=9, side=5, twist=-6, tilt=4, left="elbow_out", right="pump_low"),
        1.5: pose(hip_side=0.035, hip_roll=4, side=3),
        2: pose(hip_side=0.07, hip_roll=10, side=6, twist=-8, nod=6, left="elbow_back", right="pump_high"),
        3: pose(hip_side=-0.06, hip_roll=-9, side=-5, twist=6, tilt=-4, left="pump_low", right="elbow_out"),
        3.5: pose(hip_side=-0.03, hip_roll=-4, side=-3),
        4: pose(hip_side=-0.05, hip_roll=-8, side=-6, twist=8, nod=6, left="pump_high", right="elbow_back"),
    },
    bounce=Bounce(0.04, "down"),
)  # fmt: skip

KICK_STEP = Move(
    "step kick", counts=4,
    steps=(
        step("left", 1, (0.10, 0.06)),
        kick("right", 2, (0.06, 0.66), 0.26),
        step("right", 3),
        touch("left", 4, (0.0, 0.0)),
    ),
    poses={
        1: pose(twist=-8, bend=3, left="swing_back", right="swing_fwd"),
        2: pose(twist=14, bend=-4, hip_turn=-10, nod=-4, hip_tilt=-4, left="wide_up", right="low_out"),
        3: pose(twist=8, bend=4, left="swing_fwd", right="swing_back"),
        4: pose(twist=-6, bend=2, side=-4, hip_roll=5, nod=6, left="clap", right="clap"),
    },
    bounce=_UP,
)  # fmt: skip

JAZZ_SQUARE = Move(
    "jazz square", counts=4,
    steps=(
        step("left", 1, (-0.17, 0.22), bow=(0.05, 0.06), toe_out=0.0),
        step("right", 2, (-0.06, -0.20), bow=(-0.07, 0.0)),
        step("left", 3, (0.0, 0.0), swing=0.7),
        step("right", 4, (0.0, 0.0), swing=0.7),
    ),
    poses={
        1: pose(twist=12, hip_turn=-12, look=-6, left="swing_fwd", right="swing_out"),
        2: pose(twist=-8, bend=-2, side=-3, hip_roll=4, left="swing_out", right="swing_in"),
        3: pose(twist=-6, side=4, hip_roll=-4, left="low_out", right="swing_out"),
        4: pose(twist=4, side=-2, nod=5, left="elbow_back", right="elbow_back"),
    },
    bounce=_UP,
)  # fmt: skip

# Wide and slow below, the arms paint an arch overhead: two counts for each side.
ARCH = Move(
    "arms over", counts=8,
    steps=(
        step("left", 1, (0.34, 0.0), toe_out=18.0),
        press("right", 3),
        press("left", 5),
        press("right", 7, weight=1.0),
        touch("left", 8),
    ),
    poses={
        1: pose(hip_side=0.02, side=8, twist=6, look=15, left="out", right="across"),
        2: pose(hip_side=0.05, hip_roll=6, side=3, twist=2, nod=-8, left="wide_up", right="up"),
        3: pose(hip_side=-0.02, side=-6, twist=-6, look=-12, left="up", right="wide_up"),
        4: pose(hip_side=-0.05, hip_roll=-6, side=-8, twist=-10, nod=4, left="across", right="out"),
        5: pose(hip_side=0.02, side=-3, twist=2, look=0, nod=-8, left="up", right="wide_up"),
        6: pose(hip_side=0.05, hip_roll=6, side=8, twist=8, look=15, nod=2, left="out", right="chest"),
        7: pose(hip_side=-0.03, hip_roll=-6, side=-3, twist=-4, look=0, left="elbow_out", right="elbow_out"),
        8: pose(hip_side=-0.02, side=0, twist=0, nod=6, left="elbow_back", right="elbow_back"),
    },
    bounce=Bounce(0.035, "down"),
)  # fmt: skip

HEEL_DIG = Move(
    "heel digs", counts=4,
    steps=(
        heel("left", 1, (0.16, 0.22)),
        step("left", 2),
        heel("right", 3, (-0.16, 0.22)),
        step("right", 4),
    ),
    poses={
        1: pose(twist=-10, bend=-3, hip_tilt=-3, look=8, tilt=4, left="low_out", right="pump_high"),
        2: pose(twist=0, bend=6, hip_roll=4, nod=5, look=0, left="elbow_back", right="elbow_back"),
        3: pose(twist=10, bend=-3, hip_tilt=-3, look=-8, tilt=-4, left="pump_high", right="low_out"),
        4: pose(twist=0, bend=6, hip_roll=-4, nod=5, look=0, left="elbow_back", right="elbow_back"),
    },
    bounce=_UP,
)  # fmt: skip

DISCO = Genre(
    "disco",
    (
        STEP_TOUCH,
        GRAPEVINE,
        POINT,
        ROLL_WALK,
        THREE_STEP_TURN,
        HIP_BUMP,
        KICK_STEP,
        JAZZ_SQUARE,
        ARCH,
        HEEL_DIG,
    ),
    size=1.22,
    sharpness=0.4,
    figures=street("step touch", "grapevine", "three step turn", "jazz square", "kick step"),
    manner=replace(
        MANNER,
        bounce=Bounce(0.022, "up"),
        groove_deg=4.0,
        side_deg=0.0,
        toe_out_deg=12.6,
        swing=0.99,
        lift_m=0.063,
        turns_vary_deg=12.4,
    ),
    steer_deg=30.0,
    carriage=replace(
        CARRIAGE,
        lean=2.0,
        posture=5.5,
        looks=11.0,
        reach=0.9965,
        through=0.48,
        give_m=0.008,
        hip_out_m=0.029,
        hip_with_feet=21.6,
        left_behind=1.3,
        sway=0.8,
        arms_open=1.8,
        arm_swing=7.6,
        toes_sweep=21.3,
        toes_point=45.7,
    ),
    bounce=0.96,
)
