"""The rhythm of a song relative to its counts, twice a second: tempo, metre, and patterns of onsets.

A tempogram differs more between instruments and arrangements than between a rumba and a cha-cha. A linear
model of tempograms classified nearly all rumbas outside its training set as waltzes or cha-chas. With these
features, it misclassified few.

ChoreoGraph's music input is the log-mel alone. The columns, `RHYTHM_DIM` in all, are:

- `LOUDNESS` and `ONSETS`: level in dB relative to the song's median, and mean rise of log power. These two
  are means over the 4 s around the row, all others over 12 s
- `TEMPO`: a bump on a logarithmic axis at the tempo of the beats
- `METRE`: shares of beats in bars of three and of four
- `PATTERN`: onsets of bass, melody and percussion in each quarter of a beat of the bar, then in each twelfth
  of a beat, relative to their mean

Without beats, tempo, metre and patterns are 0.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from choreograph.core.arguments import as_array
from choreograph.core.counts import Counts
from choreograph.core.errors import ParameterError
from choreograph.core.numerics import AnyFloats, Floats, frame_blocks
from choreograph.core.progress import StepReport
from choreograph.core.timebase import (
    MUSIC_FPS,
    SAMPLE_RATE_HZ,
    SEGMENT_S,
    frame_times_s,
    seconds_to_frames,
    times_to_frames,
)
from choreograph.music.beats import checked_beat_times_s
from choreograph.music.mel import (
    MEL_BANDS,
    MEL_WINDOW,
    N_BANDS,
    ONSET_RANGE,
    PAUSE_GATE,
    band_means,
    log_mel,
    log_mel_of_windows,
    loudness,
    onset_envelopes,
    scaled,
    sums_before,
)
from choreograph.music.song import SILENCE_PEAK, Song, sample_blocks
from choreograph.music.spectral import spectral_features

RHYTHM_FPS = 2
CONTEXT_S = 12.0  # of music around a row, except for loudness and onsets
TEMPI_BPM = np.geomspace(45.0, 240.0, 30)
_BUMP_OCTAVES = 0.08  # standard deviation, one step of the axis
_METRES = (3, 4)
_BAR_BEATS, _BEAT_PARTS = 4, 4  # of a bar's pattern. Counts beyond four are left out
_FINE_PARTS = 12  # of a beat: triplets and sixteenths
_BAR_PARTS = _BAR_BEATS * _BEAT_PARTS

LOUDNESS, ONSETS = 0, 1
TEMPO = slice(2, 2 + len(TEMPI_BPM))
METRE = slice(TEMPO.stop, TEMPO.stop + len(_METRES))
PATTERN = slice(METRE.stop, METRE.stop + N_BANDS * (_BAR_PARTS + _FINE_PARTS))
RHYTHM_DIM = PATTERN.stop

_DB_PER_NEPER = 10.0 / np.log(10.0)


def rhythm_features(log_mel: AnyFloats, counts: Counts, *, start_s: float = 0.0) -> NDArray[np.float32]:
    """Rhythm of a song, float32 (N, RHYTHM_DIM) at 2 rows a second.

    Parameters
    ----------
    log_mel : float array (T, 96)   of the whole song, at 60 fps
    counts : of the song, in seconds from its beginning, or none if it has no beats
    start_s : time of the first row, for a take whose motion begins there

    Returns
    -------
    row i is about the 12 s around start_s + i / 2 s, up to the song's end (at least one row)

    Raises
    ------
    ParameterError   if `log_mel` is not (T, 96) with T of at least 1
    """
    onsets = onset_envelopes(log_mel)  # (T, 3)
    n_rows = 1 + max(0, int((len(onsets) / MUSIC_FPS - start_s) * RHYTHM_FPS))
    centres_s = start_s + np.arange(n_rows) / RHYTHM_FPS
    out = np.zeros((n_rows, RHYTHM_DIM), np.float32)
    out[:, LOUDNESS], out[:, ONSETS] = _near(log_mel, onsets, centres_s)
    if len(counts) >= 2:
        out[:, TEMPO], out[:, METRE] = _tempo_and_metre(counts, centres_s)
        out[:, PATTERN] = _patterns(onsets, counts, centres_s)
    return out


def off_beat_share(rhythm: AnyFloats) -> float:
    """Share of a song's percussion that is halfway between beats rather than on them.

    `rhythm` (N, RHYTHM_DIM) is the result of `rhythm_features`. The share is the upper quartile of that of
    its rows. Without beats, it is 1.
    """
    fine = rhythm[:, PATTERN].reshape(len(rhythm), N_BANDS, -1)[:, -1, _BAR_PARTS:]  # (N, 12)
    half = _FINE_PARTS // 2
    on_beat = fine[:, 0] + (fine[:, 1] + fine[:, -1]) / 2
    between = fine[:, half] + (fine[:, half - 1] + fine[:, half + 1]) / 2
    counted = on_beat + between > 0
    if not counted.any():
        return 1.0
    return float(np.quantile(between[counted] / (on_beat + between)[counted], 0.75))


def _near(log_mel: AnyFloats, onsets: AnyFloats, centres_s: AnyFloats) -> tuple[AnyFloats, AnyFloats]:
    """Loudness in dB and mean onset strength (N,) of the 4 s around each row."""
    level = np.empty(len(log_mel))  # (T,)
    for block in frame_blocks(len(log_mel)):
        level[block] = np.logaddexp.reduce(np.asarray(log_mel[block], np.float64), axis=1)
    power = np.exp(level - level.max())
    frames = _window_frames(centres_s, SEGMENT_S, len(onsets))
    mean_power = _window_means([power[:, None]], frames)[:, 0]
    level_db = _DB_PER_NEPER * np.log(np.maximum(mean_power, 1e-6))
    return level_db - np.median(level_db), _window_means([onsets], frames).mean(axis=1)


def _tempo_and_metre(counts: Counts, centres_s: AnyFloats) -> tuple[AnyFloats, AnyFloats]:
    """Bumps (N, 30) at the tempo of the beats around each row, and shares of bars (N, 2)."""
    times_s = counts.times_s
    metre = _metre_of_beats(counts)  # (Q,)
    tempo = np.zeros((len(centres_s), len(TEMPI_BPM)))
    shares = np.zeros((len(centres_s), len(_METRES)))
    windows = np.searchsorted(
        times_s, np.stack([centres_s - CONTEXT_S / 2, centres_s + CONTEXT_S / 2], axis=1)
    )
    for row, (first, last) in enumerate(windows):
        if last - first < 2:
            continue
        bpm = 60.0 / np.median(np.diff(times_s[first:last]))
        tempo[row] = np.exp(-0.5 * (np.log2(TEMPI_BPM / bpm) / _BUMP_OCTAVES) ** 2)
        shares[row] = [np.mean(metre[first:last] == beats) for beats in _METRES]
    return tempo, shares


def _metre_of_beats(counts: Counts) -> NDArray[np.int64]:
    """Length of the bar that each beat is in, (Q,), or 0 outside bars that are complete."""
    downbeats = np.flatnonzero(counts.numbers == 1)
    metre = np.zeros(len(counts), np.int64)
    if len(downbeats) >= 2:
        metre[downbeats[0] : downbeats[-1]] = np.repeat(np.diff(downbeats), np.diff(downbeats))
    return metre


def _patterns(onsets: AnyFloats, counts: Counts, centres_s: AnyFloats) -> AnyFloats:
    """Onsets (N, 3 × 28) around each row by their position in bar and beat, relative to their mean."""
    frame_s = frame_times_s(len(onsets), MUSIC_FPS)
    index = np.interp(frame_s, counts.times_s, np.arange(len(counts)), left=-1.0, right=-1.0)  # (T,)
    beat, part = _places(index, _BEAT_PARTS)
    number = counts.numbers[beat]
    in_bar = (number - 1) * _BEAT_PARTS + part
    has_bar = (index >= 0) & (number >= 1) & (in_bar < _BAR_PARTS)
    _, in_beat = _places(index, _FINE_PARTS)

    def parts(block: slice) -> AnyFloats:
        """1 where a frame is in a part of the bar or of the beat, (T_b, P)."""
        within = np.zeros((block.stop - block.start, _BAR_PARTS + _FINE_PARTS))
        counted = index[block] >= 0
        within[np.flatnonzero(has_bar[block]), in_bar[block][has_bar[block]]] = 1.0
        within[np.flatnonzero(counted), _BAR_PARTS + in_beat[block][counted]] = 1.0
        return within

    frames = _window_frames(centres_s, CONTEXT_S, len(onsets))
    blocks = list(frame_blocks(len(onsets)))
    share = _window_means(map(parts, blocks), frames)  # (N, P)
    by_part = _window_means(
        ((onsets[b][:, :, None] * parts(b)[:, None]).reshape(b.stop - b.start, -1) for b in blocks), frames
    )
    by_part = by_part.reshape(len(frames), N_BANDS, -1) / np.maximum(share, 1e-6)[:, None]  # (N, 3, P)
    mean = _window_means([onsets], frames)[:, :, None]
    return (by_part / np.maximum(mean, 1e-3)).reshape(len(frames), -1)


def _places(index: AnyFloats, parts: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The beat, and the nearest of its `parts`, of fractional beat indices (T,)."""
    places = np.rint(index * parts).astype(np.int64).clip(0)
    beat = np.minimum(places // parts, int(index.max()))
    return beat, places % parts


def _window_frames(centres_s: AnyFloats, width_s: float, n_frames: int) -> NDArray[np.int64]:
    """First frame and end (N, 2) of the window around each row, at least one frame inside the song."""
    edges_s = np.stack([centres_s - width_s / 2, centres_s + width_s / 2], axis=1)
    frames = np.rint(edges_s * MUSIC_FPS).astype(np.int64)
    first = np.clip(frames[:, 0], 0, n_frames - 1)
    return np.stack([first, np.clip(frames[:, 1], first + 1, n_frames)], axis=1)


def _window_means(blocks: Iterable[AnyFloats], frames: NDArray[np.int64]) -> AnyFloats:
    """Means (N, D) of the rows of values (T, D), in blocks, in each window (N, 2)."""
    sums = sums_before(blocks, frames)  # (N, 2, D)
    return (sums[:, 1] - sums[:, 0]) / (frames[:, 1] - frames[:, 0])[:, None]


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


# Rhythmic features of a stream: those of `music.rhythm`, row by row as samples arrive.
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
