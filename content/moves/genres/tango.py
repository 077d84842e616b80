"""Tango in the frame of a couple, danced alone: level, into the knees, sudden in head and chest."""

from __future__ import annotations

from content.moves.carriage import Carriage
from content.moves.figures import Figure, Manner
from content.moves.notation import pose
from content.moves.sequencer import Genre

_HEAD = {2: pose(look=40, twist=8), 4: pose(look=35)}

FIGURES = (
    Figure("two walks", 4, "1 L -4 48, 3 R 0 46"),
    Figure("two walks curving", 4, "1 L -4 46 @18, 3 R 0 44 @18"),
    Figure("progressive side step", 4, "1 L 0 40 @10, 2 R 26 4, 3 L -2 44 @10"),
    Figure("progressive link", 4, "1 L 0 44, 2 R 20 4 @-35, 3 L 40 6 @-10", poses=_HEAD),
    Figure("closed promenade", 4, "1 L 42 10, 2 R -16 42, 3 L 36 4 @25, 4 R 0 0", poses=_HEAD),
    Figure("open promenade", 4, "1 L 42 10, 2 R -16 42, 3 L 36 14 @15, 4 R -10 36", poses=_HEAD),
    Figure("open reverse turn", 4, "1 L 0 42 @50, 2 R 36 10 @70, 3 L -6 -40 @20, 4 R 0 -36 @10"),
    Figure("closed finish", 4, "1 R 0 -42 @30, 2 L 32 6 @50, 3 R 0 0"),
    Figure("back corte", 4, "1 L 0 -44, 2 R 0 -40 @30, 3 L 32 8 @50, 4 R 0 0"),
    Figure("rock turn", 4, "1 R 0 40 @-30, 2 L 24 -18 @-20, 3 R 0 26 @-25"),
    Figure("rock back", 4, "1 L 0 -36, 2 R 0 0 p, 3 L 0 -30 @15"),
    Figure(
        "natural twist turn",
        8,
        "1 L 40 8, 2 R -14 42 @-20, 3 L 38 6 @-70, 5 R -22 -18 @-20, 6 L 8 18 @-80, 7 R 4 14 @-90",
        poses=_HEAD,
    ),
    Figure("promenade link", 4, "1 L 42 8, 2 R -14 40 @-25, 4 L 4 2 @30 t"),
    Figure("five step", 4, "1 L 0 42 @10, 2 R 26 -22 @30, 3 L -8 -36, 4 R 0 -30 @-20", poses=_HEAD),
    Figure("four step", 4, "1 L 0 42, 2 R 28 -8 @15, 3 L -8 -38, 4 R 6 4 @-30", poses=_HEAD),
    Figure(
        "fallaway promenade",
        8,
        "1 L 42 8, 2 R -14 42, 3 L 38 6 @-30, 5 R 10 -38 @-30, 6 L 4 -38, 7 R 4 -8 @-40",
    ),
    Figure(
        "contra check",
        4,
        "1 L -8 40 @14, 3 R 0 0 p, 4 L 30 -8 @-25",
        poses={1: pose(drop=0.06, twist=-16, side=6, look=25), 2: pose(drop=0.065, side=9)},
    ),
    Figure(
        "oversway",
        4,
        "1 L 48 4, 3 R 12 6 t",
        poses={
            1: pose(drop=0.05),
            2: pose(drop=0.065, side=12, look=40),
            3: pose(drop=0.05, side=2, twist=-18),
            4: pose(drop=0.03, side=-2, twist=8, look=-10),
        },
    ),
    Figure("brush tap", 4, "1 L 0 40 @30, 2 R 32 4 @30, 3 L 6 0 t, 4 L 14 2 t"),
    Figure("outside swivel", 4, "1 L 0 -42 @-10, 3 R -8 40 @80", poses=_HEAD),
    Figure(
        "chase",
        8,
        "1 L 40 8, 2 R -14 42 @-30, 3 L 38 4 @-30, 4 R 0 38 @-60, 5 L 0 -36 @-60, 6 R 34 -6 @-40, 7 L -8 38",
    ),
    Figure(
        "viennese cross",
        4,
        "1 L 0 40 @50, 2 R 30 8 @60, 2.5 L -18 6 s, 3 R 0 -38 @40, 4 L 30 4 @40",
        fastest_bpm=140,
    ),
    Figure(
        "lunge to the side",
        4,
        "1 L 50 0, 3 R 14 4 t, 4 R 16 2 @-20",
        poses={
            1: pose(drop=0.05, look=-30),
            2: pose(drop=0.06, twist=10, side=8),
            3: pose(drop=0.03, side=2),
        },
    ),
    Figure("corte and recover", 4, "1 R 0 -50, 3 L 0 0 p, 4 R -2 40", poses={1: pose(drop=0.06, bend=-6)}),
    Figure(
        "spanish drag",
        4,
        "1 R 50 -4, 4 L 14 4 t",
        poses={
            1: pose(drop=0.06, side=-8),
            2: pose(drop=0.065),
            3: pose(drop=0.02, look=-35, twist=-18, side=6),
        },
    ),
)

MANNER = Manner(
    arms=(("frame_up", "frame_round"), ("frame_up", "frame_low")),
    changes=(4.0,),
    swaps_arms=False,
    flow=0.3,
    levels_m=(0.019,),
    twist_deg=6.9,
    side_deg=-0.3,
    settles={"twist": 14.0, "side": -3.0, "look": 12.0, "drop": 0.008},
    look_deg=24.7,
    toe_out_deg=9.0,
    swing=1.0,
    lift_m=0.05,
    varies=0.29,
    turns_vary_deg=12.4,
    ball_deg=22.3,
)

TANGO = Genre(
    "tango",
    figures=FIGURES,
    manner=MANNER,
    sharpness=0.9,
    bounce=0.0,
    size=1.35,
    steer_deg=20.0,
    stage_m=4.0,
    carriage=Carriage(
        posture=7.0,
        to_go=0.8,
        left_behind=0.7,
        through=0.4,
        reach=0.9965,
        stoop_m=-0.02,
        give_m=0.0,
        lean=-15.1,
        hip_up=5.8,
        sway=1.1,
        hip_with_feet=27.5,
        chest_against=0.34,
        head_still=-0.9,
        arm_swing=5.6,
        arm_drag_s=0.015,
        arm_throw=2.2,
        arm_play=5.4,
        looks=16.0,
        sinks_m=0.018,
        hip_out_m=0.014,
        turned=4.8,
        shoulders_against=0.02,
        lean_into=1.8,
        head_back=20.5,
        head_drag=2.6,
        arms_back=3.0,
        arms_open=4.5,
        toes_vary=11.0,
        toes_sweep=16.2,
        toes_point=46.0,
    ),
)
