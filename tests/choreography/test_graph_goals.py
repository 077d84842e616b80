"""The graph engine follows a genre or a signature: the requested one, or that of the likely genre."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from synthetic_repertoire import synthetic_contents, synthetic_repertoire, synthetic_takes, with_vocabulary

import choreograph as cg
from choreograph.choreography.enforcement import danced_motifs
from choreograph.core.errors import ParameterError
from choreograph.core.numerics import chi_square_distance
from choreograph.library.repertoire import starter_repertoire
from choreograph.library.vocabulary import dance_bounds_s, signature
from choreograph.library.writing import write_repertoire

pytestmark = pytest.mark.slow

UNSTEERED = {"signature": 0.0, "motif_transition": 0.0}


def six_takes(genres=("waltz",) * 4 + ("rumba",) * 2):
    return synthetic_takes(periods_s=[0.45, 0.5, 0.55, 0.6, 0.5, 0.55], duration_s=24.0, genres=list(genres))


def with_style_nets(path, takes):
    """A repertoire with a vocabulary and style networks: so that a song's genre can be estimated."""
    nets = {"style": starter_repertoire().net("style")}
    write_repertoire(path, with_vocabulary(replace(synthetic_contents(takes), nets=nets), takes))
    return cg.Repertoire.open(path)


@pytest.fixture(scope="module")
def worded(tmp_path_factory):
    return synthetic_repertoire(tmp_path_factory.mktemp("worded") / "rep.h5", six_takes(), vocabulary=True)


def distance(dance, repertoire, wanted) -> float:
    bounds_s = dance_bounds_s(np.array(dance.plan.music_beats_s), dance.plan.duration_s)
    motifs = danced_motifs(dance.motion, bounds_s, repertoire)
    return float(chi_square_distance(signature(motifs[motifs >= 0], len(wanted)), wanted))


@pytest.fixture(scope="module")
def with_style(tmp_path_factory):
    return with_style_nets(tmp_path_factory.mktemp("style") / "rep.h5", six_takes())


@pytest.mark.parametrize("planner", ["exact", "greedy"])
def test_a_requested_signature_is_approached(worded, song, planner):
    wanted = worded.vocabulary.signatures[worded.vocabulary.genre_index("rumba")]
    config = cg.DanceConfig(planner=planner, candidates=16)
    without = cg.dance(song, worded, config=config)
    steered = cg.dance(song, worded, config=config, signature=wanted, weights={"signature": 5.0})
    assert distance(steered, worded, wanted) < distance(without, worded, wanted) - 0.05
    assert set(steered.plan.seconds[0].costs) - set(without.plan.seconds[0].costs) == {
        "signature", "motif_transition", "constraints",
    }  # fmt: skip


def test_the_signature_costs_add_up_to_the_planned_distance(worded, song):
    # Held poses breathe and put their feet down, which is no planned word.
    made = cg.dance(
        song, worded, genre="waltz", weights={"signature": 2.0}, beats="tempo-path", hold_ends=False
    )
    paid = np.mean([second.costs["signature"] for second in made.plan.seconds]) / 2.0
    assert 0.0 <= paid <= 1.0
    wanted = worded.vocabulary.signatures[worded.vocabulary.genre_index("waltz")]
    assert abs(paid - distance(made, worded, wanted)) < 0.25  # except for words that transitions changed


def test_the_likely_genre_is_followed_by_default(with_style, song):
    made = cg.dance(song, with_style)
    (note,) = [note for note in made.notes if "no genre given" in note]
    genre = next(genre for genre in ("waltz", "rumba") if f"follows {genre} (" in note)
    requested = cg.dance(song, with_style, genre=genre)
    assert made.plan.seconds == requested.plan.seconds and made.plan.weights == requested.plan.weights
    assert not any("no genre given" in note for note in requested.notes)


def test_a_banned_genre_is_not_followed(with_style, song):
    for banned, other in (("waltz", "rumba"), ("rumba", "waltz")):
        notes = cg.dance(song, with_style, bans=[cg.Ban(genre=banned)]).notes
        assert any(f"follows {other} (100 % sure)" in note for note in notes)


def test_takes_without_genres_are_not_followed(song, tmp_path):
    nameless = with_style_nets(tmp_path / "rep.h5", six_takes(genres=[""] * 6))
    made = cg.dance(song, nameless)
    assert "signature" not in made.plan.weights and not any("genre" in note for note in made.notes)


@pytest.mark.parametrize("how", [{"weights": UNSTEERED}, {"config": cg.DanceConfig(planner="motion-graph")}])
def test_a_vocabulary_without_weight_changes_nothing(with_style, song, tmp_path, how):
    nets = {"style": starter_repertoire().net("style")}
    write_repertoire(tmp_path / "rep.h5", replace(synthetic_contents(six_takes()), nets=nets))
    plain = cg.Repertoire.open(tmp_path / "rep.h5")
    a, b = cg.dance(song, with_style, **how).plan, cg.dance(song, plain, **how).plan
    assert a.seconds == b.seconds and a.weights == b.weights


@pytest.mark.parametrize(
    ("constraints", "message"),
    [
        ({"genre": "polka"}, "rumba"),
        ({"signature": np.ones(3) / 3}, "signature"),
        ({"weights": {"signature": 1.0}}, "'signature'"),
        (
            {"weights": {"motif_transition": 1.0}, "config": cg.DanceConfig(planner="motion-graph")},
            "'motif_transition'",
        ),
        ({"genre": "waltz", "config": cg.DanceConfig(planner="motion-graph")}, "motion-graph"),
    ],
)
def test_goals_that_cannot_be_followed_are_reported_in_one_line(worded, song, constraints, message):
    with pytest.raises(ParameterError, match=message) as raised:
        cg.dance(song, worded, **constraints)
    assert "\n" not in str(raised.value)
