"""Contemporary: slow, long arms, breath, deep pliés, falls that are caught. Each count is a soft arrival."""

from __future__ import annotations

from functools import partial

from content.moves.arm_poses import Arm
from content.moves.carriage import Carriage
from content.moves.figures import Manner
from content.moves.genres.travelling_figures import CONTEMPORARY_FIGURES
from content.moves.notation import Bounce, Move, both_sides, kick, pivot, pose, press, step, touch
from content.moves.sequencer import Genre

# Weight taken on 3.05 sets off just after 2: a stop on 2 that lasts is over before.
_BREATH = Bounce(0.015, "down", every=2.0, start=2.0)

# It slows down on the counts but does not stop there.
_via = partial(pose, flow=0.4)
_slow = partial(pose, flow=0.1)

# Long lines, curves round a space, and arms gathered in.
_UP = Arm((0.42, 0.95, 0.18), (0.22, 1.0, 0.12), -8, 0)
_DIAGONAL = Arm((0.88, 0.55, 0.22), (0.82, 0.60, 0.26), -8, 5)
_LOW = Arm((0.70, -0.75, -0.12), (0.72, -0.72, 0.08), -10, 10)
_SIDE = Arm((1.0, -0.05, 0.12), (1.0, 0.03, 0.22), -10, 10)
_FWD = Arm((0.28, 0.02, 1.0), (0.15, 0.12, 1.0), -10, 15)
_BACK = Arm((0.50, -0.80, -0.55), (0.45, -0.80, -0.30), -8, 15)
_ROUND_LOW = Arm((0.55, -0.85, 0.40), (-0.42, -0.55, 0.75), 10, 25)  # a ball held before the hips
_ROUND_MID = Arm((0.80, -0.30, 0.55), (-0.50, 0.05, 0.90), 10, 25)  # before the chest
_ROUND_HIGH = Arm((0.72, 0.70, 0.28), (-0.15, 1.0, 0.25), 8, 0)  # over the head
_HUG = Arm((0.36, -0.42, 0.74), (-0.72, 0.06, 0.68), 15, 25)
_GATHER = Arm((0.42, -0.52, 0.85), (-0.25, -0.30, 0.90), 5, 25)  # up from between the knees
_HANG = Arm((0.46, -0.66, 0.72), (0.20, -0.78, 0.62), 5, 15)  # down, from a chest that is bent over
_HEART = Arm((0.72, -0.60, 0.32), (-0.70, 0.55, 0.55), 20, 25)

REACH = Move(
    "reach and release", counts=4,
    steps=(
        step("left", 1, (0.30, 0.06), toe_out=18.0),
        press("right", 3.05),
        step("left", 4),
    ),
    poses={
        1: _via(side=-6, twist=8, drop=0.02, look=16, nod=-8, hip_roll=4, left=_DIAGONAL, right=_LOW),
        2: pose(side=-14, twist=14, arch=8, drop=-0.01, look=22, nod=-16, left=_UP, right=_SIDE),
        3: _via(side=8, twist=-12, bend=22, arch=-8, drop=0.1, look=-8, nod=12, left=_HUG, right=_ROUND_LOW),
        4: _via(side=0, twist=0, bend=0, arch=0, drop=0.00, look=0, nod=0, hip_roll=0, arms="loose"),
    },
    bounce=_BREATH,
)  # fmt: skip

# From the crown down through the chest and the hips into the knees, and up again from there.
BODY_ROLL = Move(
    "body roll", counts=8,
    steps=(
        step("left", 1, (0.12, 0.0), weight=0.5, toe_out=14.0),
        press("right", 4, weight=0.6),
        press("left", 6, weight=0.6),
        press("right", 7),
        step("left", 8),
    ),
    poses={
        1: _via(nod=-14, arch=8, bend=-4, hip_fwd=-0.03, drop=0.02, arms=_FWD),
        2: _via(nod=8, arch=16, bend=2, hip_fwd=-0.05, hip_tilt=6, drop=0.06, arms=_ROUND_MID),
        3: _via(nod=14, arch=-12, bend=12, hip_fwd=0.05, hip_tilt=-10, drop=0.09, arms=_HEART),
        4: _via(nod=18, arch=-10, bend=30, hip_fwd=-0.07, hip_tilt=2, drop=0.15, arms=_LOW),
        5: _via(nod=16, arch=-14, bend=20, hip_fwd=0.04, hip_tilt=-10, drop=0.11, arms=_ROUND_LOW),
        6: _via(nod=8, arch=12, bend=0, hip_fwd=0.04, hip_tilt=-4, drop=0.04, arms=_ROUND_MID),
        7: _via(nod=-16, arch=16, bend=-8, hip_fwd=0.0, hip_tilt=2, drop=0.00, arms=_ROUND_HIGH),
        8: _via(nod=0, arch=4, bend=0, hip_fwd=0, hip_tilt=0, drop=0.02, twist=6, left=_HEART, right="loose"),
    },
    bounce=_BREATH,
)  # fmt: skip

LUNGE = Move(
    "lunge port de bras", counts=8,
    steps=(
        step("left", 1, (0.52, 0.10), toe_out=34.0),
        press("right", 5),
        step("left", 8),
    ),
    poses={
        1: _via(drop=0.08, side=-4, twist=6, look=14, arms=_SIDE),
        2: _via(drop=0.115, side=18, twist=4, hip_roll=-4, look=20, nod=4, left=_LOW, right=_UP),
        3: _via(drop=0.115, side=10, bend=30, twist=18, look=6, nod=10, left=_BACK, right=_HANG),
        4: _via(drop=0.1, side=-6, bend=24, twist=-14, look=-10, nod=8, left=_HANG, right=_SIDE),
        5: _via(drop=0.06, side=-16, bend=0, twist=-10, look=-16, nod=-6, left=_UP, right=_SIDE),
        6: _slow(drop=0.03, side=-4, bend=-6, arch=10, twist=0, look=0, nod=-16, arms=_ROUND_HIGH),
        7: _slow(drop=0.085, side=6, bend=12, arch=-6, hip_roll=0, nod=6, arms=_ROUND_MID),
        8: _via(drop=0.00, side=0, bend=0, arch=0, nod=0, left=_LOW, right=_ROUND_LOW),
    },
    bounce=_BREATH,
)  # fmt: skip

CONTRACTION = Move(
    "contraction and release", counts=4,
    steps=(
        step("left", 1, (0.0, 0.26)),
        press("right", 2, weight=0.7),
        press("right", 3),
        step("left", 4),
    ),
    poses={
        1: _via(arch=10, bend=-4, nod=-8, drop=0.02, arms=_SIDE),
        2: _via(arch=-16, bend=26, nod=16, hip_tilt=-14, hip_fwd=-0.04, drop=0.095, arms=_HUG),
        3: _via(arch=18, bend=-10, nod=-16, hip_tilt=6, hip_fwd=0.03, drop=0.03, arms="wide_up"),
        4: _via(arch=0, bend=2, nod=4, hip_tilt=0, hip_fwd=0, drop=0.03, side=5, left="loose", right=_LOW),
    },
    bounce=_BREATH,
)  # fmt: skip

# Two counts for each step of the turn. One arm winds up, the other down, and they change places.
SPIRAL_TURN = Move(
    "spiral turn", counts=8,
    steps=(
        step("left", 1, (0.22, 0.10), face=70.0),
        pivot("left", 2, face=140.0),
        pivot("left", 3, face=190.0),
        step("right", 3.05, (0.72, 0.12), face=225.0, bow=(0.0, 0.26)),
        pivot("right", 4, face=285.0),
        pivot("right", 5, face=335.0),
        step("left", 5, (0.92, 0.0), face=360.0, bow=(0.0, 0.22)),
        step("right", 7, (0.90, 0.0), face=360.0),
        touch("left", 8, (0.90, 0.0), face=360.0),
    ),
    poses={
        1: _via(twist=16, drop=0.06, look=20, nod=4, left=_SIDE, right=_ROUND_MID),
        2: _via(twist=10, drop=0.01, look=16, nod=-8, side=4, left=_UP, right=_HEART),
        3: _via(twist=14, drop=0.05, look=20, nod=0, side=-4, left=_ROUND_HIGH, right=_LOW),
        4: _via(twist=8, drop=0.00, look=16, nod=-10, side=-6, left=_HEART, right=_UP),
        5: _via(twist=-8, drop=0.085, look=0, nod=4, side=8, left=_LOW, right=_DIAGONAL),
        6: _via(twist=-16, drop=0.105, look=-14, nod=8, side=14, bend=10, left=_ROUND_LOW, right=_UP),
        7: _via(twist=6, drop=0.03, look=6, nod=-4, side=0, bend=0, arms=_SIDE),
        8: _via(twist=0, drop=0.03, look=0, nod=2, arms="low_out"),
    },
    bounce=_BREATH,
)  # fmt: skip

# The leg floats out to the side, low. The body answers with a long line away from it.
TILT = both_sides(Move(
    "tilt", counts=4,
    steps=(
        step("left", 1, (0.0, 0.0), toe_out=20.0),
        kick("right", 2, (-0.46, 0.02), 0.20, toe_out=24.0),
        kick("right", 3, (-0.52, 0.02), 0.30, toe_out=24.0),
        step("right", 4, (0.0, 0.0), weight=0.5),
    ),
    poses={
        1: _via(drop=0.09, bend=12, nod=10, side=-3, arms=_HUG),
        2: _via(drop=0.00, bend=0, nod=0, side=12, look=-8, hip_roll=-4, left=_SIDE, right=_DIAGONAL),
        3: _via(drop=0.02, side=24, twist=6, look=10, tilt=4, hip_roll=-10, left=_LOW, right=_UP),
        4: _via(drop=0.02, side=0, twist=0, bend=0, look=0, tilt=0, nod=-4, hip_roll=0, arms="low_out"),
    },
    bounce=_BREATH,
))  # fmt: skip

# Low, in a wide second position: the arms sweep over the floor from knee to knee and open above it.
PLIE_SWEEP = Move(
    "plié sweep", counts=8,
    steps=(
        step("left", 1, (0.44, 0.0), weight=0.5, toe_out=36.0),
        press("left", 3, weight=0.8),
        press("right", 5, weight=0.8),
        press("right", 7),
        step("left", 8),
    ),
    poses={
        1: _via(drop=0.08, nod=-4, arms=_SIDE),
        2: _via(drop=0.18, bend=22, nod=10, arms=_ROUND_LOW),
        3: _via(drop=0.14, bend=14, side=10, twist=16, look=10, left=_SIDE, right=_HUG),
        4: _via(drop=0.195, bend=28, side=0, twist=0, look=0, nod=12, arms=_GATHER),
        5: _via(drop=0.14, bend=14, side=-10, twist=-16, look=-10, nod=4, left=_HUG, right=_SIDE),
        6: _via(drop=0.08, bend=-4, side=-14, twist=-6, look=-18, nod=-10, left=_UP, right=_SIDE),
        7: _via(drop=0.03, bend=-6, arch=8, side=0, twist=0, look=0, nod=-12, arms=_ROUND_HIGH),
        8: _via(drop=0.02, bend=2, arch=0, nod=2, look=12, twist=6, left="low_out", right=_ROUND_LOW),
    },
    bounce=_BREATH,
)  # fmt: skip

SWING_DROP = Move(
    "drop and rebound", counts=4,
    steps=(
        step("left", 1, (0.10, 0.0), weight=0.5),
        press("left", 3, weight=0.0, pitch=16.0),
        press("right", 3, pitch=16.0),
        step("left", 4),
    ),
    poses={
        1: _via(arch=10, bend=-6, nod=-12, drop=0.00, arms=_UP),
        2: _via(twist=0, look=0, arch=-8, bend=64, nod=20, hip_fwd=-0.13, hip_tilt=14, drop=0.15, arms=_HANG),
        3: _via(arch=12, bend=-8, nod=-16, hip_fwd=0.0, hip_tilt=0, drop=-0.01, left=_UP, right=_DIAGONAL),
        4: _via(arch=-2, bend=6, nod=6, drop=0.05, twist=-10, look=-12, left=_ROUND_MID, right=_LOW),
    },
    bounce=Bounce(0.01, "down", every=2.0, start=2.0),
)  # fmt: skip

WALKING_MELT = Move(
    "walking melt", counts=8,
    steps=(
        step("left", 1, (0.0, 0.30)),
        step("right", 2, (0.0, 0.58)),
        step("left", 3, (0.02, 0.82)),
        press("right", 4, weight=0.4),
        press("right", 5),
        step("left", 6, (0.0, 0.34)),
        step("right", 7),
        step("left", 8),
    ),
    poses={
        1: _via(twist=-6, bend=-2, look=4, left="low_out", right=_FWD),
        2: _via(twist=6, bend=0, look=-4, left=_FWD, right=_SIDE),
        3: _via(twist=-8, drop=0.05, bend=6, look=0, nod=-4, left=_SIDE, right=_DIAGONAL),
        4: _via(twist=-4, drop=0.16, bend=28, arch=-10, nod=18, side=-4, left=_ROUND_MID, right=_HEART),
        5: _via(twist=10, drop=0.12, bend=14, arch=-6, nod=8, side=4, left=_HEART, right=_LOW),
        6: _via(twist=-8, drop=0.04, bend=-2, arch=8, nod=-6, side=0, left=_DIAGONAL, right=_LOW),
        7: _via(twist=6, drop=0.01, bend=-4, arch=8, nod=-8, left=_SIDE, right=_UP),
        8: _via(twist=0, drop=0.02, bend=2, arch=0, nod=2, tilt=5, left="relaxed", right=_ROUND_LOW),
    },
    bounce=_BREATH,
)  # fmt: skip

# Both arms draw one great circle: down through the left, over the top, and down the right.
ARM_CIRCLE = Move(
    "great circle", counts=8,
    steps=(
        step("left", 1, (0.34, 0.0), toe_out=20.0),
        press("right", 3.1),
        press("left", 5.1),
        press("right", 6.9),
        step("left", 8),
    ),
    poses={
        1: _via(drop=0.05, side=6, twist=10, look=14, left=_SIDE, right=_HUG),
        2: _slow(drop=0.12, side=0, bend=22, twist=2, look=0, nod=12, arms=_HANG),
        3: _via(drop=0.06, side=-10, bend=4, twist=-12, look=-16, nod=0, left=_HUG, right=_SIDE),
        4: _slow(drop=0.00, side=-4, bend=-6, arch=6, twist=-4, look=-6, nod=-14, left=_UP, right=_DIAGONAL),
        5: _via(drop=0.02, side=10, bend=-2, twist=10, look=18, nod=-6, left=_DIAGONAL, right=_UP),
        6: _slow(drop=0.09, side=12, bend=14, arch=0, twist=14, look=10, nod=6, left=_LOW, right=_HUG),
        7: _slow(drop=0.06, side=-4, bend=10, twist=-8, look=-6, nod=4, left=_ROUND_LOW, right=_SIDE),
        8: _via(drop=0.01, side=0, bend=0, twist=0, look=0, nod=0, left="loose", right="low_out"),
    },
    bounce=_BREATH,
)  # fmt: skip

# Off balance over the crossing foot, the body winds up. A wide step catches it and it unwinds.
FALL_AND_CATCH = Move(
    "fall and catch", counts=4,
    steps=(
        step("left", 1, (-0.22, 0.29), toe_out=4.0, bow=(0.05, 0.05)),
        step("right", 2, (-0.42, 0.0), toe_out=24.0, bow=(0.0, -0.06)),
        step("left", 3),
        step("right", 4),
    ),
    poses={
        1: _via(twist=18, hip_turn=-10, side=-4, drop=0.03, look=-10, left=_LOW, right=_HUG),
        2: _via(twist=-14, hip_turn=6, side=-12, bend=12, drop=0.1, look=-18, nod=8, left=_HUG, right=_SIDE),
        3: _slow(twist=8, hip_turn=0, side=10, bend=-4, arch=8, drop=0, nod=-9, left=_SIDE, right=_UP),
        4: _via(twist=0, side=0, bend=4, arch=0, drop=0.05, look=4, nod=4, tilt=-4, left=_HEART, right=_LOW),
    },
    bounce=_BREATH,
)  # fmt: skip

CONTEMPORARY = Genre(
    "contemporary",
    (
        REACH,
        BODY_ROLL,
        LUNGE,
        CONTRACTION,
        SPIRAL_TURN,
        TILT,
        PLIE_SWEEP,
        SWING_DROP,
        WALKING_MELT,
        ARM_CIRCLE,
        FALL_AND_CATCH,
    ),
    size=1.01,
    sharpness=0.2,
    half_time_from_bpm=126.0,
    figures=CONTEMPORARY_FIGURES,
    manner=Manner(
        arms=(
            ("second", "fifth"),
            ("reach", "reach_back"),
            ("first", "second"),
            ("wide_up", "low_out"),
            ("fifth", "second"),
            ("across", "out"),
            ("en_bas", "reach"),
            ("second", "first"),
            ("up", "second"),
        ),
        changes=(1.0, 2.0, 2.0),
        flow=0.6,
        twist_deg=10.0,
        side_deg=-4.4,
        swing=1.0,
        glides=True,
        lift_m=0.05,
        varies=0.21,
        turns_vary_deg=16.0,
        look_deg=13.2,
    ),
    steer_deg=30.0,
    carriage=Carriage(
        to_go=0.74,
        through=0.3,
        reach=0.9965,
        stoop_m=-0.015,
        give_m=0.01,
        hip_up=5.0,
        hip_out_m=0.029,
        hip_with_feet=27.6,
        chest_against=0.7,
        looks=10.0,
        arm_swing=14.0,
        arm_play=8.1,
        sinks_m=0.009,
        shoulders_against=0.49,
        lean_into=1.8,
        head_back=2.1,
        arms_open=0.3,
        arm_drag_s=0.029,
        toes_vary=14.8,
        toes_point=45.1,
    ),
    bounce=0.9,
)
