"""Jive: on the balls of the feet, knees and hips that rebound, kicks, flicks and fast chassés."""

from __future__ import annotations

from content.moves.carriage import Carriage
from content.moves.figures import Figure, Manner
from content.moves.notation import Bounce, pose
from content.moves.sequencer import Genre

_CHASSES = "3 L 24 0, 3.5 R 4 0 s, 4 L 20 0, 5 R 24 0, 5.5 L 4 0 s, 6 R 20 0"

FIGURES = (
    Figure("basic in place", 6, "1 L 0 -26 b, 2 R 0 0 p, " + _CHASSES),
    Figure(
        "fallaway rock",
        6,
        "1 L 8 -32 @30 b, 2 R 0 0 p, 3 L 26 4 @-30, 3.5 R 4 0 s, 4 L 20 0, 5 R 24 0,5.5 L 4 0 s, 6 R 20 0",
    ),
    Figure(
        "fallaway throwaway",
        6,
        "1 L 8 -32 @30 b, 2 R 0 0 p, 3 L 14 20 @20, 3.5 R -6 6 s, 4 L 6 22 @30,"
        "5 R 0 24 @20, 5.5 L -6 -4 s, 6 R 4 22",
    ),
    Figure(
        "link",
        6,
        "1 L 0 -30 b, 2 R 0 0 p, 3 L 0 26, 3.5 R -4 -6 s, 4 L 4 24, 5 R 22 4, 5.5 L 4 0 s, 6 R 20 0",
    ),
    Figure(
        "change right to left",
        6,
        "1 L 8 -30 @30 b, 2 R 0 0 p, 3 L 16 8 @-60, 3.5 R 0 4 @-60 s, 4 L 18 4 @-90,"
        "5 R 10 -18 @-60, 5.5 L 0 4 s, 6 R 16 -8",
        arms=(("up", "low_guard"), ("fifth", "out")),
    ),
    Figure(
        "change left to right",
        6,
        "1 L 0 -30 b, 2 R 0 0 p, 3 L 16 14 @70, 3.5 R 0 4 @60 s, 4 L 16 8 @80,"
        "5 R 20 0 @60, 5.5 L 4 0 s, 6 R 18 -6",
        arms=(("up", "low_guard"), ("fifth", "out")),
    ),
    Figure(
        "change hands behind the back",
        6,
        "1 L 0 -30 b, 2 R 0 0 p, 3 L 4 28 @40, 3.5 R 0 2 @40 s, 4 L 6 18 @40,"
        "5 R 14 -16 @30, 5.5 L 2 0 s, 6 R 14 -12 @20",
    ),
    Figure(
        "American spin",
        6,
        "1 L 0 -30 b, 2 R 0 0 p, 3 L 6 16, 3.5 R 0 6 s, 4 L 2 12 @-120, 5 R 14 8 @-180,"
        "5.5 L 2 0 @-60 s, 6 R 18 -4",
    ),
    Figure("whip", 4, "1 L -14 -16 @-60 b, 2 R 26 6 @-70, 3 L 22 2 @-40, 3.5 R 4 0 s, 4 L 20 0"),
    Figure("chassé to the side", 2, "1 L 26 0, 1.5 R 4 0 s, 2 L 24 0"),
    Figure("walks", 4, "1 L -6 26 @-20, 1.5 R 0 2 s, 2 L 2 20, 3 R -6 26 @20, 3.5 L 0 2 s, 4 R 2 20"),
    Figure(
        "stop and go",
        6,
        "1 L 0 -30 b, 2 R 0 0 p, 3 L 4 22 @80, 3.5 R 0 2 @40 s, 4 L 8 10 @50, 5 R 0 -36, 6 L 0 0 p",
        poses={5: pose(drop=0.05, bend=10)},
    ),
    Figure(
        "windmill",
        6,
        "1 L 0 -26 b, 2 R 0 0 p, 3 L 12 18 @40, 3.5 R 0 4 @30 s, 4 L 16 8 @40, 5 R 12 16 @40,"
        "5.5 L 0 4 @30 s, 6 R 14 8 @40",
        arms=(("out", "out"), ("wide_up", "low_out")),
    ),
    Figure(
        "Spanish arms",
        6,
        "1 L 0 -28 b, 2 R 0 0 p, 3 L 8 18 @-50, 3.5 R 0 2 @-50 s, 4 L 10 4, 5 R 12 10 @60,"
        "5.5 L 0 2 @60 s, 6 R 14 -6",
        arms=(("across", "head"), ("fifth", "chest")),
    ),
    Figure(
        "chicken walks",
        4,
        "1 L -4 -20 @20, 2 R -4 -20 @-40, 3 L -4 -20 @40, 4 R -4 -20 @-20",
        poses={c: pose(drop=0.03, bend=-4) for c in (1, 2, 3, 4)},
    ),
    Figure(
        "toe heel swivels",
        8,
        "1 L 4 4 @-30 t, 2 L 6 16 @40 h, 3 L -14 12 @-10, 4 R 4 4 @30 t, 5 R 6 16 @-40 h,"
        "6 R -14 12 @10, 7 L 20 0, 7.5 R 4 0 s, 8 L 20 0",
    ),
    Figure(
        "flicks into break",
        8,
        "1 L 2 40 k24, 2 L 0 0, 3 R 2 40 k24, 4 R 0 0, 5 L 10 36 k22, 6 L 0 -10, 7 R 22 0, 8 L 0 0",
    ),
    Figure("kick ball change", 2, "1 L 4 38 k22, 1.5 L 0 -10 s, 2 R 0 4"),
    Figure(
        "rolling off the arm",
        6,
        "1 L 6 -28 @20 b, 2 R 0 0 p, 3 L 8 20 @-70, 3.5 R 0 4 @-50 s, 4 L 8 14 @-70,"
        "5 R 4 20 @-60, 5.5 L 0 4 s, 6 R 6 18 @-50",
    ),
    Figure("simple spin", 4, "1 L 6 18 @-150, 2 R 2 12 @-170, 3 L 22 0 @-20, 3.5 R 4 0 s, 4 L 20 0"),
    Figure(
        "miami special",
        6,
        "1 L 0 -28 b, 2 R 0 0 p, 3 L 2 26 @90, 3.5 R 0 2 @50 s, 4 L 6 16 @60, 5 R 22 -4,"
        "5.5 L 4 0 s, 6 R 20 0",
    ),
    Figure(
        "catapult",
        6,
        "1 L 0 -30 b, 2 R 0 0 p, 3 L 0 32, 3.5 R -6 -4 s, "
        "4 L 2 28 @60, 5 R 6 18 @120, 5.5 L 2 2 @60 s, 6 R 18 0",
    ),
    Figure(
        "skip and flick", 4, "1 L 18 10, 1.5 R 10 -30 k18, 2 R -8 12, 3 L 18 10, 3.5 R 10 -30 k18, 4 R -8 12"
    ),
    Figure(
        "mooch",
        8,
        "1 L 0 -28 b, 2 R 0 0 p, 3 L 4 38 k20, 4 L 0 0, 5 R 0 -28 b, 6 L 0 0 p, 7 R 4 38 k20, 8 R 0 0",
    ),
)

MANNER = Manner(
    arms=(
        ("guard", "low_guard"),
        ("low_guard", "swing_out"),
        ("out", "guard"),
        ("pump_high", "low_guard"),
        ("swing_fwd", "elbow_back"),
        ("hold_out", "low_guard"),
        ("chest", "out"),
        ("elbow_out", "pump_low"),
    ),
    changes=(1.0, 2.0, 2.0),
    levels_m=(0.0, 0.03),
    bounce=Bounce(0.018, "down"),
    twist_deg=6.7,
    side_deg=-2.0,
    ball_deg=20.0,
    settles={"twist": 8.0, "bend": 4.0},
    swing=0.85,
    lift_m=0.051,
    varies=0.2,
    turns_vary_deg=10.4,
)

JIVE = Genre(
    "jive",
    figures=FIGURES,
    manner=MANNER,
    sharpness=0.6,
    bounce=1.0,
    size=1.38,
    steer_deg=30.0,
    carriage=Carriage(
        posture=6.5,
        to_go=0.65,
        through=0.5,
        reach=0.996,
        stoop_m=-0.02,
        give_m=0.008,
        hip_up=7.0,
        hip_out_m=0.029,
        hip_with_feet=18.4,
        chest_against=0.8,
        shoulders_against=0.8,
        looks=16.0,
        arm_swing=16.0,
        arm_play=8.0,
        sinks_m=0.014,
        turned=1.0,
        left_behind=1.3,
        sway=0.8,
        arms_open=8.0,
        arm_throw=0.7,
        toes_sweep=23.2,
        toes_point=43.5,
    ),
)
