"""True phases in beat and bar, and their likelihood by a network, for training the counting networks."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from choreograph.core.counts import Counts
from choreograph.music.bar_pointer import METRES

_LONGEST_INTERVAL = 1.75  # of the median. Longer ones are gaps without counts


@dataclass(frozen=True, eq=False)
class Phases:
    """Phases in turns at instants, shape (...)."""

    beat: NDArray[np.float32]  # 0 … 1
    bar: NDArray[np.float32]  # 0 … 1
    metre: NDArray[np.int64]  # index in `METRES`
    known: NDArray[np.bool_]  # False where there are no counts


def phases_at(counts: Counts, times_s: NDArray[np.floating]) -> Phases:
    """The phases of counts at times (...) in seconds.

    Between two counts the phase is linear. Phases are unknown before the first and after the last count, in
    gaps, where the next number is not the next in the bar, or if the metre is not among `METRES`.
    """
    times = np.asarray(times_s, np.float64)
    if len(counts) < 2 or counts.metre not in METRES:
        nothing = np.zeros(times.shape, np.float32)
        return Phases(nothing, nothing, nothing.astype(np.int64), nothing > 0)
    length_s = np.diff(counts.times_s)
    is_counted = (length_s < _LONGEST_INTERVAL * np.median(length_s)) & (
        counts.numbers[1:] == counts.numbers[:-1] % counts.metre + 1
    )
    interval = np.searchsorted(counts.times_s, times, side="right") - 1
    inside = (interval >= 0) & (interval < len(length_s))
    interval = interval.clip(0, len(length_s) - 1)
    beat = (times - counts.times_s[interval]) / length_s[interval]
    bar = (counts.numbers[interval] - 1 + beat) / counts.metre
    known = inside & is_counted[interval]
    metre = np.full(times.shape, METRES.index(counts.metre), np.int64)
    return Phases(
        np.where(known, beat, 0.0).astype(np.float32),
        np.where(known, bar, 0.0).astype(np.float32),
        metre,
        known,
    )


@dataclass(frozen=True, eq=False)
class PhaseTargets:
    """`Phases` of a batch as tensors, (B, T) each."""

    beat: Tensor
    bar: Tensor
    metre: Tensor
    known: Tensor

    @classmethod
    def of(cls, batch: list[Phases]) -> PhaseTargets:
        """The phases of a batch's rows, of one length."""
        return cls(*(torch.from_numpy(np.stack([getattr(p, f.name) for p in batch])) for f in fields(Phases)))

    def to(self, device: torch.device) -> PhaseTargets:
        """The targets on a device."""
        return PhaseTargets(*(getattr(self, field.name).to(device) for field in fields(self)))


def phase_loss(outputs: Tensor, targets: PhaseTargets, *, bar_weight: float) -> Tensor:
    """Mean negative log likelihood of the phases of known frames, in nats above a uniform density's.

    `outputs` is (B, N_OUTPUTS, T). The bar has the weight `bar_weight`. Its vector of the right metre should
    have the phase, and those of the other metres should be 0.
    """
    batch, _, frames = outputs.shape
    vectors = outputs.reshape(batch, 1 + len(METRES), 2, frames)
    log_i0 = _log_i0(vectors.square().sum(dim=2).add(1e-8).sqrt())  # (B, 1 + M, T)
    beat = log_i0[:, 0] - _along(vectors[:, 0], targets.beat)
    index = (1 + targets.metre)[:, None, None, :].expand(-1, 1, 2, -1)  # (B, 1, 2, T)
    bar = log_i0[:, 1:].sum(dim=1) - _along(vectors.gather(1, index)[:, 0], targets.bar)
    known = targets.known.to(outputs.dtype)
    return ((beat + bar_weight * bar) * known).sum() / known.sum().clamp(min=1.0)


def _along(vectors: Tensor, turns: Tensor) -> Tensor:
    """Vectors (B, 2, T) along unit vectors of phases (B, T)."""
    angle = 2 * torch.pi * turns
    return vectors[:, 0] * angle.cos() + vectors[:, 1] * angle.sin()


def _log_i0(concentration: Tensor) -> Tensor:
    result: Tensor = torch.special.i0e(concentration).log() + concentration
    return result
