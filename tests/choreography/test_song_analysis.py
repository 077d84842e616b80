"""What a song is told to be: its counts, at the level that the takes are danced at, and notes."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic_repertoire import synthetic_repertoire, synthetic_takes, write_clicks

from choreograph.choreography import song_analysis
from choreograph.choreography.song_analysis import analyse_song
from choreograph.core.counts import make_counts, numbers_in_bar
from choreograph.library.repertoire import Repertoire
from choreograph.library.writing import MeasuredTake
from choreograph.music.bars import tempo_bpm
from choreograph.music.form import Sections
from choreograph.music.song import load_song


@pytest.fixture(scope="module")
def clicks(tmp_path_factory):
    """Clicks at 120 BPM."""
    return load_song(write_clicks(tmp_path_factory.mktemp("songs") / "clicks.wav", duration_s=20.4))


def repertoire_takes(*bpm: float) -> list[MeasuredTake]:
    """Takes of genres a, b and c, one in three and two in four, counted at these tempi, or at one tempo."""
    takes = []
    for m, metre, of_take in zip(
        synthetic_takes(), (3, 4, 4), bpm if len(bpm) == 3 else 3 * bpm, strict=True
    ):
        times_s = np.arange(0, 29, 60 / of_take)
        counts = make_counts(times_s, numbers_in_bar(len(times_s), metre), metre)
        takes.append(replace(m, take=replace(m.take, counts=counts)))
    return takes


def repertoire_at(folder, *bpm: float) -> Repertoire:
    """The repertoire of `repertoire_takes`."""
    return synthetic_repertoire(folder / "rep.h5", repertoire_takes(*bpm))


@pytest.mark.parametrize(("takes_bpm", "expected"), [(118.0, 120), (62.0, 60), (90.0, 120)])
def test_the_level_is_the_takes(clicks, tmp_path, takes_bpm, expected):
    features, notes = analyse_song(clicks, repertoire_at(tmp_path, takes_bpm))
    assert tempo_bpm(features.counts) == pytest.approx(expected, rel=0.02)
    assert features.counts.has_bars
    assert any("rather than the tracked 120" in note for note in notes) == (expected != 120)


@pytest.mark.parametrize(("genre", "expected"), [("b", 60), ("c", 120), ("unknown", 120), (None, 120)])
def test_the_level_is_that_of_the_genre_asked_for(clicks, tmp_path, genre, expected):
    features, notes = analyse_song(clicks, repertoire_at(tmp_path, 118.0, 62.0, 118.0), genre=genre)
    assert tempo_bpm(features.counts) == pytest.approx(expected, rel=0.02)
    assert any("the takes of b" in note for note in notes) == (genre == "b")


def test_beats_of_a_file_are_not_second_guessed(clicks, tmp_path):
    beats = tmp_path / "clicks.beats"
    beats.write_text("".join(f"{2.25 + 0.5 * i} {i % 3 + 1}\n" for i in range(30)))
    song = replace(clicks, start_s=2.0)
    features, _ = analyse_song(song, repertoire_at(tmp_path, 62.0), beats=beats)
    assert features.counts.metre == 3 and features.counts.source == "annotation"
    assert features.beat_times_s[:2].tolist() == [0.25, 0.75]
    assert features.counts.numbers[:4].tolist() == [1, 2, 3, 1]


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_a_take_with_one_count_says_nothing_of_the_level(clicks, tmp_path):
    """The tempo of one count was NaN, which no level was nearer to than the tracked one."""
    first, *others = repertoire_takes(62.0, 62.0, 62.0)
    counts = make_counts([1.0], [1], 4)
    takes = [replace(first, take=replace(first.take, counts=counts)), *others]
    features, _ = analyse_song(clicks, synthetic_repertoire(tmp_path / "rep.h5", takes))
    assert tempo_bpm(features.counts) == pytest.approx(60, rel=0.02)


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_a_part_of_one_beat_keeps_it(clicks, tmp_path, monkeypatch):
    bounds_s = np.array([0.25, 10.1, 10.6, 20.0])
    sections = Sections(bounds_s, np.arange(3))
    monkeypatch.setattr(song_analysis, "song_sections", lambda *_, **__: sections)
    monkeypatch.setattr(song_analysis, "change_times_s", lambda _: bounds_s[1:3])
    tracked = analyse_song(clicks, repertoire_at(tmp_path, 118.0))[0].beat_times_s
    assert ((tracked >= 10.1) & (tracked < 10.6)).sum() == 1 and len(tracked) > 38


def test_takes_without_counts_leave_the_tracked_level(clicks, repertoire):
    features, _ = analyse_song(clicks, repertoire)
    assert tempo_bpm(features.counts) == pytest.approx(120, rel=0.02)


def test_parts_that_keep_the_tracked_level_are_the_tracked_counts(clicks, tmp_path, monkeypatch):
    """A change of tempo that changes no level is not noted as one."""
    halves = Sections(np.array([0.25, 10.1, 20.0]), np.arange(2))
    monkeypatch.setattr(song_analysis, "song_sections", lambda *_, **__: halves)
    monkeypatch.setattr(song_analysis, "change_times_s", lambda _: np.array([10.1]))
    features, notes = analyse_song(clicks, repertoire_at(tmp_path, 118.0))
    assert tempo_bpm(features.counts) == pytest.approx(120, rel=0.02)
    assert not any("rather than the tracked" in note for note in notes)


def test_a_note_states_the_tempi_of_the_part_that_changes(clicks, tmp_path, monkeypatch):
    """The median tempo of this song is 60 BPM as tracked and as counted."""
    times_s = np.r_[np.arange(0.25, 4.0, 0.5), np.arange(4.25, 20.0, 1.0)]
    beats = make_counts(times_s, numbers_in_bar(len(times_s), 4), 4)
    monkeypatch.setattr(song_analysis, "song_counts", lambda *_: beats)
    halves = Sections(np.array([0.25, 4.25, 20.0]), np.arange(2))
    monkeypatch.setattr(song_analysis, "song_sections", lambda *_, **__: halves)
    monkeypatch.setattr(song_analysis, "change_times_s", lambda _: np.array([4.25]))
    features, notes = analyse_song(clicks, repertoire_at(tmp_path, 62.0))
    assert np.diff(features.beat_times_s) == pytest.approx(1.0)
    note = next(note for note in notes if "rather than the tracked" in note)
    assert "counted at 60 BPM from 0 s to 3 s rather than the tracked 120 BPM" in note


def half_at_half_tempo(clicks, tmp_path, monkeypatch, style):
    """The song with its second half tracked at half the tempo, and with these styles of both halves."""
    times_s = np.r_[np.arange(0.25, 10.0, 0.5), np.arange(10.25, 20.0, 1.0)]
    tracked = make_counts(times_s, numbers_in_bar(len(times_s), 4), 4)
    monkeypatch.setattr(song_analysis, "song_counts", lambda *_: tracked)
    vectors = np.repeat(np.eye(2, 32, dtype=np.float32)[list(style)], [10, 11], axis=0)
    monkeypatch.setattr(song_analysis, "_style", lambda *_: (vectors, np.zeros(21, np.float32), []))
    return analyse_song(clicks, repertoire_at(tmp_path, 118.0))[0].counts


@pytest.mark.parametrize(("style", "same_level"), [((0, 0), True), ((0, 1), False)])
def test_parts_tracked_at_half_tempo_are_counted_like_the_rest(
    clicks, tmp_path, monkeypatch, style, same_level
):
    """Unless their style is another one. Then they may be other music."""
    monkeypatch.setattr(song_analysis, "choose_level", lambda levels, *_: levels[0])
    counts = half_at_half_tempo(clicks, tmp_path, monkeypatch, style)
    second_half = counts.within(10.2, 20.0)
    assert np.diff(second_half.times_s) == pytest.approx(0.5 if same_level else 1.0)
    assert np.diff(second_half.downbeat_times_s) == pytest.approx(2.0 if same_level else 4.0)
