"""Bars of a song: the number of each beat in its bar, estimated from the music, and its metrical level.

`track_bars` numbers the beats by features of the music at each of them. `metrical_levels` has the same counts
at half and at double tempo, and `choose_level` the one that suits takes. `change_times_s` are the instants at
which tempo or metre change.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import scipy
from numpy.typing import NDArray

from choreograph.core.counts import FROM_MUSIC, Counts, time_at
from choreograph.core.numerics import Floats, Indices, frame_blocks
from choreograph.core.timebase import MUSIC_FPS, SAMPLE_RATE_HZ, times_to_frames
from choreograph.music.beats import checked_beat_times_s
from choreograph.music.mel import checked_log_mel, level_rise, mel_band_hz, sums_before, windows_around
from choreograph.music.spectral import chroma_filterbank

# Features of the music at every beat, from which bars are estimated.
#
# Kick and bass are on downbeats, harmony changes there, and the patterns of a bar are repeated a bar later.
# So every beat gets accents in five bands (on it and halfway to the next), levels, changes of harmony, bass
# and timbre, and the similarity of the music to that some beats later.


_BANDS_HZ = (0.0, 120.0, 250.0, 1000.0, 4000.0, 11025.0)  # kick, bass, chords, melody, percussion
_FLOOR = 60.0 / (10.0 / np.log(10.0))  # 60 dB below the song's maximum, as the natural logarithm of power
_BEFORE, _AFTER = 2, 4  # frames around a beat in which its onset peaks
_SPECTRUM = 8192  # samples, 0.37 s, of the longest window of a beat's spectrum
_BASS_HZ, _HARMONY_HZ = (40.0, 260.0), (200.0, 2000.0)
_COMPRESSION = 100.0  # of chroma, relative to its largest value in the song: log(1 + 100 c)
_NORM_BEATS = 24  # whole bars of three and of four
_CLIP = 3.0
_BAR_BEATS = 3  # the shortest duration of a chord
_BLOCK_BEATS = 512  # whose spectra are in memory at the same time
_SPECTRA_AT_ONCE = 32  # which stay in the processor's cache

_BAND_NAMES = ("kick", "bass", "chords", "melody", "high")
ACCENT_NAMES = (
    *(f"{band} on the beat" for band in _BAND_NAMES),
    *(f"{band} off the beat" for band in _BAND_NAMES),
    *(f"{band} level" for band in _BAND_NAMES),
    "harmony change", "harmony change over two beats", "bass change", "timbre change", "bass in harmony",
)  # fmt: skip
_GROUPS = {
    "low accents": (0, 1, 5, 6),
    "high accents": (2, 3, 4, 7, 8, 9),
    "levels": (10, 11, 12, 13, 14),
    "changes": (15, 16, 17, 18),
}
LAGS = (2, 3, 4, 5, 6, 7, 8, 10, 12, 14)  # beats
REPEAT_NAMES = tuple(f"{name}, {lag} beats" for name in (*_GROUPS, "harmony", "timbre") for lag in LAGS)


def beat_evidence(
    samples: NDArray[np.floating], log_mel: NDArray[np.floating], beat_times_s: Floats
) -> tuple[Floats, Floats]:
    """Accents (Q, 20) and repeats (Q, 60) of two beats or more, as named above. They do not depend on gain.

    Accents are normalised over the 24 beats around. A repeat is the product of the accents of two beats, or
    of the deviations of their harmony or timbre from the mean of all beats.
    """
    floor = log_mel.max() - _FLOOR
    bounds_s = np.append(beat_times_s, 2 * beat_times_s[-1] - beat_times_s[-2])  # (Q + 1,)
    middles_s = 0.5 * (bounds_s[:-1] + bounds_s[1:])
    hz = mel_band_hz()
    bands = [(hz >= low) & (hz < high) for low, high in pairwise(_BANDS_HZ)]
    timbre = _interval_means(log_mel, floor, bounds_s)  # (Q, 96)
    bass, harmony = _chroma(samples, bounds_s)
    rises = np.empty((len(log_mel), len(bands)))  # (T, 5)
    for block in frame_blocks(len(log_mel)):
        rise = level_rise(log_mel, floor, block)
        rises[block] = np.stack([rise[:, band].mean(axis=1) for band in bands], axis=1)
    following = np.minimum(np.arange(len(harmony))[:, None] + np.arange(_BAR_BEATS), len(harmony) - 1)
    spectral_shape = timbre - timbre.mean(axis=1, keepdims=True)
    changes = (
        _change(harmony, 1), _change(harmony, 2), _change(bass, 1), _change(spectral_shape, 1),
        _cosine(bass, harmony[following].sum(axis=1)),
    )  # fmt: skip
    accents = np.hstack(
        [
            _peaks(rises, beat_times_s),
            _peaks(rises, middles_s),
            np.stack([timbre[:, band].mean(axis=1) for band in bands], axis=1),
            np.stack(changes, axis=1),
        ]
    )
    normal = _locally_normal(accents)
    groups = [normal[:, list(columns)] / np.sqrt(len(columns)) for columns in _GROUPS.values()]
    groups += [_unit(harmony - _local_mean(harmony)), _unit(timbre - _local_mean(timbre))]
    return normal, np.stack([_repeat(rows, lag) for rows in groups for lag in LAGS], axis=1)


def _peaks(rises: Floats, times_s: Floats) -> Floats:
    """Largest rise near each time, (Q, 5)."""
    frames = np.rint(times_to_frames(times_s, MUSIC_FPS)).astype(np.int64)
    near = np.clip(frames[:, None] + np.arange(-_BEFORE, _AFTER + 1), 0, len(rises) - 1)
    peaks: Floats = rises[near].max(axis=1)
    return peaks


def _interval_means(log_mel: NDArray[np.floating], floor: float, bounds_s: Floats) -> Floats:
    """Mean of log-mel (T, 96), no lower than `floor`, from each bound to the next, (Q, 96)."""
    n_frames = len(log_mel)
    frames = np.clip(np.rint(times_to_frames(bounds_s, MUSIC_FPS)).astype(np.int64), 0, n_frames)
    starts = np.minimum(frames[:-1], n_frames - 1)
    stops = np.maximum(frames[1:], starts + 1)
    levels = (np.maximum(log_mel[block], floor).astype(np.float64) for block in frame_blocks(n_frames))
    at_starts, at_stops = sums_before(levels, np.stack([starts, stops]))
    means: Floats = (at_stops - at_starts) / (stops - starts)[:, None]
    return means


def _chroma(samples: NDArray[np.floating], bounds_s: Floats) -> tuple[Floats, Floats]:
    """Compressed chroma of bass and of harmony, (Q, 12) each, from the middle 0.37 s of each beat."""
    middles = np.rint(0.5 * (bounds_s[:-1] + bounds_s[1:]) * SAMPLE_RATE_HZ).astype(np.int64)
    sizes = np.clip(np.rint(np.diff(bounds_s) * SAMPLE_RATE_HZ), 2, _SPECTRUM)
    samples = np.asarray(samples, np.float32)
    offsets = np.arange(_SPECTRUM) - _SPECTRUM // 2
    banks = _chroma_banks()
    chroma = tuple(np.empty((len(middles), 12)) for _ in banks)
    for block in frame_blocks(len(middles), _BLOCK_BEATS):
        magnitude = np.empty((block.stop - block.start, _SPECTRUM // 2 + 1), np.float32)  # (Q_b, 4097)
        for few in frame_blocks(len(magnitude), _SPECTRA_AT_ONCE):
            beats = slice(block.start + few.start, block.start + few.stop)
            phase = np.minimum(np.abs(offsets) / sizes[beats, None], 0.5)  # 0 mid-beat, 0.5 outside
            window = (0.5 + 0.5 * np.cos(2 * np.pi * phase)).astype(np.float32)
            sound = windows_around(samples, middles[beats], _SPECTRUM)
            magnitude[few] = np.abs(scipy.fft.rfft(sound * window, axis=1))
        for rows, bank in zip(chroma, banks, strict=True):
            rows[block] = magnitude @ bank.T
    bass, harmony = (np.log1p(_COMPRESSION * rows / max(rows.max(), 1e-12)) for rows in chroma)
    return bass, harmony


@lru_cache(maxsize=1)
def _chroma_banks() -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Pitch class filters (12, 4097) of the bass and of the harmony."""
    bank = chroma_filterbank(_SPECTRUM)
    hz = scipy.fft.rfftfreq(_SPECTRUM, 1 / SAMPLE_RATE_HZ)
    low, high = (bank * ((hz >= a) & (hz < b)) for a, b in (_BASS_HZ, _HARMONY_HZ))
    return low.astype(np.float32), high.astype(np.float32)


def _change(rows: Floats, span: int) -> Floats:
    """Difference of the `span` beats from each beat on to those before it, 0 to 2, (Q,)."""
    sums = np.cumsum(np.vstack([np.zeros((1, rows.shape[1])), rows]), axis=0)
    index = np.arange(len(rows))
    after = sums[np.minimum(index + span, len(rows))] - sums[index]
    before = sums[index] - sums[np.maximum(index - span, 0)]
    before[0] = after[0]
    return 1.0 - _cosine(before, after)


def _cosine(one: Floats, other: Floats) -> Floats:
    cosine: Floats = (_unit(one) * _unit(other)).sum(axis=1)
    return cosine


def _unit(rows: Floats) -> Floats:
    unit: Floats = rows / (np.linalg.norm(rows, axis=1, keepdims=True) + 1e-6)
    return unit


def _local_mean(rows: Floats) -> Floats:
    means: Floats = scipy.ndimage.uniform_filter1d(rows, _NORM_BEATS, axis=0, mode="nearest")
    return means


def _locally_normal(rows: Floats) -> Floats:
    """Rows (Q, F) with local mean 0 and spread 1, no more than 3 from the mean."""
    centred = rows - _local_mean(rows)
    spread = np.sqrt(np.maximum(0.0, _local_mean(centred**2)))  # a running mean may round below 0
    floor = 0.1 * np.sqrt((centred**2).mean(axis=0)) + 1e-3
    normal: Floats = np.clip(centred / np.maximum(spread, floor), -_CLIP, _CLIP)
    return normal


def _repeat(rows: Floats, lag: int) -> Floats:
    """Mean product of each beat's row with those `lag` beats later and earlier, (Q,)."""
    product = (rows[lag:] * rows[:-lag]).sum(axis=1) if len(rows) > lag else np.zeros(0)
    out, count = np.zeros(len(rows)), np.zeros(len(rows))
    out[: len(product)] += product
    count[: len(product)] += 1
    out[lag:] += product
    count[lag:] += 1
    return out / np.maximum(count, 1)


# Bars of a song: the number of each of its beats, by the features of the music there.
#
# A linear model gives the evidence of each beat for each state: a number in a bar of three to seven. The bars
# of the song are the best path through the states. Number follows number, except where the tracker has
# dropped or added a beat, where music begins with a pick-up, or where the metre changes. Each exception has a
# cost. Two in a bar are counted as four (two bars as one). Six beats are a bar if they are as fast as the
# eighths of 6/8. Slower ones are counted as two bars of three, as dancers do.
#
# The model was fitted to synthetic songs alone (`research/fit_bars.py`), so no real song was in its training.


_MIN_BEATS = 4  # one bar
METRES = (3, 4, 5, 6, 7)
_SLOWEST_SIX_BPM = 140.0
STATE_METRE = np.repeat(METRES, METRES)
STATE_NUMBER = np.concatenate([np.arange(1, metre + 1) for metre in METRES])
_METRE_OF_STATE = np.repeat(np.arange(len(METRES)), METRES)
# Two bars of three and a bar of six are counted alike by dancers.
_PLACE = np.where(STATE_METRE == 6, 30 + (STATE_NUMBER - 1) % 3, 10 * STATE_METRE + STATE_NUMBER - 1)
_P_IRREGULAR = 1e-3  # that a bar is shorter or longer
_P_CHANGE = 1e-5  # that a whole bar is followed by another metre
WEIGHTS_PATH = Path(__file__).with_name("bar_weights.json")


@dataclass(frozen=True, eq=False)
class BarWeights:
    """The weights of the linear models, as `research/fit_bars.py` writes them."""

    accents: Floats  # (20, 25) log evidence of an accent for each state
    repeats: Floats  # (61, 5) the same of a repeat for bars of three to seven. The last row is of every beat
    eighths: Floats  # (61,) of mean repeats in the log odds that every beat is counted, not every second one
    confidence: tuple[float, float]  # log odds of right bars: offset, slope in nats over root of beats


@lru_cache(maxsize=1)
def fitted_weights() -> BarWeights:
    """The weights of `bar_weights.json`, in which each row has the name of its accent or repeat."""
    stored = json.loads(WEIGHTS_PATH.read_text(encoding="utf-8"))
    accents, repeats, eighths = (
        np.array(list(stored[name].values())) for name in ("accents", "repeats", "eighths")
    )
    offset, slope = stored["confidence"]
    return BarWeights(accents, repeats, eighths, (offset, slope))


def track_bars(
    samples: NDArray[np.floating],
    log_mel: NDArray[np.floating],
    beat_times_s: NDArray[np.floating],
    *,
    metres: Sequence[int] = METRES,
    may_be_one: NDArray[np.bool_] | None = None,
) -> Counts:
    """The beats of a song numbered in their bars.

    Parameters
    ----------
    samples : float array (S,)        mono at 22.05 kHz, at any gain
    log_mel : float array (T, 96)     of the samples, as `music.mel.log_mel` returns it
    beat_times_s : float array (Q,)   increasing times inside the song
    metres : ints                     metres that the song may have, among `METRES`
    may_be_one : bool array (Q,)      beats that may be count 1, by default all

    Returns
    -------
    Counts   the beats with their numbers. The metre is that of most beats, since it may change within a
    song. The confidence is the probability that the bars are right, given that the beats are. There
    are no bars (metre 0) if there are fewer than four beats or the song is silent

    Raises
    ------
    ParameterError   if `log_mel` is not (T, 96), or beats do not increase inside the song
    """
    log_mel = checked_log_mel(log_mel)
    beats_s = checked_beat_times_s(np.asarray(beat_times_s), len(samples) / SAMPLE_RATE_HZ)
    if len(beats_s) < _MIN_BEATS:
        return _without_bars(beats_s)
    accents, repeats = beat_evidence(samples, log_mel, beats_s)
    if not accents.any():
        return _without_bars(beats_s)
    evidence = state_evidence(accents, repeats, fitted_weights().accents, fitted_weights().repeats)
    evidence[:, ~np.isin(STATE_METRE, metres)] = -np.inf
    if np.median(np.diff(beats_s)) > 60.0 / _SLOWEST_SIX_BPM:
        evidence[:, STATE_METRE == 6] = -np.inf
    if may_be_one is not None:
        evidence[~may_be_one[:, None] & (STATE_NUMBER == 1)] = -np.inf
    states, margin = best_bars(evidence)
    return Counts(
        beats_s,
        STATE_NUMBER[states],
        int(np.bincount(STATE_METRE[states]).argmax()),
        FROM_MUSIC,
        _confidence(margin, len(beats_s)),
    )


def _without_bars(beats_s: Floats) -> Counts:
    return Counts(beats_s, np.zeros(len(beats_s), np.int64), 0, FROM_MUSIC)


def state_evidence(accents: Floats, repeats: Floats, accent_weights: Floats, metre_weights: Floats) -> Floats:
    """Log evidence (Q, 25) of each beat for each state."""
    of_metre = repeats @ metre_weights[:-1] + metre_weights[-1]  # (Q, 5)
    evidence: Floats = accents @ accent_weights + of_metre[:, _METRE_OF_STATE]
    return evidence


def best_bars(evidence: Floats) -> tuple[NDArray[np.int64], float]:
    """The best path of states (Q,), and its log margin over the best path that is nowhere counted alike."""
    suits = np.exp(evidence - evidence.max(axis=1, keepdims=True))  # (Q, 25)
    suits /= suits.sum(axis=1, keepdims=True)
    transition = _transition()
    states, score = _most_probable_path(suits, transition)
    suits[_PLACE[states][:, None] == _PLACE] = 0.0
    _, other = _most_probable_path(suits, transition)
    return states, score - other


def _most_probable_path(observed: Floats, transition: Floats) -> tuple[Indices, float]:
    """The most probable path (Q,) through states and its log probability, by Viterbi's algorithm.

    `observed` (Q, S) are likelihoods, and `transition` (S, S) probabilities. All first states are equally
    probable.
    """
    tiny = np.finfo(np.float64).tiny
    log_observed, log_transition = np.log(observed + tiny), np.log(transition + tiny)
    value = log_observed[0] - np.log(observed.shape[1])
    before = np.zeros(observed.shape, np.int64)
    for beat in range(1, len(observed)):
        values = value[:, None] + log_transition  # (S, S)
        before[beat] = values.argmax(axis=0)
        value = log_observed[beat] + values.max(axis=0)
    path = np.empty(len(observed), np.int64)
    path[-1] = value.argmax()
    for beat in range(len(observed) - 1, 0, -1):
        path[beat - 1] = before[beat, path[beat]]
    return path, float(value.max())


def _transition() -> Floats:
    """Transition probabilities (25, 25) between the states of two beats."""
    same_metre = STATE_METRE[:, None] == STATE_METRE
    last = STATE_NUMBER == STATE_METRE
    out = np.where(same_metre, _P_IRREGULAR, 0.0)
    out += np.where(~same_metre & last[:, None] & (STATE_NUMBER == 1), _P_CHANGE, 0.0)
    follows = same_metre & ((STATE_NUMBER % STATE_METRE + 1)[:, None] == STATE_NUMBER)
    out[follows] = 0.0
    out[follows] = 1.0 - out.sum(axis=1)
    return out


def _confidence(margin: float, n_beats: int) -> float:
    """Probability that bars are right. The margin of noise grows with the root of the number of beats."""
    offset, slope = fitted_weights().confidence
    return float(1.0 / (1.0 + np.exp(-(offset + slope * margin / np.sqrt(n_beats)))))


# The instants at which the tempo or the metre of a song changes, as where other music begins.
#
# A ramp has none, since its tempo hardly differs a few beats later. A single irregular bar has none either. A
# tracker that counts a break at half the tempo makes two.


_OTHER_TEMPO_OCTAVES = 0.085  # 6 %. Over six beats a ramp from 90 to 140 BPM in 50 s changes by up to 5 %
_PERIODS, _FEWEST_PERIODS = 6, 4  # before and after a change of tempo
_BARS, _FEWEST_BARS = 4, 3  # before and after a change of metre
SAME_S = 1.5  # a tracker may follow a change of tempo a beat or two late
PLAUSIBLE_METRES = (3, 4)  # other bars have beats lost or added by the tracker, or are cut at a splice
_CLEARLY_MOST = 0.75  # share of a part's plausible bars that determine its metre


def change_times_s(counts: Counts) -> Floats:
    """The beats (C,), in seconds, at which the tempo or the metre of a song changes.

    The tempo changes if the median of six beat periods changes by more than 6 %. The metre changes if that of
    four bars differs from that of the next four (see `part_metre`).
    """
    beats = np.union1d(_tempo_changes(counts.times_s), _metre_changes(counts))
    return counts.times_s[beats]


def at_changes(bounds_s: NDArray[np.number], changes_s: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Which bounds (B,) of sections lie within 1.5 s of a change (C,) of tempo or metre."""
    near: NDArray[np.bool_] = np.any(np.abs(np.subtract.outer(bounds_s, changes_s)) <= SAME_S, axis=1)
    return near


def part_metre(bar_lengths: Indices, metre: int) -> int:
    """The metre of a part of a song in `metre`, whose whole bars have these lengths (B,) in beats.

    It is that of the song, unless there are two plausible bars or more and at least three quarters of them
    have another metre.
    """
    bars = bar_lengths[np.isin(bar_lengths, PLAUSIBLE_METRES)]
    if len(bars) < 2:
        return metre
    commonest = int(np.bincount(bars).argmax())
    return commonest if np.mean(bars == commonest) >= _CLEARLY_MOST else metre


def _tempo_changes(times_s: Floats) -> Indices:
    octaves = np.log2(np.diff(times_s))  # (Q - 1,) of each beat period

    def change(beat: int) -> float:
        """How much the periods differ before and after a beat, in octaves, or 0 if the tempo is the same."""
        before, after = octaves[max(0, beat - _PERIODS) : beat], octaves[beat : beat + _PERIODS]
        if min(len(before), len(after)) < _FEWEST_PERIODS:
            return 0.0
        if abs(np.median(after) - np.median(before)) <= _OTHER_TEMPO_OCTAVES:
            return 0.0
        return float(abs(after.mean() - before.mean()))  # greatest where all periods differ

    return _run_peaks(change, np.arange(len(octaves)))


def _metre_changes(counts: Counts) -> Indices:
    downbeats = np.flatnonzero(counts.numbers == 1)
    lengths = np.diff(downbeats)  # (bars,)

    def change(bar: int) -> float:
        """The clarity of the two metres before and after a bar, up to 2, or 0 if they are the same."""
        before, after = lengths[max(0, bar - _BARS) : bar], lengths[bar : bar + _BARS]
        if min(len(before), len(after)) < _FEWEST_BARS:
            return 0.0
        metres = [part_metre(bars, 0) for bars in (before, after)]
        if 0 in metres or metres[0] == metres[1]:
            return 0.0
        return float(np.mean(before == metres[0]) + np.mean(after == metres[1]))

    return downbeats[_run_peaks(change, np.arange(len(lengths)))]


def _run_peaks(height_at: Callable[[int], float], positions: Indices) -> Indices:
    """The position of the maximum of each run of positions with a height."""
    height = np.array([height_at(int(position)) for position in positions])
    runs = np.split(positions, np.flatnonzero(np.diff(height > 0)) + 1)
    return np.array([run[height[run].argmax()] for run in runs if len(run) and height[run[0]] > 0], np.int64)


# The metrical level of a song's beats: the tracked beats, fewer of them, or twice as many.
#
# Whether a salsa is counted at 84 or at 168 does not follow from the music, since both are in it. For a
# dance, it follows from the tempi of the takes. At every level, count 1 is on a downbeat of the tracked bars.


_CLEARLY_NEARER = 0.4  # octaves
_OTHER_METRE = 0.8  # penalty, in octaves, of bars of another metre than that of the takes
_SLOWEST_BPM, _FASTEST_BPM = 40.0, 240.0  # range of tempi at which dancers count
# The numbers in a bar of each metre that are counted at the slower level. Half of three beats is no whole
# count, so a bar of three has one. Bars of five and seven are counted at their own level only.
_SLOWER = {3: (1,), 4: (1, 3), 6: (1, 4)}
_EIGHTHS_BPM = (140.0, 250.0)  # range of tempi of eighths that are counted as beats
_LEAST_EIGHTHS = 2.0  # log odds. Real waltzes, whose eighths are no beats, have up to 1.2
# The same if count 1 lies between the tracked beats: in about every second 6/8, but in one of twenty waltzes.
_LEAST_EIGHTHS_BETWEEN = _LEAST_EIGHTHS - float(np.log(0.5 / 0.05))
_SURELY_BETWEEN = 0.9  # of the counts 1
DANCED_IN = {6: (6, 3)}  # metres of the takes that fit a bar: two bars of three fit a bar of six


def metrical_levels(
    samples: NDArray[np.floating], log_mel: NDArray[np.floating], tracked: Counts
) -> tuple[Counts, ...]:
    """A song's counts as tracked, then at a slower and at double tempo where that can be counted.

    At the slower level, a bar of four or six has two counts and a bar of three has one. These counts are
    grouped in fours, so that count 1 is the downbeat of every second or fourth bar. The music determines of
    which ones. At double tempo, a bar of four has count 1 on beats 1 and 3. Other bars are not doubled.
    Arguments and errors are those of `track_bars`.
    """
    if not tracked.has_bars or len(tracked) < 2:
        return (tracked,)
    others = (_slower(samples, log_mel, tracked), _doubled(tracked, len(samples) / SAMPLE_RATE_HZ))
    return (tracked, *(counts for counts in others if counts is not None))


def _slower(samples: NDArray[np.floating], log_mel: NDArray[np.floating], tracked: Counts) -> Counts | None:
    """The counts at the slower level, or None if they would be too slow or too few."""
    kept = _SLOWER.get(tracked.metre, ())
    if tempo_bpm(tracked) * len(kept) / tracked.metre < _SLOWEST_BPM:
        return None
    on_one = tracked.numbers == 1
    # Irregular bars keep their count 1. Between a second count and the next count 1 there is a beat.
    chosen = on_one | (np.isin(tracked.numbers, kept) & ~np.append(on_one[1:], False))
    counts = track_bars(samples, log_mel, tracked.times_s[chosen], metres=(4,), may_be_one=on_one[chosen])
    return replace(counts, confidence=tracked.confidence) if counts.has_bars else None


def _doubled(tracked: Counts, duration_s: float) -> Counts | None:
    """The counts at double tempo, or None if they would be too fast or count 1 would lie off the bars."""
    if tracked.metre != 4 or tempo_bpm(tracked) * 2 > _FASTEST_BPM:
        return None
    times_s = _twice_as_many(tracked.times_s)
    numbers = (2 * (tracked.numbers[:, None] - 1) % 4 + np.array([1, 2])).ravel()
    inside = times_s < duration_s
    return replace(tracked, times_s=times_s[inside], numbers=numbers[inside])


def _twice_as_many(times_s: Floats) -> Floats:
    between_s = time_at(times_s, np.arange(len(times_s)) + 0.5)
    return np.stack([times_s, between_s], axis=1).ravel()


def with_eighths(samples: NDArray[np.floating], log_mel: NDArray[np.floating], tracked: Counts) -> Counts:
    """The counts of 6/8 and 7/8 on every eighth if they are tracked on every second one.

    A bar of 6/8 is tracked as three beats then, and two bars of 7/8 as seven. Whether the eighths are the
    beats follows from what repeats after two, three and more of them. Less evidence is needed for bars of
    six whose count 1 lies between the tracked beats. Arguments and errors are those of `track_bars`.
    """
    metre = {3: 6, 7: 7}.get(tracked.metre)
    if metre is None or not _EIGHTHS_BPM[0] <= 2 * tempo_bpm(tracked) <= _EIGHTHS_BPM[1]:
        return tracked
    times_s = _twice_as_many(tracked.times_s)
    times_s = times_s[times_s < len(samples) / SAMPLE_RATE_HZ]
    _, repeats = beat_evidence(samples, log_mel, times_s)
    weights = fitted_weights().eighths
    log_odds = repeats.mean(axis=0) @ weights[:-1] + weights[-1]
    if log_odds < (_LEAST_EIGHTHS_BETWEEN if metre == 6 else _LEAST_EIGHTHS):
        return tracked
    counts = track_bars(samples, log_mel, times_s)
    between = np.mean(np.flatnonzero(counts.numbers == 1) % 2) if counts.has_bars else 0.0
    are_beats = log_odds >= _LEAST_EIGHTHS or between >= _SURELY_BETWEEN
    return counts if counts.metre == metre and are_beats else tracked


def choose_level(
    levels: Sequence[Counts], take_tempi_bpm: Mapping[int, Floats], take_weights: Mapping[int, Floats]
) -> Counts:
    """The level at which takes are danced nearest to their own tempo.

    It is the first level, unless another one is nearer by 0.4 octaves. `take_tempi_bpm` has by metre the
    tempi (X,) of the takes in that metre, and `take_weights` their weights. A level in whose metre there is
    no take is not chosen, except the first one. Its bars may be wrong, so it is chosen even without takes in
    its metre if takes of other metres would be danced much too fast at another level.
    """
    distances = []
    for song in levels:
        metres = [metre for metre in DANCED_IN.get(song.metre, (song.metre,)) if metre in take_weights]
        tempi_bpm, weights = _of_metres(metres, take_tempi_bpm), _of_metres(metres, take_weights)
        distances.append(_distance_octaves(tempo_bpm(song), tempi_bpm, weights) if weights.sum() else np.inf)
    if np.isinf(distances[0]) and np.isfinite(distances).any():
        tempi_bpm, weights = (_of_metres(take_weights, values) for values in (take_tempi_bpm, take_weights))
        distances[0] = _OTHER_METRE + _distance_octaves(tempo_bpm(levels[0]), tempi_bpm, weights)
    nearest = int(np.argmin(distances))
    return levels[nearest] if distances[nearest] < distances[0] - _CLEARLY_NEARER else levels[0]


def _of_metres(metres: Iterable[int], by_metre: Mapping[int, Floats]) -> Floats:
    return np.concatenate([np.zeros(0), *(by_metre[metre] for metre in metres)])


def level_at_tempo(
    samples: NDArray[np.floating], log_mel: NDArray[np.floating], tracked: Counts, metre: int, bpm: float
) -> Counts:
    """A song's counts at the level nearest to a tempo in a metre. See `metrical_levels`."""
    levels = metrical_levels(samples, log_mel, tracked)
    return choose_level(levels, {metre: np.array([bpm])}, {metre: np.ones(1)})


def between(counts: Counts, start_s: float, stop_s: float) -> Counts:
    """The counts of a part of a song, at their times in the song. Its metre is that of its bars.

    See `music.bars.part_metre`.
    """
    inside = (counts.times_s >= start_s) & (counts.times_s < stop_s)
    numbers = counts.numbers[inside]
    metre = part_metre(np.diff(np.flatnonzero(numbers == 1)), counts.metre)
    return replace(counts, times_s=counts.times_s[inside], numbers=numbers, metre=metre)


def joined(parts: Sequence[Counts]) -> Counts:
    """The counts of consecutive parts of a song. A beat too close to the part before it is left out."""
    times_s, numbers = [parts[0].times_s], [parts[0].numbers]
    for before, part in pairwise(parts):
        period_s = min((60.0 / tempo_bpm(p) for p in (before, part) if len(p) > 1), default=0.0)
        kept = part.times_s > (before.times_s[-1] + 0.6 * period_s if len(before) else -np.inf)
        times_s.append(part.times_s[kept])
        numbers.append(part.numbers[kept])
    longest = max(parts, key=len)
    confidence = min(part.confidence for part in parts)
    return Counts(np.concatenate(times_s), np.concatenate(numbers), longest.metre, longest.source, confidence)


def tempo_bpm(counts: Counts) -> float:
    """Median tempo of two counts or more."""
    return float(60.0 / np.median(np.diff(counts.times_s)))


def _distance_octaves(bpm: float, tempi_bpm: Floats, weights: Floats) -> float:
    return float(np.average(np.abs(np.log2(bpm / tempi_bpm)), weights=weights))
