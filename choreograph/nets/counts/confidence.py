"""How sure decoded counts are: the share of them that will be right, from what the decoder saw.

A logistic function of a few features of a take and its curves, fitted to takes that the network did not see.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from choreograph.counts import Counts
from choreograph.errors import ParameterError
from choreograph.features.bar_pointer import DecodedCounts, PhaseCurves
from choreograph.timebase import frame_times_s

Floats = NDArray[np.float64]

N_CONFIDENCE = 5
_STEADY_S = 5.0  # over which curves are to keep one phase to the counts
_SHRINKAGE = 1.0  # of the weights, worth about a take


def confidence_features(curves: PhaseCurves, decoded: DecodedCounts) -> Floats:
    """What speaks for a take's counts, (N_CONFIDENCE,): 1, and means over its frames, each around 0 to 1.

    How far the beat's phase agrees with the counts, how far the bar's, both weighted by concentration, how
    concentrated the beat is, and how steadily it keeps to the counts, whatever its phase against them.
    """
    if not len(decoded.beat_agreement):
        return np.append(1.0, np.zeros(N_CONFIDENCE - 1))
    beat = np.linalg.norm(curves.beat, axis=1)  # (T,)
    bar = np.linalg.norm(curves.bar, axis=2).max(axis=1)
    return np.array(
        [
            1.0,
            np.average(decoded.beat_agreement, weights=beat + 1e-6),
            np.average(decoded.bar_agreement, weights=bar + 1e-6),
            np.log1p(beat).mean(),
            _steadiness(curves, decoded.counts),
        ]
    )


def _steadiness(curves: PhaseCurves, counts: Counts) -> float:
    """In every five seconds, the size of the mean beat vector turned back by the counts, over the mean size.

    The mean over the take, 0 … 1. What has no count keeps no phase for so long, though the best path of all
    agrees with it here and there.
    """
    times_s = frame_times_s(len(curves.beat), curves.fps)
    if len(counts) < 2:
        return 0.0
    in_beats = np.interp(times_s, counts.times_s, np.arange(len(counts)))
    inside = (times_s >= counts.times_s[0]) & (times_s <= counts.times_s[-1])
    vectors = (curves.beat[:, 0] + 1j * curves.beat[:, 1]) * np.exp(-2j * np.pi * in_beats) * inside
    windows = np.array_split(vectors, max(1, round(len(vectors) / curves.fps / _STEADY_S)))
    return float(np.mean([abs(w.sum()) / max(np.abs(w).sum(), 1e-12) for w in windows]))


def confidence_of(features: Floats, weights: Floats) -> float:
    """The expected share of right counts, 0 to 1, of features (N_CONFIDENCE,)."""
    return float(1.0 / (1.0 + np.exp(-features @ weights)))


def fit_confidence(features: Sequence[Floats], share_right: Sequence[float]) -> Floats:
    """Weights (N_CONFIDENCE,) by which `confidence_of` the features of takes is their share of right counts.

    Logistic regression with a little shrinkage. `ParameterError` without a take.
    """
    if not len(features) or len(features) != len(share_right):
        raise ParameterError(f"expected features of takes and a share for each, got {len(features)}")
    x, y = np.array(features), np.array(share_right, np.float64)
    prior = _SHRINKAGE / len(y) * np.append(1e-3, np.ones(N_CONFIDENCE - 1))  # the offset is free

    def loss(weights: Floats) -> tuple[float, Floats]:
        logits = x @ weights
        value = np.mean(np.logaddexp(0.0, logits) - y * logits) + 0.5 * np.sum(prior * weights**2)
        slope = x.T @ (1.0 / (1.0 + np.exp(-logits)) - y) / len(y) + prior * weights
        return float(value), slope

    return minimize(loss, np.zeros(N_CONFIDENCE), jac=True, method="L-BFGS-B").x
