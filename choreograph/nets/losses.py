"""Losses of the style networks: equation 1, contrast across the batch, and what selection ranks by."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional


def style_loss(
    music: Tensor,
    motion: Tensor,
    beat_count: Tensor,
    n_beats: Tensor,
    *,
    style_weight: float,
    beat_weight: float,
) -> Tensor:
    """Equation 1 of ChoreoGraph (section 3.1), mean over a batch of pairs.

    `music`, `motion` (B, 32) style vectors; `beat_count` (B,) predicted from the music, `n_beats` (B,)
    counted in the motion. Constant embeddings minimise it: add `contrastive_loss`.
    """
    distance = (music - motion).square().sum(dim=1).clamp_min(1e-12).sqrt()  # (B,)
    return (style_weight * distance + beat_weight * (beat_count - n_beats).abs()).mean()


def contrastive_loss(
    music: Tensor, motion: Tensor, *, positive: Tensor, negative: Tensor, temperature: float
) -> Tensor:
    """How much nearer music is to its positives than to its negatives, and motion likewise (ours).

    `positive` and `negative` (B, B) boolean, music in rows; pairs in neither are left out. Each
    positive is held against all negatives; rows without a negative count nothing.
    """
    squared = (music[:, None] - motion[None]).square().sum(dim=2)  # (B, B)
    logits = -squared / temperature
    return 0.5 * (_one_way(logits, positive, negative) + _one_way(logits.T, positive.T, negative.T))


def _one_way(logits: Tensor, positive: Tensor, negative: Tensor) -> Tensor:
    against = logits.masked_fill(~negative, -torch.inf).logsumexp(dim=1, keepdim=True)  # (B, 1)
    counted = positive & negative.any(dim=1, keepdim=True)
    losses = functional.softplus(torch.where(counted, against - logits, 0.0))  # (B, B)
    return (losses * counted).sum() / counted.sum().clamp_min(1)


def selection_loss(
    music_style: NDArray[np.floating],
    beat_count: NDArray[np.floating],
    motion_style: NDArray[np.floating],
    n_beats: NDArray[np.floating],
    *,
    style_weight: float,
    beat_weight: float,
) -> NDArray[np.float64]:
    """Equation 1 between every music segment and every clip, (M, N): selection takes the least.

    `music_style` (M, 32), `beat_count` (M,) predicted from it; `motion_style` (N, 32) and `n_beats` (N,)
    of the clips' middle 4 s.
    """
    music_style, motion_style = np.asarray(music_style, np.float64), np.asarray(motion_style, np.float64)
    squared = (
        (music_style**2).sum(axis=1)[:, None]
        + (motion_style**2).sum(axis=1)[None]
        - 2.0 * music_style @ motion_style.T
    )
    beats_off = np.abs(np.asarray(beat_count)[:, None] - np.asarray(n_beats)[None])  # (M, N)
    return style_weight * np.sqrt(np.maximum(squared, 0.0)) + beat_weight * beats_off
