"""Structure of a song: boundaries of its sections, and labels that mark repeated sections."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.hierarchy import fcluster, linkage

from choreograph.features.music_changes import at_changes
from choreograph.features.spectral import SPECTRAL_COLUMNS, spectral_features
from choreograph.progress import StepReport

Floats = NDArray[np.float64]

SECTION_S = 12.0  # average length of a section
_MIN_SECTION_S = 6.0  # anything shorter is a fill or a break, not a section
_MIN_BEATS = 8
_SAME_SECTION_DISTANCE = 0.35  # of the features' deviation: closer sections, on average, are repeats
# Weights of standardised groups. Timbre separates sections better than harmony; both together do best.
_GROUP_WEIGHTS = {"chroma_cens": 0.5, "mel_db": 1.0, "mfcc": 1.0}
_CHANGE_REACH_S = 4.0  # drums may change a bar before the cut, and a tracker follows a beat or two late
_NONE = np.zeros(0)


@dataclass(frozen=True, eq=False)
class Sections:
    """Consecutive sections of a song; none if the song has too few beats."""

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
    """The sections of a song, mono at 22.05 kHz, bounded by beats (Q,): by downbeats where those are given.

    Neighbouring bars (beats, if downbeats are not known) are merged by Ward's criterion (librosa's
    agglomerative segmentation) to one section per 12 s, those shorter than 6 s with the neighbour that is
    more like them, and sections with similar mean features get one label. There is a bound at every beat of
    `change_times_s` (C,), where other music is known to begin (see `features.music_changes`): one that is 1.5
    to 4 s from it is moved there. It takes at least 17 beats.

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
    from choreograph.cached_librosa import librosa  # a second to import

    most = min(len(beat_features) // _MIN_BEATS, len(units))
    n_sections = int(np.clip(round((beats_s[-1] - beats_s[0]) / SECTION_S), min(2, most), most))
    starts = units[np.unique(librosa.segment.agglomerative(_means(beat_features, units).T, n_sections))]
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
