"""Rhythm by a song's counts, and density of its onsets: planted tempi, metres, patterns and levels."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from choreograph.core.counts import NO_COUNTS, Counts, make_counts, numbers_in_bar
from choreograph.core.errors import ParameterError
from choreograph.music.mel import onset_density
from choreograph.music.rhythm import (
    LOUDNESS,
    METRE,
    ONSETS,
    PATTERN,
    RHYTHM_DIM,
    TEMPI_BPM,
    TEMPO,
    off_beat_share,
    rhythm_features,
)

QUIET = -10.0  # nats of power
BAR_PARTS, BEAT_PARTS = 16, 12


def clicks(times_s, duration_s: float = 30.0) -> np.ndarray:
    """Log-mel (T, 96) of broadband clicks."""
    mel = np.full((round(60 * duration_s), 96), QUIET, np.float32)
    for time_s in times_s:
        frame = round(60 * time_s)
        mel[frame : frame + 3] = [[0.0], [-2.0], [-4.0]]
    return mel


def counts(bpm: float, metre: int, duration_s: float = 30.0) -> Counts:
    times_s = np.arange(0.5, duration_s, 60 / bpm)
    return make_counts(times_s, numbers_in_bar(len(times_s), metre), metre)


@given(st.integers(1, 2000), st.booleans())
@settings(max_examples=20, deadline=None)
def test_every_length_has_its_rows(n_frames, counted):
    mel = np.random.default_rng(n_frames).normal(-4, 2, (n_frames, 96))
    given_counts = counts(100, 4, n_frames / 60) if counted and n_frames > 200 else NO_COUNTS
    rows = rhythm_features(mel, given_counts)
    assert rows.shape == (1 + int(n_frames / 60 * 2), RHYTHM_DIM) and np.isfinite(rows).all()
    assert bool(rows[:, TEMPO].any()) == (len(given_counts) >= 2)


@pytest.mark.parametrize("bpm", [60, 95, 128, 180])
@pytest.mark.parametrize("metre", [3, 4])
def test_tempo_and_metre_are_those_of_the_counts(bpm, metre):
    song = counts(bpm, metre)
    row = rhythm_features(clicks(song.times_s), song)[30]
    assert TEMPI_BPM[row[TEMPO].argmax()] == pytest.approx(bpm, rel=0.04)
    assert row[METRE].tolist() == pytest.approx([float(metre == 3), float(metre == 4)], abs=0.15)


def test_patterns_say_where_in_the_bar_and_in_the_beat_it_sounds():
    song = counts(100, 4)
    on_two = song.times_s[song.numbers == 2]
    pattern = rhythm_features(clicks(on_two), song)[30, PATTERN].reshape(3, BAR_PARTS + BEAT_PARTS)
    assert (pattern[:, :BAR_PARTS].argmax(axis=1) == 4).all()  # the first quarter of beat 2
    off_beats = song.times_s[:-1] + 0.3
    pattern = rhythm_features(clicks(off_beats), song)[30, PATTERN].reshape(3, BAR_PARTS + BEAT_PARTS)
    assert (pattern[:, BAR_PARTS:].argmax(axis=1) == BEAT_PARTS // 2).all()
    assert pattern[:, :BAR_PARTS].reshape(3, 4, 4).argmax(axis=2).tolist() == [[2] * 4] * 3


def test_patterns_do_not_depend_on_tempo_or_level():
    rows = []
    for bpm, gain in ((80, 0.0), (120, -3.0)):
        song = counts(bpm, 4)
        row = rhythm_features(clicks(song.times_s[song.numbers % 2 == 1]) + gain, song)[30, PATTERN]
        of_bar = row.reshape(3, BAR_PARTS + BEAT_PARTS)[:, :BAR_PARTS]
        rows.append(of_bar / of_bar.max())
    np.testing.assert_allclose(*rows, atol=0.15)


def test_loud_and_dense_parts_are_told_from_soft_and_sparse_ones():
    mel = np.concatenate([clicks(np.arange(0, 15, 1.0), 15.0) - 3.0, clicks(np.arange(0, 15, 0.25), 15.0)])
    rows = rhythm_features(mel, NO_COUNTS)
    assert rows[45:55, LOUDNESS].min() > rows[5:25, LOUDNESS].max() + 10
    assert rows[45:55, ONSETS].min() > 2 * rows[5:25, ONSETS].max()
    density = onset_density(mel, 30)
    assert density[18:26].min() > 0.5 > density[:10].max()


def test_the_density_of_equal_seconds_is_in_the_middle():
    np.testing.assert_allclose(onset_density(np.full((600, 96), QUIET), 10), 0.5)


def test_rows_begin_at_start_s():
    song = counts(100, 4)
    mel = clicks(song.times_s)
    whole, later = rhythm_features(mel, song), rhythm_features(mel, song, start_s=3.0)
    np.testing.assert_allclose(whole[6:], later, atol=1e-6)


def test_bars_that_are_not_known_leave_the_beat():
    song = counts(100, 4)
    unnumbered = Counts(song.times_s, np.zeros(len(song), np.int64), 0)
    row = rhythm_features(clicks(song.times_s), unnumbered)[30]
    pattern = row[PATTERN].reshape(3, BAR_PARTS + BEAT_PARTS)
    assert row[TEMPO].any() and not row[METRE].any()
    assert not pattern[:, :BAR_PARTS].any() and (pattern[:, BAR_PARTS:].argmax(axis=1) == 0).all()


def test_other_shapes_are_refused():
    with pytest.raises(ParameterError, match="log-mel"):
        rhythm_features(np.zeros((10, 80)), NO_COUNTS)


@pytest.mark.parametrize(("offsets", "share"), [((0.0,), 0.0), ((0.25,), 1.0), ((0.0, 0.25), 0.5)])
def test_off_beats_are_half_way_between_beats(offsets, share):
    beats = counts(120.0, 4)
    heard = np.add.outer(beats.times_s[:-1], offsets).ravel()
    assert off_beat_share(rhythm_features(clicks(heard), beats)) == pytest.approx(share, abs=0.05)
    assert off_beat_share(rhythm_features(clicks(heard), NO_COUNTS)) == 1.0
