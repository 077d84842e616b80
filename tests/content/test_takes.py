"""Takes of the built-in repertoire: their number, their beats, and import with the folder importer."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from choreograph.evaluation.metrics.beat import f_score
from choreograph.formats.register import import_takes
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion_beats import motion_beat_times_s
from content import starter as recipe
from content import starter_takes as takes
from content.moves.genres import GENRES
from content.songs.danced_styles import DANCED
from content.songs.known_songs import BENCHMARK_SONGS, FIRST_SEED

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("short_trainings")]


def test_there_are_enough_takes_and_none_is_a_benchmark_song():
    specs = list(takes.take_specs())
    assert len({spec.name for spec in specs}) == len(specs)
    assert len({spec.seed for spec in specs}) == len(specs)
    assert max(spec.seed for spec in specs) < FIRST_SEED <= min(song.seed for song in BENCHMARK_SONGS)
    assert len(GENRES) >= 15 and set(GENRES) == set(DANCED)
    assert all(len({m.name for m in (*genre.moves, *genre.figures)}) >= 23 for genre in GENRES.values())
    assert len(specs) * takes.DURATION_S >= 40 * 60
    assert min(spec.bpm for spec in specs) <= 80 and max(spec.bpm for spec in specs) >= 180


@pytest.mark.parametrize("genre", sorted(GENRES))
def test_a_take_is_on_the_beat_of_its_song(genre):
    spec = next(spec for spec in takes.take_specs() if spec.genre == genre)
    song, dance = takes.render_spec(spec)
    assert song.beat_times_s[-1] < dance.motion.duration_s <= song.duration_s
    beats_s = motion_beat_times_s(body_pos_m(dance.motion.resampled(60.0)), 60.0)
    counts_s = dance.count_times_s
    rng = np.random.default_rng(0)
    chance = np.mean([f_score(np.sort((beats_s + shift) % 30), counts_s) for shift in rng.uniform(0, 30, 20)])
    assert f_score(beats_s, counts_s) > max(0.75, chance + 0.3)


def test_takes_are_written_as_a_library_folder(tmp_path, monkeypatch):
    monkeypatch.setattr(takes, "PARTS_OF_GENRE", ("whole", "whole"))
    monkeypatch.setattr(takes, "GENRES", {"disco": GENRES["disco"]})
    specs = [replace(spec, duration_s=10.0) for spec in takes.take_specs()]
    takes.write_takes(tmp_path / "takes", specs)
    read = list(import_takes(tmp_path / "takes"))
    assert [take.name for take in read] == [spec.name for spec in specs] == ["disco-01", "disco-02"]
    for take, spec in zip(read, specs, strict=True):
        assert take.credits.genre == "disco" and take.credits.licence == "CC0-1.0"
        assert take.song_path is not None and take.song_name == spec.name
        _, dance = takes.render_spec(spec)
        order = [dance.motion.skeleton.index(name) for name in take.motion.skeleton.names]
        moved_m = take.motion.joint_pos_m() - dance.motion.joint_pos_m()[:, order]
        np.testing.assert_allclose(moved_m, np.broadcast_to(moved_m[0, 0], moved_m.shape), atol=1e-3)
        assert abs(moved_m[0, 0]).max() < 0.02  # the importer puts the lowest foot joint on the floor
        song, _ = takes.render_spec(spec)
        np.testing.assert_allclose(take.counts.times_s, song.beat_times_s, atol=1e-6)
        np.testing.assert_array_equal(take.counts.downbeat_times_s, take.counts.times_s[::4])
        assert take.counts.metre == 4 and take.counts.confidence == 1.0
        assert take.figures and {figure.name for figure in take.figures} <= {
            m.name for m in (*GENRES["disco"].moves, *GENRES["disco"].figures)
        }
        truth = json.loads((tmp_path / "takes" / f"{spec.name}.truth.json").read_text(encoding="utf-8"))
        assert truth["beat_times_s"] == sorted(truth["beat_times_s"])
        assert {move["name"] for move in truth["moves"]} <= {
            move.name for move in (*GENRES["disco"].moves, *GENRES["disco"].figures)
        }


@pytest.mark.slow
def test_the_repertoire_contains_the_takes_alone(tmp_path, monkeypatch):
    """A small recipe run: all networks are trained, words come from the takes, no file is left over."""
    specs = [
        spec for spec in takes.take_specs() if spec.genre in ("waltz", "house") and spec.name[-2:] < "04"
    ]
    monkeypatch.setattr(recipe, "take_specs", lambda: iter(specs))
    output = tmp_path / "made.h5"
    made, _ = recipe.build_starter(tmp_path / "work", output, preset="tiny")
    assert made.path == output
    assert sorted(path.name for path in tmp_path.iterdir()) == ["made.h5", "work"]
    assert set(made.net_names) == {"rollout", "style", "words"}
    assert made.vocabulary.genres == ("house", "waltz", "all")
    assert set(made.vocabulary.word_take.tolist()) == set(range(6))


def test_counts_are_the_beats_in_half_time_as_well():
    """Cha-cha at 172 BPM is danced with two beats a count; its moves last whole numbers of beats."""
    spec = takes.TakeSpec("fast", "cha-cha", 172.0, seed=3, duration_s=12.0)
    song, dance = takes.render_spec(spec)
    assert len(dance.count_times_s) < 0.6 * len(song.beat_times_s)
    counts, figures = takes.true_counts(song, dance)
    np.testing.assert_array_equal(counts.times_s, song.beat_times_s)
    for figure in figures:
        inside = (counts.times_s >= figure.start_s) & (counts.times_s < figure.end_s)
        assert inside.sum() == figure.n_counts and figure.n_counts % 2 == 0
    assert all(a.end_s == b.start_s for a, b in pairwise(figures))
