"""Phases of dances against experts of the genre to other songs."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic_motions import stepping

from choreograph.evaluation.scores import DancedPhases, danced_phases, phase_scores

RNG = np.random.default_rng(0)


def dance(genre: str, song: str, centre: float) -> DancedPhases:
    return DancedPhases(genre, song, RNG.normal(centre, 0.05, 80) % 1.0)


EXPERTS = [dance("rumba", f"r{i}", 0.8) for i in range(4)] + [
    dance("cha-cha", f"c{i}", 0.0) for i in range(4)
]


@pytest.mark.parametrize(("genre", "centre"), [("rumba", 0.8), ("cha-cha", 0.0)])
def test_a_dance_is_compared_with_its_own_genre(genre, centre):
    like = phase_scores(dance(genre, "new", centre), EXPERTS, np.random.default_rng(1)).values
    unlike = phase_scores(dance(genre, "new", centre + 0.5), EXPERTS, np.random.default_rng(1))
    assert like["phase_nearness"] > 0.8 > 0 > unlike.values["phase_nearness"]
    assert like["phase_distance"] < unlike.chance["phase_distance"] < unlike.values["phase_distance"]


def test_a_songs_own_expert_is_left_out():
    rng = np.random.default_rng(2)
    odd = [*EXPERTS[:3], dance("rumba", "same", 0.3)]
    assert phase_scores(dance("rumba", "same", 0.3), odd, rng).values["phase_nearness"] < 0


def test_too_few_experts_or_no_beats():
    rng = np.random.default_rng(0)
    assert phase_scores(dance("tango", "new", 0.5), EXPERTS, rng).values == {}
    assert phase_scores(dance("rumba", "r0", 0.8), EXPERTS[:2], rng).values == {}
    assert phase_scores(DancedPhases("rumba", "new", np.zeros(0)), EXPERTS, rng).values == {}


def test_phases_of_a_motion():
    motion = stepping(300, period_s=0.5)  # rests at 0, 0.5, 1, … s
    found = danced_phases(motion, 0.1 + 0.5 * np.arange(19), "a", "song")
    assert (found.genre, found.song) == ("a", "song")
    assert found.phases == pytest.approx(np.full(len(found.phases), 0.8), abs=0.1)
