"""Cha-cha: two, three, four-and-one. Legs are straight on every step, hips that settle, long quiet arms.

Home is the "four": a move begins on the "and" (0.5), where the free foot half closes, goes to the side
on 1, has its two slow steps on 2 and 3, and lands the next chassé's first step on 4, home again.
Moves of four counts drift with their chassé and come back in their mirror.
"""

from __future__ import annotations

from content.moves.genres.cuban import over
from content.moves.notation import Bounce, Move, Step, ball, kick, pivot, press, step, touch
from content.moves.sequencer import Genre

_KNEES = Bounce(0.012, "up")
_SIDE_M = 0.22  # a chassé's way


def _chasse(count: float, to_m: float = _SIDE_M) -> tuple[Step, Step]:
    """Right closes by half on "and", left goes on to the side on `count`."""
    return ball("right", count - 0.5, (0.07, 0.0), pitch=14.0, lift=0.04, swing=0.42), step(
        "left", count, (to_m, 0.0)
    )


def _chasse_home(count: float) -> tuple[Step, Step]:
    """The same to the right, back from `_SIDE_M` to the home the move began at."""
    return ball("left", count - 0.5, (_SIDE_M - 0.07, 0.0), pitch=14.0, lift=0.04, swing=0.42), step(
        "right", count
    )


BASIC = Move(
    "basic", counts=8,
    steps=(
        *_chasse(1),
        step("right", 2, (_SIDE_M, -0.27)),
        press("left", 3),
        step("right", 4, (_SIDE_M, 0.0)),
        *_chasse_home(5),
        step("left", 6, (0.0, 0.27), toe_out=4.0),
        press("right", 7),
        step("left", 8),
    ),
    poses={
        1: over("left", look=10, left="low_out", right="low_out"),
        2: over("right", bend=4, look=0, left="swing_fwd", right="out"),
        3: over("left", bend=0, look=4, left="low_out", right="swing_in"),
        4: over("right", look=-6, left="low_guard", right="low_guard"),
        5: over("right", look=-10, left="low_out", right="low_out"),
        6: over("left", bend=-3, arch=4, look=0, left="out", right="swing_fwd"),
        7: over("right", bend=0, arch=0, look=-4, left="swing_in", right="low_out"),
        8: over("left", look=6, left="low_guard", right="low_guard"),
    },
    bounce=_KNEES,
)  # fmt: skip

TIME_STEP = Move(
    "time step", counts=4,
    steps=(
        *_chasse(1),
        step("right", 2, (_SIDE_M + 0.03, -0.05)),
        step("left", 3, (_SIDE_M, 0.0), lift=0.04),
        step("right", 4, (_SIDE_M, 0.0)),
    ),
    poses={
        1: over("left", look=14, left="out", right="chest"),
        2: over("right", 1.2, look=6, left="low_out", right="low_guard"),
        3: over("left", 1.2, look=0, left="chest", right="low_out"),
        4: over("right", look=-8, left="low_guard", right="chest"),
    },
    bounce=_KNEES,
)  # fmt: skip

# Through to the side, the inside arm in front, the other one up and away: a line for the audience.
NEW_YORKER = Move(
    "New Yorker", counts=4,
    steps=(
        *_chasse(1),
        pivot("left", 2, face=75.0),
        step("right", 2, (0.53, 0.05), face=80.0, bow=(0.0, 0.10), toe_out=4.0),
        pivot("left", 3, face=40.0, weight=1.0),
        pivot("left", 3.6, face=0.0),
        step("right", 4, (_SIDE_M, 0.0), bow=(0.0, 0.22)),
    ),
    poses={
        1: over("left", look=20, left="low_guard", right="low_guard"),
        2: over("right", 0.8, twist=-24, arch=5, look=-24, nod=-4, left="wide_up", right="fwd"),
        3: over("left", twist=-6, arch=0, look=-10, nod=0, left="chest", right="low_guard"),
        4: over("right", look=-8, left="low_out", right="low_out"),
    },
    bounce=_KNEES,
)  # fmt: skip

# Opened backwards, the free arm drawn along the floor's horizon behind.
HAND_TO_HAND = Move(
    "hand to hand", counts=4,
    steps=(
        *_chasse(1),
        pivot("left", 2, face=-70.0),
        step("right", 2, (0.67, 0.04), face=-80.0, bow=(0.0, -0.20)),
        pivot("left", 3, face=-40.0, weight=1.0),
        pivot("left", 3.6, face=0.0),
        step("right", 4, (_SIDE_M, 0.0), bow=(0.0, -0.25)),
    ),
    poses={
        1: over("left", look=10, left="low_guard", right="low_guard"),
        2: over("right", 0.8, twist=-14, bend=-3, look=30, left="fwd", right="out"),
        3: over("left", twist=4, bend=0, look=18, left="low_guard", right="chest"),
        4: over("right", look=-8, left="low_out", right="low_out"),
    },
    bounce=_KNEES,
)  # fmt: skip

SPOT_TURN = Move(
    "spot turn", counts=4,
    steps=(
        *_chasse(1),
        pivot("left", 2, face=90.0),
        step("right", 2, (0.50, -0.02), face=100.0, bow=(0.0, 0.14), toe_out=0.0),
        pivot("right", 3, face=265.0),
        pivot("left", 3, face=280.0, weight=1.0, toe_out=0.0),
        pivot("left", 3.6, face=360.0),
        step("right", 4, (_SIDE_M, 0.0), face=360.0, bow=(0.0, -0.30)),
    ),
    poses={
        1: over("left", look=22, left="low_out", right="low_guard"),
        2: over("right", 0.6, twist=8, look=28, left="low_guard", right="chest"),
        3: over("left", 0.6, twist=2, look=30, left="chest", right="chest"),
        4: over("right", look=-6, left="low_out", right="low_out"),
    },
    bounce=_KNEES,
)  # fmt: skip

CUCARACHA = Move(
    "cucaracha", counts=4,
    steps=(
        *_chasse(1, 0.20),
        step("right", 2, (-0.06, 0.0), toe_out=16.0),
        press("left", 3),
        step("right", 4, (0.20, 0.0)),
    ),
    poses={
        1: over("left", look=8, left="out", right="low_guard"),
        2: over("right", 1.4, look=-22, tilt=-3, left="chest", right="out"),
        3: over("left", 1.3, look=-6, tilt=2, left="low_out", right="across"),
        4: over("right", look=0, tilt=0, left="chest", right="low_out"),
    },
    bounce=_KNEES,
)  # fmt: skip

CROSS_BASIC = Move(
    "cross basic", counts=8,
    steps=(
        *_chasse(1),
        pivot("left", 2, face=-25.0),
        step("right", 2, (0.46, -0.24), face=-30.0, bow=(0.0, -0.06)),
        pivot("left", 3, face=0.0, weight=1.0),
        step("right", 4, (_SIDE_M, 0.0), bow=(0.0, -0.06)),
        *_chasse_home(5),
        pivot("right", 6, face=-40.0),
        step("left", 6, (-0.24, 0.22), face=-45.0, bow=(0.0, 0.06)),
        pivot("right", 7, face=0.0, weight=1.0),
        step("left", 8, bow=(0.0, 0.06)),
    ),
    poses={
        1: over("left", look=14, left="low_out", right="low_out"),
        2: over("right", twist=-4, look=26, left="across", right="out"),
        3: over("left", look=8, left="low_out", right="chest"),
        4: over("right", look=-6, left="low_guard", right="low_guard"),
        5: over("right", look=-14, left="low_out", right="low_out"),
        6: over("left", twist=-2, look=-8, arch=4, left="fwd", right="wide_up"),
        7: over("right", look=0, arch=0, left="chest", right="low_out"),
        8: over("left", look=6, left="low_guard", right="low_guard"),
    },
    bounce=_KNEES,
)  # fmt: skip

# Three chassés forward, shoulders leading by turns, a check with the arms wide, and walks back home.
THREE_CHA_CHAS = Move(
    "three cha-chas", counts=16,
    steps=(
        ball("right", 0.5, (0.03, 0.08), lift=0.04, swing=0.42), step("left", 1, (0.0, 0.18)),
        step("right", 2, (0.0, 0.34)),
        ball("left", 2.5, (-0.03, 0.42), lift=0.04, swing=0.42), step("right", 3, (0.0, 0.52)),
        step("left", 4, (0.0, 0.66)),
        ball("right", 4.5, (0.03, 0.74), lift=0.04, swing=0.42), step("left", 5, (0.0, 0.82)),
        step("right", 6, (0.02, 1.04), toe_out=4.0), press("left", 7), step("right", 8, (0.0, 0.66)),
        step("left", 9, (0.0, 0.48)), step("right", 10, (0.0, 0.30)), step("left", 11, (0.0, 0.12)),
        step("right", 12), step("left", 13, (0.20, 0.0), toe_out=16.0), press("right", 14), step("left", 15),
        step("right", 16, lift=0.04),
    ),
    poses={
        1: over("left", 0.8, twist=-16, look=10, left="low_out", right="swing_fwd"),
        2: over("right", 0.8, twist=6, look=0, left="chest", right="low_guard"),
        3: over("right", 0.8, twist=16, look=-10, left="swing_fwd", right="low_out"),
        4: over("left", 0.8, twist=-6, look=0, left="low_guard", right="chest"),
        5: over("left", 0.8, twist=-16, look=10, left="low_out", right="swing_fwd"),
        6: over("right", twist=10, arch=5, bend=-3, look=0, left="out", right="out"),
        7: over("left", twist=-4, arch=0, bend=2, left="low_out", right="low_out"),
        8: over("right", twist=8, look=0, left="chest", right="low_guard"),
        9: over("left", left="low_guard", right="chest"),
        10: over("right", look=-6, left="swing_fwd", right="low_out"),
        11: over("left", look=6, left="low_out", right="swing_fwd"),
        12: over("right", look=0, left="chest", right="low_guard"),
        13: over("left", 1.3, look=20, tilt=3, left="out", right="chest"),
        14: over("right", 1.2, look=6, tilt=-2, left="swing_in", right="low_out"),
        15: over("left", look=0, tilt=0, left="chest", right="chest"),
        16: over("right", left="low_guard", right="low_guard"),
    },
    bounce=_KNEES,
)  # fmt: skip

# Two-and-three, four-and-five: crossed in front with half the weight, replaced, to the side.
CUBAN_BREAKS = Move(
    "Cuban breaks", counts=8,
    steps=(
        *_chasse(1),
        step("right", 2, (0.38, 0.22), bow=(0.0, 0.08), weight=0.4), press("left", 2.5),
        step("right", 3, (0.16, 0.0), bow=(0.0, 0.06)),
        step("left", 4, (0.0, 0.22), bow=(0.0, 0.08), weight=0.4), press("right", 4.5),
        step("left", 5, (_SIDE_M, 0.0), bow=(0.0, 0.06)),
        step("right", 6, (_SIDE_M, -0.26)), press("left", 7),
        step("right", 8, (_SIDE_M, 0.0)),
    ),
    poses={
        1: over("left", look=8, left="low_out", right="low_guard"),
        2: over("right", 0.6, twist=14, look=14, left="low_out", right="across"),
        3: over("right", 1.2, hip_side=-0.015, look=-10, left="chest", right="out"),
        4: over("left", 0.6, twist=-14, look=-14, left="across", right="low_out"),
        5: over("left", 1.2, hip_side=0.015, look=10, left="out", right="chest"),
        6: over("right", bend=4, look=0, left="swing_fwd", right="low_out"),
        7: over("left", bend=0, look=4, left="low_out", right="swing_in"),
        8: over("right", look=0, left="low_guard", right="low_guard"),
    },
    bounce=_KNEES,
)  # fmt: skip

FLICK = Move(
    "flick and step", counts=8,
    steps=(
        *_chasse(1, 0.16),
        kick("right", 2, (0.18, 0.46), 0.18),
        step("right", 3, (0.16, 0.0)),
        touch("left", 4, (0.14, 0.04)),
        ball("left", 4.5, (0.10, 0.0), pitch=14.0, lift=0.04, swing=0.42), step("right", 5),
        kick("left", 6, (-0.02, 0.46), 0.18),
        step("left", 7),
        touch("right", 8, (0.02, 0.04)),
    ),
    poses={
        1: over("left", hip_side=0.018, look=8, left="low_out", right="chest"),
        2: over(
            "left", 0.7, hip_side=0.045, hip_turn=-6, twist=12, bend=-3, nod=4, look=0,
            left="fwd", right="out",
        ),
        3: over("right", 1.1, bend=2, nod=0, look=6, left="low_out", right="low_guard"),
        4: over("right", 1.3, twist=12, look=12, left="chest", right="out"),
        5: over("right", hip_side=-0.018, twist=0, bend=0, look=-8, left="chest", right="low_out"),
        6: over(
            "right", 0.7, hip_side=-0.045, hip_turn=6, twist=-12, bend=-3, nod=4, look=0,
            left="out", right="fwd",
        ),
        7: over("left", 1.1, bend=2, nod=0, look=-6, left="low_guard", right="low_out"),
        8: over("left", 1.3, bend=0, twist=-12, look=-12, left="out", right="chest"),
    },
    bounce=_KNEES,
)  # fmt: skip

CHA_CHA = Genre(
    "cha-cha",
    (
        BASIC, TIME_STEP, NEW_YORKER, HAND_TO_HAND, SPOT_TURN, CUCARACHA, CROSS_BASIC, THREE_CHA_CHAS,
        CUBAN_BREAKS, FLICK,
    ),
    sharpness=0.5,
    bounce=0.8,
    half_time_from_bpm=168.0,
)  # fmt: skip
