"""Rumba: steps on 2, 3 and 4, and on 1 the hip turns over the straight leg."""

from __future__ import annotations

from content.moves.carriage import Carriage
from content.moves.figures import Figure, Manner
from content.moves.genres.cha_cha import LATIN_ARMS
from content.moves.notation import pose
from content.moves.sequencer import Genre

_OPEN = {3: pose(look=30, twist=-14, left="out", right="reach_back")}

FIGURES = (
    Figure("forward basic", 4, "2 L 0 50, 3 R 0 0 p, 4 L 38 -20"),
    Figure("backward basic", 4, "2 R 0 -50, 3 L 0 0 p, 4 R 38 20"),
    Figure("cucaracha", 4, "2 L 48 0, 3 R 0 0 p, 4 L 2 2"),
    Figure("New Yorker", 4, "2 L -4 54 @-85, 3 R 0 0 p, 4 L 40 0 @85", poses={2: pose(look=-20, twist=-18)}),
    Figure("hand to hand", 4, "2 L 0 -52 @85, 3 R 0 0 p, 4 L 40 0 @-85"),
    Figure("spot turn", 4, "2 L -4 50 @-95, 3 R 0 30 @-180, 4 L 36 0 @-85"),
    Figure(
        "alemana",
        4,
        "2 L -6 50 @-110, 3 R 0 44 @-150, 4 L 20 36 @-100",
        arms=(("up", "chest"), ("fifth", "out")),
    ),
    Figure("fan", 4, "2 L 0 -46 @20, 3 R 4 44 @40, 4 L 10 -48 @55", poses={4: pose(look=35, left="second")}),
    Figure("hockey stick", 4, "2 L 0 46, 3 R 0 50 @-25, 4 L 0 44 @150"),
    Figure("forward walks", 4, "2 L 0 54, 3 R 0 54, 4 L 0 52"),
    Figure("backward walks", 4, "2 R 0 -52, 3 L 0 -52, 4 R 0 -50"),
    Figure("curved walks", 4, "2 L 0 52 @30, 3 R 0 52 @35, 4 L 0 50 @35"),
    Figure(
        "aida",
        4,
        "2 L 0 -50 @60, 3 R 0 -52 @50, 4 L 0 -46 @20",
        poses={4: pose(twist=22, look=35, left="wide_up", right="reach_back")},
    ),
    Figure("natural top", 4, "2 L -20 -18 @-80 b, 3 R 42 6 @-80, 4 L -18 -16 @-70"),
    Figure("opening out", 4, "2 L 46 10 @60, 3 R 0 0 p, 4 L 6 2 @-60", poses=_OPEN),
    Figure("sliding doors", 4, "2 L 10 -44 @30, 3 R 0 0 p, 4 L -24 30 @-20"),
    Figure("hip twist", 4, "2 L 0 46 @20, 3 R 0 0 p, 4 L -8 -30 @-100"),
    Figure(
        "rope spinning",
        4,
        "2 L 0 44 @-140, 3 R 0 42 @-120, 4 L 0 40 @-120",
        arms=(("fifth", "up"), ("up", "second")),
    ),
    Figure(
        "fencing",
        4,
        "2 L -10 58 @-60, 3 R 0 0 p, 4 L 36 -10 @70",
        poses={2: pose(drop=0.05, look=-30, left="fwd", right="out")},
    ),
    Figure("shoulder to shoulder", 4, "2 L -18 50 @-35, 3 R 0 0 p, 4 L 36 -12 @35"),
    Figure("cross and unwind", 4, "2 L -24 28 @-60 b, 3 R 30 4 @-200, 4 L 38 0 @-60"),
    Figure("cross body lead", 4, "2 L 0 50, 3 R 0 0 p, 4 L 40 4 @150"),
    Figure(
        "side lunge",
        4,
        "2 L 60 4, 3.2 R 8 0 t, 4 R 34 4 @20",
        poses={2: pose(drop=0.07, side=12, look=35, left="out", right="up"), 3: pose(drop=0.05, side=6)},
    ),
    Figure("rondé", 4, "2 L 30 40 k6, 3 L -10 -34 @40, 4 R 34 4 @40"),
    Figure("spiral", 4, "2 L 0 50, 3 R 0 50 @40, 4 L 0 44 @150"),
    Figure("three alemanas", 4, "2 L -4 46 @-120, 3 R 4 42 @-160, 4 L 4 40 @-80"),
    Figure("Cuban rocks", 4, "2 L 40 0, 3 R 0 0 p, 4 L 0 0 p"),
    Figure("swivels", 4, "2 L -8 38 @-70, 3 R -8 40 @130, 4 L -6 38 @-80"),
)

MANNER = Manner(
    arms=(*LATIN_ARMS, ("fifth", "second"), ("reach", "second")),
    changes=(1.0, 2.0, 2.0),
    flow=0.6,
    twist_deg=12.0,
    side_deg=-2.2,
    settles={"hip_turn": 16.0, "hip_side": 0.02, "twist": 10.0, "side": 3.0},
    toe_out_deg=22.3,
    swing=0.91,
    glides=True,
    lift_m=0.03,
    varies=0.27,
    turns_vary_deg=12.4,
)

RUMBA = Genre(
    "rumba",
    figures=FIGURES,
    manner=MANNER,
    sharpness=0.3,
    bounce=0.0,
    size=0.82,
    steer_deg=30.0,
    carriage=Carriage(
        to_go=0.7,
        through=0.6,
        reach=0.9965,
        stoop_m=-0.035,
        give_m=0.0,
        hip_up=10.5,
        hip_out_m=0.05,
        hip_with_feet=28.6,
        chest_against=0.8,
        shoulders_against=0.3,
        lean=-3.5,
        lean_into=1.4,
        posture=4.8,
        left_behind=1.0,
        sway=0.0,
        head_still=2.0,
        head_drag=2.4,
        looks=10.5,
        arm_swing=25.2,
        arm_throw=0.3,
        arm_play=7.0,
        sinks_m=0.0,
        head_back=1.0,
        arms_open=8.1,
        arm_drag_s=0.037,
        toes_sweep=28.7,
        toes_point=42.6,
    ),
)
