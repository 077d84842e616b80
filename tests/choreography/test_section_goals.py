"""Goals by section: as requested, else one for each part of the song that is nearest to one genre."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from synthetic_repertoire import synthetic_contents, synthetic_repertoire, synthetic_takes, with_vocabulary

from choreograph.choreography.constraints import make_constraints
from choreograph.choreography.engine import DanceRequest
from choreograph.choreography.genres import section_goals
from choreograph.choreography.slots import resolve
from choreograph.core.counts import NO_COUNTS
from choreograph.library.repertoire import Repertoire
from choreograph.library.schema import NetArrays
from choreograph.library.writing import write_repertoire
from choreograph.music.sections import Sections
from choreograph.music.song import Song
from choreograph.music.song_features import SongFeatures
from choreograph.settings import DanceConfig

GENRES = ("waltz", "rumba")
STYLES = dict(zip(GENRES, np.eye(2, 32, dtype=np.float32), strict=True))
N_SECONDS = 24


def takes():
    return synthetic_takes(periods_s=(0.5, 0.6, 0.75, 0.5), duration_s=12.0, genres=GENRES)


@pytest.fixture(scope="module")
def repertoire(tmp_path_factory):
    """Takes of two genres, whose clips have the style of their genre."""
    contents = with_vocabulary(synthetic_contents(takes()), takes())
    style = np.stack([STYLES[GENRES[take % 2]] for take in contents.arrays["clips/take"]])
    nets = {**contents.nets, "style": NetArrays({}, {"weight": np.zeros(1, np.float32)})}
    path = tmp_path_factory.mktemp("planted") / "rep.h5"
    write_repertoire(path, replace(contents, arrays={**contents.arrays, "clips/style": style}, nets=nets))
    return Repertoire.open(path)


def request(repertoire, genres, **constraints) -> DanceRequest:
    """A dance to a song whose halves are of these genres."""
    half = N_SECONDS // 2
    style = np.repeat([STYLES[genre] for genre in genres], half, axis=0)
    features = SongFeatures(
        "planted", float(N_SECONDS), NO_COUNTS, style, np.zeros(N_SECONDS, np.float32),
        np.zeros((N_SECONDS, 80), np.float32), Sections(np.array([0.0, half, N_SECONDS]), np.arange(2)),
        np.ones(N_SECONDS, np.float32), 0.0, float(N_SECONDS), np.full(N_SECONDS, 0.5, np.float32),
    )  # fmt: skip
    resolved = resolve(
        make_constraints(**constraints), repertoire, np.arange(N_SECONDS + 1.0), float(N_SECONDS)
    )
    return DanceRequest(
        Song(np.zeros(1, np.float32), "planted"), features, repertoire, DanceConfig(), resolved
    )


def signature_of(repertoire, genre):
    return repertoire.vocabulary.signatures[repertoire.vocabulary.genre_index(genre)]


@pytest.mark.parametrize("genres", [("waltz", "rumba"), ("rumba", "waltz")])
def test_two_halves_have_two_goals(repertoire, genres):
    goals, (note,) = section_goals(request(repertoire, genres))
    assert [goal.first_second for goal in goals] == [0, N_SECONDS // 2]
    for goal, genre in zip(goals, genres, strict=True):
        assert np.array_equal(goal.goal.signature, signature_of(repertoire, genre))
    assert ", then ".join(genres) in note


def test_a_song_of_one_genre_has_one_goal(repertoire):
    (goal,), (note,) = section_goals(request(repertoire, ("rumba", "rumba")))
    assert goal.first_second == 0 and "rumba" in note and "then" not in note
    assert np.array_equal(goal.goal.signature, signature_of(repertoire, "rumba"))


def test_what_is_requested_holds_for_the_whole_song(repertoire):
    (goal,), notes = section_goals(request(repertoire, GENRES, genre="waltz"))
    assert goal.first_second == 0 and notes == ()
    assert np.array_equal(goal.goal.signature, signature_of(repertoire, "waltz"))
    wanted = signature_of(repertoire, "rumba")
    (goal,), notes = section_goals(request(repertoire, GENRES, signature=wanted))
    assert np.allclose(goal.goal.signature, wanted) and notes == ()


def test_without_motifs_or_style_there_is_no_goal(tmp_path):
    plain = synthetic_repertoire(tmp_path / "plain.h5", takes())
    worded = synthetic_repertoire(tmp_path / "worded.h5", takes(), vocabulary=True)
    assert section_goals(request(plain, GENRES)) == ([], ())
    asked = request(worded, GENRES)
    without = replace(asked.song_features, style=np.zeros_like(asked.song_features.style))
    assert section_goals(replace(asked, song_features=without)) == ([], ())
