"""The paper's style-based selection."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from choreograph.errors import ParameterError

_BLOCK_BYTES = 64e6


def select_clips(
    music_style: NDArray[np.floating],
    music_beat_count: NDArray[np.floating],
    clip_style: NDArray[np.floating],
    clip_beat_count: NDArray[np.floating],
    *,
    candidates: int,
    beat_weight: float,
) -> NDArray[np.int64]:
    """The clips with the least style loss for each music segment, best first.

    Parameters
    ----------
    music_style : float array (S, D)        s_m of every second's 4 s
    music_beat_count : float array (S,)     B_m(s_m)
    clip_style : float array (N, D)         s_x of every clip's middle 4 s
    clip_beat_count : float array (N,)      motion beats in the clip's middle 4 s
    candidates : int                        K; all clips if there are fewer
    beat_weight : float                     λ_b against λ_cs = 1, as in training

    Returns
    -------
    int array (S, min(K, N)); ties go to the earlier clip.

    References
    ----------
    ChoreoGraph, section 3.1, equation 1.
    """
    if candidates < 1:
        raise ParameterError(f"expected at least 1 candidate, got {candidates}")
    n_clips = len(clip_style)
    if n_clips == 0:
        raise ParameterError("there is no clip to select from: every take is shorter than 8 s")
    k = min(candidates, n_clips)
    chosen = np.empty((len(music_style), k), np.int64)
    block = max(1, int(_BLOCK_BYTES / (8 * n_clips)))
    clip_sq = np.sum(clip_style**2, axis=1)
    for start in range(0, len(music_style), block):
        style = music_style[start : start + block]  # (B, D)
        sq = np.sum(style**2, axis=1)[:, None] + clip_sq - 2.0 * style @ clip_style.T
        loss = np.sqrt(np.maximum(sq, 0.0))  # (B, N)
        loss += beat_weight * np.abs(music_beat_count[start : start + block, None] - clip_beat_count)
        if k < n_clips:
            nearest = np.argpartition(loss, k - 1, axis=1)[:, :k]
            nearest.sort(axis=1)
        else:
            nearest = np.broadcast_to(np.arange(n_clips), loss.shape)
        order = np.argsort(np.take_along_axis(loss, nearest, axis=1), axis=1, kind="stable")
        chosen[start : start + block] = np.take_along_axis(nearest, order, axis=1)
    return chosen
