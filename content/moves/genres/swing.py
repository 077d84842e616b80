"""Swing danced alone: triple steps and rock steps low over bent knees, kicks, swivels, easy arms.

The "and" of swung music is late: two thirds of the way to the next count.
"""

from __future__ import annotations

from dataclasses import replace
from math import cos, pi, sin
from typing import Any

from content.moves.arm_poses import Arm
from content.moves.carriage import Carriage
from content.moves.genres.jive import MANNER
from content.moves.genres.travelling_figures import LINDY_FIGURES
from content.moves.notation import (
    Bounce,
    Move,
    Pose,
    Side,
    Step,
    ball,
    kick,
    other,
    pivot,
    pose,
    press,
    step,
    touch,
)
from content.moves.sequencer import Genre

Place = tuple[float, float]  # (left, forward), m

_AND = 2.0 / 3.0
_PULSE = Bounce(0.028, "down")
_EVEN = Bounce(0.02, "down")  # triples bounce by themselves: the feet are quicker than the knees
_TRIPLES_TO_BPM = 158.0  # faster songs are danced in single steps
_LOW = 0.025  # how much deeper than standing swing is danced, m

_JAZZ_HAND = Arm((0.72, -0.80, 0.15), (0.62, 0.75, 0.50), -20, -20)
_JAZZ_LOW = Arm((0.60, -1.0, 0.10), (0.75, -0.25, 0.55), -35, 20)
_PADDLE = Arm((0.25, -0.75, 0.55), (-0.35, 0.05, 0.95), 5, 35)
_POINT_LOW = Arm((0.45, -0.95, 0.10), (0.30, -1.0, 0.30), 0, 15)
_SNAP = Arm((0.50, -0.85, 0.35), (0.30, 0.65, 0.75), 12, 0)


def _triple(foot: Side, count: float, first: Place, close: Place, last: Place) -> tuple[Step, ...]:
    """Step, close, step: `foot` to `first`, the other to `close` on the swung "and", `foot` to `last`."""
    return (
        step(foot, count, first),
        ball(other(foot), count + _AND, close, pitch=12.0, lift=0.02, swing=0.6),
        step(foot, count + 1, last, swing=0.33, lift=0.02),
    )


def _rock(count: float, at: Place = (0.0, 0.0)) -> tuple[Step, ...]:
    """Left back on the ball, right again in its place."""
    return (
        ball("left", count, (at[0] + 0.02, at[1] - 0.27), pitch=24.0),
        step("right", count + 1, at, swing=0.5, lift=0.04),
    )


# Rock step, triple to the left, triple to the right: six counts, twice.
TRIPLE_BASIC = Move(
    "triple step basic", counts=12,
    steps=(
        *_rock(1), *_triple("left", 3, (0.16, 0.0), (0.14, 0.0), (0.30, 0.0)),
        *_triple("right", 5, (0.11, 0.0), (0.06, 0.0), (0.0, 0.0)),
        *_rock(7), *_triple("left", 9, (0.03, 0.14), (0.03, 0.12), (0.05, 0.20)),
        *_triple("right", 11, (0.03, 0.09), (0.03, 0.05), (0.0, 0.0)),
    ),
    poses={
        1: pose(drop=_LOW, bend=8, twist=14, nod=0, look=-6, left="swing_back", right="swing_fwd"),
        2: pose(drop=_LOW, bend=10, twist=-8, nod=4, look=0, left="swing_fwd", right="elbow_back"),
        3: pose(drop=_LOW, bend=10, side=8, twist=-14, look=10, left=_SNAP, right="swing_back"),
        4: pose(drop=_LOW, bend=4, side=-6, twist=16, look=18, left="reach_back", right="across"),
        5: pose(drop=_LOW, bend=10, side=-8, twist=20, look=-10, left="swing_back", right=_SNAP),
        6: pose(drop=_LOW, bend=4, side=6, twist=-22, look=-12, left="across", right="reach_back"),
        7: pose(drop=_LOW, bend=8, twist=14, nod=0, look=0, left="swing_back", right="pump_high"),
        8: pose(drop=_LOW, bend=12, twist=-8, nod=5, left="pump_high", right="swing_back"),
        9: pose(drop=_LOW, bend=18, side=6, twist=-22, look=8, left="reach_back", right="across"),
        10: pose(drop=_LOW, bend=-2, side=-6, twist=22, nod=-5, left="up", right="reach_back"),
        11: pose(drop=_LOW, bend=4, side=-8, twist=14, look=-8, nod=0, left="across", right="swing_back"),
        12: pose(drop=_LOW, bend=12, side=5, twist=-14, look=0, nod=4, left="reach_back", right="pump_high"),
    },
    bounce=_EVEN,
    fastest_bpm=_TRIPLES_TO_BPM,
)  # fmt: skip

# The basic of fast songs: one step for two counts, a tap of the free foot between.
SINGLE_BASIC = Move(
    "single step basic", counts=12,
    steps=(
        *_rock(1),
        step("left", 3, (0.20, 0.04)), touch("right", 4, (0.18, 0.06), pitch=16.0),
        step("right", 5), touch("left", 6, (0.03, 0.08), pitch=16.0),
        *_rock(7),
        step("left", 9, (0.16, 0.16)), touch("right", 10, (0.14, 0.18), pitch=16.0),
        step("right", 11), touch("left", 12),
    ),
    poses={
        1: pose(drop=_LOW, bend=8, twist=12, left="swing_back", right="swing_fwd"),
        2: pose(drop=_LOW, bend=10, twist=-8, nod=4, left="swing_fwd", right="swing_back"),
        3: pose(drop=_LOW, bend=6, side=8, twist=-8, look=14, left="low_out", right="low_guard"),
        4: pose(drop=_LOW, bend=8, side=10, twist=2, look=14, nod=5, left=_SNAP, right=_SNAP),
        5: pose(drop=_LOW, bend=6, side=-8, twist=8, look=-14, left="low_guard", right="low_out"),
        6: pose(drop=_LOW, bend=8, side=-10, twist=-2, look=-14, nod=5, left=_SNAP, right=_SNAP),
        7: pose(drop=_LOW, bend=8, twist=12, look=0, left="swing_back", right="pump_high"),
        8: pose(drop=_LOW, bend=12, twist=-8, nod=4, left="pump_high", right="swing_back"),
        9: pose(drop=_LOW, bend=10, side=5, twist=-10, look=8, left="swing_back", right="swing_fwd"),
        10: pose(drop=_LOW, bend=2, side=8, twist=6, nod=-4, left=_JAZZ_HAND, right="swing_back"),
        11: pose(drop=_LOW, bend=6, side=-5, twist=10, look=-8, left="swing_fwd", right="swing_back"),
        12: pose(drop=_LOW, bend=8, side=-8, twist=-2, nod=5, look=-8, left=_SNAP, right=_SNAP),
    },
    bounce=_PULSE,
)  # fmt: skip

# Rock, triple and a prep to the left, then a whole turn to the right through 5, 6 and the last triple.
TUCK_TURN = Move(
    "tuck turn", counts=8,
    steps=(
        *_rock(1), *_triple("left", 3, (0.22, 0.0), (0.20, 0.0), (0.34, 0.0)),
        step("right", 5, (0.22, 0.08), face=-80.0),
        pivot("right", 6, face=-190.0),
        step("left", 6, (-0.20, 0.12), face=-245.0, bow=(0.0, 0.24)),
        pivot("left", 7, face=-325.0),
        step("right", 7, (-0.24, 0.0), face=-360.0, bow=(0.0, 0.18)),
        ball("left", 7 + _AND, (-0.18, 0.0), face=-360.0, pitch=12.0, lift=0.03, swing=0.45),
        step("right", 8, (-0.20, 0.0), face=-360.0, swing=0.33, lift=0.03),
    ),
    poses={
        1: pose(drop=_LOW, bend=8, twist=12, left="swing_back", right="swing_fwd"),
        2: pose(drop=_LOW, bend=10, twist=-6, nod=4, left="low_guard", right="elbow_back"),
        3: pose(drop=_LOW, bend=8, side=6, twist=-12, look=0, left="across", right="swing_back"),
        4: pose(drop=0.04, bend=8, side=-4, twist=26, look=-10, left="reach_back", right="across"),
        5: pose(drop=0.0, bend=2, side=0, twist=-14, look=-28, left="swing_in", right="low_out"),
        6: pose(drop=-0.01, bend=0, twist=-6, look=-30, left="chest", right="up"),
        7: pose(drop=0.01, bend=2, twist=6, look=-8, left="up", right="wide_up"),
        8: pose(drop=0.04, bend=14, twist=-10, side=6, look=0, nod=5, left=_JAZZ_LOW, right=_JAZZ_LOW),
    },
    bounce=_EVEN,
    fastest_bpm=_TRIPLES_TO_BPM,
)  # fmt: skip

KICK_BALL_CHANGE = Move(
    "kick ball change", counts=4,
    steps=(
        kick("left", 1, (0.03, 0.50), 0.18),
        ball("left", 1 + _AND, (0.02, -0.10), pitch=20.0),
        step("right", 2, swing=0.3, lift=0.015),
        step("left", 3, (0.26, 0.02), swing=0.7),
        touch("right", 4, (0.24, 0.03), pitch=18.0),
    ),
    poses={
        1: pose(drop=_LOW, bend=-4, twist=-18, hip_tilt=-4, nod=2, left="reach_back", right="reach"),
        2: pose(drop=0.04, bend=18, twist=18, hip_tilt=2, nod=5, left="fwd", right="reach_back"),
        3: pose(drop=0.04, bend=8, side=6, twist=-8, look=16, left="low_out", right="swing_in"),
        4: pose(drop=_LOW, bend=4, side=10, twist=6, look=18, tilt=4, nod=5, left=_SNAP, right="low_out"),
    },
    bounce=_EVEN,
)  # fmt: skip

# The 1920s: tap behind, step, kick, step. Both feet twist in and out on their balls all the while.
CHARLESTON = Move(
    "charleston", counts=4,
    steps=(
        touch("left", 1, (0.02, -0.32), toe_out=22.0),
        pivot("right", 1, toe_out=26.0),
        step("left", 2, (0.0, 0.05), toe_out=-8.0),
        pivot("right", 2, toe_out=-4.0),
        kick("right", 3, (0.02, 0.52), 0.22, toe_out=16.0),
        pivot("left", 3, toe_out=26.0),
        step("right", 4, toe_out=0.0),
        pivot("left", 4, toe_out=0.0),
    ),
    poses={
        1: pose(drop=0.03, bend=16, twist=16, nod=-4, look=6, left="swing_back", right="swing_fwd"),
        2: pose(drop=_LOW, bend=6, twist=-4, nod=4, look=0, left=_JAZZ_LOW, right=_JAZZ_LOW),
        3: pose(drop=0.02, bend=-4, twist=16, hip_tilt=-4, nod=0, look=-6, left="swing_fwd",
                right="swing_back"),
        4: pose(drop=_LOW, bend=6, twist=-4, hip_tilt=0, nod=4, look=0, left=_JAZZ_LOW, right=_JAZZ_LOW),
    },
    bounce=_PULSE,
)  # fmt: skip

# Kick ahead, kick to the side, behind, side and in place.
KICK_STEP_KICK = Move(
    "kick step kick", counts=8,
    steps=(
        kick("left", 1, (-0.02, 0.50), 0.20),
        step("left", 2),
        kick("right", 3, (0.0, 0.46), 0.20),
        kick("right", 4, (-0.30, 0.30), 0.20, toe_out=25.0),
        ball("right", 5, (0.10, -0.17), bow=(0.0, -0.05), toe_out=20.0),
        ball("left", 5 + _AND, (0.14, -0.02), pitch=12.0, lift=0.03, swing=0.5),
        step("right", 6, (0.10, 0.02), swing=0.33, lift=0.03),
        kick("left", 7, (0.10, 0.50), 0.20),
        step("left", 8, (0.10, 0.0)),
    ),
    poses={
        1: pose(drop=_LOW, bend=-2, twist=-14, hip_tilt=-4, left="swing_back", right="swing_fwd"),
        2: pose(drop=_LOW, bend=10, twist=2, hip_tilt=0, nod=5, left="low_guard", right="low_guard"),
        3: pose(drop=_LOW, bend=-2, twist=14, hip_tilt=-4, nod=0, left="swing_fwd", right="swing_back"),
        4: pose(drop=_LOW, bend=2, side=9, twist=4, hip_tilt=0, look=-22, left="low_out", right="pump_high"),
        5: pose(drop=0.045, bend=14, side=-6, twist=-16, look=-10, left="across", right="reach_back"),
        6: pose(drop=_LOW, bend=4, side=4, twist=16, look=0, nod=4, left="low_out", right="across"),
        7: pose(drop=_LOW, bend=-2, twist=-14, hip_tilt=-4, nod=0, left="swing_back", right="swing_fwd"),
        8: pose(drop=_LOW, bend=10, side=4, twist=2, hip_tilt=0, nod=5, left=_SNAP, right=_SNAP),
    },
    bounce=_PULSE,
)  # fmt: skip


def _suzie(count: int, x: float) -> tuple[Step, ...]:
    """The left foot crosses before the right to `x`, which steps on. Both swivel on their balls."""
    return (
        step("left", count, (x - 0.27, 0.34), face=-8.0, bow=(0.0, 0.08), toe_out=0.0),
        pivot("left", count + 1, face=10.0, toe_out=12.0),
        ball("right", count + 1, (x - 0.24, 0.0), face=10.0, bow=(0.0, -0.10), pitch=12.0, toe_out=14.0),
    )


SUZIE_Q = Move(
    "suzie q", counts=8,
    steps=(
        *_suzie(1, 0.0), *_suzie(3, -0.24), *_suzie(5, -0.48),
        step("left", 7, (-0.66, 0.0)), touch("right", 8, (-0.64, 0.02), pitch=18.0),
    ),
    poses={
        **{c: pose(drop=0.04, bend=10, twist=20, hip_turn=-14, side=-4, look=-16, nod=4, left=_PADDLE,
                   right="low_out") for c in (1, 3, 5)},
        **{c: pose(drop=_LOW, bend=4, twist=-16, hip_turn=10, side=4, look=-16, nod=-2, left="low_out",
                   right=_PADDLE) for c in (2, 4, 6)},
        7: pose(drop=0.04, bend=8, twist=-8, hip_turn=0, side=6, look=6, left="low_out", right="swing_in"),
        8: pose(drop=_LOW, bend=8, twist=4, side=9, look=10, nod=5, left="clap", right="clap"),
    },
    bounce=Bounce(0.02, "down"),
)  # fmt: skip

# Sinking, knees together, hips over each step, fingers at the floor. Then strutting back up.
SHORTY_GEORGE = Move(
    "shorty george", counts=8,
    steps=(
        step("left", 1, (0.0, 0.15), toe_out=-4.0), step("right", 2, (0.0, 0.30), toe_out=-4.0),
        step("left", 3, (0.0, 0.45), toe_out=-4.0), step("right", 4, (0.0, 0.60), toe_out=-4.0),
        step("left", 5, (0.0, 0.42)), step("right", 6, (0.0, 0.26)),
        step("left", 7, (0.0, 0.10)), step("right", 8, (0.0, 0.06)),
    ),
    poses={
        1: pose(drop=0.05, hip_side=0.03, hip_roll=7, side=9, bend=6, look=10, left=_POINT_LOW,
                right="low_out"),
        2: pose(drop=0.075, hip_side=-0.03, hip_roll=-7, side=-9, bend=8, look=-10, left="low_out",
                right=_POINT_LOW),
        3: pose(drop=0.10, hip_side=0.03, hip_roll=7, side=9, bend=10, look=10, left=_POINT_LOW,
                right="low_out"),
        4: pose(drop=0.12, hip_side=-0.03, hip_roll=-7, side=-9, bend=12, look=-10, left="low_out",
                right=_POINT_LOW),
        5: pose(drop=0.05, hip_side=0, hip_roll=0, side=3, twist=-12, bend=4, look=0, left="swing_back",
                right="swing_fwd"),
        6: pose(drop=_LOW, side=-3, twist=12, bend=0, nod=-3, left="swing_fwd", right="swing_back"),
        7: pose(drop=_LOW, side=3, twist=-12, bend=0, nod=-3, left=_JAZZ_HAND, right="low_guard"),
        8: pose(drop=_LOW, side=-3, twist=0, bend=8, nod=5, left="clap", right="clap"),
    },
    bounce=Bounce(0.02, "down"),
)  # fmt: skip

# Kick and step back, twice. Then forward with the hips, a clap before each pair.
BOOGIE_BACK = Move(
    "boogie back and forward", counts=8,
    steps=(
        kick("left", 1, (0.02, 0.40), 0.14), step("left", 2, (0.0, -0.20)),
        kick("right", 3, (-0.02, 0.22), 0.14), step("right", 4, (0.0, -0.38)),
        step("left", 5, (0.0, -0.26)), step("right", 6, (0.0, -0.12)),
        step("left", 7, (0.0, 0.0)), step("right", 8),
    ),
    poses={
        1: pose(drop=_LOW, bend=0, twist=-12, hip_tilt=-5, nod=-3, look=6, left="clap", right="clap"),
        2: pose(drop=0.04, bend=16, twist=4, hip_tilt=6, nod=4, left="elbow_back", right="elbow_back"),
        3: pose(drop=_LOW, bend=0, twist=12, hip_tilt=-5, nod=-3, look=-6, left="clap", right="clap"),
        4: pose(drop=0.04, bend=16, twist=-4, hip_tilt=6, nod=4, look=0, left="elbow_back",
                right="elbow_back"),
        5: pose(drop=0.05, bend=6, hip_side=0.03, hip_roll=7, hip_tilt=0, side=6, twist=-10,
                left="elbow_back", right=_PADDLE),
        6: pose(drop=0.05, bend=6, hip_side=-0.03, hip_roll=-7, side=-6, twist=10, left=_PADDLE,
                right="elbow_back"),
        7: pose(drop=0.05, bend=6, hip_side=0.03, hip_roll=7, side=6, twist=-10, left="elbow_back",
                right=_PADDLE),
        8: pose(drop=_LOW, bend=4, hip_side=-0.02, hip_roll=-5, side=-6, twist=8, nod=5, left=_JAZZ_HAND,
                right=_JAZZ_LOW),
    },
    bounce=_PULSE,
)  # fmt: skip

_CIRCLE_RADIUS_M = 0.26


def _round(foot: Side, count: float, quarters: float, **more: Any) -> Step:
    """A step of the lindy circle: so many quarters of the way round, to the left."""
    turn = 0.5 * pi * quarters
    at = (_CIRCLE_RADIUS_M * (1.0 - cos(turn)), _CIRCLE_RADIUS_M * sin(turn))
    return Step(foot, count, at, face=90.0 * quarters, **{"weight": 1.0, **more})


# Rock step, triple, two walks, triple: the walks and triples go once round, leaning in.
LINDY_CIRCLE = Move(
    "lindy circle", counts=8,
    steps=(
        *_rock(1),
        _round("left", 3, 0.45), _round("right", 3 + _AND, 0.65, pitch=12.0, lift=0.02, swing=0.6),
        _round("left", 4, 1.0, swing=0.33, lift=0.02),
        pivot("left", 5, face=140.0), _round("right", 5, 1.9, bow=(0.09, 0.09)),
        pivot("right", 6, face=220.0), _round("left", 6, 2.65),
        pivot("left", 7, face=290.0), _round("right", 7, 3.3, bow=(0.08, -0.18)),
        _round("left", 7 + _AND, 4.0, pitch=12.0, lift=0.02, swing=0.6),
        _round("right", 8, 4.0, swing=0.33, lift=0.02),
    ),
    poses={
        1: pose(drop=_LOW, bend=8, twist=12, left="swing_back", right="swing_fwd"),
        2: pose(drop=_LOW, bend=10, twist=-8, nod=4, left="swing_fwd", right="swing_back"),
        3: pose(drop=0.035, bend=16, side=2, twist=-14, look=22, left="across", right="reach_back"),
        4: pose(drop=_LOW, bend=4, side=10, twist=20, look=24, left="reach_back", right="reach"),
        5: pose(drop=0.035, bend=10, side=8, twist=18, look=24, left="elbow_back", right="fwd"),
        6: pose(drop=_LOW, bend=8, side=8, twist=4, look=24, left="low_guard", right="low_out"),
        7: pose(drop=0.035, bend=12, side=8, twist=18, look=16, left="reach_back", right="across"),
        8: pose(drop=_LOW, bend=4, side=-2, twist=-12, look=0, nod=5, left="across", right="reach_back"),
    },
    bounce=_EVEN,
    fastest_bpm=_TRIPLES_TO_BPM,
)  # fmt: skip


def _jack(count: float, way: int, arms: dict[str, str | Arm], **values: float) -> tuple[list[Step], Pose]:
    """Both toes to the left (`way` 1), right (-1), or one another's (0), the weight in between."""
    toes = {1: (38.0, -18.0), -1: (-18.0, 38.0), 0: (10.0, 10.0)}[way]
    steps = [pivot("left", count, toe_out=toes[0]), pivot("right", count, toe_out=toes[1])]
    if count == 1:
        steps = [press("left", count, weight=0.5, face=0.0, toe_out=toes[0]), steps[1]]
    return steps, pose(hip_turn=14.0 * way, twist=-12.0 * way, side=6.0 * way, **arms, **values)  # type: ignore[arg-type]


_JACKS = [
    _jack(1, 1, {"left": _JAZZ_HAND, "right": "swing_in"}, drop=0.05, look=10, nod=3),
    _jack(2, -1, {"left": "swing_in", "right": _JAZZ_HAND}, drop=0.035, look=-10),
    _jack(3, 1, {"left": _JAZZ_HAND, "right": "swing_in"}, drop=0.05, look=10, nod=3),
    _jack(4, 0, {"left": "elbow_back", "right": "elbow_back"}, drop=_LOW, look=0, nod=5),
    _jack(5, -1, {"left": "swing_in", "right": _JAZZ_HAND}, drop=0.05, look=-10, nod=3),
    _jack(6, 1, {"left": _JAZZ_HAND, "right": "swing_in"}, drop=0.035, look=10),
    _jack(7, -1, {"left": "swing_in", "right": _JAZZ_HAND}, drop=0.05, look=-10, nod=3),
    _jack(8, 0, {"left": "clap", "right": "clap"}, drop=_LOW, look=0, nod=5),
]

APPLE_JACKS = Move(
    "apple jacks", counts=8,
    steps=tuple(s for steps, _ in _JACKS for s in steps),
    poses={count: p for count, (_, p) in enumerate(_JACKS, start=1)},
    bounce=_PULSE,
)  # fmt: skip

SWING = Genre(
    "swing",
    (
        TRIPLE_BASIC, SINGLE_BASIC, TUCK_TURN, KICK_BALL_CHANGE, CHARLESTON, KICK_STEP_KICK, SUZIE_Q,
        SHORTY_GEORGE, BOOGIE_BACK, LINDY_CIRCLE, APPLE_JACKS,
    ),
    size=1.22,
    sharpness=0.45,
    figures=LINDY_FIGURES,
    manner=replace(
        MANNER,
        twist_deg=8.0,
        side_deg=0.0,
        look_deg=13.2,
        lift_m=0.063,
        ball_deg=17.5,
        varies=0.16,
    ),
    steer_deg=30.0,
    carriage=Carriage(
        to_go=0.5, through=0.5, reach=0.9965, stoop_m=-0.02, give_m=0.008, hip_up=6.0, hip_out_m=0.02,
        hip_with_feet=8.0, chest_against=0.5, looks=10.0, arm_swing=15.2, arm_play=7.2, posture=5.3,
        sinks_m=0.01,
        turned=1.0,
        shoulders_against=0.02,
        left_behind=1.3,
        sway=0.8,
        arms_back=1.2,
        arms_open=8.0,
        toes_vary=14.5,
        toes_point=55.0,
    ),
        bounce=0.96,
    )  # fmt: skip
