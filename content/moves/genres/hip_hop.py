"""Hip-hop: low and heavy, knees soft, the groove drops into every count. The arms have a swagger."""

from __future__ import annotations

from dataclasses import replace

from content.moves.arm_poses import Arm
from content.moves.genres.street_figures import CARRIAGE, MANNER, street
from content.moves.notation import Bounce, Move, Side, Step, ball, kick, other, pose, press, step, touch
from content.moves.sequencer import Genre

_DEEP = Bounce(0.05, "down")

# Fists side by side in front, at four quarters of a flat circle. Near and far are the same for both arms.
_NEAR = Arm((0.62, -0.75, -0.10), (-0.60, 0.15, 0.75), 5, 25)
_FAR = Arm((0.25, -0.45, 0.75), (-0.30, 0.05, 1.0), 5, 25)
_OWN_SIDE = Arm((0.75, -0.65, 0.20), (0.10, 0.12, 1.0), 5, 25)
_OTHER_SIDE = Arm((0.15, -0.60, 0.60), (-0.95, 0.12, 0.45), 5, 25)
# The wave along one arm: flat, hand dropped, elbow up, shoulder up.
_FLAT = Arm((1.0, -0.05, 0.12), (1.0, 0.0, 0.20), 0, 20)
_HAND_DOWN = Arm((1.0, 0.02, 0.12), (0.95, 0.28, 0.20), 65, 20)
_ELBOW_UP = Arm((0.95, 0.35, 0.12), (0.80, -0.62, 0.25), -45, 20)
_SHOULDER_UP = Arm((0.85, -0.50, 0.12), (0.95, 0.22, 0.25), 15, 20)
# The bent arm that swings like a pendulum in front of the body, and behind it.
_PENDULUM_IN = Arm((0.30, -0.80, 0.50), (-0.88, -0.30, 0.55), 15, 25)
_PENDULUM_OUT = Arm((0.85, -0.55, -0.15), (0.55, -0.75, 0.20), 10, 25)
_CROSS_OVER = Arm((0.12, -0.66, 0.70), (-0.72, -0.35, 0.60), 10, 25)  # over the other arm
_SHOULDER_BRUSH = Arm((0.25, -0.35, 0.80), (-0.75, 0.55, -0.10), 20, 20)

TWO_STEP = Move(
    "two step", counts=4,
    steps=(
        step("left", 1, (0.34, 0.02), toe_out=14.0),
        touch("right", 2, (0.30, 0.04)),
        step("right", 3, (0.0, 0.0), toe_out=14.0),
        touch("left", 4, (0.02, 0.02)),
    ),
    poses={
        1: pose(bend=10, side=7, twist=8, look=10, nod=6, left="elbow_back", right="swing_in"),
        2: pose(
            bend=4, side=-4, twist=-12, hip_roll=-5, look=4, nod=-2, left="pump_high", right="swing_back"
        ),
        3: pose(bend=10, side=-7, twist=-8, look=-10, nod=6, left="swing_in", right="elbow_back"),
        4: pose(bend=4, side=4, twist=12, hip_roll=5, look=-4, nod=-2, left="swing_back", right="pump_high"),
    },
    bounce=_DEEP,
)  # fmt: skip

# Feet wide, the chest sinks into the count, one shoulder first.
GROOVE = Move(
    "groove down", counts=4,
    steps=(
        step("left", 1, (0.20, 0.0), toe_out=18.0),
        press("right", 2),
        touch("left", 4),
    ),
    poses={
        1: pose(
            bend=14, arch=-8, side=8, twist=14, hip_side=0.02, nod=8, look=8, left="low_guard", right="guard"
        ),
        2: pose(
            bend=14, arch=-8, side=-8, twist=-14, hip_side=0.0, nod=8, look=-8,
            left="guard", right="low_guard",
        ),
        3: pose(
            bend=20, arch=-10, side=10, twist=16, hip_side=0.04, drop=0.05, nod=4, look=0,
            left="swing_back", right="pump_high",
        ),
        4: pose(
            bend=-2, arch=8, side=-4, twist=-10, hip_side=0.0, drop=0.0, nod=-6, look=0,
            left="guard", right="swing_back",
        ),
    },
    bounce=Bounce(0.04, "down"),
)  # fmt: skip

# Side to side like on a skateboard: both arms swing across, the trailing foot drags behind.
BART_SIMPSON = Move(
    "bart simpson", counts=4,
    steps=(
        step("left", 1, (0.36, 0.0), toe_out=24.0),
        touch("right", 2, (0.22, -0.20), toe_out=-6.0, lift=0.02),
        step("right", 3, (0.0, 0.0), toe_out=24.0),
        touch("left", 4, (0.06, 0.0), lift=0.02),
    ),
    poses={
        1: pose(
            bend=8, side=-9, twist=-16, hip_side=0.03, look=22, tilt=-4,
            left=_PENDULUM_OUT, right=_PENDULUM_IN,
        ),
        2: pose(
            bend=16, side=8, twist=14, drop=0.04, hip_side=0.0, look=10, nod=4,
            left=_PENDULUM_IN, right=_PENDULUM_OUT,
        ),
        3: pose(
            bend=8, side=9, twist=16, drop=0.0, hip_side=-0.03, look=-22, tilt=4,
            left=_PENDULUM_IN, right=_PENDULUM_OUT,
        ),
        4: pose(
            bend=12, side=-6, twist=-14, hip_side=0.0, look=-8, nod=4, left=_PENDULUM_OUT, right=_PENDULUM_IN
        ),
    },
    bounce=Bounce(0.04, "down"),
)  # fmt: skip

# The fists stir a big flat bowl, the chest goes round with them: half a circle a count.
CABBAGE_PATCH = Move(
    "cabbage patch", counts=4,
    steps=(
        step("left", 1, (0.20, 0.0), toe_out=16.0),
        press("right", 2),
        touch("left", 4),
    ),
    poses={
        0.5: pose(bend=10, arms=_FAR, flow=1.0),
        1: pose(bend=5, side=9, twist=16, hip_side=0.04, look=6, nod=4, left=_OWN_SIDE, right=_OTHER_SIDE),
        1.5: pose(bend=-4, arms=_NEAR, flow=1.0),
        2: pose(
            bend=5, side=-9, twist=-16, hip_side=0.0, look=-6, nod=4, left=_OTHER_SIDE, right=_OWN_SIDE
        ),
        2.5: pose(bend=12, arms=_FAR, flow=1.0),
        3: pose(bend=5, side=9, twist=16, hip_side=0.07, look=6, nod=4, left=_OWN_SIDE, right=_OTHER_SIDE),
        3.5: pose(bend=-4, arms=_NEAR, flow=1.0),
        4: pose(
            bend=5, side=-9, twist=-16, hip_side=0.0, look=-6, nod=4, left=_OTHER_SIDE, right=_OWN_SIDE
        ),
    },
    bounce=Bounce(0.035, "down"),
)  # fmt: skip


def _running(foot: Side, count: int) -> tuple[Step, Step, Step]:
    return (
        kick(foot, count, (0.0, 0.16), 0.26),
        step(foot, count + 1, (0.0, 0.05)),
        touch(other(foot), count + 1.5, (0.0, -0.12), lift=0.015, swing=0.5),
    )


# A knee comes up, then it stamps down as the other foot slides back from under the body.
RUNNING_MAN = Move(
    "running man", counts=8,
    steps=(
        *_running("left", 1),
        *_running("right", 3),
        *_running("left", 5),
        kick("right", 7, (0.0, 0.16), 0.26),
        step("right", 8, (0.0, 0.03)),
    ),
    poses={
        1: pose(bend=-4, twist=-14, hip_tilt=-6, nod=-2, drop=-0.01, left="pump_low", right="pump_high"),
        2: pose(bend=16, twist=8, hip_tilt=3, nod=6, drop=0.05, arms="elbow_back"),
        3: pose(bend=-4, twist=14, hip_tilt=-6, nod=-2, drop=-0.01, left="pump_high", right="pump_low"),
        4: pose(bend=16, twist=-8, hip_tilt=3, nod=6, drop=0.05, arms="elbow_back"),
        5: pose(bend=-4, twist=-14, hip_tilt=-6, nod=-2, drop=-0.01, arms="pump_high"),
        6: pose(bend=16, twist=8, hip_tilt=3, nod=6, drop=0.05, arms="elbow_back"),
        7: pose(bend=-4, twist=14, hip_tilt=-6, nod=-2, drop=-0.01, arms="pump_high"),
        8: pose(bend=12, twist=-4, hip_tilt=2, nod=5, drop=0.02, arms="low_guard"),
    },
    bounce=Bounce(0.01, "down"),
)  # fmt: skip

# The wave runs from the right hand over the shoulders to the left one, and back.
ARM_WAVE = Move(
    "arm wave", counts=8,
    steps=(
        step("left", 1, (0.22, 0.0), toe_out=16.0),
        press("right", 2),
        press("left", 4),
        press("right", 6),
        touch("left", 8),
    ),
    poses={
        1: pose(side=-5, twist=-6, look=-40, nod=4, left=_FLAT, right=_HAND_DOWN),
        2: pose(side=-8, twist=-4, look=-36, nod=-2, right_shrug=4, left=_FLAT, right=_ELBOW_UP),
        3: pose(side=-3, twist=0, look=-16, arch=-8, bend=6, right_shrug=18, left=_FLAT, right=_SHOULDER_UP),
        4: pose(
            side=5, twist=2, look=16, arch=8, bend=-2, right_shrug=0, left_shrug=18,
            left=_SHOULDER_UP, right=_FLAT,
        ),
        5: pose(side=8, twist=4, look=36, arch=0, bend=0, left_shrug=4, left=_ELBOW_UP, right=_FLAT),
        6: pose(side=4, twist=8, look=40, nod=4, left_shrug=0, left=_HAND_DOWN, right=_FLAT),
        7: pose(side=6, twist=0, look=10, arch=-8, bend=8, nod=6, arms=_SHOULDER_UP),
        8: pose(side=0, twist=0, look=0, arch=6, bend=0, nod=-2, arms="low_guard"),
    },
    bounce=Bounce(0.03, "down"),
)  # fmt: skip

# From the chin down to the knees, and up again with a shoulder.
BODY_ROLL = Move(
    "body roll", counts=4,
    steps=(
        step("left", 1, (0.14, 0.04), toe_out=16.0),
        press("right", 2, weight=0.5),
        press("right", 3),
        touch("left", 4, (0.02, 0.0)),
    ),
    poses={
        1: pose(arch=24, bend=-2, hip_tilt=12, hip_fwd=-0.05, nod=-12, arms="elbow_back"),
        2: pose(arch=-12, bend=-10, hip_tilt=-20, hip_fwd=0.10, drop=0.04, nod=8, arms="low_guard"),
        3: pose(arch=-14, bend=26, hip_tilt=8, hip_fwd=-0.04, drop=0.09, nod=4, arms="swing_out"),
        4: pose(
            arch=8, bend=-2, hip_tilt=0, hip_fwd=0.0, drop=0.0, side=5, nod=-4,
            left="swing_back", right="guard",
        ),
    },
    bounce=Bounce(0.015, "down"),
)  # fmt: skip

# Twice quick and out to the side, then a slow step each way with a brush of the shoulder.
KICK_BALL_CHANGE = Move(
    "kick ball change", counts=8,
    steps=(
        kick("left", 1, (0.02, 0.50), 0.23),
        ball("left", 1.5, (0.0, -0.12)),
        step("right", 2, (0.0, 0.02)),
        touch("left", 3, (0.32, 0.0), toe_out=18.0),
        touch("left", 4),
        step("left", 5, (0.28, 0.02), toe_out=14.0),
        touch("right", 6, (0.22, 0.12), toe_out=4.0),
        step("right", 7, toe_out=14.0),
        touch("left", 8),
    ),
    poses={
        1: pose(bend=-3, twist=-12, hip_tilt=-6, nod=2, left="swing_back", right="pump_high"),
        2: pose(bend=10, twist=10, hip_tilt=2, nod=5, left="pump_high", right="swing_back"),
        3: pose(bend=6, twist=-6, side=-8, look=14, nod=0, left="low_out", right=_SHOULDER_BRUSH),
        4: pose(bend=8, twist=4, side=3, look=0, nod=6, left="low_guard", right="elbow_back"),
        5: pose(bend=12, twist=12, side=8, look=8, nod=6, drop=0.02, left="swing_back", right="guard"),
        6: pose(bend=0, arch=6, twist=-10, side=-4, hip_roll=-5, look=-6, nod=-4, drop=0.0,
                left=_SHOULDER_BRUSH, right="low_out"),
        7: pose(
            bend=12, arch=0, twist=-12, side=-8, hip_roll=0, look=-8, nod=6, left="guard", right="swing_back"
        ),
        8: pose(bend=2, twist=8, side=3, hip_roll=4, look=0, nod=0, left="swing_back", right="pump_high"),
    },
    bounce=Bounce(0.035, "down"),
)  # fmt: skip

# The leg flies out to the side, the body leans away from it, and both arms fly against it.
STEVE_MARTIN = Move(
    "steve martin", counts=4,
    steps=(
        kick("left", 1, (0.42, 0.04), 0.17),
        step("left", 2),
        kick("right", 3, (-0.42, 0.04), 0.17),
        step("right", 4),
    ),
    poses={
        1: pose(side=-12, hip_roll=6, twist=-8, tilt=-4, look=16, left="swing_in", right="wide_up"),
        2: pose(side=3, hip_roll=0, twist=6, bend=12, look=0, nod=6, arms="elbow_back"),
        3: pose(
            side=12, hip_roll=-6, twist=8, bend=0, tilt=4, look=-16, nod=0, left="wide_up", right="swing_in"
        ),
        4: pose(side=-3, hip_roll=0, twist=-6, bend=12, look=0, nod=6, arms="elbow_back"),
    },
    bounce=Bounce(0.045, "down"),
)  # fmt: skip

# Out, cross, out, in: Kriss Kross jumped it.
CRISS_CROSS = Move(
    "criss cross", counts=4,
    steps=(
        step("left", 1, (0.12, -0.06), toe_out=16.0),
        step("right", 2, (0.36, 0.25), bow=(0.0, 0.08), toe_out=4.0),
        step("left", 3, (0.36, 0.0), bow=(0.0, -0.12), toe_out=14.0),
        step("right", 4, (0.31, 0.0), bow=(0.0, 0.04)),
    ),
    poses={
        1: pose(bend=6, side=4, twist=-8, look=6, arms="low_out"),
        2: pose(bend=12, twist=14, hip_turn=10, nod=6, look=-4, left="cross_low", right=_CROSS_OVER),
        3: pose(bend=4, side=-4, twist=-10, hip_turn=0, nod=-2, look=10, left="low_out", right="guard"),
        4: pose(bend=12, twist=6, nod=8, look=0, left="elbow_back", right="low_guard"),
    },
    bounce=_DEEP,
)  # fmt: skip

HIP_HOP = Genre(
    "hip-hop",
    (
        TWO_STEP,
        GROOVE,
        BART_SIMPSON,
        CABBAGE_PATCH,
        RUNNING_MAN,
        ARM_WAVE,
        BODY_ROLL,
        KICK_BALL_CHANGE,
        STEVE_MARTIN,
        CRISS_CROSS,
    ),
    size=1.11,
    sharpness=0.42,
    bounce=1.06,
    figures=street("running man", "kick ball change"),
    manner=replace(
        MANNER,
        bounce=Bounce(0.032, "down"),
        groove_deg=8.0,
        twist_deg=10.3,
        side_deg=0.6,
        look_deg=14.7,
        lift_m=0.069,
        ball_deg=23.0,
    ),
    steer_deg=30.0,
    carriage=replace(
        CARRIAGE,
        lean=-0.5,
        posture=5.2,
        looks=6.1,
        reach=0.9955,
        to_go=0.44,
        stoop_m=-0.015,
        hip_out_m=0.024,
        chest_against=0.89,
        lean_into=0.8,
        left_behind=0.7,
        sway=0.4,
        head_back=1.1,
        arms_back=-1.2,
        arms_open=1.8,
        toes_vary=9.2,
        toes_sweep=21.3,
    ),
)
