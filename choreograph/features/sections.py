"""Sections of a song: where its music changes for longer than a phrase, and what is the same music again."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.hierarchy import fcluster, linkage

from choreograph.features.spectral import SPECTRAL_COLUMNS, spectral_features

Floats = NDArray[np.float64]

SECTION_S = 12.0  # one section so long, on average
_LEAST_BEATS = 8
_SAME = 0.6  # of the features' deviation: sections nearer than that, on average, are the same music
# Standardised, each group by its size; timbre tells sections better than harmony does, and both best.
_GROUPS = {"chroma_cens": 0.5, "mel_db": 1.0, "mfcc": 1.0}


@dataclass(frozen=True, eq=False)
class Sections:
    """Stretches of a song, one after another; none if the song has too few beats."""

    bounds_s: Floats  # (S + 1,), or (0,)
    labels: NDArray[np.int64]  # (S,): equal ones are the same music again

    def __len__(self) -> int:
        return len(self.labels)


def song_sections(samples: NDArray[np.floating], beat_times_s: NDArray[np.floating]) -> Sections:
    """The sections of a song, mono at 22.05 kHz, bounded by beats (Q,).

    Beats are merged with their neighbours by Ward's criterion (librosa's agglomerative segmentation) to one
    section in 12 s, and these by their mean colour. Fewer than 17 beats are too few.

    Raises `ParameterError` as `spectral_features` does.
    """
    from librosa.segment import agglomerative  # a second to import

    beats_s = np.asarray(beat_times_s, np.float64)
    if len(beats_s) <= 2 * _LEAST_BEATS:
        return Sections(np.zeros(0), np.zeros(0, np.int64))
    colours = _colours(spectral_features(samples, beats_s))
    n_sections = int(np.clip(round((beats_s[-1] - beats_s[0]) / SECTION_S), 2, len(colours) // _LEAST_BEATS))
    starts = np.unique(agglomerative(colours.T, n_sections))
    means = np.stack([part.mean(axis=0) for part in np.split(colours, starts[1:])])
    apart = _SAME * np.sqrt(np.square(colours).sum(axis=1).mean())
    labels = fcluster(linkage(means, "average"), apart, "distance").astype(np.int64) - 1
    first = np.r_[True, np.diff(labels) != 0]  # neighbours that are the same are one
    return Sections(np.r_[beats_s[starts[first]], beats_s[-1]], labels[first])


def _colours(features: NDArray[np.float32]) -> Floats:
    """Features (B, 87) of beats as (B, F), every group standardised and weighed."""
    groups = []
    for name, weight in _GROUPS.items():
        columns = features[:, SPECTRAL_COLUMNS[name]].astype(np.float64)
        spread = columns.std(axis=0) + 1e-6
        groups.append(weight * (columns - columns.mean(axis=0)) / spread / np.sqrt(columns.shape[1]))
    return np.hstack(groups)
