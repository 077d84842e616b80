"""Dances that the rollout network learns from: on the count of their songs, kept for a resumed build."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from synthetic_repertoire import synthetic_repertoire, synthetic_takes, with_counts, write_clicks

from choreograph.library.building.networks import taught_dances
from choreograph.motion.motion import Credits
from choreograph.pipeline import building as graph_teacher
from choreograph.pipeline.building import AGAIN_PER_GENRE, dances_to_teach, graph_dances, teach_rollout
from choreograph.plan.plan import Plan

SETTINGS = {"beats": "tempo-path", "seed": 0}


@pytest.fixture(scope="module")
def counted():
    return with_counts(synthetic_takes())


@pytest.fixture(scope="module")
def repertoire(tmp_path_factory, counted):
    return synthetic_repertoire(tmp_path_factory.mktemp("teacher") / "rep.h5", counted, vocabulary=True)


@pytest.fixture(scope="module")
def to_clicks(tmp_path_factory, counted):
    """Two takes to one song, one to another, and one without."""
    folder = tmp_path_factory.mktemp("songs")
    for name, bpm in (("fast", 120.0), ("slow", 100.0)):
        write_clicks(folder / f"{name}.wav", duration_s=16.0, bpm=bpm)
    songs = (folder / "fast.wav", folder / "fast.wav", folder / "slow.wav", None)
    takes = [counted[i % 3].take for i in range(4)]
    return [replace(take, song_path=song) for take, song in zip(takes, songs, strict=True)]


def test_every_song_is_danced_once_and_on_its_count(repertoire, to_clicks, tmp_path):
    fast, slow = graph_dances(repertoire, dances_to_teach(to_clicks)[:2], tmp_path / "dances", **SETTINGS)
    assert [d.song_path.stem for d in (fast, slow)] == ["fast", "slow"]
    assert fast.credits == Credits(genre="a") and slow.credits == Credits(genre="c")
    for dance, period_s in ((fast, 0.5), (slow, 0.6)):
        assert len(dance.counts) >= 8
        assert np.allclose(np.diff(dance.counts.times_s), period_s, atol=0.03)
        assert dance.counts.times_s[-1] <= dance.motion.duration_s


def test_the_songs_of_a_genre_are_danced_again_in_turn_with_other_seeds(
    repertoire, to_clicks, tmp_path, monkeypatch
):
    fast, slow = to_clicks[0].song_path, to_clicks[2].song_path
    other = replace(to_clicks[0], song_path=slow.with_name("other.wav"))
    wanted = dances_to_teach([*to_clicks, other])
    assert wanted[:3] == [(fast, "a", 0), (slow, "c", 0), (other.song_path, "a", 0)]
    assert [one for one in wanted[3:] if one[1] == "c"] == [(slow, "c", n) for n in range(1, 9)]
    again = [(song, n) for song, genre, n in wanted[3:] if genre == "a"]
    assert len(again) == AGAIN_PER_GENRE and again[:4] == [
        (fast, 1), (other.song_path, 1), (fast, 2), (other.song_path, 2)
    ]  # fmt: skip
    first, second = graph_dances(
        repertoire, [(fast, "a", 0), (fast, "a", 1)], tmp_path / "dances", beats="tempo-path", seed=3
    )
    monkeypatch.setattr(graph_teacher, "AGAIN_PER_GENRE", 1)
    assert len(dances_to_teach(to_clicks)) == 4
    assert first.song_path == second.song_path
    plans = [Plan.read(tmp_path / "dances" / f"{n}.json") for n in (0, 1)]
    assert [plan.seed for plan in plans] == [3, 4]


def test_a_call_after_a_stop_goes_on_with_the_plans_that_are_kept(
    repertoire, to_clicks, tmp_path, monkeypatch
):
    first = graph_dances(repertoire, dances_to_teach(to_clicks)[:2], tmp_path / "dances", **SETTINGS)
    monkeypatch.setattr(graph_teacher, "dance", lambda *a, **k: pytest.fail("danced anew"))
    again = graph_dances(repertoire, dances_to_teach(to_clicks)[:2], tmp_path / "dances", **SETTINGS)
    for one, other in zip(first, again, strict=True):
        assert np.array_equal(one.motion.local_quat, other.motion.local_quat)
        assert np.array_equal(one.counts.times_s, other.counts.times_s)


def test_other_contents_are_taught_by_other_dances(counted, to_clicks, tmp_path):
    from synthetic_repertoire import synthetic_contents

    folders = []

    def teacher(repertoire, takes, folder):
        folders.append(folder)
        return []

    for takes in (counted, counted, counted[:2]):
        taught_dances(synthetic_contents(takes), to_clicks, teacher, tmp_path)
    assert folders[0] == folders[1] != folders[2]


def test_no_clips_no_dances(to_clicks, tmp_path):
    short = synthetic_takes(duration_s=6.0)
    repertoire = synthetic_repertoire(tmp_path / "short.h5", short)
    assert teach_rollout(repertoire, to_clicks, tmp_path / "dances", **SETTINGS) == []
    assert not (tmp_path / "dances").exists()
