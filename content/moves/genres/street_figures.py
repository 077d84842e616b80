"""Steps of street and club dances, and how they are danced, which their genres share."""

from __future__ import annotations

from content.moves.carriage import Carriage
from content.moves.figures import Figure, Manner
from content.moves.notation import pose

_LOW = {c: pose(drop=0.06, bend=8) for c in (1, 2)}


MANNER = Manner(
    arms=(
        ("loose", "swing_out"),
        ("low_guard", "guard"),
        ("swing_fwd", "swing_back"),
        ("low_out", "low_guard"),
        ("chest", "low_out"),
        ("pump_low", "guard"),
        ("out", "low_guard"),
        ("hip", "loose"),
    ),
    changes=(1.0, 2.0, 2.0),
    twist_deg=9.0,
    side_deg=-1.0,
    swing=0.9,
    lift_m=0.06,
    varies=0.22,
    turns_vary_deg=10.0,
)
CARRIAGE = Carriage(
    to_go=0.5,
    through=0.5,
    reach=0.996,
    stoop_m=0.0,
    give_m=0.01,
    hip_up=6.0,
    hip_out_m=0.02,
    hip_with_feet=20.0,
    chest_against=0.7,
    arm_swing=14.0,
    arm_play=8.0,
)


def street(*without: str) -> tuple[Figure, ...]:
    """The walks and hops, without those that a genre has as moves of its own."""
    return tuple(figure for figure in (*WALKS, *HOPS) if figure.name not in without)


WALKS = (
    Figure("walk forward", 4, "1 L 0 40, 2 R 0 40, 3 L 0 36, 4 R 4 8 t"),
    Figure("walk back", 4, "1 L 0 -36, 2 R 0 -36, 3 L 2 -32, 4 R 4 -6 t"),
    Figure("walk round", 4, "1 L 0 38 @30, 2 R 0 38 @35, 3 L 0 36 @35, 4 R 8 4 t"),
    Figure("step and drag", 4, "1 L 48 0, 3 R 8 2 t, 4 R 16 0", poses={1: pose(drop=0.05, side=8)}),
    Figure("grapevine", 4, "1 L 36 0, 2 R -16 -18, 3 L 38 4, 4 R 8 0 t"),
    Figure("cross and open", 4, "1 L -18 30 @-25, 2 R 30 -8 @25, 3 L 36 0, 4 R 6 4 t"),
    Figure("three step turn", 4, "1 L 34 4 @90, 2 R 4 38 @170, 3 L 32 -4 @100, 4 R 8 2 t"),
    Figure("pivot turn", 4, "1 L 0 44, 2 R 0 34 @170, 3 L 2 38, 4 R 4 4 t"),
    Figure("jazz square", 4, "1 L -20 24, 2 R 12 -34, 3 L 34 4, 4 R 4 26"),
    Figure("step touch", 4, "1 L 40 4, 2 R 8 4 t, 3 R 40 4, 4 L 8 4 t"),
    Figure("lunge and back", 4, "1 L 46 26 @20, 2 R 0 0 p, 3 L 4 -18, 4 R 8 6 t", poses=_LOW),
)

HOPS = (
    Figure(
        "running man",
        4,
        "1 L 0 22, 1.5 R 2 -24 s, 2 L 0 24, 3 R 0 26, 3.5 L 2 -24 s, 4 R 0 24",
        fastest_bpm=132,
    ),
    Figure("kick step", 4, "1 L 4 42 k24, 2 L 10 4, 3 R 4 42 k24, 4 R 10 4"),
    Figure("kick and cross", 4, "1 L 8 40 k22, 2 L -16 8, 3 R 34 0, 4 L 8 2 t"),
    Figure(
        "kick ball change", 4, "1 L 4 40 k22, 1.5 L 0 -14 s, 2 R 4 10, 3 L 30 8, 4 R 8 4 t", fastest_bpm=150
    ),
    Figure(
        "shuffle to the side", 4, "1 L 30 4, 1.5 R 4 0 s, 2 L 30 0, 3 R -14 -20 b, 4 L 0 0 p", fastest_bpm=150
    ),
    Figure("heel and toe", 4, "1 L 8 26 h, 2 L 4 0, 3 R 10 -22 t, 4 R 24 6"),
    Figure("pas de bourrée", 4, "1 L -14 -18 b, 2 R 26 0, 3 L 14 26, 4 R 8 6 t"),
    Figure("skip round", 4, "1 L 8 30 @40, 2 R 6 30 @50 b, 3 L 8 30 @50, 4 R 6 8 @20"),
    Figure("scissors", 4, "1 L -10 24, 2 R 20 -28, 3 L 4 30, 4 R 10 -24"),
    Figure(
        "slide and close", 4, "1 L 52 -4, 2 R 10 2, 3 L 26 18 @-20, 4 R 8 6 t", poses={1: pose(drop=0.05)}
    ),
    Figure("stomp and turn", 4, "1 L 14 22, 2 R 6 6 t, 3 R 22 -8 @-100, 4 L 6 14 @-70"),
    Figure("box with a kick", 4, "1 L 0 34, 2 R 36 0, 3 L 0 -30, 4 R 14 38 k20"),
)

LOCKING = (
    Figure("skeeter rabbit", 4, "1 L 10 42 k28, 2 L 0 -10, 3 R 24 2, 4 L 6 6 t"),
    Figure("scooby walk", 4, "1 L 6 42 k26, 2 L 2 20, 3 R 6 42 k26, 4 R 2 20"),
    Figure(
        "scooby doo",
        4,
        "1 L 8 34 k20, 2 L 0 8, 3 R -18 18 @20, 4 L 28 -6 @-20",
        arms=(("point_up", "low_guard"), ("point_down", "out")),
    ),
    Figure(
        "stop and go",
        4,
        "1 L 0 40, 2 R 20 8 t, 3 R 24 -20, 4 L 8 6 t",
        poses={1: pose(drop=0.07, bend=12), 2: pose(drop=0.08, bend=14)},
    ),
    Figure("funky walk", 4, "1 L -6 34 @-15, 2 R -6 34 @30, 3 L -6 32 @-30, 4 R 4 6 @15 t"),
    Figure("Alpha", 4, "1 L 0 -20, 2 R 4 48 k34, 3 R 2 10, 4 L 8 4 t", poses={2: pose(bend=-12, drop=0.06)}),
    Figure(
        "jazz split walk", 4, "1 L 50 10, 2 R 0 0 p, 3 L -14 14, 4 R 30 4", poses={1: pose(drop=0.10, bend=8)}
    ),
    Figure("which away", 4, "1 L 42 8 k22, 2 L 10 0, 3 R 42 8 k22, 4 R 10 0"),
    Figure(
        "leo walk",
        4,
        "1 L 0 38 @45, 2 R 6 8 t, 3 R 0 38 @-90, 4 L 6 8 t",
        arms=(("point_up", "chest"), ("fwd", "elbow_back")),
    ),
    Figure(
        "lock and point",
        4,
        "1 L 24 4, 2 R 16 0 t, 3 R 24 4, 4 L 16 0 t",
        arms=(("elbow_out", "elbow_out"), ("point_up", "hip"), ("point_down", "chest")),
        poses={2: pose(drop=0.06, bend=12), 4: pose(drop=0.06, bend=12)},
    ),
)
