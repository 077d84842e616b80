"""How far music is from the genres of a repertoire, in the space of styles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_RIDGE = 0.3  # of the mean variance: keeps a few clips of a genre from saying too much
_LEAST_VARIANCE = 1e-4  # of style vectors of length 1; clips of real takes have 3e-3


def genre_distances(
    music_style: NDArray[np.floating], clip_style: NDArray[np.floating], clip_genre: NDArray[np.integer]
) -> Floats:
    """Squared Mahalanobis distance (S, G) of each second's style (S, D) from the mean clip of each genre.

    `clip_style` (N, D) are the clips' styles and `clip_genre` (N,) their genres 0 … G - 1, each of at least
    one clip. The covariance is that of clips within their genres, pooled, so that what varies among the takes
    of every genre does not tell genres apart (linear discriminant analysis). The nearest clip, by contrast,
    is a matter of chance where genres lie close together.
    """
    style = np.asarray(clip_style, np.float64)
    n_genres = int(clip_genre.max()) + 1
    means = np.stack([style[clip_genre == genre].mean(axis=0) for genre in range(n_genres)])  # (G, D)
    within = style - means[clip_genre]
    covariance = within.T @ within / len(within)  # (D, D)
    ridge = max(_RIDGE * np.trace(covariance) / len(covariance), _LEAST_VARIANCE)
    away = np.asarray(music_style, np.float64)[:, None] - means  # (S, G, D)
    precision = np.linalg.inv(covariance + ridge * np.eye(len(covariance)))
    return np.einsum("sgd,de,sge->sg", away, precision, away, optimize=True)
