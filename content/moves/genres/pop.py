"""Pop, what people dance to a chart song: steps to the side, turns, and arms that draw lines."""

from __future__ import annotations

from content.moves.carriage import Carriage
from content.moves.figures import Manner
from content.moves.genres.street_figures import HOPS, LOCKING, WALKS
from content.moves.notation import Bounce
from content.moves.sequencer import Genre

MANNER = Manner(
    arms=(
        ("loose", "swing_out"),
        ("low_guard", "guard"),
        ("out", "low_guard"),
        ("swing_fwd", "swing_back"),
        ("chest", "low_out"),
        ("wide_up", "hip"),
        ("head", "low_out"),
        ("across", "out"),
        ("low_out", "chest"),
        ("hip", "loose"),
        ("fwd", "elbow_back"),
        ("clap_open", "clap_open"),
        ("pump_low", "guard"),
    ),
    changes=(1.0, 2.0, 2.0),
    flow=0.5,
    bounce=Bounce(0.022, "down"),
    twist_deg=9.0,
    groove_deg=5.0,
    side_deg=-1.0,
    settles={"twist": 8.0, "bend": 4.0},
    swing=0.9,
    lift_m=0.058,
    varies=0.22,
    turns_vary_deg=12.4,
)

POP = Genre(
    "pop",
    figures=(*WALKS, *HOPS, LOCKING[3], LOCKING[4]),
    manner=MANNER,
    sharpness=0.45,
    bounce=1.0,
    size=1.2,
    steer_deg=30.0,
    carriage=Carriage(
        to_go=0.6,
        through=0.52,
        reach=0.9944,
        give_m=0.01,
        hip_up=7.0,
        hip_out_m=0.038,
        hip_with_feet=20.0,
        chest_against=0.7,
        lean=3.0,
        posture=5.4,
        looks=8.7,
        arm_swing=20.4,
        arm_play=7.0,
        stoop_m=0.0,
        sinks_m=0.015,
        left_behind=1.3,
        sway=0.8,
        head_still=-0.05,
        head_back=0.6,
        head_drag=2.2,
        arms_back=-1.0,
        arms_open=14.2,
        arm_drag_s=0.071,
        arm_throw=0.4,
        toes_sweep=15.9,
        toes_point=45.7,
    ),
)
