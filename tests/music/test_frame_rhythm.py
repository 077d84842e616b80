"""The four rhythmic features per frame on clicks, pauses and very short songs."""

from __future__ import annotations

import librosa
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from choreograph.core.errors import ParameterError
from choreograph.core.timebase import SAMPLE_RATE_HZ
from choreograph.music.mel import loudness, scaled
from choreograph.music.rhythm import FRAME_RHYTHM_NAMES, WINDOW_FRAMES, frame_rhythm

FRAME = 735  # samples
TEMPOGRAM, ONSET, RMS, BEAT = range(len(FRAME_RHYTHM_NAMES))


def clicks(times_s: np.ndarray, duration_s: float) -> np.ndarray:
    samples = np.random.default_rng(0).normal(0, 1e-4, round(duration_s * SAMPLE_RATE_HZ)).astype(np.float32)
    n = np.arange(3000) / SAMPLE_RATE_HZ
    click = np.exp(-40 * n) * np.sin(2 * np.pi * 700 * n)
    for time_s in times_s:
        start = round(time_s * SAMPLE_RATE_HZ)
        samples[start : start + 3000] += 0.5 * click[: len(samples) - start]
    return samples


def song(seed: int = 0, duration_s: float = 6.0) -> tuple[np.ndarray, np.ndarray]:
    """Clicks on irregular beats and softer between them, over a tone that swells."""
    rng = np.random.default_rng(seed)
    beats = np.cumsum(rng.uniform(0.4, 0.6, int(duration_s)))
    between = beats[:-1] + rng.uniform(0.3, 0.7, len(beats) - 1) * np.diff(beats)
    n = np.arange(round(duration_s * SAMPLE_RATE_HZ)) / SAMPLE_RATE_HZ
    swell = 0.1 * np.sin(2 * np.pi * 330 * n) * np.sin(np.pi * n / duration_s) ** 2
    return clicks(beats, duration_s) + 0.4 * clicks(between, duration_s) + swell.astype(np.float32), beats


def test_rms_agrees_with_librosa_over_the_window_that_ends_with_the_frame():
    samples, beats = song()
    ours = frame_rhythm(samples, beats)[:, RMS]
    window = WINDOW_FRAMES * FRAME
    half = FRAME // 2 + 1  # the window ends half a frame after the frame's time
    padded = np.pad(scaled(samples, loudness(samples)), (window - half, half))
    theirs = librosa.feature.rms(y=padded, frame_length=window, hop_length=FRAME, center=False)[0]
    np.testing.assert_allclose(ours, theirs[: len(ours)], atol=1e-5)


def test_onset_strength_correlates_with_librosas():
    samples, beats = song()
    ours = frame_rhythm(samples, beats)[:, ONSET]
    theirs = librosa.onset.onset_strength(y=samples, sr=SAMPLE_RATE_HZ, hop_length=FRAME, center=True)
    shift = round(2048 / 2 / FRAME)  # librosa puts an onset half a window late
    n = len(ours) - shift
    assert np.corrcoef(ours[3:n], theirs[3 + shift : n + shift])[0, 1] > 0.85


def test_the_tempogram_value_is_the_correlation_of_two_windows():
    from choreograph.music.mel import log_mel, onset_envelopes

    samples, beats = song(3)
    onsets = onset_envelopes(log_mel(scaled(samples, loudness(samples)))).mean(axis=1)  # 60 fps
    ours = frame_rhythm(samples, beats)[:, TEMPOGRAM]
    for k in (2, 3):
        frame = int(np.ceil(beats[k] * 30)) + 1  # inside the interval from beat k on
        lag = round((beats[k + 1] - beats[k]) * 60)
        now, before = (onsets[end - 19 : end + 1] for end in (2 * frame, 2 * frame - lag))
        expected = now @ before / np.sqrt((now @ now) * (before @ before))
        assert ours[frame] == pytest.approx(expected, abs=1e-4)


@pytest.mark.parametrize("bpm", [60, 97, 120, 140])
def test_steady_clicks_repeat_at_the_beat_and_at_no_other_lag(bpm):
    period_s = 60 / bpm
    beats = np.arange(0.5, 19.5, period_s)
    samples = clicks(beats, 20.0)
    right = frame_rhythm(samples, beats)[:, TEMPOGRAM]
    wrong = frame_rhythm(samples, np.arange(0.5, 19.5, 0.7 * period_s))[:, TEMPOGRAM]
    has_click = np.zeros(600, bool)
    for beat in beats[2:-1]:
        has_click[round(beat * 30) : round(beat * 30) + 9] = True
    assert np.median(right[has_click]) > 0.9
    assert np.median(wrong[has_click]) < 0.3


@pytest.mark.parametrize("bpm", [80, 120])
def test_clicks_are_onsets_on_beats(bpm):
    beats = np.arange(1.0, 9.5, 60 / bpm)
    rows = frame_rhythm(clicks(beats, 10.0), beats)
    frames = np.flatnonzero(rows[:, BEAT])
    np.testing.assert_array_equal(frames, np.rint(beats * 30).astype(int))
    near = np.abs(np.arange(300)[:, None] - frames).min(axis=1) <= 2
    assert rows[near, ONSET].max() > 1.0
    for frame in frames:
        assert rows[frame - 1 : frame + 2, ONSET].max() > 5 * rows[~near, ONSET].max()


def test_rms_has_no_look_ahead():
    """A tone from 2 s on: its root mean square rises from there, through a third of a second, to 1."""
    n = np.arange(4 * SAMPLE_RATE_HZ) / SAMPLE_RATE_HZ
    rms = frame_rhythm(np.where(n >= 2.0, np.sin(2 * np.pi * 500 * n), 0.0), np.zeros(0))[:, RMS]
    assert (rms[:60] == 0.0).all()
    np.testing.assert_allclose(rms[60:71], np.sqrt(np.minimum(1.0, (np.arange(11) + 0.5) / 10)), atol=0.01)
    np.testing.assert_allclose(rms[70:-1], 1.0, atol=0.01)


@given(st.floats(5e-3, 50.0), st.integers(0, 5))
@settings(max_examples=15, deadline=None)
def test_gain_changes_nothing(gain, seed):
    samples, beats = song(seed, 3.0)
    np.testing.assert_allclose(frame_rhythm(samples * gain, beats), frame_rhythm(samples, beats), atol=2e-3)


@given(st.integers(0, 50), st.integers(0, 5))
@settings(max_examples=15, deadline=None)
def test_a_delayed_song_gives_delayed_features(n_frames, seed):
    samples, beats = song(seed, 4.0)
    later = np.concatenate([np.zeros(n_frames * FRAME, np.float32), samples])
    shifted = frame_rhythm(later, beats + n_frames / 30)
    quiet_until = 2 + int(beats[0] * 30)  # the start of a song is no onset there; after a pause it is
    here = slice(quiet_until + WINDOW_FRAMES + 20, None)
    np.testing.assert_allclose(shifted[n_frames:][here], frame_rhythm(samples, beats)[here], atol=5e-3)
    np.testing.assert_array_equal(shifted[: max(0, n_frames - 2), [TEMPOGRAM, RMS, BEAT]], 0.0)


@given(st.integers(1, 3 * WINDOW_FRAMES * FRAME), st.booleans())
@settings(max_examples=30, deadline=None)
def test_every_length_has_its_frames(n_samples, silent):
    samples = np.zeros(n_samples) if silent else np.random.default_rng(0).normal(0, 0.1, n_samples)
    duration_s = n_samples / SAMPLE_RATE_HZ
    rows = frame_rhythm(samples, np.array([0.0, duration_s / 2, duration_s]))
    assert rows.shape == (max(1, round(duration_s * 30)), 4)
    assert rows.dtype == np.float32
    assert np.isfinite(rows).all()
    assert rows[0, BEAT] == rows[-1, BEAT] == 1.0
    assert (rows[:, :BEAT] == 0.0).all() == silent


@pytest.mark.parametrize("beats", [[], [1.0]])
def test_without_two_beats_there_is_no_tempogram(beats):
    rows = frame_rhythm(song()[0], np.array(beats))
    assert (rows[:, TEMPOGRAM] == 0.0).all()
    assert rows[:, BEAT].sum() == len(beats)
    assert rows[:, ONSET].max() > 0.5


@pytest.mark.parametrize(
    ("beats", "reason"),
    [
        ([0.5, 0.5], "increasing"),
        ([1.0, 0.5], "increasing"),
        ([0.5, np.nan], "finite"),
        ([[0.5], [1.0]], "shape"),
        ([-0.1, 1.0], "another song"),
        ([0.5, 7.0], "another song"),
    ],
)
def test_beats_of_another_song_are_refused_in_one_line(beats, reason):
    with pytest.raises(ParameterError, match=reason) as error:
        frame_rhythm(song()[0], np.array(beats))
    assert "\n" not in str(error.value)
