"""Rhythmic features of music per frame at 30 fps, four numbers each: input of the rollout network.

| the paper's Table 2 | here |
| --- | --- |
| a1 tempogram (autocorrelation of onset strength) | that of the window at a lag of one beat, 0 to 1 |
| a2 spectral flux onset strength | rise of log power into the window's last frame, 0 to about 4 |
| a3 root mean square value | of the window's samples; 1 is the song's own loudness |
| a4 beat rate (binary form) | 1 if a beat is nearest to the window's last frame, else 0 |

The window is the 10 frames (1/3 s) that end with the frame itself, so a row depends on nothing later
than half a spectral window (46 ms). To let a network see 1/3 s ahead, give it row t + 9 at frame t.

Where the paper leaves details open: a tempogram has one value per lag but Table 2 has one number, which
we take at the lag of the beat (the mean over the lags of a 10-frame window would only count onsets). a2
and a4 are taken at the window's last frame: averaged over 1/3 s, neither would locate a beat.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from choreograph.features.loudness import at_unit_loudness
from choreograph.features.mel import log_mel
from choreograph.features.music_beats import checked_beat_times_s
from choreograph.features.onsets import onset_envelopes
from choreograph.timebase import MUSIC_FPS, SAMPLE_RATE_HZ, frame_times_s, seconds_to_frames, times_to_frames

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
    beat_times_s : float array (Q,)   increasing times inside the song; may be empty

    Returns
    -------
    float32 array (T, 4)   T = round(S / 22050 * 30), at least 1; frame i is at i / 30 s and its window is
    the 10 frames that end with it. Outside the song there is silence. In a silent song only the beat
    column is not 0. With fewer than two beats there is no lag, and the tempogram is 0.

    Raises
    ------
    ParameterError   if samples are empty, not mono or not finite, or beats not increasing in the song

    References
    ----------
    Rhythm is a Dancer, section 3.1.1 and Table 2 (a1 to a4).
    """
    samples = at_unit_loudness(samples)
    duration_s = len(samples) / SAMPLE_RATE_HZ
    beats = checked_beat_times_s(beat_times_s, duration_s)
    n_frames = max(1, seconds_to_frames(duration_s, FRAME_RHYTHM_FPS))
    onsets = onset_envelopes(log_mel(samples)).mean(axis=1)  # (T60,) at 60 fps, T60 >= 2 T - 1
    is_beat = np.zeros(n_frames)
    is_beat[np.minimum(np.rint(times_to_frames(beats, FRAME_RHYTHM_FPS)).astype(np.int64), n_frames - 1)] = 1
    columns = (
        _beat_lag_autocorrelation(onsets, beats, n_frames),
        onsets[: _ONSETS_PER_FRAME * n_frames : _ONSETS_PER_FRAME],
        _window_rms(samples, n_frames),
        is_beat,
    )
    return np.stack(columns, axis=1).astype(np.float32)  # (T, 4)


def _beat_lag_autocorrelation(
    onsets: NDArray[np.floating], beats: NDArray[np.float64], n_frames: int
) -> NDArray[np.floating]:
    """Autocorrelation of each frame's window of onsets, at the beat interval the frame lies in, (T,)."""
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
    return (now * before).sum(axis=1) / np.maximum(energy, 1e-9)


def _window_rms(samples: NDArray[np.float32], n_frames: int) -> NDArray[np.float64]:
    """Root mean square of each frame's window, which ends half a frame after the frame's time, (T,)."""
    energy = np.concatenate([[0.0], np.cumsum(np.square(samples, dtype=np.float64))])  # (S + 1,)
    ends = np.arange(n_frames) * _FRAME_SAMPLES + _FRAME_SAMPLES // 2 + 1
    width = WINDOW_FRAMES * _FRAME_SAMPLES
    inside = energy[np.minimum(ends, len(samples))] - energy[np.clip(ends - width, 0, len(samples))]
    return np.sqrt(inside / width)
