"""Waltz danced alone: a long step down on 1, up through 2 and 3, in the frame that a couple would hold."""

from __future__ import annotations

from content.moves.carriage import Carriage
from content.moves.figures import Figure, Manner
from content.moves.notation import pose
from content.moves.sequencer import Genre

_SWAY = {2: pose(side=-6, tilt=-4), 3: pose(side=-4, look=-12)}

FIGURES = (
    Figure("forward change", 3, "1 L 0 50, 2 R 42 6 b, 3 L 0 0 b", poses=_SWAY),
    Figure("backward change", 3, "1 L 0 -46, 2 R 42 -6 b, 3 L 0 0 b"),
    Figure(
        "natural turn",
        6,
        "1 R 0 52 @-45, 2 L 44 8 @-60 b, 3 R 0 0 @-30 b, 4 L 0 -48 @-45, 5 R 42 -8 @-60 b, 6 L 0 0 @-30 b",
    ),
    Figure(
        "reverse turn",
        6,
        "1 L 0 50 @40, 2 R 46 8 @55 b, 3 L 0 0 @30 b, 4 R 0 -46 @35, 5 L 44 -6 @55 b, 6 R 0 0 @20 b",
        poses=_SWAY,
    ),
    Figure(
        "left box",
        6,
        "1 L 0 46 @20, 2 R 42 8 @25 b, 3 L 0 0 b, 4 R 0 -46 @20, 5 L 42 -8 @25 b, 6 R 0 0 b",
        poses=_SWAY,
    ),
    Figure("whisk", 3, "1 L 0 46, 2 R 40 12 b, 3 L -22 -12 @10 b", poses={3: pose(look=-30, side=-5)}),
    Figure("back whisk", 3, "1 L 0 -44, 2 R 42 -6 b, 3 L -22 -12 @15 b", poses={3: pose(look=-28, side=-5)}),
    Figure("chassé from promenade", 3, "1 R -12 46, 2 L 36 6 b, 2.5 R 2 0 s, 3 L 38 0 b", fastest_bpm=132),
    Figure("progressive chassé", 3, "1 L 0 46 @40, 2 R 38 0 @40 b, 2.5 L 2 0 s, 3 R 38 0 b", fastest_bpm=132),
    Figure("back lock", 3, "1 L 0 -44, 2 R 4 -38 b, 2.5 L -16 8 s, 3 R 6 -38 b", fastest_bpm=132),
    Figure("forward lock", 3, "1 R -8 44, 2 L 4 40 b, 2.5 R -14 -10 s, 3 L 6 40 b", fastest_bpm=132),
    Figure(
        "natural spin turn",
        6,
        "1 R 0 50 @-45, 2 L 44 8 @-60 b, 3 R 0 0 @-30 b, 4 L 0 -34 @-150, 5 R 0 42 @-45 b, 6 L 36 -10 @-20",
    ),
    Figure("impetus turn", 3, "1 L 0 -44 @-40, 2 R 8 -4 @-110 b, 3 L 40 10 @-35 b"),
    Figure("open impetus", 3, "1 L 0 -44 @-35, 2 R 8 -4 @-120 b, 3 L 44 16 @40 b", poses={3: pose(look=35)}),
    Figure("telemark", 3, "1 L 0 48 @50, 2 R 42 8 @100 b, 3 L 38 4 @30", poses=_SWAY),
    Figure("open telemark", 3, "1 L 0 44 @30, 2 R 34 8 @45 b, 3 L 40 14 @-10", poses={3: pose(look=35)}),
    Figure("hesitation change", 3, "1 L 0 -42 @-40, 2 R 42 0 @-80, 3 L 2 4 t", poses={3: pose(side=-9)}),
    Figure("double reverse spin", 3, "1 L 0 46 @60, 2 R 38 12 @130 b, 3 L 2 4 @110 t"),
    Figure("outside change", 3, "1 L 0 -44, 2 R 0 -40 @15 b, 3 L 34 10 @40"),
    Figure(
        "weave",
        6,
        "1 R -10 46, 2 L 4 42 @45 b, 3 R 36 6 @50 b, 4 L -6 -42 @20, 5 R 4 -40 @50 b, 6 L 36 8 @40",
    ),
    Figure(
        "basic weave",
        6,
        "1 R 0 -44 @30, 2 L 36 -8 @50 b, 3 R -8 40 @20 b, 4 L 4 42 @45, 5 R 40 4 @50 b, 6 L -6 -38 @15",
    ),
    Figure(
        "cross hesitation",
        3,
        "1 R -10 44, 2 L 4 16 @50 t",
        poses={2: pose(side=-4, look=25, drop=0.0), 3: pose(side=6, twist=-14, look=-10, drop=-0.04)},
    ),
    Figure("twinkle", 3, "1 L -16 42 @-20, 2 R 38 6 @20 b, 3 L 0 2 @30 b"),
    Figure(
        "contra check",
        6,
        "1 L -8 34 @12, 3 R 0 0 p, 4 L 34 -10 @-20, 5 R 36 4 b, 6 L 0 0 b",
        poses={1: pose(drop=0.055, twist=-16, side=8, look=30), 2: pose(drop=0.05, twist=-6, side=10)},
    ),
    Figure(
        "oversway",
        3,
        "1 L 50 6, 2 R 14 6 t",
        poses={
            1: pose(drop=0.05, side=4),
            2: pose(drop=0.05, side=13, look=40, twist=-8),
            3: pose(drop=0.02, side=-4, twist=12, look=10),
        },
    ),
    Figure("balance to the side", 3, "1 L 46 0, 2 R -4 -12 b, 3 L 0 0 p", poses={2: pose(side=8)}),
    Figure(
        "balance forward",
        3,
        "1 L 0 50, 2 R 2 4 t",
        poses={2: pose(side=-4, look=15, drop=0.0), 3: pose(side=7, twist=-14, look=-10, drop=-0.04)},
    ),
    Figure(
        "turn under the arm",
        3,
        "1 L 14 42 @110, 2 R 0 40 @150 b, 3 L 4 34 @100 b",
        arms=(("fifth", "second"), ("second", "fifth")),
    ),
    Figure("curved run", 3, "1 L 0 50 @25, 2 R 0 48 @25 b, 3 L 2 46 @25 b"),
    Figure("fallaway", 3, "1 L 0 44 @20, 2 R 16 -36 @30 b, 3 L 0 -40 @25 b", poses={2: pose(look=-35)}),
    Figure("pivots", 3, "1 R 0 44 @-160, 2 L 0 -42 @-160, 3 R 0 42 @-30 b", fastest_bpm=150),
)

MANNER = Manner(
    arms=(("frame_up", "frame_round"), ("frame_up", "frame_low")),
    changes=(6.0, 12.0),
    varies=0.19,
    turns_vary_deg=10.3,
    swaps_arms=False,
    levels_m=(0.07, -0.01, -0.05),
    ball_deg=21.0,
    twist_deg=9.0,
    side_deg=-1.7,
    settles={"side": -9.0, "twist": 10.0, "tilt": -6.0},
    toe_out_deg=0.9,
    swing=1.0,
    glides=True,
    lift_m=0.05,
    look_deg=14.4,
)

WALTZ = Genre(
    "waltz",
    figures=FIGURES,
    manner=MANNER,
    bar=3,
    sharpness=0.2,
    bounce=0.0,
    size=1.45,
    steer_deg=15.0,
    stage_m=4.0,
    carriage=Carriage(
        to_go=0.8,
        through=0.63,
        reach=0.9965,
        stoop_m=-0.02,
        give_m=0.0,
        hip_up=5.9,
        hip_out_m=0.005,
        hip_with_feet=5.5,
        chest_against=1.14,
        shoulders_against=-0.14,
        lean=-16.0,
        lean_into=1.8,
        posture=8.5,
        left_behind=0.3,
        sway=-2.7,
        head_still=-0.7,
        head_drag=2.5,
        looks=13.8,
        arm_swing=4.4,
        arm_drag_s=0.016,
        arm_throw=0.0,
        arm_play=2.1,
        sinks_m=0.0,
        turned=0.0,
        arms_back=-1.2,
        arms_open=3.0,
        toes_vary=11.8,
        toes_sweep=21.1,
    ),
)
