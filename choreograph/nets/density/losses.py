"""Losses of motion's tempo-density: equation 2 of ChoreoGraph (section 3.2), equivariance and location."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional

from choreograph.nets.density.config import DensityConfig
from choreograph.nets.density.data import WarpedPairs
from choreograph.nets.density.model import standardised

WINDOW_FRAMES = 11  # half a second: what the location term compares
RANGE_FRAMES = 20  # a second to either side: where it might be confused


@dataclass(frozen=True, eq=False)
class DensityOutputs:
    """What the estimator makes of warped pairs."""

    density: Tensor  # (B, 160)
    warped_density: Tensor  # (B, 160)
    content: Tensor  # (B, C)
    warped_content: Tensor  # (B, C)


def density_loss(
    estimator: nn.Module, decoder: nn.Module, pairs: WarpedPairs, config: DensityConfig
) -> Tensor:
    """Equation 2 and, unless `config.loss` is "paper", equivariance and location (ours)."""
    n = len(pairs.body)
    density, content = estimator(torch.cat([pairs.body, pairs.warped]))
    outputs = DensityOutputs(density[:n], density[n:], content[:n], content[n:])
    reconstruction = reconstruction_loss(decoder, pairs, outputs, content_weight=config.content_weight)
    if config.loss == "paper":
        return reconstruction
    loss = config.reconstruction_weight * reconstruction
    # The density of the warped motion should be the density, warped alike.
    expected = standardised(interpolate_curves(outputs.density, pairs.frames))
    loss = loss + config.equivariance_weight * (outputs.warped_density - expected).square().mean()
    return loss + config.location_weight * location_loss(
        outputs.warped_density, outputs.density, pairs.frames, temperature=config.temperature
    )


def reconstruction_loss(
    decoder: nn.Module, pairs: WarpedPairs, outputs: DensityOutputs, *, content_weight: float
) -> Tensor:
    """Equation 2, with means for sums: each density with each content, and the contents' distance."""
    o = outputs
    decoded = decoder(
        torch.cat([o.density, o.warped_density, o.density, o.warped_density]),
        torch.cat([o.content, o.warped_content, o.warped_content, o.content]),
    )
    target = torch.cat([pairs.body, pairs.warped, pairs.body, pairs.warped])
    return 4 * functional.mse_loss(decoded, target) + content_weight * functional.mse_loss(
        o.content, o.warped_content
    )


def location_loss(query: Tensor, target: Tensor, frames: Tensor, *, temperature: float) -> Tensor:
    """How well the warped density finds its true source frames in the density, as DTW will have to (ours).

    Every half second of the warped density should be more similar to the density at its true source frames
    than to the density a tenth of a second to one second beside them: cross-entropy over shifts, of mean
    squared differences over the window. One frame off is no error, because the warp is known no better.
    """
    n_frames = target.shape[1]
    shifts = torch.arange(-RANGE_FRAMES, RANGE_FRAMES + 1, device=target.device)  # (S,)
    shifts = shifts[(shifts == 0) | (shifts.abs() > 1)]
    at = frames[:, None, :] + shifts[None, :, None]  # (B, S, T)
    inside = (at >= 0) & (at <= n_frames - 1)
    squared = (query[:, None] - interpolate_curves(target, at.flatten(1)).view_as(at)).square()
    costs = functional.avg_pool1d(squared, WINDOW_FRAMES, stride=2)  # (B, S, T')
    valid = -functional.max_pool1d(-inside.float(), WINDOW_FRAMES, stride=2) > 0  # windows wholly inside
    logits = torch.where(valid, -costs / temperature, torch.full_like(costs, -1e4))
    true = int((shifts == 0).nonzero())
    return -functional.log_softmax(logits, dim=1)[:, true].mean()


def interpolate_curves(curves: Tensor, frames: Tensor) -> Tensor:
    """Curves (B, T) at fractional frames (B, N), linear between neighbours; differentiable.

    Outside, the end values are repeated: `motion.interpolation.interpolate_frames` of tensors.
    """
    at = frames.clamp(0, curves.shape[1] - 1)
    low = at.long().clamp(max=curves.shape[1] - 2)
    weight = at - low
    return curves.gather(1, low) * (1 - weight) + curves.gather(1, low + 1) * weight
