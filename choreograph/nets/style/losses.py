"""Losses of the style networks: equation 1, and a contrastive loss across the batch."""

from __future__ import annotations

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
    anchors: Tensor, others: Tensor, *, positive: Tensor, negative: Tensor, temperature: float
) -> Tensor:
    """How much nearer anchors are to their positives than to their negatives (ours).

    `anchors` (A, 32) and `others` (B, 32) are unit vectors; `positive` and `negative` are boolean (A, B), and
    pairs in neither are ignored. Each positive is compared with all negatives of its anchor; anchors without
    a negative are ignored.
    """
    logits = 2.0 * (anchors @ others.T - 1.0) / temperature  # minus the squared distance, (A, B)
    against = logits.masked_fill(~negative, -1e9).logsumexp(dim=1, keepdim=True)  # (A, 1)
    valid = positive & negative.any(dim=1, keepdim=True)
    losses = functional.softplus(against - logits)  # (A, B)
    return (losses * valid).sum() / valid.sum().clamp_min(1)
