"""Warping: how hard time is bent, and whether a warp that is known is found again.

Conventions: a time map is the source's frame at every output frame, (..., T) of one rate, increasing; its
slope is source frames a frame, 1 where nothing is bent, 2 where the source is played at double speed.
ChoreoGraph (section 3.2) holds slopes in [½, 2]: a map that lies at its limits wanted to go further, and
such a segment should not have been chosen. Errors of a found warp are in milliseconds of the source. What
does not fit is refused with a `ParameterError`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from choreograph.errors import ParameterError

Floats = NDArray[np.float64]

SLOWEST, FASTEST = 0.5, 2.0
SLOPE_EDGES = np.geomspace(SLOWEST, FASTEST, 13)  # of a histogram, six bins an octave
AT_LIMIT = 0.02  # of a limit: where a smoothed map runs along it


def validate(time_maps: Floats) -> Floats:
    """The time maps (..., T) as float64; `ParameterError` unless finite, of two frames or more, rising."""
    maps = np.asarray(time_maps, np.float64)
    if maps.ndim == 0 or maps.shape[-1] < 2 or maps.size == 0 or not np.isfinite(maps).all():
        raise ParameterError(f"expected finite time maps (..., T) of two frames or more, got {maps.shape}")
    if (np.diff(maps, axis=-1) < 0).any():
        raise ParameterError("expected time maps that never go back")
    return maps


def slope_histogram(time_maps: Floats, *, edges: Floats = SLOPE_EDGES) -> Floats:
    """Share of the frames with a slope between two edges, (B,); what is beyond is in the outer bins."""
    slopes = np.diff(validate(time_maps), axis=-1).ravel()
    counts, _ = np.histogram(np.clip(slopes, edges[0], edges[-1]), edges)
    return counts / len(slopes)


def share_at_limits(
    time_maps: Floats, *, slowest: float = SLOWEST, fastest: float = FASTEST, tolerance: float = AT_LIMIT
) -> tuple[float, float]:
    """Shares of the frames that are as slow, and as fast, as the limits allow, or more so."""
    slopes = np.diff(validate(time_maps), axis=-1)
    return (
        float(np.mean(slopes <= slowest * (1 + tolerance))),
        float(np.mean(slopes >= fastest * (1 - tolerance))),
    )


def recovery_errors_ms(found_frames: Floats, teacher_frames: Floats, fps: float) -> Floats:
    """How far from the true source frame (..., T) each found one is, in ms: (N,), all frames of all maps."""
    found, true = np.asarray(found_frames, np.float64), np.asarray(teacher_frames, np.float64)
    if found.shape != true.shape or found.size == 0:
        raise ParameterError(f"expected a true frame for each found, got {true.shape} and {found.shape}")
    if not (np.isfinite(found).all() and np.isfinite(true).all() and np.isfinite(fps) and fps > 0):
        raise ParameterError("expected finite source frames at a positive rate")
    return np.abs(found - true).ravel() * 1000.0 / fps


def summary_ms(errors_ms: Floats) -> dict[str, float]:
    """Median, mean and 90th percentile of errors (N,) by name."""
    if len(errors_ms) == 0:
        raise ParameterError("expected errors to summarise, got none")
    return {
        "median_ms": float(np.median(errors_ms)),
        "mean_ms": float(np.mean(errors_ms)),
        "p90_ms": float(np.percentile(errors_ms, 90)),
    }


def evaluate(time_maps: Floats) -> dict[str, float]:
    """Slopes of the maps by name: middle, spread and how much lies at the limits."""
    slopes = np.diff(validate(time_maps), axis=-1)
    slowest, fastest = share_at_limits(time_maps)
    return {
        "slope_p05": float(np.percentile(slopes, 5)),
        "slope_median": float(np.median(slopes)),
        "slope_p95": float(np.percentile(slopes, 95)),
        "share_at_slowest": slowest,
        "share_at_fastest": fastest,
    }
