"""The built-in repertoire and songs: size, genres, networks, and dances made with them."""

from __future__ import annotations

import json
from collections import Counter

import numpy as np
import pytest
from click.testing import CliRunner

import choreograph as cg
from choreograph.cli.main import main
from choreograph.core.numerics import chi_square_distance
from choreograph.core.timebase import WORD_FPS
from choreograph.evaluation.metrics.beat import f_score
from choreograph.evaluation.metrics.physical import floor_penetration_cm
from choreograph.library.builtin import STARTER_PATH
from choreograph.library.vocabulary import segment_words, signature
from choreograph.motion.body import body_pos_m
from choreograph.motion.contacts import sole_pos_m
from choreograph.motion.motion_beats import motion_beat_times_s
from choreograph.motion.skeleton import CANONICAL_JOINTS
from content.moves.genres import GENRES
from content.songs.known_songs import BENCHMARK_SONGS
from content.songs.synthesis.song import write_song

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def starter():
    return cg.starter_repertoire()


def test_size_and_content(starter):
    assert STARTER_PATH.stat().st_size < 16e6  # bytes, 2.3e6 of them the rollout network
    assert sum(take.duration_s for take in starter.takes) > 68 * 60
    assert set(Counter(take.credits.genre for take in starter.takes)) == set(GENRES)
    assert set(starter.skeleton.names) == set(CANONICAL_JOINTS)
    assert {take.credits.licence for take in starter.takes} == {"CC0-1.0"}
    assert {"rollout", "style", "words"} == set(
        starter.net_names
    )  # the clips carry the analytic tempo-density


def test_genres_are_recognised_by_their_motifs(starter):
    vocabulary = starter.vocabulary
    assert vocabulary.genres == (*sorted(GENRES), "all")
    assert set(vocabulary.word_take.tolist()) == set(range(len(starter.takes)))
    own = []
    for index, take in enumerate(starter.takes):
        danced = signature(vocabulary.word_motif[vocabulary.words_of_take(index)], vocabulary.n_motifs)
        distances = chi_square_distance(danced, vocabulary.signatures[:-1])
        own.append(vocabulary.genres[int(distances.argmin())] == take.credits.genre)
    assert np.mean(own) > 0.95


def test_word_network_reproduces_the_motifs(starter):
    vocabulary, net = starter.vocabulary, starter.word_net()
    for take in (0, 60, 127):
        words = vocabulary.words_of_take(take)
        edges_s = np.append(vocabulary.word_start_s[words], vocabulary.word_end_s[words[-1]])
        motion, _ = starter.motion(take)
        cut = segment_words(body_pos_m(motion.resampled(WORD_FPS)), WORD_FPS, edges_s)
        given = vocabulary.motifs.nearest(net.embed(cut.body_pos_m))
        assert np.mean(given == vocabulary.word_motif[words]) > 0.9


def test_training_songs_are_recorded(starter):
    """The built-in takes' own, and nobody else's."""
    assert set(starter.provenance["trained_on"]) == {take.song_name for take in starter.takes}
    assert starter.provenance["pretrained"] == "clean"
    card = STARTER_PATH.with_name("STARTER.md").read_text(encoding="utf-8")
    assert "No recorded dancer" in card


@pytest.mark.slow
@pytest.mark.parametrize(
    "bench", [BENCHMARK_SONGS[6], BENCHMARK_SONGS[10], BENCHMARK_SONGS[16]], ids=lambda song: song.name
)
def test_dances_are_on_the_true_beat(starter, tmp_path, bench):
    truth = bench.render()
    write_song(tmp_path / "song.wav", truth)
    made = cg.dance(tmp_path / "song.wav", starter)
    pos = body_pos_m(made.motion)
    assert f_score(motion_beat_times_s(pos, made.motion.fps), truth.beat_times_s) > 0.75
    # A song in four is not danced in three because its tempo leaves that of the takes in four.
    assert "waltz" not in {second.credits.genre for second in made.plan.seconds}
    soles = sole_pos_m(made.motion)
    assert floor_penetration_cm(pos, made.motion.fps, sole_pos_m=soles) < 0.5
    takes = [second.take for second in made.plan.seconds]
    assert len(set(takes)) >= 5
    for a, b in zip(made.plan.seconds, made.plan.seconds[1:], strict=False):
        back_s = a.source_times_s[-1] - b.source_times_s[0]
        assert a.take != b.take or not 0.25 < back_s < 8.0


def test_songs_are_listed_found_and_copied(tmp_path):
    listed = json.loads(CliRunner().invoke(main, ["songs", "--json"]).output)
    assert set(listed) == {"cha-cha", "house", "waltz"}
    assert CliRunner().invoke(main, ["songs", "--path", "waltz"]).output.strip() == listed["waltz"]
    assert CliRunner().invoke(main, ["songs", "--copy", str(tmp_path)]).exit_code == 0
    assert {path.stem for path in tmp_path.iterdir()} == set(listed)
    unknown = CliRunner().invoke(main, ["songs", "--path", "polka"])
    assert unknown.exit_code == 2
    assert "polka" in unknown.stderr


def test_first_command_needs_only_a_song(tmp_path, monkeypatch):
    opened = []
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("click.launch", opened.append)
    song = str(cg.example_songs()["house"])
    done = CliRunner().invoke(main, ["dance", song, "--duration", "6", "--open", "--json"])
    assert done.exit_code == 0, done.output
    facts = json.loads(done.stdout)
    assert facts["outputs"] == ["house.bvh", "house.html"]
    assert facts["repertoire"] == "starter.h5"
    assert sum(take["seconds"] for take in facts["takes"]) == 6
    assert opened == [(tmp_path / "house.html").resolve().as_uri()]
    assert "<html" in (tmp_path / "house.html").read_text(encoding="utf-8")


def test_seed_determines_the_dance(starter):
    song = cg.example_songs()["house"]
    dances = [cg.dance(song, starter, duration_s=20.0, seed=seed) for seed in (0, 0, 1)]
    first, same, other = (dance.motion.joint_pos_m() for dance in dances)
    np.testing.assert_array_equal(first, same)
    assert np.linalg.norm(first - other, axis=-1).mean() > 0.1
