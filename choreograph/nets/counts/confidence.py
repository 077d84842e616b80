"""How sure decoded counts are: the share of them that will be right, from what the decoder saw.

A logistic function of a few features of a take and its curves, fitted to takes that the network did not see.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from choreograph.errors import ParameterError
from choreograph.features.bar_pointer import DecodedCounts, PhaseCurves

Floats = NDArray[np.float64]

N_CONFIDENCE = 4
_SHRINKAGE = 1.0  # of the weights, worth about a take


def confidence_features(curves: PhaseCurves, decoded: DecodedCounts) -> Floats:
    """What speaks for a take's counts, (N_CONFIDENCE,): 1, and means over its frames, each around 0 to 1.

    How far the beat's phase agrees with the counts, how far the bar's, both weighted by concentration, and
    how concentrated the beat is.
    """
    if not len(decoded.beat_agreement):
        return np.array([1.0, 0.0, 0.0, 0.0])
    beat = np.linalg.norm(curves.beat, axis=1)  # (T,)
    bar = np.linalg.norm(curves.bar, axis=2).max(axis=1)
    return np.array(
        [
            1.0,
            np.average(decoded.beat_agreement, weights=beat + 1e-6),
            np.average(decoded.bar_agreement, weights=bar + 1e-6),
            np.log1p(beat).mean(),
        ]
    )


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
