"""Time warping: slopes of time maps, and how well a known warp is recovered.

Conventions: a time map (..., T) gives the source frame at every output frame, increasing, both at one rate.
Its slope is in source frames per output frame: 1 for the recorded speed, 2 for double speed. ChoreoGraph
(section 3.2) limits slopes to [½, 2]. A map that lies at these limits would have gone further, and its
segment was a poor choice. Errors of a recovered warp are in milliseconds of the source. Input that does not
fit raises `ParameterError`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import default_numerics

Floats = NDArray[np.float64]

SLOWEST, FASTEST = 0.5, 2.0
SLOPE_EDGES = np.geomspace(SLOWEST, FASTEST, 13)  # of the histogram, six bins per octave
AT_LIMIT = 0.02  # relative: a smoothed map comes this close where it runs along a limit


def validate(time_maps: Floats) -> Floats:
    """The time maps (..., T) as float64; `ParameterError` unless finite, non-decreasing and T at least 2."""
    maps = np.asarray(time_maps, np.float64)
    if maps.ndim == 0 or maps.shape[-1] < 2 or maps.size == 0 or not np.isfinite(maps).all():
        raise ParameterError(f"expected finite time maps (..., T) of two frames or more, got {maps.shape}")
    if (np.diff(maps, axis=-1) < 0).any():
        raise ParameterError("expected time maps that never go back in time")
    return maps


def slope_histogram(time_maps: Floats, *, edges: Floats = SLOPE_EDGES) -> Floats:
    """Share of the frames in each slope bin, (B,); slopes beyond the edges count in the outer bins."""
    slopes = np.diff(validate(time_maps), axis=-1).ravel()
    counts, _ = np.histogram(np.clip(slopes, edges[0], edges[-1]), edges)
    return counts / len(slopes)


def share_at_limits(
    time_maps: Floats, *, slowest: float = SLOWEST, fastest: float = FASTEST, tolerance: float = AT_LIMIT
) -> tuple[float, float]:
    """Shares of the frames at or below the slowest slope, and at or above the fastest."""
    slopes = np.diff(validate(time_maps), axis=-1)
    return (
        float(np.mean(slopes <= slowest * (1 + tolerance))),
        float(np.mean(slopes >= fastest * (1 - tolerance))),
    )


def recovery_errors_ms(found_frames: Floats, true_frames: Floats, fps: float) -> Floats:
    """Distance of each found source frame (..., T) from the true one, in ms: (N,), all frames of all maps."""
    found, true = np.asarray(found_frames, np.float64), np.asarray(true_frames, np.float64)
    if found.shape != true.shape or found.size == 0:
        raise ParameterError(f"expected one true frame per found frame, got {true.shape} for {found.shape}")
    if not (np.isfinite(found).all() and np.isfinite(true).all() and np.isfinite(fps) and fps > 0):
        raise ParameterError("expected finite source frames at a positive rate")
    return np.abs(found - true).ravel() * 1000.0 / fps


def summary_ms(errors_ms: Floats) -> dict[str, float]:
    """Median, mean and 90th percentile of errors (N,) by name; `ParameterError` without errors."""
    if len(errors_ms) == 0:
        raise ParameterError("expected errors to summarise, got none")
    return {
        "median_ms": float(np.median(errors_ms)),
        "mean_ms": float(np.mean(errors_ms)),
        "p90_ms": float(np.percentile(errors_ms, 90)),
    }


@default_numerics()
def evaluate(time_maps: Floats) -> dict[str, float]:
    """Slope percentiles of the maps and shares at the limits, by name."""
    slopes = np.diff(validate(time_maps), axis=-1)
    slowest, fastest = share_at_limits(time_maps)
    return {
        "slope_p05": float(np.percentile(slopes, 5)),
        "slope_median": float(np.median(slopes)),
        "slope_p95": float(np.percentile(slopes, 95)),
        "share_at_slowest": slowest,
        "share_at_fastest": fastest,
    }
