"""Rhythmic features of music per frame at 30 fps, for whole songs, motion words and streams of samples."""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from choreograph.core.arguments import as_array
from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats, sums_before
from choreograph.core.progress import StepReport
from choreograph.core.timebase import (
    MUSIC_FPS,
    SAMPLE_RATE_HZ,
    frame_times_s,
    seconds_to_frames,
    times_to_frames,
)
from choreograph.music.beats import checked_beat_times_s
from choreograph.music.mel import (
    MEL_BANDS,
    MEL_WINDOW,
    ONSET_RANGE,
    PAUSE_GATE,
    band_means,
    log_mel,
    log_mel_of_windows,
    loudness,
    onset_envelopes,
    scaled,
)
from choreograph.music.song import SILENCE_PEAK, Song, sample_blocks
from choreograph.music.spectral import spectral_features

# Rhythmic features of music per frame at 30 fps, four numbers each, for the rollout network.
#
# | the paper's Table 2 | here |
# | --- | --- |
# | a1 tempogram (autocorrelation of onset strength) | that of the window at a lag of one beat, 0 to 1 |
# | a2 spectral flux onset strength | rise of log power into the window's last frame, 0 to about 4 |
# | a3 root mean square value | of the window's samples, relative to the song's own loudness |
# | a4 beat rate (binary form) | 1 if a beat is nearest to the window's last frame, else 0 |
#
# The window is the 10 frames (1/3 s) that end with the frame itself, so a row depends on samples up to half a
# spectral window (46 ms) after it. To give a network 1/3 s of future, pass it row t + 9 at frame t.
#
# The paper leaves two details open. A tempogram has one value per lag but Table 2 has one number. It is taken
# at the lag of the beat, since the mean over the lags of a 10-frame window would only count onsets. a2 and a4
# are taken at the last frame of the window, since a mean over 1/3 s would not locate a beat.


FRAME_RHYTHM_FPS = 30
FRAME_RHYTHM_NAMES = ("tempogram", "onset_strength", "rms", "beat")
WINDOW_FRAMES = 10

_FRAME_SAMPLES = SAMPLE_RATE_HZ // FRAME_RHYTHM_FPS  # 735, exactly
_ONSETS_PER_FRAME = MUSIC_FPS // FRAME_RHYTHM_FPS


def frame_rhythm(samples: NDArray[np.floating], beat_times_s: NDArray[np.floating]) -> NDArray[np.float32]:
    """The four rhythmic features of every frame: tempogram, onset strength, RMS, beat.

    Parameters
    ----------
    samples : float array (S,)        mono at 22.05 kHz, at any gain
    beat_times_s : float array (Q,)   increasing times inside the song, may be empty

    Returns
    -------
    float32 array (T, 4)   T = round(S / 22050 * 30), at least 1. Frame i is at i / 30 s and its window is
    the 10 frames that end with it. Outside the song there is silence. In a silent song only the beat
    column is not 0. With fewer than two beats there is no lag, and the tempogram is 0.

    Raises
    ------
    ParameterError   if samples are empty, not mono or not finite, or beats not increasing in the song

    References
    ----------
    Rhythm is a Dancer, section 3.1.1 and Table 2 (a1 to a4).
    """
    samples = np.asarray(samples, np.float32)
    level = loudness(samples)
    duration_s = len(samples) / SAMPLE_RATE_HZ
    beats = checked_beat_times_s(beat_times_s, duration_s)
    n_frames = max(1, seconds_to_frames(duration_s, FRAME_RHYTHM_FPS))
    onsets = onset_envelopes(log_mel(samples, level=level)).mean(axis=1)  # (T60,) at 60 fps, T60 >= 2 T - 1
    is_beat = np.zeros(n_frames)
    is_beat[np.minimum(np.rint(times_to_frames(beats, FRAME_RHYTHM_FPS)).astype(np.int64), n_frames - 1)] = 1
    columns = (
        _beat_lag_autocorrelation(onsets, beats, n_frames),
        onsets[: _ONSETS_PER_FRAME * n_frames : _ONSETS_PER_FRAME],
        _window_rms(samples, level, n_frames),
        is_beat,
    )
    return np.stack(columns, axis=1).astype(np.float32)  # (T, 4)


def _beat_lag_autocorrelation(
    onsets: NDArray[np.floating], beats: NDArray[np.float64], n_frames: int
) -> NDArray[np.floating]:
    """Autocorrelation of each frame's window of onsets, at the lag of the beat interval around it, (T,)."""
    if len(beats) < 2:
        return np.zeros(n_frames)
    intervals = np.maximum(1, np.rint(times_to_frames(np.diff(beats), MUSIC_FPS))).astype(np.int64)  # (Q-1,)
    interval = np.searchsorted(beats, frame_times_s(n_frames, FRAME_RHYTHM_FPS), side="right") - 1
    lags = intervals[interval.clip(0, len(intervals) - 1)]  # (T,)
    width = WINDOW_FRAMES * _ONSETS_PER_FRAME
    silence = np.zeros(width, onsets.dtype)
    windows = np.lib.stride_tricks.sliding_window_view(np.concatenate([silence, onsets]), width)
    ends = 1 + _ONSETS_PER_FRAME * np.arange(n_frames)  # row 0 is the silence before the song
    now, before = windows[ends], windows[np.maximum(0, ends - lags)]  # (T, W)
    energy = np.sqrt((now**2).sum(axis=1) * (before**2).sum(axis=1))
    correlation: NDArray[np.floating] = (now * before).sum(axis=1) / np.maximum(energy, 1e-9)
    return correlation


def _window_rms(samples: NDArray[np.floating], level: float, n_frames: int) -> NDArray[np.float64]:
    """Root mean square, relative to a level, of each frame's window, (T,).

    The window ends half a frame after the frame's time.
    """
    ends = np.arange(n_frames) * _FRAME_SAMPLES + _FRAME_SAMPLES // 2 + 1
    width = WINDOW_FRAMES * _FRAME_SAMPLES
    at = np.stack([np.minimum(ends, len(samples)), np.clip(ends - width, 0, len(samples))])
    squares = (np.square(scaled(block, level), dtype=np.float64)[:, None] for block in sample_blocks(samples))
    until_end, until_start = sums_before(squares, at)[..., 0]
    inside = until_end - until_start
    rms: NDArray[np.float64] = np.sqrt(inside / width)
    return rms


# Audio input of the rollout network: rhythm per frame and spectral features per motion word.


def rhythm_from(song: Song, beat_times_s: NDArray[np.float64], start_s: float) -> NDArray[np.float32]:
    """The four rhythmic features (T, 4) at 30 fps from a time in the song on, at least one row.

    Before the song's start the first row is repeated.
    """
    rhythm = frame_rhythm(song.samples, beat_times_s)
    first = seconds_to_frames(start_s, FRAME_RHYTHM_FPS)
    if first < 0:
        return np.concatenate([np.repeat(rhythm[:1], -first, axis=0), rhythm])
    return rhythm[min(first, len(rhythm) - 1) :]


def word_spectra(
    song: Song, bounds_s: NDArray[np.float64], *, report: StepReport | None = None
) -> NDArray[np.float32]:
    """The 87 spectral features of the music of each word, (N, 87), for word boundaries (N + 1,) in seconds.

    A word outside the song gets the features of the nearest one inside.
    """
    inside = np.unique(np.clip(bounds_s, 0.0, song.duration_s))
    if len(inside) < 2:
        inside = np.array([0.0, song.duration_s])
    rows = spectral_features(song.samples, inside, report=report)
    middles = (bounds_s[1:] + bounds_s[:-1]) / 2
    spectra: NDArray[np.float32] = rows[
        (np.searchsorted(inside, middles, side="right") - 1).clip(0, len(rows) - 1)
    ]
    return spectra


# Rhythmic features of a stream: those of `music.frame_rhythm`, row by row as samples arrive.
#
# Every row is a function of the samples up to 46 ms after its frame. Two references of `frame_rhythm` are
# computed from the music fed so far instead of from the whole song: the loudness for `rms`, and the loudest
# band, for the 60 dB of onsets. After the first loud bar the two agree.


_HALF = MEL_WINDOW // 2
_WIDTH = WINDOW_FRAMES * MUSIC_FPS // FRAME_RHYTHM_FPS  # onsets in a window
_LONGEST_LAG = 2 * MUSIC_FPS  # of the autocorrelation: no beat lasts longer


class RhythmStream:
    """The four rhythmic features of frames 0, 1, 2, … of music whose beats (Q,) are known, at 30 fps."""

    def __init__(self, beat_times_s: Floats) -> None:
        self._beats = beat_times_s
        self._beat_frames = frozenset(np.rint(times_to_frames(beat_times_s, FRAME_RHYTHM_FPS)).tolist())
        self._samples = np.zeros(_HALF, np.float32)  # silence before the song. The oldest are dropped
        self._first = -_HALF  # index in the song of the first of them
        self._n_fed, self.has_ended = 0, False
        self._mel = np.full((2, MEL_BANDS), -np.inf, np.float32)  # of the last two frames at 60 fps
        self._loudest = -np.inf
        self._onsets = deque([0.0] * (_WIDTH + _LONGEST_LAG), maxlen=_WIDTH + _LONGEST_LAG)
        self._energy = deque([0.0] * WINDOW_FRAMES, maxlen=WINDOW_FRAMES)  # of the frames of a window
        self._loudest_energy = _FRAME_SAMPLES * SILENCE_PEAK**2 / PAUSE_GATE
        self._sound = [0.0, 0]  # energy and number of samples outside pauses
        self._row, self._n_rows = np.zeros(4, np.float32), 0  # the last one and their number

    @property
    def fed_s(self) -> float:
        """Seconds of music fed so far."""
        return self._n_fed / SAMPLE_RATE_HZ

    def feed(self, samples: NDArray[np.floating]) -> None:
        """Add samples (S,), mono at 22.05 kHz. Raises `ParameterError` after the end, or if not finite."""
        block = as_array("samples (S,)", samples).astype(np.float32, copy=False)
        if self.has_ended:
            raise ParameterError("expected no more samples after the end of the music")
        if block.ndim != 1 or not np.isfinite(block).all():
            raise ParameterError(f"expected finite mono samples (S,), got an array of shape {block.shape}")
        self._samples = np.concatenate([self._samples, block])
        self._n_fed += len(block)

    def finish(self) -> None:
        """End the music: silence is added, and from the end on the last row is repeated."""
        if not self.has_ended:
            self._samples = np.concatenate([self._samples, np.zeros(MEL_WINDOW, np.float32)])
            self.has_ended = True

    def has_row(self) -> bool:
        """Whether enough music was fed for the next row."""
        return self.has_ended or self._n_rows * _FRAME_SAMPLES + _HALF <= self._n_fed

    def next_row(self) -> NDArray[np.float32]:
        """Tempogram, onset strength, RMS and beat of the next frame, (4,)."""
        frame = self._n_rows
        if self.has_ended and frame >= max(1, seconds_to_frames(self.fed_s, FRAME_RHYTHM_FPS)):
            return self._row
        self._n_rows += 1
        begin = max(0, 2 * frame - 1)  # each row adds the frame at 60 fps before it, and its own
        for onset_frame in range(begin, 2 * frame + 1):
            self._add_onset(round(onset_frame * SAMPLE_RATE_HZ / MUSIC_FPS))
        features = (self._tempogram(frame), self._onsets[-1], self._rms(frame), frame in self._beat_frames)
        self._row = np.array(features, np.float32)
        keep = (frame - 1) * _FRAME_SAMPLES - _HALF - self._first
        if keep > SAMPLE_RATE_HZ:
            self._samples, self._first = self._samples[keep:], self._first + keep
        return self._row

    def _add_onset(self, centre: int) -> None:
        """Add the onset strength of the frame at 60 fps around a sample."""
        start = centre - _HALF - self._first
        mel = log_mel_of_windows(self._samples[None, start : start + MEL_WINDOW])[0]  # (96,)
        self._loudest = max(self._loudest, float(mel.max()))
        floor = self._loudest - ONSET_RANGE
        before = np.maximum(self._mel[0], floor) if np.isfinite(self._mel[0, 0]) else np.maximum(mel, floor)
        rise = np.maximum(0.0, np.maximum(mel, floor) - before)
        self._onsets.append(float(band_means(rise[None]).mean()))
        self._mel = np.stack([self._mel[1], mel])

    def _tempogram(self, frame: int) -> float:
        """Autocorrelation of the last window of onsets at the beat interval of the frame."""
        if len(self._beats) < 2:
            return 0.0
        beat = int(np.searchsorted(self._beats, frame / FRAME_RHYTHM_FPS, side="right")) - 1
        beat = min(max(beat, 0), len(self._beats) - 2)
        interval = round(float(self._beats[beat + 1] - self._beats[beat]) * MUSIC_FPS)
        lag = min(max(1, interval), _LONGEST_LAG)
        onsets = np.array(self._onsets)
        now, earlier = onsets[-_WIDTH:], onsets[-_WIDTH - lag : -lag]
        return float(now @ earlier / max(np.sqrt((now @ now) * (earlier @ earlier)), 1e-9))

    def _rms(self, frame: int) -> float:
        """Root mean square of the frame's window, relative to that of all sound fed so far."""
        start = max(0, frame * _FRAME_SAMPLES - _FRAME_SAMPLES // 2) - self._first
        stop = frame * _FRAME_SAMPLES + _FRAME_SAMPLES // 2 + 1 - self._first
        energy = float(np.square(self._samples[start:stop], dtype=np.float64).sum())
        self._energy.append(energy)
        self._loudest_energy = max(self._loudest_energy, energy)
        if energy > PAUSE_GATE * self._loudest_energy:
            self._sound = [self._sound[0] + energy, self._sound[1] + stop - start]
        level = self._sound[0] / max(self._sound[1], 1)
        mean = sum(self._energy) / (WINDOW_FRAMES * _FRAME_SAMPLES)
        return float(np.sqrt(mean / level)) if level > 0 else 0.0
