"""Funk, danced as locking: drops and stops, points, kicks, wide arms."""

from __future__ import annotations

from content.moves.carriage import Carriage
from content.moves.figures import Manner
from content.moves.genres.street_figures import HOPS, LOCKING, WALKS
from content.moves.notation import Bounce
from content.moves.sequencer import Genre

MANNER = Manner(
    arms=(
        ("point_up", "low_guard"),
        ("elbow_out", "elbow_out"),
        ("point_down", "out"),
        ("low_guard", "guard"),
        ("fwd", "elbow_back"),
        ("chest", "low_out"),
        ("roll_high", "roll_low"),
        ("pump_high", "pump_low"),
        ("loose", "swing_out"),
        ("wide_up", "hip"),
    ),
    changes=(1.0, 2.0, 2.0),
    flow=0.25,
    bounce=Bounce(0.028, "down"),
    twist_deg=10.0,
    groove_deg=6.0,
    side_deg=0.0,
    swing=0.89,
    lift_m=0.07,
    varies=0.18,
    turns_vary_deg=12.4,
    toe_out_deg=12.6,
)

FUNK = Genre(
    "funk",
    figures=(*LOCKING, *WALKS, *HOPS),
    manner=MANNER,
    sharpness=0.7,
    bounce=0.96,
    size=1.25,
    steer_deg=30.0,
    carriage=Carriage(
        to_go=0.54,
        through=0.4,
        reach=0.996,
        stoop_m=0.01,
        give_m=0.013,
        hip_up=6.0,
        hip_out_m=0.033,
        hip_with_feet=18.0,
        chest_against=0.8,
        lean=-1.5,
        posture=6.1,
        looks=10.0,
        arm_swing=14.0,
        arm_play=8.0,
        sinks_m=0.01,
        lean_into=1.1,
        left_behind=0.8,
        sway=0.0,
        arms_open=14.2,
        toes_sweep=21.3,
        toes_point=45.7,
    ),
)
