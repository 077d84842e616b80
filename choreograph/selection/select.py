"""The paper's style-based selection."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from choreograph.distances import squared_distances
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
    penalty: Callable[[int], NDArray[np.floating]] | None = None,
) -> NDArray[np.int64]:
    """The clips with the smallest style loss for each music segment, best first.

    Parameters
    ----------
    music_style : float array (S, D)        s_m of the 4 s from every second
    music_beat_count : float array (S,)     B_m(s_m)
    clip_style : float array (N, D)         s_x of every clip's middle 4 s
    clip_beat_count : float array (N,)      motion beats in the clip's middle 4 s
    candidates : int                        K; all clips if there are fewer
    beat_weight : float                     λ_b against λ_cs = 1, as in training
    penalty : second -> float array (N,)    added to the losses of the clips

    Returns
    -------
    int array (S, min(K, N)); ties go to the earlier clip.

    Raises
    ------
    ParameterError   if there are no clips, or `candidates` is less than 1

    References
    ----------
    ChoreoGraph, section 3.1, equation 1.
    """
    if candidates < 1:
        raise ParameterError(f"expected at least 1 candidate, got {candidates}")
    n_clips = len(clip_style)
    if n_clips == 0:
        raise ParameterError("expected clips to select from, got none: every take is shorter than 8 s")
    k = min(candidates, n_clips)
    chosen = np.empty((len(music_style), k), np.int64)
    losses = style_losses(
        music_style, music_beat_count, clip_style, clip_beat_count, beat_weight=beat_weight
    )  # fmt: skip
    for start, loss in losses:
        if penalty is not None:
            loss = loss + np.stack([penalty(start + row) for row in range(len(loss))])
        if k < n_clips:
            nearest = np.argpartition(loss, k - 1, axis=1)[:, :k]
            nearest.sort(axis=1)
        else:
            nearest = np.broadcast_to(np.arange(n_clips), loss.shape)
        order = np.argsort(np.take_along_axis(loss, nearest, axis=1), axis=1, kind="stable")
        chosen[start : start + len(loss)] = np.take_along_axis(nearest, order, axis=1)
    return chosen


def style_losses(
    music_style: NDArray[np.floating],
    music_beat_count: NDArray[np.floating],
    clip_style: NDArray[np.floating],
    clip_beat_count: NDArray[np.floating],
    *,
    beat_weight: float,
) -> Iterator[tuple[int, NDArray[np.floating]]]:
    """Equation 1 for every music segment and clip, in blocks of seconds: (first second, loss (B, N))."""
    block = max(1, int(_BLOCK_BYTES / (8 * len(clip_style))))
    clip_squares = np.sum(clip_style**2, axis=1)
    for start in range(0, len(music_style), block):
        style = music_style[start : start + block]  # (B, D)
        loss = np.sqrt(squared_distances(style, clip_style, b_squares=clip_squares))  # (B, N)
        yield (
            start,
            loss + beat_weight * np.abs(music_beat_count[start : start + block, None] - clip_beat_count),
        )
