"""Charleston: kicks before and behind, twisting feet, swinging arms, knees that never rest."""

from __future__ import annotations

from content.moves.carriage import Carriage
from content.moves.figures import Figure, Manner
from content.moves.notation import Bounce, pose
from content.moves.sequencer import Genre

_FIGURES_4 = (
    Figure("twenties basic", 4, "1 L 0 24, 2 R 2 42 k22, 3 R 0 -8, 4 L 2 -44 t"),
    Figure("step kick", 2, "1 L 4 16, 2 R 2 44 k26"),
    Figure("step kick back", 2, "1 L 2 -16, 2 R 0 -36 k20"),
    Figure("side kicks", 4, "1 L 14 0, 2 R 38 10 k22, 3 R 6 4, 4 L 38 10 k22"),
    Figure("crossing kicks", 4, "1 L 6 6, 2 R -20 40 k24, 3 R 14 -6, 4 L -20 40 k24"),
    Figure(
        "twisted toes",
        4,
        "1 L 12 4 @-25, 2 R 4 4 @50 b, 3 L 8 4 @-50 b, 4 R 4 4 @25 b",
        poses={1: pose(drop=0.02), 3: pose(drop=0.02)},
    ),
    Figure(
        "scarecrow",
        4,
        "1 L 16 0, 2 R 30 4 k14, 3 R 12 0, 4 L 30 4 k14",
        arms=(("elbow_out", "elbow_out"), ("out", "elbow_out")),
    ),
    Figure("kick and step back", 4, "1 L 2 44 k26, 2 L 0 -16, 3 R 2 -44 k18, 4 R 0 6"),
    Figure(
        "mess around",
        4,
        "1 L 14 6 @20, 2 R 10 -4 @20, 3 L 12 -6 @20, 4 R 10 6 @20",
        poses={c: pose(drop=0.04, bend=14) for c in (1, 2, 3, 4)},
    ),
    Figure(
        "fall off the log",
        4,
        "1 L 30 4 k16, 2 L -16 -10, 3 R 24 2, 4 L -18 12",
        poses={1: pose(side=-10, look=20)},
    ),
    Figure("tick tock", 4, "1 L 10 0 @-18 b, 2 R 10 0 @36 b, 3 L 10 0 @-36 b, 4 R 10 0 @18 b"),
    Figure(
        "shorty George",
        4,
        "1 L -4 22 @-15, 2 R -4 22 @30, 3 L -4 22 @-30, 4 R -4 22 @15",
        poses={c: pose(drop=0.05) for c in (1, 2, 3, 4)},
    ),
    Figure("boogie forward", 4, "1 L -10 26 @-20, 2 R -10 26 @40, 3 L -10 26 @-40, 4 R -10 26 @20"),
    Figure("boogie back", 4, "1 L 6 -22 @20, 2 R 6 -22 @-40, 3 L 6 -22 @40, 4 R 6 -22 @-20"),
)

_FIGURES_8 = (
    Figure(
        "side by side Charleston",
        8,
        "1 L 0 -26 b, 2 R 0 0 p, 3 L 4 40 k22, 4 L 0 0, 5 R 2 42 k26, 6 R 2 -38 k18, 7 R 0 -8, 8 L 2 -30 t",
    ),
    Figure(
        "tandem Charleston",
        8,
        "1 L 0 -24 b, 2 R 0 0 p, 3 L -8 40 k20, 4 L 4 8, 5 R 8 44 k26, 6 R 4 10 t, 7 R 4 -38 k16, 8 R 0 -6",
    ),
    Figure(
        "kick through turn",
        8,
        "1 L 2 40 k22, 2 L 0 14 @40, 3 R 2 40 k22, 4 R 0 14 @60, "
        "5 L 2 40 k20, 6 L 0 12 @60, 7 R 2 38 k20, 8 R 0 10 @40",
    ),
    Figure(
        "travelling Charleston",
        8,
        "1 L 0 34, 2 R 2 42 k22, 3 R 0 30, 4 L 2 42 k22, 5 L 0 30, 6 R 2 40 k20, 7 R 0 -20, 8 L 2 -36 t",
    ),
    Figure(
        "Charleston around",
        8,
        "1 L 2 26 @40, 2 R 2 40 k22, 3 R 2 22 @40, 4 L 2 40 k22, "
        "5 L 2 24 @40, 6 R 2 40 k22, 7 R 2 20 @40, 8 L 2 6 t",
    ),
    Figure(
        "grapevine Charleston",
        8,
        "1 L 28 0, 2 R -14 -14, 3 L 28 0, 4 R 10 40 k22, 5 R 26 0, 6 L -14 -14, 7 R 28 0, 8 L 10 40 k22",
    ),
    Figure(
        "apple jacks",
        8,
        "1 L 12 6 @-20 b, 2 R 6 6 @20 t, 3 R 14 6 @20 b, 4 L 6 6 @-20 t, "
        "5 L 14 -4 @-20 b, 6 R 6 4 t, 7 R 14 -4 @20 b, 8 L 6 4 t",
    ),
    Figure(
        "Suzie Q",
        8,
        "1 L -18 14 @-40, 2 R 18 0 @30, 3 L -18 14 @-30, 4 R 18 0 @30, "
        "5 L 26 0 @10, 6 R 18 -4, 7 L -14 10, 8 R 22 0",
    ),
    Figure(
        "savoy kicks",
        8,
        "1 L 4 44 k28, 2 L 4 6 t, 3 L 10 40 k24, 4 L 0 -8, 5 R 4 44 k28, 6 R 4 6 t, 7 R 10 40 k24, 8 R 0 -8",
    ),
    Figure(
        "knock knees",
        8,
        "1 L 10 2 @-10 b, 2 R 16 2 @10 b, 3 L 4 0 b, 4 R 16 2 b, "
        "5 L 22 8 k10, 6 L 4 0, 7 R 22 8 k10, 8 R 4 0",
        arms=(("cross_low", "cross_low"), ("low_out", "low_out")),
        poses={1: pose(drop=0.04), 3: pose(drop=0.04)},
    ),
    Figure(
        "walk and lock",
        8,
        "1 L 0 34, 2 R -8 30, 3 L 4 30, 4 R 2 40 k20, 5 R 0 -30, 6 L 4 -28, 7 R 0 -26, 8 L 2 4 t",
    ),
)

MANNER = Manner(
    arms=(
        ("swing_back", "swing_fwd"),
        ("low_out", "swing_in"),
        ("out", "chest"),
        ("swing_out", "across"),
        ("elbow_out", "low_out"),
        ("low_guard", "swing_fwd"),
    ),
    changes=(1.0, 1.0, 2.0),
    levels_m=(0.0, 0.0, 0.035, 0.035),
    bounce=Bounce(0.025, "down"),
    twist_deg=18.4,
    side_deg=-1.0,
    swing=0.8,
    lift_m=0.067,
    ball_deg=20.0,
    varies=0.22,
    turns_vary_deg=8.0,
)

CHARLESTON = Genre(
    "Charleston",
    figures=(*_FIGURES_4, *_FIGURES_8),
    manner=MANNER,
    sharpness=0.5,
    bounce=0.6,
    size=1.29,
    steer_deg=30.0,
    carriage=Carriage(
        stoop_m=-0.01,
        posture=6.8,
        to_go=0.4,
        through=0.6,
        reach=0.9965,
        give_m=0.007,
        hip_up=5.0,
        hip_with_feet=15.3,
        chest_against=1.0,
        looks=11.8,
        arm_swing=26.0,
        arm_play=8.0,
        lean=7.5,
        lean_into=2.7,
        left_behind=1.1,
        sway=2.8,
        arms_open=8.0,
        toes_sweep=30.4,
        toes_point=40.3,
    ),
)
