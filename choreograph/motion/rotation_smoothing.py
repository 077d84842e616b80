"""Smoothing of fitted rotations: flips bridged, weighted angles smoothed over time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

from choreograph.motion import rotations as rot

Floats = NDArray[np.float64]

_FLIP_RAD = 1.4  # between two frames


def bridge_flips(local_quat: Floats, half: int) -> Floats:
    """Rotations (T, J, 4) with impossible jumps replaced by slerp from `half` frames before to after.

    Changes `local_quat` in place.
    """
    n_frames = len(local_quat)
    dot = np.abs(np.sum(local_quat[1:] * local_quat[:-1], axis=-1))  # (T-1, J)
    jumps = 2.0 * np.arccos(np.clip(dot, 0.0, 1.0)) > _FLIP_RAD
    for joint in np.flatnonzero(jumps.any(axis=0)):
        jumped = np.convolve(jumps[:, joint], np.ones(2 * half), mode="same") > 0
        edges = np.flatnonzero(
            np.diff(np.concatenate([[False], jumped[: n_frames - 1], [False]]).astype(int))
        )
        for start, stop in zip(edges[::2], edges[1::2], strict=True):  # frames start and stop are valid
            weight = np.linspace(0.0, 1.0, stop - start + 1)
            ends = local_quat[[start, stop], joint]
            local_quat[start : stop + 1, joint] = rot.slerp(ends[:1], ends[1:], weight)
    return rot.make_continuous(local_quat)


def smoothed_angle(cos: Floats, sin: Floats, smoothing: float) -> Floats:
    """Smoothed angles (T,) of vectors (cos, sin), each weighted by its length.

    Least squares in the plane: sum of length * |z - unit vector|² + smoothing * |dz/dt|².
    """
    weight = np.hypot(cos, sin)
    n = len(weight)
    link = np.full(n, smoothing)
    bands = np.zeros((2, n))  # upper form: off-diagonal, diagonal
    bands[1] = weight + 1e-9
    bands[1, 1:] += link[1:]
    bands[1, :-1] += link[1:]
    bands[0, 1:] = -link[1:]
    smooth = solveh_banded(bands, np.stack([cos, sin], axis=-1))  # (T, 2)
    return np.arctan2(smooth[:, 1], smooth[:, 0])
