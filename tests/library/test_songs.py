"""A song's counts by a tracker or from a file."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic_motions import swaying
from synthetic_repertoire import synthetic_takes, write_clicks
from synthetic_rollouts import synthetic_motion

from choreograph.core.counts import ANNOTATED, FROM_MOTION, NO_COUNTS, make_counts, numbers_in_bar
from choreograph.core.errors import FormatError, ParameterError
from choreograph.library import songs as song_cache
from choreograph.library.building.networks import style_take
from choreograph.library.building.options import BuildOptions
from choreograph.library.building.words import segment_takes
from choreograph.library.notes import summary
from choreograph.library.songs import (
    AnalysedSong,
    SongCache,
    beats_ahead,
    better_offset_s,
    check_beats,
    music_of_take,
    song_beats,
    song_counts,
    song_notes,
)
from choreograph.motion.motion import Credits, Take
from choreograph.music.mel import log_mel
from choreograph.music.rhythm import FRAME_RHYTHM_FPS, FRAME_RHYTHM_NAMES
from choreograph.music.song import load_song
from content.songs.synthesis.song import render_song, write_song

# A song's counts by a tracker or from a file.


@pytest.fixture(scope="module")
def clicks(tmp_path_factory):
    song = load_song(write_clicks(tmp_path_factory.mktemp("clicks") / "a.wav", duration_s=12.4))
    return song, log_mel(song.samples)


def test_bars_of_a_file_are_kept(clicks, tmp_path):
    song, mel = clicks
    path = tmp_path / "a.beats"
    path.write_text("".join(f"{3 + 0.5 * i} {i % 3 + 1}\n" for i in range(12)))
    counts = song_counts(replace(song, start_s=3.0), mel, path)
    assert counts.source == "annotation" and counts.metre == 3
    assert counts.times_s.tolist() == (0.5 * np.arange(12)).tolist()


def test_bars_are_tracked_where_a_file_has_none(clicks, tmp_path):
    song, mel = clicks
    path = tmp_path / "a.beats"
    path.write_text("\n".join(str(0.25 + 0.5 * i) for i in range(20)))
    assert not song_beats(song, mel, path).has_bars
    counts = song_counts(song, mel, str(path))
    assert counts.has_bars and counts.source == "music" and len(counts) == 20


@pytest.mark.parametrize("name", ["tempo-path", "network"])
def test_a_tracker_by_name(clicks, name):
    song, mel = clicks
    counts = song_counts(song, mel, name)
    assert counts.has_bars and np.median(np.diff(counts.times_s)) == pytest.approx(0.5, abs=0.02)


@pytest.mark.parametrize("beats", ["ear", 5, None, "no/such/file.txt"])
def test_neither_tracker_nor_file(clicks, beats):
    with pytest.raises(ParameterError, match="expected beats"):
        check_beats(beats)
    with pytest.raises(ParameterError, match="tempo-path"):
        song_counts(*clicks, beats)


# Every song of a build is decoded and analysed once, whoever needs it.


@pytest.fixture
def decoded(monkeypatch):
    """How often each file was decoded."""
    counts: Counter = Counter()
    load_song = song_cache.load_song

    def counted(path):
        counts[path] += 1
        return load_song(path)

    monkeypatch.setattr(song_cache, "load_song", counted)
    return counts


def test_training_and_segmentation_share_one_decoding(tmp_path, decoded):
    song = write_clicks(tmp_path / "clicks.wav", duration_s=31.0)
    measured = [
        replace(m, take=replace(m.take, song_path=song)) for m in synthetic_takes(periods_s=[0.5, 0.6])
    ]
    songs = SongCache()
    mels = [style_take(m, songs).log_mel for m in measured]
    segmented, notes = segment_takes(measured, songs)
    assert decoded == {song: 1}
    assert len(mels) == 2 and not notes
    assert all(np.allclose(np.diff(take.words.start_s), 0.5, atol=0.05) for take in segmented)


def test_samples_are_kept_only_where_they_are_needed(tmp_path):
    path = write_clicks(tmp_path / "clicks.wav", duration_s=4.0)
    assert SongCache().analysed(path).song is None
    kept = SongCache(keep_samples=True).analysed(path)
    assert kept.song is not None and kept.song.duration_s == kept.duration_s


def test_a_song_that_cannot_be_read(tmp_path):
    with pytest.raises(FormatError, match="no such file"):
        SongCache().analysed(tmp_path / "gone.wav")


def test_songs_are_tracked_as_asked(tmp_path):
    path = write_clicks(tmp_path / "clicks.wav", duration_s=12.0)
    song = song_cache.load_song(path)
    for tracker in ("librosa", "tempo-path"):
        expected = song_counts(song, log_mel(song.samples), tracker)
        assert np.array_equal(SongCache(tracker).analysed(path).beat_times_s, expected.times_s)


def test_a_build_takes_its_beats_from_a_tracker_and_not_from_a_file(tmp_path):
    with pytest.raises(ParameterError, match=r"expected beats among .*librosa.*, got 'beats.txt'"):
        BuildOptions(beats="beats.txt")


# Takes that do not fit their songs are noted, and those that do are not.


BEAT_S = 0.5
SONG = Path("song.wav")


def song(duration_s: float = 20.0) -> AnalysedSong:
    times_s = np.arange(0.2, duration_s, BEAT_S)
    counts = make_counts(times_s, numbers_in_bar(len(times_s), 4), 4, source="tracked")
    return AnalysedSong(duration_s, np.zeros((0, 96), np.float32), counts, None)


def take(
    name: str = "a", *, late_s: float = 0.0, jitter_s: float = 0.0, seconds: float = 15.0, source=ANNOTATED
):
    """A take whose counts lie `late_s` after the beats of `song`."""
    times_s = np.arange(0.2, seconds - 1.0, BEAT_S) + late_s
    times_s += jitter_s * np.random.default_rng(0).uniform(-1, 1, len(times_s))
    counts = make_counts(times_s, numbers_in_bar(len(times_s), 4), 4, source=source)
    motion = swaying(round(30 * seconds), fps=30.0)
    return Take(name, motion, Credits(), song_path=SONG, counts=counts)


def songs(analysed: AnalysedSong) -> SongCache:
    cache = SongCache()
    cache._analysed[SONG] = analysed
    return cache


@pytest.mark.parametrize("late_s", [0.12, -0.15, 0.2])
def test_the_offset_that_would_fit_is_found(late_s):
    assert better_offset_s(take(late_s=late_s), song()) == pytest.approx(-late_s, abs=0.01)
    (note,) = song_notes([take(late_s=late_s)], songs(song()))
    assert f"{-late_s:+.2f} s" in note.text and "audio_offset_s" in note.text


@pytest.mark.parametrize(
    "fitting",
    [
        take(), take(late_s=0.05), take(jitter_s=0.24), take(late_s=0.2, source=FROM_MOTION),
        take(late_s=0.2, seconds=4.0),
    ],
    ids=["on the beat", "nearly", "not alike all along", "read from motion", "too few"],
)  # fmt: skip
def test_what_fits_or_is_not_known_is_not_noted(fitting):
    assert song_notes([fitting], songs(song())) == []


def test_motion_that_is_longer_than_its_song_is_noted_and_many_are_counted():
    takes = [take(name, seconds=22.0) for name in "abcde"]
    notes = song_notes(takes, songs(song(20.0)))
    assert [(note.subject, note.values) for note in notes] == [(name, {"over_s": 2.0}) for name in "abcde"]
    line, _ = summary(notes, 6, "a.h5")
    assert (
        line
        == "5 of 6 takes: the motion continues without music for 2.00 s after its song (a, b, c and 2 more)"
    )


def test_of_songs_that_are_not_analysed_nothing_is_said():
    assert song_notes([take(seconds=30.0)], SongCache()) == []


# A take's music in step with it: beats on counts, bars on bars, however the pair was recorded.


BEAT, SONG_BPM = FRAME_RHYTHM_NAMES.index("beat"), 120.0


@pytest.fixture(scope="module")
def analysed(tmp_path_factory):
    """A song of 120 beats a minute and its true counts."""
    truth = render_song("house", seed=5, duration_s=30.0, bpm=SONG_BPM)
    path = tmp_path_factory.mktemp("song") / "song.wav"
    write_song(path, truth)
    song = load_song(path)
    counts = make_counts(truth.beat_times_s, numbers_in_bar(len(truth.beat_times_s), 4), 4)
    return AnalysedSong(song.duration_s, log_mel(song.samples), counts, song)


def take_of(first_s, period_s, *, n=20, first_number=1, song_start_s=0.0):
    times_s = first_s + period_s * np.arange(n)
    numbers = (np.arange(n) + first_number - 1) % 4 + 1
    motion = synthetic_motion(np.zeros(30, int))  # 15 s
    counts = make_counts(times_s[times_s < 15], numbers[times_s < 15], 4)
    return Take("take", motion, Credits(), song_start_s=song_start_s, counts=counts)


@pytest.mark.parametrize(("first_s", "period_s"), [(0.2, 0.55), (0.4, 0.47), (0.75, 0.5)])
def test_beats_are_on_counts(analysed, first_s, period_s):
    take = take_of(first_s, period_s)
    music = music_of_take(take, analysed, take.counts.times_s)
    beats = np.flatnonzero(music.rhythm[:, BEAT]) / FRAME_RHYTHM_FPS
    assert beats == pytest.approx(take.counts.times_s, abs=0.5 / FRAME_RHYTHM_FPS + 1e-6)
    assert len(music.spectral) == len(take.counts) - 1
    # What sounds is on the counts as well: onsets are strong there, and weak between.
    times_s = np.arange(len(music.rhythm)) / FRAME_RHYTHM_FPS
    phase = (times_s - first_s) / period_s % 1.0
    inside = (times_s > first_s) & (times_s < take.counts.times_s[-1])
    on, between = (np.abs(phase - at) < 0.1 for at in (np.round(phase), 0.3))
    onsets = music.rhythm[:, 1]
    assert onsets[inside & on].mean() > 2 * onsets[inside & between].mean()


def test_count_1_is_on_a_downbeat(analysed):
    for first_number in (1, 2, 3, 4):
        take = take_of(0.3, 0.5, first_number=first_number, song_start_s=2.0)
        ahead = beats_ahead(take.counts.times_s, take.counts, analysed.counts, take.song_start_s)
        assert analysed.counts.numbers[ahead] == first_number
        recorded = (2.0 + 0.3 - analysed.counts.times_s[0]) / 0.5
        assert abs(ahead - recorded) <= 2  # and the pair is moved no further than that needs


def test_a_pair_in_step_stays_as_it_was_recorded(analysed):
    beats_s = analysed.counts.times_s
    start_s = round((float(beats_s[4]) - 0.2) * FRAME_RHYTHM_FPS) / FRAME_RHYTHM_FPS  # rhythm is in frames
    inside = (beats_s >= start_s) & (beats_s < start_s + 15)
    counts = make_counts(beats_s[inside] - start_s, analysed.counts.numbers[inside], 4)
    take = replace(take_of(0.2, 0.5), counts=counts, song_start_s=start_s)
    bounds_s = counts.times_s
    in_step = music_of_take(take, analysed, bounds_s)
    recorded = music_of_take(replace(take, counts=NO_COUNTS), analysed, bounds_s)
    frames = slice(0, 14 * FRAME_RHYTHM_FPS)
    assert np.corrcoef(in_step.rhythm[frames, 1], recorded.rhythm[frames, 1])[0, 1] > 0.9
    assert np.allclose(in_step.spectral, recorded.spectral, rtol=0.2, atol=0.5)


def test_without_counts_the_music_is_as_recorded_and_has_no_phase(analysed):
    take = replace(take_of(0.2, 0.5), counts=NO_COUNTS)
    music = music_of_take(take, analysed, np.arange(0.0, 14.0, 0.5))
    assert not music.count_phase.any()
    beats = np.flatnonzero(music.rhythm[:, BEAT]) / FRAME_RHYTHM_FPS
    assert beats[:5] == pytest.approx(analysed.counts.times_s[:5], abs=0.5 / FRAME_RHYTHM_FPS + 1e-6)
