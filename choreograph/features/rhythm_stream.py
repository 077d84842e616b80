"""Rhythmic features of music that is still playing: `features.frame_rhythm`, row by row as samples come in.

Every row is a function of the samples up to 46 ms after its frame. What `frame_rhythm` relates to the whole
song is related to what was heard so far: the loudness that `rms` is relative to, and the loudest band that
onsets are within 60 dB of. After the first loud bar the two agree.
"""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from choreograph.arguments import as_array
from choreograph.audio.song import SILENCE_PEAK
from choreograph.errors import ParameterError
from choreograph.features.frame_rhythm import FRAME_RHYTHM_FPS, WINDOW_FRAMES
from choreograph.features.loudness import PAUSE_GATE
from choreograph.features.mel import MEL_BANDS, MEL_WINDOW, log_mel_of_windows
from choreograph.features.onsets import ONSET_RANGE, band_means
from choreograph.timebase import MUSIC_FPS, SAMPLE_RATE_HZ, seconds_to_frames, times_to_frames

Floats = NDArray[np.float64]

_FRAME_SAMPLES = SAMPLE_RATE_HZ // FRAME_RHYTHM_FPS  # 735, exactly
_HALF = MEL_WINDOW // 2
_WIDTH = WINDOW_FRAMES * MUSIC_FPS // FRAME_RHYTHM_FPS  # onsets in a window
_LONGEST_LAG = 2 * MUSIC_FPS  # of the autocorrelation: no beat lasts longer


class RhythmStream:
    """The four rhythmic features of frames 0, 1, 2, … of music whose beats (Q,) are known, at 30 fps."""

    def __init__(self, beat_times_s: Floats) -> None:
        self._beats = beat_times_s
        self._beat_frames = frozenset(np.rint(times_to_frames(beat_times_s, FRAME_RHYTHM_FPS)).tolist())
        self._samples = np.zeros(_HALF, np.float32)  # silence before the song; the oldest are dropped
        self._first = -_HALF  # index in the song of the first of them
        self._n_fed, self.has_ended = 0, False
        self._mel = np.full((2, MEL_BANDS), -np.inf, np.float32)  # of the last two frames at 60 fps
        self._loudest = -np.inf
        self._onsets = deque([0.0] * (_WIDTH + _LONGEST_LAG), maxlen=_WIDTH + _LONGEST_LAG)
        self._energy = deque([0.0] * WINDOW_FRAMES, maxlen=WINDOW_FRAMES)  # of the frames of a window
        self._loudest_energy = _FRAME_SAMPLES * SILENCE_PEAK**2 / PAUSE_GATE
        self._sound = [0.0, 0]  # energy and samples of what is no pause
        self._row, self._n_rows = np.zeros(4, np.float32), 0  # the last one; how many

    @property
    def heard_s(self) -> float:
        """Seconds of music fed so far."""
        return self._n_fed / SAMPLE_RATE_HZ

    def feed(self, samples: NDArray[np.floating]) -> None:
        """Add samples (S,), mono at 22.05 kHz; `ParameterError` unless they are finite, or after the end."""
        block = as_array("samples (S,)", samples).astype(np.float32, copy=False)
        if self.has_ended:
            raise ParameterError("expected no more samples after the end of the music")
        if block.ndim != 1 or not np.isfinite(block).all():
            raise ParameterError(f"expected finite mono samples (S,), got an array of shape {block.shape}")
        self._samples = np.concatenate([self._samples, block])
        self._n_fed += len(block)

    def finish(self) -> None:
        """Say that no more music follows: silence is heard then, and the last row is repeated."""
        if not self.has_ended:
            self._samples = np.concatenate([self._samples, np.zeros(MEL_WINDOW, np.float32)])
            self.has_ended = True

    def has_row(self) -> bool:
        """Whether enough music was fed for the next row."""
        return self.has_ended or self._n_rows * _FRAME_SAMPLES + _HALF <= self._n_fed

    def next_row(self) -> NDArray[np.float32]:
        """Tempogram, onset strength, RMS and beat of the next frame, (4,)."""
        frame = self._n_rows
        if self.has_ended and frame >= max(1, seconds_to_frames(self.heard_s, FRAME_RHYTHM_FPS)):
            return self._row
        self._n_rows += 1
        begin = max(0, 2 * frame - 1)  # each row adds the frame at 60 fps before it, and its own
        for onset_frame in range(begin, 2 * frame + 1):
            self._hear(round(onset_frame * SAMPLE_RATE_HZ / MUSIC_FPS))
        features = (self._tempogram(frame), self._onsets[-1], self._rms(frame), frame in self._beat_frames)
        self._row = np.array(features, np.float32)
        keep = (frame - 1) * _FRAME_SAMPLES - _HALF - self._first
        if keep > SAMPLE_RATE_HZ:
            self._samples, self._first = self._samples[keep:], self._first + keep
        return self._row

    def _hear(self, centre: int) -> None:
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
        """Root mean square of the frame's window, relative to that of all sound heard so far."""
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
