"""Waltz danced alone: down on 1, up through 2 and 3, rounded arms, sway over the standing foot."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import cos, pi, sin
from typing import Any

from content.moves.notation import Bounce, Move, Pose, Side, Step, ball, kick, pivot, pose, press, step, touch
from content.moves.sequencer import Genre

_FALL_AND_RISE_M = (0.045, -0.015, -0.035)  # lowered on 1, 2 and 3 of a bar: knees, then heels off the floor
_LEVEL = Bounce(0.0)  # the poses' `drop` does it all


def _rise_and_fall(poses: Mapping[float, Pose]) -> dict[float, Pose]:
    """`poses`, lowered and raised on the bar's counts where they do not say otherwise."""
    return {
        count: replace(p, values={"drop": _FALL_AND_RISE_M[int(count - 1) % 3], **p.values})
        for count, p in poses.items()
    }


def _up(foot: Side, count: float, at: tuple[float, float] = (0.0, 0.0), **more: Any) -> Step:
    """A step on 2 or 3: high, slow, off as soon as the last one has landed."""
    return ball(foot, count, at, **{"pitch": 16.0, "swing": 0.95, **more})


BOX = Move(
    "box step", counts=6,
    steps=(
        step("left", 1, (0.0, 0.36)),
        _up("right", 2, (-0.34, 0.36)),
        _up("left", 3, (-0.34, 0.36), pitch=18.0),
        step("right", 4, (-0.34, 0.0)),
        _up("left", 5),
        _up("right", 6, pitch=18.0),
    ),
    poses=_rise_and_fall({
        1: pose(twist=-10, bend=3, look=14, nod=3, left="en_bas", right="en_bas"),
        2: pose(twist=2, side=-7, tilt=-4, look=-10, nod=-4, left="first", right="second"),
        3: pose(twist=8, side=-9, arch=6, tilt=-5, look=-24, nod=-9, left="fifth", right="reach_back"),
        4: pose(twist=10, bend=3, side=0, look=-12, nod=4, left="en_bas", right="en_bas"),
        5: pose(twist=-2, side=7, tilt=4, look=10, nod=-4, left="second", right="first"),
        6: pose(twist=-8, side=9, arch=6, tilt=5, look=24, nod=-9, left="reach_back", right="fifth"),
    }),
    bounce=_LEVEL,
)  # fmt: skip

# The frame a couple would hold, opening a little on 3. A quarter to the left each bar, and the way back.
BOX_TURN = Move(
    "left box turn", counts=6,
    steps=(
        step("left", 1, (0.04, 0.34), face=35.0),
        pivot("left", 2, face=75.0),
        _up("right", 2, (0.02, 0.56), face=90.0),
        _up("left", 3, (0.02, 0.56), face=90.0, pitch=18.0, swing=0.8),
        step("right", 4, (-0.30, 0.54), face=125.0),
        pivot("right", 5, face=165.0),
        _up("left", 5, (-0.52, 0.50), face=180.0),
        _up("right", 6, (-0.52, 0.50), face=180.0, pitch=18.0, swing=0.8),
    ),
    poses=_rise_and_fall({
        1: pose(twist=12, look=30, nod=2, left="hold_out", right="hold_in"),
        2: pose(twist=4, side=-9, look=22, tilt=-4, arch=4, nod=-5, left="second", right="second"),
        3: pose(twist=-8, side=-3, look=-16, arch=8, nod=-9, left="hold_in", right="fifth"),
        4: pose(twist=12, side=0, look=30, nod=2, left="hold_in", right="hold_out"),
        5: pose(twist=4, side=9, look=22, tilt=4, arch=4, nod=-5, left="second", right="second"),
        6: pose(twist=-8, side=3, look=-16, arch=8, nod=-9, left="fifth", right="hold_in"),
    }),
    bounce=_LEVEL,
)  # fmt: skip

BALANCE_SIDE = Move(
    "balance to the side", counts=3,
    steps=(
        step("left", 1, (0.40, 0.0), toe_out=18.0),
        _up("right", 2, (0.42, -0.06), pitch=26.0, toe_out=22.0),
        step("left", 3, (0.40, 0.0), swing=0.5, lift=0.03, toe_out=18.0),
    ),
    poses=_rise_and_fall({
        1: pose(twist=-6, side=-5, look=22, nod=3, left="first", right="second"),
        2: pose(twist=10, side=11, look=28, tilt=5, nod=-6, left="second", right="fifth"),
        3: pose(twist=0, side=3, look=10, drop=0.015, tilt=0, nod=4, left="en_bas", right="second"),
    }),
    bounce=_LEVEL,
)  # fmt: skip

BALANCE_FORWARD = Move(
    "balance forward and back", counts=6,
    steps=(
        step("left", 1, (0.0, 0.40)),
        _up("right", 2, (0.0, 0.38), pitch=26.0),
        _up("left", 3, (0.0, 0.40), swing=0.5, lift=0.03, pitch=18.0),
        step("right", 4, (0.0, 0.0)),
        _up("left", 5, (0.0, 0.02), pitch=26.0),
        step("right", 6, swing=0.5, lift=0.03),
    ),
    poses=_rise_and_fall({
        1: pose(twist=-8, bend=4, nod=4, look=0, arms="first"),
        2: pose(twist=-2, arch=8, nod=-12, arms="fifth"),
        3: pose(twist=4, arch=10, nod=-8, look=12, left="second", right="fifth"),
        4: pose(twist=12, bend=6, nod=6, look=16, left="reach_back", right="first"),
        5: pose(twist=-4, bend=0, side=8, tilt=4, nod=-4, look=20, left="second", right="reach_back"),
        6: pose(twist=0, bend=4, side=0, nod=8, look=0, drop=0.01, arms="en_bas"),
    }),
    bounce=_LEVEL,
)  # fmt: skip

# Half a turn to the right each bar, forward and then backward. The reverse turn goes the same way back.
NATURAL_TURN = Move(
    "natural and reverse turn", counts=12,
    steps=(
        step("right", 1, (0.0, 0.30), face=-35.0),
        pivot("right", 2, face=-115.0),
        _up("left", 2, (0.02, 0.52), face=-150.0, bow=(0.14, 0.0)),
        _up("right", 3, (0.02, 0.56), face=-180.0, pitch=18.0, swing=0.8),
        step("left", 4, (0.0, 0.86), face=-215.0),
        pivot("left", 5, face=-295.0),
        _up("right", 5, (0.0, 1.02), face=-330.0, bow=(0.14, 0.0)),
        _up("left", 6, (0.0, 1.04), face=-360.0, pitch=18.0, swing=0.8),
        step("right", 7, (0.0, 0.76), face=-325.0),
        pivot("right", 8, face=-240.0),
        _up("left", 8, (0.0, 0.60), face=-210.0, bow=(0.14, 0.0)),
        _up("right", 9, (0.0, 0.56), face=-180.0, pitch=18.0, swing=0.8),
        step("left", 10, (0.08, 0.28), face=-130.0),
        pivot("left", 11, face=-80.0),
        _up("right", 11, (0.03, 0.05), face=-50.0, bow=(0.17, 0.0)),
        pivot("right", 12, face=0.0, pitch=16.0),
        _up("left", 12, pitch=18.0, swing=0.8),
    ),
    poses=_rise_and_fall({
        1: pose(twist=-14, look=-30, nod=2, left="hold_out", right="hold_in"),
        2: pose(twist=-4, side=7, look=-20, arch=4, nod=-5, left="second", right="second"),
        3: pose(twist=2, side=4, look=0, arch=6, nod=-8, left="hold_in", right="second"),
        4: pose(twist=-14, side=0, look=-30, nod=2, left="hold_in", right="hold_out"),
        5: pose(twist=-4, side=-7, look=-20, arch=4, nod=-5, left="second", right="second"),
        6: pose(twist=2, side=-4, look=0, arch=6, nod=-8, left="fifth", right="second"),
        7: pose(twist=14, side=0, look=30, nod=2, left="first", right="hold_in"),
        8: pose(twist=4, side=7, look=20, arch=4, nod=-5, left="second", right="second"),
        9: pose(twist=-2, side=4, look=0, arch=6, nod=-8, left="second", right="hold_in"),
        10: pose(twist=14, side=0, look=30, nod=2, left="hold_out", right="hold_in"),
        11: pose(twist=4, side=-7, look=20, arch=4, nod=-5, left="second", right="second"),
        12: pose(twist=0, side=-4, look=0, arch=6, nod=-6, left="hold_out", right="hold_out"),
    }),
    bounce=_LEVEL,
)  # fmt: skip

# Forward and held: the free leg draws up, then stretches out behind while the arms reach.
HESITATION = Move(
    "hesitation", counts=6,
    steps=(
        step("left", 1, (0.0, 0.36), toe_out=14.0),
        touch("right", 2, (0.02, 0.32)),
        kick("right", 3, (-0.02, -0.16), 0.20, pitch=52.0),
        step("right", 4, (0.0, 0.0), toe_out=14.0),
        touch("left", 5, (0.02, 0.04)),
        press("left", 6, pitch=14.0),
    ),
    poses=_rise_and_fall({
        1: pose(twist=-8, bend=3, nod=4, look=-6, left="first", right="en_bas"),
        2: pose(twist=0, arch=3, nod=-3, drop=0.0, left="first", right="first"),
        3: pose(twist=8, bend=8, arch=12, hip_tilt=8, nod=-14, look=4, drop=-0.01, left="second",
                right="reach"),
        4: pose(twist=10, bend=5, nod=5, look=16, left="second", right="first"),
        5: pose(twist=-4, side=6, tilt=4, look=24, nod=-2, left="second", right="fifth"),
        6: pose(twist=4, side=-5, tilt=-4, arch=4, look=0, nod=-6, left="second", right="en_bas"),
    }),
    bounce=_LEVEL,
)  # fmt: skip

TWINKLE = Move(
    "twinkle", counts=6,
    steps=(
        step("left", 1, (-0.30, 0.30), face=-22.0, bow=(0.05, 0.08), toe_out=4.0),
        pivot("left", 2, face=-10.0),
        _up("right", 2, (-0.32, 0.06), face=0.0),
        _up("left", 3, (-0.30, 0.06), face=15.0, swing=0.8),
        step("right", 4, (0.00, 0.36), face=22.0, bow=(-0.05, 0.08), toe_out=4.0),
        pivot("right", 5, face=10.0),
        _up("left", 5, (0.02, 0.04), face=0.0),
        _up("right", 6, pitch=18.0, swing=0.8),
    ),
    poses=_rise_and_fall({
        1: pose(twist=12, hip_turn=-6, side=-4, look=-18, nod=4, left="first", right="reach_back"),
        2: pose(twist=0, side=5, look=0, arch=5, nod=-4, left="second", right="second"),
        3: pose(twist=6, side=2, look=18, arch=5, nod=-6, left="second", right="first"),
        4: pose(twist=-12, hip_turn=6, side=4, look=18, nod=4, left="reach_back", right="first"),
        5: pose(twist=0, side=-5, look=0, arch=5, nod=-4, left="second", right="second"),
        6: pose(twist=-4, side=-2, look=-12, arch=5, nod=-6, left="en_bas", right="second"),
    }),
    bounce=_LEVEL,
)  # fmt: skip

GRAPEVINE = Move(
    "grapevine waltz", counts=12,
    steps=(
        step("left", 1, (0.26, 0.0)),
        _up("right", 2, (0.40, -0.19), bow=(0.0, -0.06), toe_out=22.0),
        _up("left", 3, (0.54, 0.0), pitch=14.0),
        step("right", 4, (0.68, 0.22), bow=(0.0, 0.08), toe_out=0.0),
        _up("left", 5, (0.80, 0.0)),
        touch("right", 6, (0.78, 0.02)),
        step("right", 7, (0.54, 0.0)),
        _up("left", 8, (0.40, -0.19), bow=(0.0, -0.06), toe_out=22.0),
        _up("right", 9, (0.26, 0.0), pitch=14.0),
        step("left", 10, (0.12, 0.22), bow=(0.0, 0.08), toe_out=0.0),
        _up("right", 11, (0.0, 0.0)),
        touch("left", 12),
    ),
    poses=_rise_and_fall({
        1: pose(twist=-4, side=-3, look=26, left="second", right="first"),
        2: pose(twist=14, hip_turn=12, side=4, look=26, left="first", right="reach_back"),
        3: pose(twist=0, side=4, look=22, nod=-4, left="second", right="en_bas"),
        4: pose(twist=-14, hip_turn=-12, side=-3, look=22, nod=3, left="reach_back", right="first"),
        5: pose(twist=0, side=6, look=12, arch=4, nod=-5, left="second", right="second"),
        6: pose(twist=4, side=8, tilt=4, look=-12, arch=6, nod=-8, left="en_bas", right="fifth"),
        7: pose(twist=4, side=3, look=-26, nod=0, left="first", right="second"),
        8: pose(twist=-14, hip_turn=-12, side=-4, look=-26, left="reach_back", right="first"),
        9: pose(twist=0, side=-4, look=-22, nod=-4, left="en_bas", right="second"),
        10: pose(twist=14, hip_turn=12, side=3, look=-22, nod=3, left="first", right="reach_back"),
        11: pose(twist=0, side=-6, look=-12, arch=4, nod=-5, left="second", right="second"),
        12: pose(twist=-4, side=-8, tilt=-4, look=12, arch=6, nod=-8, left="fifth", right="en_bas"),
    }),
    bounce=_LEVEL,
)  # fmt: skip

# The lady's turn under her partner's arm, without the partner. Then a balance back to the place.
SPIN_TURN = Move(
    "turn under the arm", counts=6,
    steps=(
        step("left", 1, (0.20, 0.10), face=80.0),
        pivot("left", 2, face=190.0),
        _up("right", 2, (0.58, 0.12), face=240.0, bow=(0.0, 0.24), pitch=18.0),
        pivot("right", 3, face=325.0, pitch=18.0),
        _up("left", 3, (0.66, 0.0), face=360.0, bow=(0.0, 0.18), swing=0.8),
        step("right", 4, (0.24, 0.0), face=360.0, toe_out=16.0),
        _up("left", 5, (0.25, -0.05), face=360.0, pitch=24.0),
        step("right", 6, (0.24, 0.0), face=360.0, swing=0.5, lift=0.03, toe_out=16.0),
    ),
    poses=_rise_and_fall({
        1: pose(twist=14, look=28, nod=0, left="fifth", right="second"),
        2: pose(twist=6, look=32, arch=4, nod=-3, left="up", right="first"),
        3: pose(twist=-4, look=8, arch=4, nod=-4, left="fifth", right="en_bas"),
        4: pose(twist=8, side=5, look=-22, nod=2, left="second", right="first"),
        5: pose(twist=-10, side=-10, look=-28, tilt=-5, nod=-6, left="fifth", right="second"),
        6: pose(twist=0, side=-5, look=0, drop=0.01, nod=3, left="en_bas", right="second"),
    }),
    bounce=_LEVEL,
)  # fmt: skip

_RUN_RADIUS_M = 0.46


def _run_step(k: int) -> Step:
    """Step k of eleven round a circle to the left, back at home on the eleventh. A twelfth closes."""
    turn = 2.0 * pi * min(k, 11) / 11
    at = (_RUN_RADIUS_M * (1.0 - cos(turn)), _RUN_RADIUS_M * sin(turn))
    foot: Side = "left" if k % 2 else "right"
    return (step if k % 3 == 1 else _up)(foot, k, at, face=360.0 * min(k, 11) / 11)


# Round a circle. The arms open, rise and fall once a bar, one a bar ahead of the other.
WALTZ_RUN = Move(
    "waltz run", counts=12,
    steps=tuple(_run_step(k) for k in range(1, 13)),
    poses=_rise_and_fall({
        1: pose(twist=-8, side=6, look=22, nod=3, left="second", right="first"),
        2: pose(twist=4, side=7, look=24, nod=-4, left="reach_back", right="reach"),
        3: pose(twist=-2, side=8, look=24, nod=-10, left="second", right="fifth"),
        4: pose(twist=8, side=6, look=22, nod=3, left="first", right="second"),
        5: pose(twist=-4, side=5, look=22, nod=-4, left="reach", right="reach_back"),
        6: pose(twist=2, side=4, look=22, nod=-10, left="fifth", right="second"),
        7: pose(twist=-8, side=6, look=22, nod=3, left="second", right="first"),
        8: pose(twist=4, side=7, look=24, nod=-4, left="reach_back", right="reach"),
        9: pose(twist=-2, side=8, look=24, nod=-10, left="second", right="fifth"),
        10: pose(twist=8, side=6, look=18, nod=3, left="first", right="second"),
        11: pose(twist=0, side=3, look=10, nod=-6, arms="fifth"),
        12: pose(twist=0, side=0, look=0, arch=5, nod=-4, arms="second"),
    }),
    bounce=_LEVEL,
)  # fmt: skip

# A wide lunge and a port de bras: the chest sinks over the leg, comes up and back over the other.
LUNGE = Move(
    "lunge and port de bras", counts=6,
    steps=(
        step("left", 1, (0.50, 0.04), toe_out=28.0),
        press("left", 2),
        press("right", 3, weight=0.85),
        press("right", 4),
        touch("left", 5, (0.02, 0.05)),
        press("right", 6),
    ),
    poses={
        1: pose(drop=0.05, side=6, twist=-4, look=25, nod=0, left="second", right="second"),
        2: pose(drop=0.11, side=12, twist=18, bend=12, look=25, nod=12, left="reach_back", right="first"),
        3: pose(drop=0.05, side=0, twist=4, bend=2, look=5, nod=0, left="en_bas", right="fifth"),
        4: pose(drop=0.04, side=-12, twist=-8, bend=0, look=-15, tilt=-5, left="fifth", right="second"),
        5: pose(drop=0.0, side=-5, twist=-4, arch=6, look=5, nod=-10, left="fifth", right="fifth"),
        6: pose(drop=-0.03, side=0, twist=0, arch=4, look=0, nod=-4, left="second", right="second"),
    },
    bounce=_LEVEL,
)  # fmt: skip

WALTZ = Genre(
    "waltz",
    (
        BOX, BOX_TURN, BALANCE_SIDE, BALANCE_FORWARD, NATURAL_TURN, HESITATION, TWINKLE, GRAPEVINE, SPIN_TURN,
        WALTZ_RUN, LUNGE,
    ),
    bar=3,
    sharpness=0.25,
)  # fmt: skip
