"""Figures that travel and turn, of salsa, swing and contemporary, beside the moves of their modules."""

from __future__ import annotations

from content.moves.figures import Figure
from content.moves.notation import pose

SALSA_FIGURES = (
    Figure("mambo forward and back", 8, "1 L 0 38, 2 R 0 0 p, 3 L 0 -34, 5 R 0 -36, 6 L 0 0 p, 7 R 0 32"),
    Figure("side breaks", 8, "1 L 42 4, 2 R 0 0 p, 3 L 2 0, 5 R 42 4, 6 L 0 0 p, 7 R 2 0"),
    Figure(
        "back rocks opening",
        8,
        "1 L 6 -36 @50, 2 R 0 0 p, 3 L 14 10 @-50, 5 R 6 -36 @-50, 6 L 0 0 p, 7 R 14 10 @50",
    ),
    Figure(
        "cross body lead", 8, "1 L 0 38, 2 R 0 0 p, 3 L 24 -10 @85, 5 R 0 40, 6 L 4 36 @60, 7 R 14 -10 @60"
    ),
    Figure(
        "inside turn",
        8,
        "1 L 0 36, 2 R 0 0 p, 3 L 10 20 @60, 5 R 0 38 @90, 6 L 4 30 @160, 7 R 12 -8 @60",
        arms=(("up", "low_guard"), ("fifth", "chest")),
    ),
    Figure(
        "outside turn",
        8,
        "1 L 0 36, 2 R 0 0 p, 3 L 6 -28, 5 R -4 34 @-100, 6 L 0 26 @-170, 7 R 14 4 @-90",
        arms=(("chest", "up"), ("low_out", "fifth")),
    ),
    Figure("spot turn", 8, "1 L -4 36 @-90, 2 R 0 26 @-180, 3 L 24 0 @-80, 5 R 0 -36, 6 L 0 0 p, 7 R 4 30"),
    Figure("grapevine", 8, "1 L -14 -18, 2 R 34 0, 3 L -14 20, 5 R 34 0, 6 L -14 -18, 7 R 32 4"),
    Figure(
        "cumbia step",
        8,
        "1 L -10 -34 @40, 2 R 0 0 p, 3 L 22 14 @-40, 5 R -10 -34 @-40, 6 L 0 0 p, 7 R 22 14 @40",
    ),
    Figure("salsa walks", 8, "1 L 0 38, 2 R 0 36, 3 L 0 36, 5 R 0 38 @25, 6 L 0 36 @25, 7 R 0 34 @25"),
    Figure("enchufla", 8, "1 L 0 -36, 2 R 0 0 p, 3 L 12 30 @100, 5 R 0 -30 @40, 6 L 0 0 p, 7 R 10 28 @40"),
    Figure("copa", 8, "1 L 0 36, 2 R 0 0 p, 3 L 8 -26 @80, 5 R 0 38 @-90, 6 L 6 30 @-120, 7 R 16 6 @-60"),
    Figure("shines crossing", 8, "1 L -16 24, 2 R 28 -20, 3 L 24 0, 5 R -16 24, 6 L 28 -20, 7 R 24 0"),
    Figure(
        "tap and step",
        8,
        "1 L 4 30 t, 2 L 14 6, 3 R 4 30 t, 4 R 14 6, 5 L 0 34, 6 R 0 0 p, 7 L 4 -24, 8 R 6 4",
    ),
)

LINDY_FIGURES = (
    Figure(
        "swing out",
        8,
        "1 L 0 -30 b, 2 R 0 0 p, 3 L 20 26 @60, 3.5 R 4 4 @30 s, 4 L 8 16 @50, 5 R 10 -18 @80,"
        "6 L 0 -34 @60, 7 R 0 -26, 7.5 L 4 2 s, 8 R 2 -14",
        fastest_bpm=170,
    ),
    Figure(
        "lindy circle, travelling",
        8,
        "1 L 0 34 @45, 2 R 4 32 @45, 3 L 4 30 @45, 4 R 4 30 @45, 5 L 4 30 @45,"
        "6 R 4 30 @45, 7 L 4 26 @45, 8 R 8 14 @20",
    ),
    Figure("send out", 6, "1 L 0 32 @30, 2 R 4 30 @40, 3 L 4 -26, 4 R 0 -32, 5 L 4 -22, 6 R 8 6"),
    Figure("pass by", 6, "1 L 0 -30 b, 2 R 0 30, 3 L 6 34 @70, 4 R 4 30 @60, 5 L 4 -20 @50, 6 R 6 -10"),
    Figure(
        "tuck and turn",
        6,
        "1 L 0 -28 b, 2 R 0 0 p, 3 L 6 16 @-30, 4 R 10 22 @160, 5 L 6 16 @160, 6 R 10 -8 @40",
    ),
    Figure(
        "promenade walks",
        8,
        "1 L 0 34 @-20, 2 R 0 34, 3 L 0 32 @10, 4 R 0 34, 5 L 0 32 @10, 6 R 0 32, 7 L 0 28, 8 R 2 6 t",
    ),
    Figure("kick and step through", 4, "1 L 4 42 k24, 2 L 0 24, 3 R 4 42 k24, 4 R 0 24"),
    Figure("sugar push", 6, "1 L 0 36, 2 R 0 32, 3 L 0 4 t, 4 L 0 -34, 5 R 0 -26, 6 L 4 6"),
    Figure(
        "break away",
        8,
        "1 L 4 36, 2 R 4 34, 3 L 30 -10 @20, 4 R 4 2 t, 5 R 0 -36, 6 L 0 -32, 7 R 2 -26, 8 L 6 2 t",
    ),
    Figure("side passes", 4, "1 L 36 6 @20, 2 R -16 20, 3 L 34 -4 @-20, 4 R 6 4 t"),
    Figure(
        "sailor steps",
        4,
        "1 L -14 -18 b, 1.5 R 18 0 s, 2 L 18 12, 3 R -14 -18 b, 3.5 L 18 0 s, 4 R 18 12",
        fastest_bpm=164,
    ),
    Figure(
        "box turn",
        8,
        "1 L 0 34 @45, 2 R 4 4 t, 3 R 30 0 @45, 4 L 4 4 t, 5 L 0 -30 @45, 6 R 4 2 t, 7 R 28 0 @45, 8 L 4 2 t",
    ),
    Figure("rock and go", 4, "1 L 0 -32 b, 2 R 0 0 p, 3 L 0 36, 4 R 0 34"),
)

_LOW = {2: pose(drop=0.10, bend=16, side=6), 3: pose(drop=0.04)}

CONTEMPORARY_FIGURES = (
    Figure(
        "triplet run",
        4,
        "1 L 0 52, 2 R 0 42 b, 3 L 0 40 b, 4 R 0 36",
        poses={1: pose(drop=0.07), 2: pose(drop=-0.03)},
    ),
    Figure(
        "curved triplets",
        6,
        "1 L 0 50 @30, 2 R 0 40 @25 b, 3 L 0 40 @20 b, 4 R 0 50 @30, 5 L 0 40 @25 b, 6 R 0 38 @20 b",
        poses={1: pose(drop=0.07), 2: pose(drop=-0.03), 4: pose(drop=0.07), 5: pose(drop=-0.03)},
    ),
    Figure("deep side lunge", 4, "1 L 56 6, 3 R 0 0 p, 4 L 8 4 t", poses=_LOW),
    Figure("turn on the ball", 4, "1 L 10 30 @60, 2 R 8 16 @160 b, 3 L 12 10 @120, 4 R 10 4 @20"),
    Figure("attitude walk", 4, "1 L 0 44, 2 R 12 -36 k26, 3 R 0 40, 4 L 10 -34 k22"),
    Figure("chaîné turns", 4, "1 L 30 6 @120, 2 R 26 0 @160 b, 3 L 28 0 @160, 4 R 20 4 @-80"),
    Figure(
        "fall and recovery",
        8,
        "1 L 46 24 @20, 3 R 0 0 p, 4 L -16 -26 @-30, 5 R 40 -8 @-40, 7 L 10 30 @30, 8 R 6 4 t",
        poses={
            1: pose(drop=0.07, bend=20, twist=14),
            2: pose(drop=0.12, bend=28),
            4: pose(drop=0.0, bend=-6),
        },
    ),
    Figure("sweep and step back", 4, "1 L 30 30 k5, 2 L -12 -34, 3 R 0 -40 @-40, 4 L 24 6 @-40"),
    Figure("crossing walks", 4, "1 L -14 40 @-20, 2 R -14 40 @35, 3 L -12 38 @-30, 4 R 4 8 @10 t"),
    Figure(
        "balance and suspend",
        4,
        "1 L 0 46, 2 R 4 -30 k30, 4 R 0 -40",
        poses={2: pose(drop=-0.03, arch=8, bend=6)},
    ),
    Figure(
        "spiral down",
        4,
        "1 L 14 30 @80, 2 R -8 18 @120 b, 4 L 34 -10 @40",
        poses={2: pose(drop=0.06, twist=20), 3: pose(drop=0.12, bend=14, twist=-10)},
    ),
    Figure("side chassé", 4, "1 L 40 0, 1.5 R 6 2 s, 2 L 42 4, 3 R -20 20, 4 L 30 -10 @-40"),
    Figure(
        "weight drops",
        4,
        "1 L 36 0, 2 R 36 0, 3 L 34 14 @30, 4 R 8 6 t",
        poses={1: pose(drop=0.07, side=10), 2: pose(drop=0.06, side=-10), 3: pose(drop=0.02)},
    ),
)
