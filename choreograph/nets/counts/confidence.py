"""How sure decoded counts are: the share of them that will be right, from what the decoder saw.

A logistic function of a few facts about a take's curves, fitted to takes that the network was not trained on.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from choreograph.errors import ParameterError
from choreograph.features.bar_pointer import PhaseCurves, PointedCounts

Floats = NDArray[np.float64]

N_FACTS = 4
_SHRINKAGE = 1.0  # of the weights, worth about a take


def count_facts(curves: PhaseCurves, pointed: PointedCounts) -> Floats:
    """What speaks for a take's counts, (N_FACTS,): 1, and means over its frames, each around 0 to 1.

    How far the beat's phase agrees with the counts, how far the bar's, both weighted by concentration, and
    how concentrated the beat is.
    """
    if not len(pointed.beat_agreement):
        return np.array([1.0, 0.0, 0.0, 0.0])
    beat = np.linalg.norm(curves.beat, axis=1)  # (T,)
    bar = np.linalg.norm(curves.bar, axis=2).max(axis=1)
    return np.array(
        [
            1.0,
            np.average(pointed.beat_agreement, weights=beat + 1e-6),
            np.average(pointed.bar_agreement, weights=bar + 1e-6),
            np.log1p(beat).mean(),
        ]
    )


def confidence_of(facts: Floats, weights: Floats) -> float:
    """The expected share of right counts, 0 to 1, of facts (N_FACTS,)."""
    return float(1.0 / (1.0 + np.exp(-facts @ weights)))


def fit_confidence(facts: Sequence[Floats], share_right: Sequence[float]) -> Floats:
    """Weights (N_FACTS,) by which `confidence_of` the facts of takes is their share of right counts.

    Logistic regression with a little shrinkage. `ParameterError` without a take.
    """
    if not len(facts) or len(facts) != len(share_right):
        raise ParameterError(f"expected facts of takes and a share for each, got {len(facts)}")
    x, y = np.array(facts), np.array(share_right, np.float64)
    prior = _SHRINKAGE / len(y) * np.append(1e-3, np.ones(N_FACTS - 1))  # the offset is free

    def loss(weights: Floats) -> tuple[float, Floats]:
        logits = x @ weights
        value = np.mean(np.logaddexp(0.0, logits) - y * logits) + 0.5 * np.sum(prior * weights**2)
        slope = x.T @ (1.0 / (1.0 + np.exp(-logits)) - y) / len(y) + prior * weights
        return float(value), slope

    return minimize(loss, np.zeros(N_FACTS), jac=True, method="L-BFGS-B").x
