"""Viennese waltz: turns without end, changes between them, and little rise. Its songs are fast waltzes."""

from __future__ import annotations

from dataclasses import replace

from content.moves.carriage import Carriage
from content.moves.figures import Figure
from content.moves.genres.waltz import MANNER
from content.moves.notation import pose
from content.moves.sequencer import Genre

FIGURES = (
    Figure(
        "natural turn",
        6,
        "1 R 0 46 @-70, 2 L 30 14 @-70, 3 R 0 0 @-40, 4 L 0 -40 @-70, 5 R 28 -8 @-70, 6 L 0 0 @-40",
    ),
    Figure(
        "reverse turn",
        6,
        "1 L 0 46 @70, 2 R 30 14 @70, 3 L -14 4 @40, 4 R 0 -40 @70, 5 L 28 -8 @70, 6 R 0 0 @40",
    ),
    Figure("natural turn, first half", 3, "1 R 0 48 @-60, 2 L 32 14 @-80, 3 R 0 0 @-40"),
    Figure("natural turn, second half", 3, "1 L 0 -42 @-60, 2 R 30 -8 @-80, 3 L 0 0 @-40"),
    Figure("reverse turn, first half", 3, "1 L 0 48 @60, 2 R 32 14 @80, 3 L -14 4 @40"),
    Figure("forward change", 3, "1 L 0 48, 2 R 26 16, 3 L 0 0"),
    Figure("forward change, turning", 3, "1 L 0 46 @20, 2 R 26 18 @20, 3 L 0 0 @15"),
    Figure("backward change", 3, "1 L 0 -44, 2 R 26 -14, 3 L 0 0"),
    Figure("passing change", 3, "1 R 0 48, 2 L 8 40 b, 3 R 0 34 b"),
    Figure("passing change, back", 3, "1 R 0 -44, 2 L 6 -36 b, 3 R 0 -32 b"),
    Figure("hesitation", 3, "1 L 0 46, 2 R 2 6 t", poses={2: pose(side=-6, look=-20)}),
    Figure("hesitation to the side", 3, "1 L 46 0, 2 R 4 2 t", poses={2: pose(side=-8, look=25)}),
    Figure("hesitation back", 3, "1 L 0 -42, 2 R 4 4 t", poses={2: pose(side=5)}),
    Figure(
        "fleckerl",
        6,
        "1 L 0 22 @90, 2 R 30 6 @60, 3 L -18 -8 @60 b, 4 R 30 4 @70, 5 L -16 12 @60 b, 6 R 26 0 @60",
    ),
    Figure(
        "natural fleckerl",
        6,
        "1 R 0 22 @-90, 2 L 30 6 @-60, 3 R -18 -8 @-60 b, 4 L 30 4 @-70, 5 R -16 12 @-60 b, 6 L 26 0 @-60",
    ),
    Figure(
        "contra check", 3, "1 L -8 34 @14, 2 R 0 0 p, 3 L 20 -10 @-20", poses={1: pose(drop=0.07, twist=-14)}
    ),
    Figure(
        "underarm turn",
        3,
        "1 L 10 42 @120, 2 R 0 34 @140 b, 3 L 4 28 @100 b",
        arms=(("fifth", "second"), ("second", "fifth")),
    ),
    Figure("side sway", 3, "1 L 40 0, 2 R 8 0 t, 3 R 30 0", poses={1: pose(side=8), 3: pose(side=-8)}),
    Figure("curtsey", 3, "1 R -14 -40, 2 L 12 20 t", poses={1: pose(drop=0.06, nod=12), 2: pose(drop=0.05)}),
    Figure(
        "promenade run", 3, "1 L 10 46, 2 R -10 42 b, 3 L 8 42 b", poses={1: pose(look=30), 3: pose(look=25)}
    ),
    Figure("curved run", 3, "1 L 0 48 @25, 2 R 0 44 @30 b, 3 L 0 42 @25 b"),
    Figure("rocking step", 3, "1 L 4 40, 2 R 2 10 b, 3 L 0 0 p"),
    Figure("pivot", 3, "1 R 0 42 @-150, 2 L 0 -38 @-150, 3 R 0 38 @-40 b"),
    Figure("whisk", 3, "1 L 0 42, 2 R 34 10, 3 L -20 -12 b", poses={3: pose(look=-30)}),
    Figure("chassé from promenade", 3, "1 R -12 44, 2 L 30 6, 3 R 0 0 b"),
)

VIENNESE_WALTZ = Genre(
    "Viennese waltz",
    figures=FIGURES,
    manner=replace(
        MANNER,
        levels_m=(0.02, -0.005, -0.015),
        ball_deg=20.0,
        lift_m=0.045,
        swing=1.0,
        twist_deg=10.0,
        side_deg=-1.0,
        toe_out_deg=8.6,
        look_deg=14.0,
        varies=0.2,
        turns_vary_deg=10.0,
    ),
    bar=3,
    sharpness=0.2,
    bounce=0.08,
    size=1.3,
    steer_deg=25.0,
    carriage=Carriage(
        reach=0.9965,
        to_go=0.9,
        through=0.8,
        stoop_m=-0.01,
        give_m=0.002,
        toes_point=42.5,
        hip_up=4.5,
        hip_out_m=0.025,
        hip_with_feet=2.0,
        chest_against=1.0,
        shoulders_against=-0.4,
        lean=-15.0,
        lean_into=3.0,
        posture=8.9,
        sway=-3.6,
        head_still=-0.7,
        head_drag=2.5,
        looks=13.5,
        arms_open=0.3,
        arm_swing=1.0,
        arm_drag_s=0.02,
        arm_throw=0.0,
        arm_play=1.2,
    ),
)
