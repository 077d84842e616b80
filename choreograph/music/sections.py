"""Structure of a song: its sections, and the part of it that is danced."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.hierarchy import fcluster, linkage

from choreograph.core.counts import Counts
from choreograph.core.numerics import Floats
from choreograph.core.progress import StepReport
from choreograph.core.timebase import MUSIC_FPS
from choreograph.music.beats import onset_strength
from choreograph.music.metrical_level import at_changes
from choreograph.music.spectral import SPECTRAL_COLUMNS, spectral_features

# The part of a song that is danced, and the instants at which takes may change.


_PICK_UP_S = 0.5  # danced at full speed before the first count, which prepares it
_EASE_IN_S = 0.4  # from the first held pose to full speed, before that
_EASE_OUT_S = 0.3  # from full speed to the last held pose, before the last count
_SETTLE_S = 0.08  # the same after the last count
REACH_S = 0.5  # largest distance of a change of takes from its second
FIRST_HOLD_S = 0.7  # least time for which the first pose is held, including the easing
LAST_HOLD_S = 0.3  # least time for which the last pose is held
_STRONG = 0.3  # of the song's usual strength at beats. Weaker ones do not start or end a dance
_SOUNDING = 0.1  # of the strength of its strongest beats. Weaker ones do not enter the usual strength
_BAR_OF = 4  # beats that must be strong, on average, where the dance starts
_NEAR_FRAMES = 3  # 50 ms, within which an onset counts as on the beat
_LONGEST_WAIT_S = 3.0  # for a downbeat, where beats are strong before it


def dance_span_s(counts: Counts, log_mel: NDArray[np.floating], duration_s: float) -> tuple[float, float]:
    """The times of the first and the last count of a song that are danced, in seconds.

    They are strong beats, on downbeats if bars are known. An introduction or an ending without beats is not
    danced. At least 0.7 s at the beginning and 0.3 s at the end remain for the poses that are held there.
    Without beats, the song is danced from 0 to its end.
    """
    beats = np.flatnonzero((counts.times_s >= FIRST_HOLD_S) & (counts.times_s <= duration_s - LAST_HOLD_S))
    if len(beats) < 2 * _BAR_OF:
        return 0.0, duration_s
    strength = _strength_at(counts.times_s[beats], log_mel)
    usual = float(np.median(strength[strength >= _SOUNDING * np.percentile(strength, 95)]))
    enough = _STRONG * usual
    # Mean of a beat and the three before it. One loud beat does not make up for three silent ones.
    ahead = np.convolve(np.minimum(strength, usual), np.ones(_BAR_OF) / _BAR_OF)
    starts = np.flatnonzero((ahead[_BAR_OF - 1 : len(beats)] >= enough) & (strength[: 1 - _BAR_OF] >= enough))
    ends = np.flatnonzero(strength >= enough)
    first, last = (starts[0] if len(starts) else 0), ends[-1]
    on_downbeat = counts.numbers[beats] == 1
    waited = [i for i in range(first, len(beats)) if on_downbeat[i]]
    if waited and counts.times_s[beats[waited[0]]] - counts.times_s[beats[first]] <= _LONGEST_WAIT_S:
        first = waited[0]
    closing = [i for i in ends if on_downbeat[i]]
    last = closing[-1] if closing else last
    if last - first < _BAR_OF:
        return 0.0, duration_s
    return float(counts.times_s[beats[first]]), float(counts.times_s[beats[last]])


def setting_off_s(opening_s: float) -> tuple[float, float]:
    """From when to when a dance goes from its first held pose to full speed: 0.4 s, and 0.5 s early.

    With less time before the first count, it sets off at the start of the song.
    """
    ease_s = min(_EASE_IN_S, opening_s)
    stop_s = opening_s - min(_PICK_UP_S, opening_s - ease_s)
    return stop_s - ease_s, stop_s


def coming_to_rest_s(opening_s: float, closing_s: float) -> tuple[float, float]:
    """The span from full speed to the last held pose: 0.38 s, but not before `opening_s`."""
    return max(opening_s, closing_s - _EASE_OUT_S), closing_s + _SETTLE_S


def held_times_s(opening_s: float, closing_s: float) -> tuple[float, float]:
    """The times whose poses are held before the first and after the last count, half-way through an ease."""
    first, last = setting_off_s(opening_s), coming_to_rest_s(opening_s, closing_s)
    return 0.5 * sum(first), 0.5 * sum(last)


def _strength_at(times_s: Floats, log_mel: NDArray[np.floating]) -> Floats:
    """Greatest onset strength within 50 ms of each time, (Q,)."""
    strength = onset_strength(log_mel)
    frames = np.round(times_s * MUSIC_FPS).astype(np.int64)[:, None]
    near = frames + np.arange(-_NEAR_FRAMES, _NEAR_FRAMES + 1)
    strongest: Floats = strength[np.clip(near, 0, len(strength) - 1)].max(axis=1)
    return strongest


def join_times_s(counts: Counts, n_borders: int) -> Floats:
    """The instants (B,) near seconds 0 … B - 1 at which takes may change.

    It is the downbeat within half a second, else the nearest beat, else the second itself. No two seconds
    share an instant.
    """
    seconds = np.arange(n_borders, dtype=np.float64)
    joins = seconds.copy()
    for instants in (counts.times_s, counts.downbeat_times_s):  # downbeats replace beats
        border = np.round(instants).astype(np.int64)
        for second in np.unique(border[(border >= 0) & (border < n_borders)]):
            near = instants[border == second]
            joins[second] = near[np.argmin(np.abs(near - second))]
    return joins


# Structure of a song: boundaries of its sections, and labels that mark repeated sections.


SECTION_S = 12.0  # average length of a section
_MIN_SECTION_S = 6.0  # a shorter part is a fill or a break, not a section
_MIN_BEATS = 8
_SAME_SECTION_DISTANCE = 0.35  # of the features' deviation. Sections with a lower mean distance are repeats
# Weights of standardised groups. Timbre separates sections better than harmony. Both together do best.
_GROUP_WEIGHTS = {"chroma_cens": 0.5, "mel_db": 1.0, "mfcc": 1.0}
_CHANGE_REACH_S = 4.0  # drums may change a bar before the cut, and a tracker follows a beat or two late
_NONE = np.zeros(0)


@dataclass(frozen=True, eq=False)
class Sections:
    """Consecutive sections of a song, or none if the song has too few beats."""

    bounds_s: Floats  # (S + 1,), or (0,)
    labels: NDArray[np.int64]  # (S,): equal labels are the same music repeated

    def __len__(self) -> int:
        return len(self.labels)


def song_sections(
    samples: NDArray[np.floating],
    beat_times_s: NDArray[np.floating],
    *,
    downbeat_times_s: NDArray[np.floating] | None = None,
    change_times_s: NDArray[np.floating] = _NONE,
    report: StepReport | None = None,
) -> Sections:
    """The sections of a song, mono at 22.05 kHz, bounded by beats (Q,), or by downbeats if those are given.

    Neighbouring bars (beats, if downbeats are not known) are merged by Ward's criterion (librosa's
    agglomerative segmentation) to one section per 12 s. Sections shorter than 6 s are merged with the more
    similar neighbour. Sections with similar mean features get one label. There is a bound at every beat of
    `change_times_s` (C,), where other music begins (see `music.metrical_level`). A bound that is 1.5 to 4 s
    from it is moved there. At least 17 beats are needed.

    Raises `ParameterError` as `spectral_features` does.
    """
    beats_s = np.asarray(beat_times_s, np.float64)
    if len(beats_s) <= 2 * _MIN_BEATS:
        return Sections(np.zeros(0), np.zeros(0, np.int64))
    beat_features = _standardized(spectral_features(samples, beats_s, report=report))  # (Q - 1, F)
    if downbeat_times_s is None or len(downbeat_times_s) == 0:
        units = np.arange(len(beat_features))
    else:
        units = np.union1d(0, np.flatnonzero(np.isin(beats_s[:-1], downbeat_times_s)))
    starts = _with_changes(_section_starts(beat_features, beats_s, units), beats_s, change_times_s)
    means = _means(beat_features, starts)
    threshold = _SAME_SECTION_DISTANCE * np.sqrt(np.square(beat_features).sum(axis=1).mean())
    if len(means) == 1:
        return Sections(beats_s[[0, -1]], np.zeros(1, np.int64))
    labels = fcluster(linkage(means, "average"), threshold, "distance").astype(np.int64) - 1
    # Neighbours with one label are one section, unless other music begins there.
    first = np.r_[True, np.diff(labels) != 0] | at_changes(beats_s[starts], change_times_s)
    return Sections(np.r_[beats_s[starts[first]], beats_s[-1]], labels[first])


def _section_starts(beat_features: Floats, beats_s: Floats, units: NDArray[np.int64]) -> NDArray[np.int64]:
    """First beat of each section, (S,), among the first beats (U,) of the units to be merged."""
    from choreograph.music.cached_librosa import librosa  # a second to import

    most = min(len(beat_features) // _MIN_BEATS, len(units))
    n_sections = int(np.clip(round((beats_s[-1] - beats_s[0]) / SECTION_S), min(2, most), most))
    starts: NDArray[np.int64] = units[
        np.unique(librosa.segment.agglomerative(_means(beat_features, units).T, n_sections))
    ]
    while len(starts) > 1:
        length_s = np.diff(beats_s[np.append(starts, len(beats_s) - 1)])
        shortest = int(length_s.argmin())
        if length_s[shortest] >= _MIN_SECTION_S:
            break
        means = _means(beat_features, starts)
        away = np.linalg.norm(np.diff(means, axis=0), axis=1)  # (S - 1,) of neighbours
        before = away[shortest - 1] if shortest > 0 else np.inf
        after = away[shortest] if shortest < len(away) else np.inf
        starts = np.delete(starts, shortest if before <= after else shortest + 1)
    return starts


def _with_changes(
    starts: NDArray[np.int64], beats_s: Floats, change_times_s: NDArray[np.floating]
) -> NDArray[np.int64]:
    """First beats of sections (S,), those near a change moved to its beat, and the other changes."""
    bounds = starts[1:].copy()  # the first section begins with the song
    for change_s in change_times_s:
        if at_changes(np.array([change_s]), beats_s[bounds])[0]:
            continue
        beat = int(np.abs(beats_s - change_s).argmin())
        away_s = np.abs(beats_s[bounds] - change_s)
        is_free = ~at_changes(beats_s[bounds], change_times_s)  # not where another change is
        if np.min(away_s, initial=np.inf, where=is_free) <= _CHANGE_REACH_S:
            bounds[np.where(is_free, away_s, np.inf).argmin()] = beat
        elif np.min(away_s, initial=np.inf) > _CHANGE_REACH_S:
            bounds = np.append(bounds, beat)
    inside = bounds[(bounds > 0) & (bounds < len(beats_s) - 1)]
    return np.union1d(starts[:1], inside)


def _means(beat_features: Floats, starts: NDArray[np.int64]) -> Floats:
    """Mean features of the parts that begin at these beats, (S, F)."""
    return np.stack([part.mean(axis=0) for part in np.split(beat_features, starts[1:])])


def _standardized(features: NDArray[np.float32]) -> Floats:
    """Features (B, 87) of beats as (B, F), every group standardised and weighted."""
    groups = []
    for name, weight in _GROUP_WEIGHTS.items():
        columns = features[:, SPECTRAL_COLUMNS[name]].astype(np.float64)
        spread = columns.std(axis=0) + 1e-6
        groups.append(weight * (columns - columns.mean(axis=0)) / spread / np.sqrt(columns.shape[1]))
    return np.hstack(groups)
