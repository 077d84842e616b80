"""Short plans of every kind of engine."""

from __future__ import annotations

from dataclasses import replace

from choreograph.motion.motion import Credits
from choreograph.plan.plan import Plan, PlannedSecond, PlannedWord


def planned(second: int) -> PlannedSecond:
    times = tuple(3.0 + second + 0.05 * i for i in range(21))
    return PlannedSecond(
        second,
        "täke",
        5,
        3.0,
        second,
        0,
        times,
        float(second),
        0.4,
        {"style": 0.5, "mine": -1.0},
        Credits("waltz", "A", "CC0", "x"),
    )


PLAN = Plan(
    song="song", duration_s=2.5, start_s=0.0, repertoire="rep.h5", planner="exact", blending="inertial",
    seed=0, fps=60.0, weights={"style": 1.0}, music_beats_s=(0.5, 1.0),
    seconds=tuple(planned(s) for s in range(3)),
)  # fmt: skip


def word(start_s: float, end_s: float, *, take: str = "täke", pinned: bool = False) -> PlannedWord:
    source_end_s = 4.0 + 1.25 * (end_s - start_s) if take else 0.0
    return PlannedWord(
        start_s, end_s, 3, take, 4.0 if take else 0.0, source_end_s, Credits(licence="CC0"), pinned
    )


PINNED = replace(PLAN, words=(word(0.5, 1.25, pinned=True), word(2.0, 2.5)))
MIXED = replace(PLAN, engine="mixer", seconds=(), words=(word(0.0, 0.75), word(0.75, 1.5), word(1.5, 2.5)))
ROLLED = replace(PLAN, engine="rollout", seconds=(), words=(word(0, 1, take=""), word(1, 2.5, take="")))
