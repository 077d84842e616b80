"""Subsequence dynamic time warping of tempo-densities, many candidates in one call."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from choreograph.errors import ParameterError


def subsequence_dtw(query: ArrayLike, targets: ArrayLike) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Find `query` inside each of `targets`, at between half and double speed.

    Steps (query, target) are (1, 1), (1, 2) and (2, 1), which keep the slope between `MIN_SLOPE` and
    `MAX_SLOPE`. A step (2, 1) pays its cell twice, once for each query frame, so that slowing down is not
    cheaper than it should be (the paper does not specify this).

    Parameters
    ----------
    query : float array (Tq,) or (K, Tq)    tempo-density wanted, motion frames
    targets : float array (Tt,) or (K, Tt)  tempo-densities of the clips, motion frames

    Returns
    -------
    source_frames : float array (K, Tq)   strictly increasing, in [0, Tt - 1]; half frames where a
        query frame falls between two target frames
    cost : float array (K,)               mean squared difference along the path
    Both without the first axis if query and target have none.

    Raises
    ------
    ParameterError   if shapes do not match, a value is not finite, or the target is too short for the
        query at half speed: Tt - 1 < (Tq - 1) / 2

    References
    ----------
    ChoreoGraph, section 3.2; Müller, Fundamentals of Music Processing (2015), section 7.2.
    """
    from choreograph.warping._kernels import dtw_batch

    q = np.asarray(query, np.float32)
    t = np.asarray(targets, np.float32)
    if q.ndim not in (1, 2) or t.ndim not in (1, 2):
        raise ParameterError(f"expected densities (T,) or (K, T), got {q.shape} and {t.shape}")
    single = q.ndim == 1 and t.ndim == 1
    n = max(len(a) if a.ndim == 2 else 1 for a in (q, t))
    if any(a.ndim == 2 and len(a) != n for a in (q, t)):
        raise ParameterError(f"expected as many queries as targets, got {q.shape} and {t.shape}")
    q = np.ascontiguousarray(np.broadcast_to(q, (n, q.shape[-1])))  # (K, Tq)
    t = np.ascontiguousarray(np.broadcast_to(t, (n, t.shape[-1])))  # (K, Tt)
    if q.shape[1] < 2 or 2 * (t.shape[1] - 1) < q.shape[1] - 1:
        raise ParameterError(
            f"expected a query of at least 2 frames and a target that holds it at half speed, got "
            f"{q.shape[1]} and {t.shape[1]} frames"
        )
    if not (np.isfinite(q).all() and np.isfinite(t).all()):
        raise ParameterError("expected finite tempo-densities, got nan or infinity")
    source_frames, cost = dtw_batch(q, t)
    return (source_frames[0], cost[0]) if single else (source_frames, cost)
