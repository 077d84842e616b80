"""Structure of a song: boundaries of its sections, and labels that mark repeated sections."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.hierarchy import fcluster, linkage

from choreograph.features.spectral import SPECTRAL_COLUMNS, spectral_features

Floats = NDArray[np.float64]

SECTION_S = 12.0  # average length of a section
_MIN_BEATS = 8
_SAME_SECTION_DISTANCE = 0.6  # of the features' deviation: closer sections, on average, are repeats
# Weights of standardised groups. Timbre separates sections better than harmony; both together do best.
_GROUP_WEIGHTS = {"chroma_cens": 0.5, "mel_db": 1.0, "mfcc": 1.0}


@dataclass(frozen=True, eq=False)
class Sections:
    """Consecutive sections of a song; none if the song has too few beats."""

    bounds_s: Floats  # (S + 1,), or (0,)
    labels: NDArray[np.int64]  # (S,): equal labels are the same music repeated

    def __len__(self) -> int:
        return len(self.labels)


def song_sections(samples: NDArray[np.floating], beat_times_s: NDArray[np.floating]) -> Sections:
    """The sections of a song, mono at 22.05 kHz, bounded by beats (Q,).

    Neighbouring beats are merged by Ward's criterion (librosa's agglomerative segmentation) to one section
    per 12 s, and sections with similar mean features get one label. It takes at least 17 beats.

    Raises `ParameterError` as `spectral_features` does.
    """
    from librosa.segment import agglomerative  # a second to import

    beats_s = np.asarray(beat_times_s, np.float64)
    if len(beats_s) <= 2 * _MIN_BEATS:
        return Sections(np.zeros(0), np.zeros(0, np.int64))
    beat_features = _standardized(spectral_features(samples, beats_s))
    n_sections = int(
        np.clip(round((beats_s[-1] - beats_s[0]) / SECTION_S), 2, len(beat_features) // _MIN_BEATS)
    )
    starts = np.unique(agglomerative(beat_features.T, n_sections))
    means = np.stack([part.mean(axis=0) for part in np.split(beat_features, starts[1:])])
    threshold = _SAME_SECTION_DISTANCE * np.sqrt(np.square(beat_features).sum(axis=1).mean())
    labels = fcluster(linkage(means, "average"), threshold, "distance").astype(np.int64) - 1
    first = np.r_[True, np.diff(labels) != 0]  # neighbours with one label are one section
    return Sections(np.r_[beats_s[starts[first]], beats_s[-1]], labels[first])


def _standardized(features: NDArray[np.float32]) -> Floats:
    """Features (B, 87) of beats as (B, F), every group standardised and weighted."""
    groups = []
    for name, weight in _GROUP_WEIGHTS.items():
        columns = features[:, SPECTRAL_COLUMNS[name]].astype(np.float64)
        spread = columns.std(axis=0) + 1e-6
        groups.append(weight * (columns - columns.mean(axis=0)) / spread / np.sqrt(columns.shape[1]))
    return np.hstack(groups)
