"""Errors of recovered time warps, in milliseconds of the source.

A time map (..., T) gives the source frame of every output frame. Input that does not fit raises
`ParameterError`.
"""

from __future__ import annotations

import numpy as np

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats


def recovery_errors_ms(found_frames: Floats, true_frames: Floats, fps: float) -> Floats:
    """Distance of each found source frame (..., T) from the true one, in ms, as (N,) over all frames."""
    found, true = np.asarray(found_frames, np.float64), np.asarray(true_frames, np.float64)
    if found.shape != true.shape or found.size == 0:
        raise ParameterError(f"expected one true frame per found frame, got {true.shape} for {found.shape}")
    if not (np.isfinite(found).all() and np.isfinite(true).all() and np.isfinite(fps) and fps > 0):
        raise ParameterError("expected finite source frames at a positive rate")
    return np.abs(found - true).ravel() * 1000.0 / fps


def summary_ms(errors_ms: Floats) -> dict[str, float]:
    """Median, mean and 90th percentile of errors (N,) by name. `ParameterError` without errors."""
    if len(errors_ms) == 0:
        raise ParameterError("expected errors to summarise, got none")
    return {
        "median_ms": float(np.median(errors_ms)),
        "mean_ms": float(np.mean(errors_ms)),
        "p90_ms": float(np.percentile(errors_ms, 90)),
    }
