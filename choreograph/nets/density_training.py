"""Training of the tempo-densities of motion and music: losses and schedule (ChoreoGraph, section 3.2)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from choreograph.core.timebase import CLIP_FRAMES
from choreograph.nets.configs import DensityConfig
from choreograph.nets.density import MotionDecoder, MotionDensity, MusicDensity, standardised
from choreograph.nets.density_data import MusicDensityData, WarpedPairs, clip_takes, warped_pairs
from choreograph.nets.style_data import StyleTake
from choreograph.nets.training import TrainingContext, load_pretrained, steps_of_epochs, train

# Losses of motion's tempo-density: equation 2 of ChoreoGraph (section 3.2), equivariance and location.


WINDOW_FRAMES = 11  # half a second, which the location term compares
RANGE_FRAMES = 20  # a second to either side, with which it is compared


@dataclass(frozen=True, eq=False)
class DensityOutputs:
    """Outputs of the estimator for warped pairs."""

    density: Tensor  # (B, 160)
    warped_density: Tensor  # (B, 160)
    content: Tensor  # (B, C)
    warped_content: Tensor  # (B, C)


def density_loss(
    estimator: nn.Module, decoder: nn.Module, pairs: WarpedPairs, config: DensityConfig
) -> Tensor:
    """Equation 2 and, unless `settings.loss` is "paper", equivariance and location (ours)."""
    n = len(pairs.body)
    density, content = estimator(torch.cat([pairs.body, pairs.warped]))
    outputs = DensityOutputs(density[:n], density[n:], content[:n], content[n:])
    reconstruction = reconstruction_loss(decoder, pairs, outputs, content_weight=config.content_weight)
    if config.loss == "paper":
        return reconstruction
    loss = config.reconstruction_weight * reconstruction
    # The density of the warped motion should be the density, warped in the same way.
    expected = standardised(interpolate_curves(outputs.density, pairs.frames))
    loss = loss + config.equivariance_weight * (outputs.warped_density - expected).square().mean()
    return loss + config.location_weight * location_loss(
        outputs.warped_density, outputs.density, pairs.frames, temperature=config.temperature
    )


def reconstruction_loss(
    decoder: nn.Module, pairs: WarpedPairs, outputs: DensityOutputs, *, content_weight: float
) -> Tensor:
    """Equation 2, with means instead of sums: each density with each content, and their distance."""
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
    """Whether the source frames of a warped density can be located in the density, as DTW does (ours).

    Every half second of the warped density should be more similar to the density at its true source frames
    than to the density 0.1 s to 1 s beside them. The loss is a cross-entropy over shifts, of the mean squared
    differences over the window. An error of one frame is ignored, since the warp is not more exact.
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
    """Curves (B, T) at fractional frames (B, N), linear between neighbours and differentiable.

    Outside, the end values are repeated, as in `core.numerics.interpolate_frames`.
    """
    at = frames.clamp(0, curves.shape[1] - 1)
    low = at.long().clamp(max=curves.shape[1] - 2)
    weight = at - low
    return curves.gather(1, low) * (1 - weight) + curves.gather(1, low + 1) * weight


# Training of the tempo-densities of motion and music (ChoreoGraph, section 3.2).


def train_motion_density(
    takes: Sequence[StyleTake],
    config: DensityConfig,
    *,
    seed: int,
    context: TrainingContext | None = None,
    pretrained: Mapping[str, NDArray[Any]] | None = None,
) -> MotionDensity:
    """Train motion's estimator with its decoder, on clips and their random warps.

    Raises `ParameterError` if no take has 8 s of motion.
    """
    usable = clip_takes(takes)
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        estimator, decoder = MotionDensity(config), MotionDecoder(config)
    nets = nn.ModuleDict({"estimator": estimator, "decoder": decoder})
    if pretrained is not None:
        load_pretrained(estimator, "motion_density", pretrained)

    def loss(rng: np.random.Generator, device: torch.device) -> Tensor:
        pairs = warped_pairs(
            usable,
            config.batch_size,
            rng,
            mirrored_share=config.mirrored_share,
            augmented=config.augmented,
        )
        return density_loss(estimator, decoder, pairs.to(device), config)

    n_clips = sum(len(take.body_pos_m) for take in usable) / CLIP_FRAMES

    train(
        nets,
        loss,
        name="motion_density",
        n_steps=_n_steps(config, config.steps, n_clips, config.batch_size),
        learning_rate=config.learning_rate,
        weight_decay=config.weight_decay,
        schedule=config.schedule,
        seed=seed,
        configuration={**asdict(config), "takes": [take.name for take in usable]},
        context=context,
    )
    return estimator


def train_music_density(
    takes: Sequence[StyleTake],
    motion_density: MotionDensity,
    config: DensityConfig,
    *,
    seed: int,
    context: TrainingContext | None = None,
    pretrained: Mapping[str, NDArray[Any]] | None = None,
) -> MusicDensity:
    """Train music's estimator to predict the motion's density (equation 3).

    Raises `ParameterError` if no take has 8 s of music and motion.
    """
    data = MusicDensityData(takes, motion_density, synchronise=config.synchronise)
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        net = MusicDensity(config)
    if pretrained is not None:
        load_pretrained(net, "music_density", pretrained)
    net.load_state_dict({name: torch.from_numpy(v) for name, v in data.statistics().items()}, strict=False)

    def loss(rng: np.random.Generator, device: torch.device) -> Tensor:
        mel, target = data.batch(config.music_batch_size, rng, augmented=config.augmented)
        return functional.mse_loss(net(mel.to(device)), target.to(device))

    train(
        net,
        loss,
        name="music_density",
        n_steps=_n_steps(config, config.music_steps, data.n_clips, config.music_batch_size),
        learning_rate=config.music_learning_rate,
        weight_decay=config.weight_decay,
        schedule=config.schedule,
        seed=seed,
        configuration={**asdict(config), "takes": [take.name for take in data.takes]},
        context=context,
    )
    return net


def _n_steps(config: DensityConfig, steps: int, n_clips: float, batch_size: int) -> int:
    return steps_of_epochs(config.epochs, n_clips, batch_size) if config.epochs else steps
