"""Salsa on one: one, two, three, five, six, seven. On four and eight the free foot waits or taps.

Small steps under the body, hips that settle on each of them, elbows bent and alive. Shines have long arms.
The counts are the music's quarter notes, even at 190 of them a minute: that is how it is danced.
"""

from __future__ import annotations

from content.moves.carriage import Carriage
from content.moves.figures import Manner
from content.moves.genres.cha_cha import LATIN_ARMS
from content.moves.genres.cuban import over
from content.moves.genres.travelling_figures import SALSA_FIGURES
from content.moves.notation import Bounce, Move, kick, pivot, press, step, touch
from content.moves.sequencer import Genre

_KNEES = Bounce(0.014, "down")

BASIC = Move(
    "basic", counts=8,
    steps=(
        step("left", 1, (0.0, 0.24)), press("right", 2), step("left", 3), touch("right", 4, lift=0.04),
        step("right", 5, (0.0, -0.24)), press("left", 6), step("right", 7), touch("left", 8, lift=0.04),
    ),
    poses={
        1: over("left", bend=-2, look=6, left="elbow_back", right="pump_high"),
        2: over("right", bend=2, look=0, left="low_guard", right="elbow_back"),
        3: over("left", bend=0, left="pump_low", right="guard"),
        4: over("left", 1.3, twist=4, look=-6, left="low_guard", right="swing_out"),
        5: over("right", bend=4, look=-4, left="pump_high", right="elbow_back"),
        6: over("left", bend=0, look=0, left="elbow_back", right="low_guard"),
        7: over("right", left="guard", right="pump_low"),
        8: over("right", 1.3, twist=-4, look=6, left="swing_out", right="low_guard"),
    },
    bounce=_KNEES,
)  # fmt: skip

SIDE_BASIC = Move(
    "side basic", counts=8,
    steps=(
        step("left", 1, (0.20, 0.0)), step("right", 2, (0.16, 0.0)),
        step("left", 3, (0.38, 0.0)), touch("right", 4, (0.34, 0.02)),
        step("right", 5, (0.18, 0.0)), step("left", 6, (0.22, 0.0)),
        step("right", 7), touch("left", 8, (0.04, 0.02)),
    ),
    poses={
        1: over("left", look=14, left="low_out", right="low_guard"),
        2: over("right", look=10, left="chest", right="low_out"),
        3: over("left", look=14, left="out", right="chest"),
        4: over("left", 1.3, twist=6, look=0, nod=4, left="low_guard", right="swing_in"),
        5: over("right", look=-14, nod=0, left="low_guard", right="low_out"),
        6: over("left", look=-10, left="low_out", right="chest"),
        7: over("right", look=-14, left="chest", right="out"),
        8: over("right", 1.3, twist=-6, look=0, nod=4, left="swing_in", right="low_guard"),
    },
    bounce=_KNEES,
)  # fmt: skip

CUCARACHA = Move(
    "cucaracha", counts=4,
    steps=(
        step("left", 1, (0.24, 0.0), toe_out=16.0), press("right", 2),
        step("left", 3), touch("right", 4, lift=0.04),
    ),
    poses={
        1: over("left", 1.3, look=18, tilt=3, left="out", right="chest"),
        2: over("right", 1.2, look=4, tilt=-2, left="swing_in", right="low_out"),
        3: over("left", look=0, tilt=0, left="chest", right="low_guard"),
        4: over("left", 1.4, twist=4, look=-6, left="low_guard", right="swing_out"),
    },
    bounce=_KNEES,
)  # fmt: skip

# The cumbia step: back behind oneself, opened to the side, and on the spot again.
BACK_ROCK = Move(
    "back rock", counts=4,
    steps=(
        pivot("right", 1, face=25.0), step("left", 1, (-0.04, -0.26), face=35.0, bow=(0.05, -0.04)),
        pivot("right", 2, face=10.0, weight=1.0),
        step("left", 3), touch("right", 4, lift=0.04),
    ),
    poses={
        1: over("left", twist=10, bend=3, look=20, left="out", right="swing_fwd"),
        2: over("right", bend=0, look=4, left="low_guard", right="swing_out"),
        3: over("left", look=0, left="pump_low", right="guard"),
        4: over("left", 1.3, twist=4, look=-8, nod=4, left="chest", right="low_out"),
    },
    bounce=_KNEES,
)  # fmt: skip

LEFT_TURN = Move(
    "left turn", counts=8,
    steps=(
        step("left", 1, (0.16, 0.10), face=90.0),
        pivot("left", 2, face=200.0), step("right", 2, (0.57, 0.12), face=250.0, bow=(0.0, 0.24)),
        pivot("right", 3, face=320.0), step("left", 3, (0.62, 0.0), face=360.0, bow=(0.0, 0.18)),
        touch("right", 4, (0.60, 0.02), face=360.0),
        step("right", 5, (0.30, 0.0), face=360.0), step("left", 6, (0.34, 0.0), face=360.0),
        step("right", 7, face=360.0), touch("left", 8, (0.04, 0.02), face=360.0),
    ),
    poses={
        1: over("left", 0.6, twist=10, look=26, left="out", right="chest"),
        2: over("right", 0.5, twist=6, look=30, left="chest", right="chest"),
        3: over("left", 0.7, twist=0, look=4, left="chest", right="low_out"),
        4: over("left", 1.2, twist=4, look=0, left="low_out", right="low_guard"),
        5: over("right", look=-14, left="low_guard", right="low_out"),
        6: over("left", look=-10, left="low_out", right="chest"),
        7: over("right", look=-8, left="chest", right="low_out"),
        8: over("right", 1.3, twist=-6, look=6, left="swing_out", right="low_guard"),
    },
    bounce=_KNEES,
)  # fmt: skip

RIGHT_TURN = Move(
    "right turn", counts=8,
    steps=(
        step("left", 1, (0.30, 0.0)), step("right", 2, (0.26, 0.0)),
        step("left", 3, (0.62, 0.0)), touch("right", 4, (0.59, 0.02)),
        step("right", 5, (0.46, 0.10), face=-90.0),
        pivot("right", 6, face=-200.0), step("left", 6, (0.05, 0.12), face=-250.0, bow=(0.0, 0.24)),
        pivot("left", 7, face=-320.0), step("right", 7, (0.0, 0.0), face=-360.0, bow=(0.0, 0.18)),
        touch("left", 8, (0.03, 0.02), face=-360.0),
    ),
    poses={
        1: over("left", look=10, left="elbow_back", right="pump_high"),
        2: over("right", look=6, left="pump_high", right="elbow_back"),
        3: over("left", look=10, left="elbow_back", right="pump_high"),
        4: over("left", 1.3, twist=14, look=-16, left="out", right="chest"),
        5: over("right", 0.6, twist=-10, look=-26, left="chest", right="out"),
        6: over("left", 0.5, twist=-6, look=-30, left="chest", right="chest"),
        7: over("right", 0.7, twist=0, look=-4, left="low_out", right="chest"),
        8: over("right", 1.2, twist=-4, look=0, left="low_guard", right="low_out"),
    },
    bounce=_KNEES,
)  # fmt: skip

# The leader's way across: back in the slot, turned to the side, an arm that shows her through.
CROSS_BODY = Move(
    "cross-body walk", counts=8,
    steps=(
        step("left", 1, (0.0, 0.24)), pivot("right", 2, face=35.0, weight=1.0),
        pivot("right", 3, face=60.0), step("left", 3, (0.14, -0.08), face=70.0, bow=(0.10, 0.0)),
        touch("right", 4, (0.16, 0.0), face=70.0),
        step("right", 5, (0.32, 0.0), face=70.0), pivot("left", 6, face=30.0, weight=1.0),
        pivot("left", 6.6, face=0.0), step("right", 7), touch("left", 8),
    ),
    poses={
        1: over("left", bend=-2, look=6, left="elbow_back", right="pump_high"),
        2: over("right", bend=2, look=16, left="low_guard", right="elbow_back"),
        3: over("left", twist=-16, look=-20, left="low_out", right="chest"),
        4: over("left", 1.2, twist=-24, look=-30, left="chest", right="out"),
        5: over("right", twist=-10, bend=3, look=-20, left="low_out", right="swing_in"),
        6: over("left", twist=-4, bend=0, look=-8, left="elbow_back", right="low_out"),
        7: over("right", look=0, left="guard", right="pump_low"),
        8: over("right", 1.3, twist=-4, look=6, left="swing_out", right="low_guard"),
    },
    bounce=_KNEES,
)  # fmt: skip

# Crossed over in front, to the side, crossed over again. The hips turn into the cross.
SUZY_Q = Move(
    "Suzy Q", counts=8,
    steps=(
        step("left", 1, (-0.23, 0.25), bow=(0.0, 0.08), toe_out=0.0),
        step("right", 2, (-0.30, -0.04), bow=(0.0, -0.14), lift=0.04),
        step("left", 3, (-0.53, 0.22), bow=(0.0, 0.10), toe_out=0.0),
        touch("right", 4, (-0.58, 0.0), bow=(0.0, -0.14), lift=0.04),
        step("right", 5, (-0.34, 0.46), bow=(-0.16, 0.14), toe_out=0.0),
        step("left", 6, (-0.04, 0.0), bow=(0.0, -0.12), lift=0.05),
        step("right", 7), touch("left", 8, (0.05, 0.03)),
    ),
    poses={
        1: over("left", hip_turn=-8, twist=8, look=-10, left="swing_in", right="low_out"),
        2: over("right", hip_turn=10, twist=-4, look=-14, left="low_out", right="chest"),
        3: over("left", hip_turn=-8, twist=8, look=-10, left="swing_in", right="out"),
        4: over("left", 1.2, twist=-4, look=0, left="low_out", right="low_guard"),
        5: over("right", hip_turn=8, twist=-8, look=10, left="low_out", right="swing_in"),
        6: over("left", hip_turn=-6, twist=4, look=14, left="chest", right="low_out"),
        7: over("right", 1.2, look=10, left="out", right="chest"),
        8: over("right", 1.2, twist=4, look=0, left="low_guard", right="low_out"),
    },
    bounce=_KNEES,
)  # fmt: skip

MAMBO_TAP = Move(
    "mambo with taps", counts=8,
    steps=(
        step("left", 1, (0.0, 0.24)), press("right", 2), step("left", 3), touch("right", 4, (-0.26, 0.04)),
        step("right", 5, (0.0, -0.24), bow=(-0.03, 0.0)), press("left", 6), step("right", 7),
        touch("left", 8, (0.05, 0.05)),
    ),
    poses={
        1: over("left", bend=-3, look=0, left="low_out", right="fwd"),
        2: over("right", bend=2, left="chest", right="low_guard"),
        3: over("left", bend=0, look=-6, left="low_guard", right="chest"),
        4: over("left", 1.4, side=4, look=-24, left="wide_up", right="low_out"),
        5: over("right", side=0, bend=4, look=0, left="fwd", right="low_out"),
        6: over("left", bend=0, left="low_guard", right="chest"),
        7: over("right", look=6, left="chest", right="low_guard"),
        8: over("right", 1.4, side=-3, look=14, left="low_out", right="out"),
    },
    bounce=_KNEES,
)  # fmt: skip

CROSSOVER = Move(
    "crossover break", counts=4,
    steps=(
        pivot("right", 1, face=-60.0),
        step("left", 1, (-0.32, 0.04), face=-65.0, bow=(0.0, 0.10), toe_out=4.0),
        pivot("right", 2, face=-30.0, weight=1.0),
        pivot("right", 2.6, face=0.0), step("left", 3, bow=(0.0, 0.16)),
        touch("right", 4, lift=0.04),
    ),
    poses={
        1: over("left", 0.8, twist=18, arch=4, look=20, left="fwd", right="wide_up"),
        2: over("right", 0.8, twist=4, arch=0, look=8, left="low_guard", right="chest"),
        3: over("left", look=0, left="low_out", right="low_out"),
        4: over("left", 1.3, twist=4, left="chest", right="chest", nod=4),
    },
    bounce=_KNEES,
)  # fmt: skip

KICK_SHINE = Move(
    "kick shine", counts=8,
    steps=(
        kick("left", 1, (0.02, 0.42), 0.16), step("left", 2, (0.0, -0.10)),
        step("right", 3, (0.0, 0.0), lift=0.05), touch("left", 4, (0.16, 0.0)),
        step("left", 5, (-0.22, 0.18), bow=(0.0, 0.06), toe_out=0.0), press("right", 6),
        step("left", 7, bow=(0.0, 0.06)), touch("right", 8, lift=0.04),
    ),
    poses={
        1: over("right", 0.6, hip_turn=6, twist=-12, bend=-2, nod=4, look=0, left="low_out", right="fwd"),
        2: over("left", bend=2, nod=0, left="swing_fwd", right="swing_back"),
        3: over("right", bend=0, left="chest", right="low_out"),
        4: over("right", 1.2, look=16, left="out", right="chest"),
        5: over("left", hip_turn=-14, twist=8, look=-8, left="swing_in", right="out"),
        6: over("right", look=0, left="low_out", right="chest"),
        7: over("left", left="chest", right="low_guard"),
        8: over("left", 1.3, twist=4, look=-6, left="low_guard", right="swing_out"),
    },
    bounce=_KNEES,
)  # fmt: skip

# In place and wide: hips from side to side, one arm combs the hair, then both open.
HIP_SHINE = Move(
    "hips and arms", counts=8,
    steps=(
        step("left", 1, (0.20, 0.0), toe_out=16.0), press("right", 2), press("left", 3), press("right", 4),
        press("left", 5), press("right", 6), step("left", 7), touch("right", 8),
    ),
    poses={
        1: over("left", 1.3, look=12, drop=0.01, left="low_out", right="across"),
        2: over("right", 1.3, look=-4, drop=0.02, left="chest", right="out"),
        3: over("left", 1.4, look=-10, drop=0.01, nod=-4, left="low_guard", right="wide_up"),
        4: over("right", 1.4, look=4, drop=0.02, tilt=-4, left="hip", right="head"),
        5: over("left", 1.4, look=12, drop=0.01, tilt=3, left="low_out", right="up"),
        6: over("right", 1.3, look=0, nod=0, tilt=0, left="out", right="out"),
        7: over("left", drop=0.0, left="chest", right="chest"),
        8: over("left", 1.3, nod=4, left="low_out", right="low_out"),
    },
    bounce=_KNEES,
)  # fmt: skip

SALSA = Genre(
    "salsa",
    (
        BASIC,
        SIDE_BASIC,
        CUCARACHA,
        BACK_ROCK,
        RIGHT_TURN,
        LEFT_TURN,
        CROSS_BODY,
        SUZY_Q,
        MAMBO_TAP,
        CROSSOVER,
        KICK_SHINE,
        HIP_SHINE,
    ),
    size=1.27,
    sharpness=0.4,
    half_time_from_bpm=230.0,
    figures=SALSA_FIGURES,
    manner=Manner(
        arms=LATIN_ARMS,
        changes=(1.0, 2.0, 2.0),
        levels_m=(0.0, 0.0, 0.045, 0.045),
        bounce=Bounce(0.008, "up"),
        twist_deg=9.0,
        side_deg=0.0,
        swing=0.95,
        lift_m=0.048,
        varies=0.26,
        turns_vary_deg=9.0,
        ball_deg=23.6,
    ),
    steer_deg=30.0,
    carriage=Carriage(
        posture=5.7,
        to_go=0.65,
        through=0.5,
        reach=0.996,
        stoop_m=0.0,
        give_m=0.008,
        hip_up=6.1,
        hip_out_m=0.02,
        hip_with_feet=20.0,
        chest_against=0.7,
        looks=12.0,
        arm_swing=14.0,
        arm_play=8.0,
        sinks_m=0.01,
        left_behind=1.3,
        sway=0.8,
        arms_open=8.0,
        toes_point=47.8,
    ),
    bounce=1.04,
)
