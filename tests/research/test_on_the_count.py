"""Phases of all dances of a genre together, against experts of the genre."""

from __future__ import annotations

import numpy as np

from choreograph.evaluation.scores import DancedPhases
from research.on_the_count import phases_by_genre

RNG = np.random.default_rng(0)


def dance(genre: str, song: str, centre: float) -> DancedPhases:
    return DancedPhases(genre, song, RNG.normal(centre, 0.05, 80) % 1.0)


EXPERTS = [dance("rumba", f"r{i}", 0.8) for i in range(4)] + [
    dance("cha-cha", f"c{i}", 0.0) for i in range(4)
]


def test_phases_pooled_by_genre():
    rng = np.random.default_rng(3)
    made = [
        dance("rumba", "a", 0.8),
        dance("rumba", "b", 0.8),
        dance("cha-cha", "c", 0.5),
        dance("tango", "d", 0),
    ]
    found = phases_by_genre(made, EXPERTS, rng)
    assert list(found) == ["cha-cha", "rumba"]  # no experts in tango
    assert found["rumba"]["phase_nearness"] > 0.9 > 0 > found["cha-cha"]["phase_nearness"]
    assert phases_by_genre([], EXPERTS, rng) == {}
