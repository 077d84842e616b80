"""`coverage` says which seconds of planted songs a repertoire cannot dance well, and what is lacking."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from synthetic_repertoire import synthetic_contents, synthetic_takes, with_counts, write_clicks

import choreograph as cg
from choreograph.choreography.song_analysis import analyse_song
from choreograph.core.counts import make_counts, numbers_in_bar
from choreograph.core.errors import ParameterError
from choreograph.evaluation import coverage as coverage_module
from choreograph.evaluation.coverage import (
    ENERGY,
    GOOD,
    METRE,
    REASONS,
    TEMPO,
    coverage,
    coverage_table,
    energy_names,
)
from choreograph.library.repertoire import Repertoire
from choreograph.library.writing import write_repertoire


@pytest.fixture(scope="module")
def repertoire(tmp_path_factory):
    """Takes at 120, 100 and 80 BPM in bars of four, 30 s each. It has no motifs, so a genre is any."""
    path = tmp_path_factory.mktemp("rep") / "rep.h5"
    write_repertoire(path, synthetic_contents(with_counts(synthetic_takes())))
    return Repertoire.open(path)


@pytest.fixture
def click_song(tmp_path):
    def write(bpm: float):
        path = tmp_path / f"{bpm:g}.wav"
        write_clicks(path, bpm=bpm, duration_s=24.0)
        return path

    return write


def test_a_song_at_the_tempo_of_takes_is_covered(repertoire, click_song):
    found = coverage(repertoire, [click_song(120)])
    assert set(found.songs[0].reasons) == {GOOD}
    assert found.lacks == ()
    assert found.songs[0].poor_s == 0
    assert "Every second of these songs is covered." in coverage_table(found)


@pytest.fixture
def planted(repertoire, click_song, monkeypatch):
    """The coverage of a song at 120 BPM in bars of four, analysed as if it were another."""
    song = cg.load_song(click_song(120))
    features, notes = analyse_song(song, repertoire)

    def covered(**changes):
        changed = replace(features, **changes)
        monkeypatch.setattr(coverage_module, "analyse_song", lambda *_, **__: (changed, notes))
        return coverage(repertoire, [song])

    return covered


@pytest.mark.parametrize(("bpm", "reason"), [(100, GOOD), (144, GOOD), (156, TEMPO), (60, TEMPO)])
def test_a_song_that_is_too_fast_or_too_slow_for_all_takes_lacks_its_tempo(planted, bpm, reason):
    """Takes have 80, 100 and 120 BPM, and are played at 0.8 to 1.25 times their speed."""
    time_s = np.arange(0, 24, 60 / bpm)
    found = planted(counts=make_counts(time_s, numbers_in_bar(len(time_s), 4), 4))
    assert set(found.songs[0].reasons) == {reason}
    assert {lack.reason for lack in found.lacks} == {reason} - {GOOD}
    if reason == TEMPO:
        assert f"at {bpm // 10 * 10} to {bpm // 10 * 10 + 10} BPM" in "\n".join(coverage_table(found))


def test_a_song_in_three_lacks_its_metre(planted):
    found = planted(counts=make_counts(np.arange(0, 24, 0.5), numbers_in_bar(48, 3), 3))
    assert set(found.songs[0].reasons) == {METRE}
    assert [(lack.metre, lack.seconds) for lack in found.lacks] == [(3, len(found.songs[0].reasons))]


def test_a_loud_part_lacks_lively_motion_where_all_takes_move_alike(planted):
    """The takes step without a pause, so nothing of them is livelier than usual."""
    n = 24
    energy = np.full(n, 0.5, np.float32)
    energy[16:20] = 1.0
    found = planted(energy=energy, duration_s=float(n))
    assert [second for second, reason in enumerate(found.songs[0].reasons) if reason] == [16, 17, 18, 19]
    [lack] = found.lacks
    assert (lack.reason, lack.energy, lack.seconds) == (ENERGY, "lively", 4)


def test_a_file_of_every_song_is_named_once_with_its_folder_where_names_are_equal(repertoire, tmp_path):
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
        write_clicks(tmp_path / folder / "audio.wav", bpm=120, duration_s=12.0)
    found = coverage(repertoire, [tmp_path / f / "audio.wav" for f in ("one", "two")])
    assert [song.song for song in found.songs] == ["one/audio", "two/audio"]


def test_takes_that_no_second_can_use_are_named(repertoire, click_song):
    found = coverage(repertoire, [click_song(120)])
    assert found.unused == ("take2",)  # of 80 BPM, which would be played at 1.5 times its speed


def test_the_built_in_repertoire_lacks_nothing_for_a_built_in_song():
    assert coverage(cg.starter_repertoire(), [cg.example_songs()["house"]]).lacks == ()


@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=30))
def test_a_second_near_the_median_of_its_song_calls_for_any_motion(energy):
    energy = np.array(energy, np.float32)
    names = energy_names(energy)
    away = energy - np.median(energy)
    assert all(name == "" for name, a in zip(names, away, strict=True) if abs(a) < 0.2)
    assert all(a < 0 for name, a in zip(names, away, strict=True) if name == "calm")
    assert all(a > 0 for name, a in zip(names, away, strict=True) if name == "lively")


def test_errors(repertoire):
    with pytest.raises(ParameterError, match="expected songs to dance to, got none"):
        coverage(repertoire, [])
    with pytest.raises(ParameterError, match="expected songs"):
        coverage(repertoire, [3])
    assert REASONS == (METRE, TEMPO, ENERGY)
