"""Cha-cha: two, three, four-and-one, on straight legs, with hips that settle over every step.

A bar ends its chassé on 1, has its two slow steps on 2 and 3, and begins the next chassé on 4 and.
"""

from __future__ import annotations

from content.moves.carriage import Carriage
from content.moves.figures import Figure, Manner
from content.moves.notation import Bounce, pose
from content.moves.sequencer import Genre

_LINE = {2: pose(twist=-20, look=-24, arch=5, right="wide_up", left="fwd")}

FIGURES = (
    Figure("forward basic", 4, "0.5 L 4 0 s, 1 R 32 0, 2 L 0 44, 3 R 0 0 p, 4 L 22 -14"),
    Figure("backward basic", 4, "0.5 R 4 0 s, 1 L 32 0, 2 R 0 -44, 3 L 0 0 p, 4 R 22 14"),
    Figure("time step", 4, "0.5 L 4 0 s, 1 R 34 0, 2 L -14 -18, 3 R 0 0 p, 4 L 30 10"),
    Figure("New Yorker", 4, "0.5 L 4 0 s, 1 R 32 0, 2 L -4 48 @-85, 3 R 0 0 p, 4 L 32 0 @85", poses=_LINE),
    Figure("hand to hand", 4, "0.5 L 4 0 s, 1 R 32 0, 2 L 0 -46 @80, 3 R 0 0 p, 4 L 32 0 @-80"),
    Figure("spot turn", 4, "0.5 L 4 0 s, 1 R 32 0, 2 L -4 44 @-95, 3 R 0 26 @-180, 4 L 30 0 @-85"),
    Figure("switch turn", 4, "0.5 L 4 0 s, 1 R 30 0, 2 L 0 42 @-60, 3 R 0 30 @-190, 4 L 28 4 @-110"),
    Figure("cucaracha", 4, "0.5 L 4 0 s, 1 R 30 0, 2 L 40 0, 3 R 0 0 p, 4 L 4 0"),
    Figure("forward lock", 4, "0.5 L -14 -10 s, 1 R 0 40, 2 L 0 48, 3 R 0 46, 4 L 2 42"),
    Figure("backward lock", 4, "0.5 R -14 10 s, 1 L 0 -40, 2 R 0 -44, 3 L 0 -42, 4 R 2 -40"),
    Figure(
        "three cha-chas",
        8,
        "0.5 L -14 -10 s, 1 R 4 42, 2 L 0 46, 2.5 R -12 -8 s, "
        "3 L 4 40, 4 R 0 46, 4.5 L -12 -8 s, 5 R 4 40, 6 L 0 44,"
        "7 R 0 0 p, 8 L 0 -40",
    ),
    Figure("shoulder to shoulder", 4, "0.5 L 4 0 s, 1 R 30 0, 2 L -16 44 @-35, 3 R 0 0 p, 4 L 28 -10 @35"),
    Figure(
        "aida",
        4,
        "0.5 L 4 0 s, 1 R 24 -10, 2 L 0 -46 @60, 3 R 0 -46 @45, 4 L 0 -40",
        poses={4: pose(twist=18, look=30, left="out", right="reach_back")},
    ),
    Figure("fan", 4, "0.5 L 4 0 s, 1 R 30 0, 2 L 0 42, 3 R 0 0 p, 4 L 0 -36 @60"),
    Figure(
        "alemana",
        4,
        "0.5 L 4 0 s, 1 R 30 0, 2 L -4 44 @-100, 3 R 0 40 @-150, 4 L 24 20 @-110",
        arms=(("up", "chest"), ("fifth", "out")),
    ),
    Figure("hockey stick", 4, "0.5 L 4 0 s, 1 R 0 36, 2 L 0 46, 3 R 0 42 @-20, 4 L 0 40 @140"),
    Figure("cross basic", 4, "0.5 L 4 0 s, 1 R 32 0, 2 L -24 30 @-40, 3 R 0 0 p, 4 L 30 0 @40"),
    Figure(
        "Cuban breaks",
        4,
        "0.5 L 4 0 s, 1 R 30 0, 2 L -20 28 @-20, 2.5 R 0 0 p, 3 L 30 -20 @20, 4 R 26 0",
        fastest_bpm=140,
    ),
    Figure(
        "split Cuban breaks",
        4,
        "0.5 L 4 0 s, 1 R 34 0, 2 L -20 26 @-25, 2.5 R 0 0 p, 3 L 36 -10 @25, 4 R 22 0",
        fastest_bpm=140,
    ),
    Figure("rondé chassé", 4, "0.5 L 4 0 s, 1 R 30 0, 2 L 0 44, 3 R 0 0 p, 4 L -14 -22 @30 b"),
    Figure("hip twist", 4, "0.5 L 4 0 s, 1 R 28 0, 2 L 0 40 @20, 3 R 0 0 p, 4 L -10 -26 @-70"),
    Figure(
        "natural top", 4, "0.5 L 4 0 s, 1 R 34 4 @-60, 2 L -18 -18 @-70 b, 3 R 34 6 @-70, 4 L -18 -18 @-70 b"
    ),
    Figure("chase", 4, "0.5 L 4 0 s, 1 R 26 0, 2 L 0 44 @-20, 3 R 0 28 @-170, 4 L 2 42"),
    Figure("swivels", 4, "0.5 L 4 0 s, 1 R 4 36, 2 L -10 34 @-45, 3 R -10 36 @75, 4 L -10 32 @-65"),
    Figure("kick and cross", 4, "0.5 L 4 0 s, 1 R 28 0, 2 L 6 44 k22, 3 L -10 10, 4 R 24 -6"),
    Figure("follow my leader", 4, "0.5 L 4 0 s, 1 R 4 34, 2 L 0 44 @-160, 3 R 0 38, 4 L 2 42"),
    Figure("turkish towel", 4, "0.5 L 4 0 s, 1 R 34 6 @50, 2 L 0 -44 @60, 3 R 0 0 p, 4 L 10 36 @-70"),
    Figure("side step turn", 4, "0.5 L 4 0 s, 1 R 36 0, 2 L 4 0 @-30, 3 R 36 0 @-120, 4 L 30 4 @-180"),
)

LATIN_ARMS = (
    ("out", "chest"),
    ("low_out", "swing_in"),
    ("hold_out", "low_guard"),
    ("hold_out", "across"),
    ("guard", "low_out"),
    ("head", "hold_out"),
    ("low_guard", "out"),
    ("chest", "hold_out"),
    ("second", "first"),
    ("hold_out", "guard"),
    ("elbow_out", "low_guard"),
)

MANNER = Manner(
    arms=LATIN_ARMS,
    changes=(1.0, 2.0, 2.0),
    bounce=Bounce(0.010, "up"),
    twist_deg=17.0,
    side_deg=-0.3,
    toe_out_deg=18.9,
    swing=0.95,
    lift_m=0.056,
    varies=0.3,
    turns_vary_deg=8.0,
    look_deg=10.9,
    ball_deg=25.7,
)

CHA_CHA = Genre(
    "cha-cha",
    figures=FIGURES,
    manner=MANNER,
    sharpness=0.5,
    bounce=0.54,
    half_time_from_bpm=168.0,
    size=1.13,
    steer_deg=30.0,
    carriage=Carriage(
        to_go=0.9,
        through=0.4,
        reach=0.9965,
        stoop_m=-0.02,
        give_m=0.016,
        hip_up=11.0,
        hip_out_m=0.022,
        hip_with_feet=24.4,
        chest_against=0.2,
        shoulders_against=0.06,
        lean=1.0,
        lean_into=0.8,
        posture=3.6,
        left_behind=2.6,
        sway=0.6,
        head_still=2.0,
        head_drag=1.7,
        looks=9.0,
        arm_swing=35.0,
        arm_drag_s=0.059,
        arm_throw=3.0,
        arm_play=9.0,
        sinks_m=0.0,
        turned=14.6,
        head_back=1.0,
        arms_back=8.2,
        arms_open=14.1,
        toes_vary=16.8,
        toes_sweep=21.3,
        toes_point=45.7,
    ),
)
