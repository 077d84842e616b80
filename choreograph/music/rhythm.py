"""The rhythm of a song relative to its counts, twice a second: tempo, metre, and patterns of onsets.

A tempogram differs more between instruments and arrangements than between a rumba and a cha-cha. A linear
model of tempograms classified nearly all rumbas outside its training set as waltzes or cha-chas. With these
features, it misclassified few.

ChoreoGraph's music input is the log-mel alone. The columns, `RHYTHM_DIM` in all, are:

- `LOUDNESS` and `ONSETS`: level in dB relative to the song's median, and mean rise of log power. These two
are
  means over the 4 s around the row, all others over 12 s
- `TEMPO`: a bump on a logarithmic axis at the tempo of the beats
- `METRE`: shares of beats in bars of three and of four
- `PATTERN`: onsets of bass, melody and percussion in each quarter of a beat of the bar, then in each twelfth
  of a beat, relative to their mean

Without beats, tempo, metre and patterns are 0.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from choreograph.core.counts import Counts
from choreograph.core.numerics import AnyFloats, frame_blocks, sums_before
from choreograph.core.timebase import MUSIC_FPS, SEGMENT_S, frame_times_s
from choreograph.music.mel import N_BANDS, onset_envelopes

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
