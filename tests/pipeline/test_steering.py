"""The graph engine follows a genre or a signature, with either planner; without one nothing changes."""

from __future__ import annotations

import numpy as np
import pytest
from planted_repertoire import planted_repertoire, planted_takes

import choreograph as cg
from choreograph.errors import ParameterError
from choreograph.motifs.signatures import chi_square_distance, signature
from choreograph.motifs.words import dance_bounds_s
from choreograph.pipeline.rendering import danced_motifs


def six_takes():
    return planted_takes(
        periods_s=[0.45, 0.5, 0.55, 0.6, 0.5, 0.55], duration_s=24.0, genres=["waltz"] * 4 + ["rumba"] * 2
    )


@pytest.fixture(scope="module")
def worded(tmp_path_factory):
    return planted_repertoire(tmp_path_factory.mktemp("worded") / "rep.h5", six_takes(), vocabulary=True)


def distance(dance, repertoire, wanted) -> float:
    bounds_s = dance_bounds_s(np.array(dance.plan.music_beats_s), dance.plan.duration_s)
    motifs = danced_motifs(dance.motion, bounds_s, repertoire)
    return float(chi_square_distance(signature(motifs[motifs >= 0], len(wanted)), wanted))


@pytest.mark.parametrize("planner", ["exact", "greedy"])
def test_a_signature_asked_for_is_come_near_to(worded, song, planner):
    wanted = worded.vocabulary.signatures[worded.vocabulary.genre_index("rumba")]
    config = cg.DanceConfig(planner=planner, candidates=16)
    without = cg.dance(song, worded, config=config)
    steered = cg.dance(song, worded, config=config, signature=wanted, weights={"signature": 5.0})
    assert distance(steered, worded, wanted) < distance(without, worded, wanted) - 0.05
    assert set(steered.plan.seconds[0].costs) - set(without.plan.seconds[0].costs) == {
        "signature", "motif_transition",
    }  # fmt: skip


def test_what_the_seconds_pay_is_the_distance_planned(worded, song):
    made = cg.dance(song, worded, genre="waltz", weights={"signature": 2.0})
    paid = np.mean([second.costs["signature"] for second in made.plan.seconds]) / 2.0
    assert 0.0 <= paid <= 1.0
    wanted = worded.vocabulary.signatures[worded.vocabulary.genre_index("waltz")]
    assert abs(paid - distance(made, worded, wanted)) < 0.25  # but for words that joins have changed


def test_a_vocabulary_that_nobody_asks_for_changes_nothing(worded, song, tmp_path):
    plain = planted_repertoire(tmp_path / "rep.h5", six_takes())
    a, b = cg.dance(song, worded).plan, cg.dance(song, plain).plan
    assert a.seconds == b.seconds and a.weights == b.weights


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"genre": "polka"}, "rumba"),
        ({"signature": np.ones(3) / 3}, "signature"),
        ({"weights": {"signature": 1.0}}, "'signature'"),
        ({"genre": "waltz", "config": cg.DanceConfig(planner="motion-graph")}, "motion-graph"),
    ],
)
def test_what_cannot_be_followed_is_said_in_one_line(worded, song, asked, said):
    with pytest.raises(ParameterError, match=said) as raised:
        cg.dance(song, worded, **asked)
    assert "\n" not in str(raised.value)
