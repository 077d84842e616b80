"""Frames replaced by a smooth path between the frames before and after, with their velocities."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

from choreograph.motion import rotations as rot

Floats = NDArray[np.float64]
Span = tuple[int, int]  # first frame, and the one after the last


def bridged(values: Floats, spans: Iterable[Span]) -> Floats:
    """`values` (T, ...) with the frames of each span on the cubic from the frame before it to the one after.

    The cubic starts and ends with the velocities there, from the two frames nearest to the span on either
    side. All other frames stay exactly as they are, and so does a span that has less than two frames before
    or after it. Spans must not touch one another.
    """
    path = np.array(values, np.float64)
    for start, stop in spans:
        if start < 2 or stop > len(path) - 2:
            continue
        ends, beyond = values[[start - 1, stop]], values[[start - 2, stop + 1]]
        rates = (ends - beyond) * np.array([1.0, -1.0]).reshape(-1, *[1] * (values.ndim - 1))
        curve = CubicHermiteSpline([start - 1, stop], ends, rates)
        path[start:stop] = curve(np.arange(start, stop))
    return path


def bridged_rotations(quat: Floats, spans: Iterable[Span]) -> Floats:
    """Rotations (T, ..., 4) bridged as `bridged` does, by the shorter arc; sign-continuous if `quat` was."""
    turns = np.array(quat, np.float64)
    for start, stop in spans:
        if start < 2 or stop > len(turns) - 2:
            continue
        around = rot.make_continuous(turns[[start - 2, start - 1, stop, stop + 1]])  # (4, ..., 4)
        gap = np.zeros((stop - start, *turns.shape[1:]))
        inside = bridged(np.concatenate([around[:2], gap, around[2:]]), [(2, 2 + stop - start)])
        turns[start:stop] = rot.normalize(inside[2:-2])
    return rot.make_continuous(turns)
