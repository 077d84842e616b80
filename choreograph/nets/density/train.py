"""Training of the motion's tempo-density on clips and their random warps (ChoreoGraph, section 3.2)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from choreograph.errors import ParameterError
from choreograph.motion.body import mirrored
from choreograph.nets.density.config import DensityConfig
from choreograph.nets.density.model import MotionDecoder, MotionDensity, standardised
from choreograph.nets.density.random_warp import random_time_map, resampled
from choreograph.nets.style.data import StyleTake
from choreograph.nets.style.model import centred, turned
from choreograph.nets.training import TrainingContext, load_pretrained, train
from choreograph.timebase import CLIP_FRAMES, CLIP_S, NET_FPS

WINDOW_FRAMES = 11  # half a second: what the location term compares
RANGE_FRAMES = 20  # a second to either side: where it might be confused


@dataclass(frozen=True, eq=False)
class WarpedPairs:
    """Clips, their random warps, and the maps between."""

    body: Tensor  # (B, 160, 21, 3) centred
    warped: Tensor  # (B, 160, 21, 3)
    frames: Tensor  # (B, 160) source frame of every warped frame


@dataclass(frozen=True, eq=False)
class DensityOutputs:
    """What the autoencoder makes of warped pairs."""

    density: Tensor  # (B, 160)
    warped_density: Tensor  # (B, 160)
    content: Tensor  # (B, C)
    warped_content: Tensor  # (B, C)


def train_motion_density(
    takes: Sequence[StyleTake],
    config: DensityConfig,
    *,
    seed: int,
    context: TrainingContext | None = None,
    start: Mapping[str, NDArray] | None = None,
) -> MotionDensity:
    """Train the estimator with its decoder; `ParameterError` if no take holds 8 s of motion."""
    usable = [take for take in takes if len(take.body_pos_m) >= CLIP_FRAMES]
    if not usable:
        raise ParameterError(f"expected a take of {CLIP_S} s or more to learn tempo-density from, got none")
    torch.manual_seed(seed)
    estimator, decoder = MotionDensity(config), MotionDecoder(config)
    nets = nn.ModuleDict({"estimator": estimator, "decoder": decoder})
    if start is not None:
        load_pretrained(estimator, "motion_density", start)

    def loss(rng: np.random.Generator, device: torch.device) -> Tensor:
        pairs = warped_pairs(usable, config.batch_size, rng, mirrored_share=config.mirrored_share)
        pairs = WarpedPairs(*(t.to(device) for t in (pairs.body, pairs.warped, pairs.frames)))
        return density_loss(estimator, decoder, pairs, config)

    train(
        nets,
        loss,
        name="motion_density",
        n_steps=config.steps,
        learning_rate=config.learning_rate,
        weight_decay=config.weight_decay,
        seed=seed,
        configuration={**asdict(config), "takes": [take.name for take in usable]},
        context=context,
    )
    return estimator


def warped_pairs(
    takes: Sequence[StyleTake], size: int, rng: np.random.Generator, *, mirrored_share: float = 0.5
) -> WarpedPairs:
    """Random clips of 8 s, some mirrored, turned by up to 30° and up to 10 % larger, and their warps."""
    lengths = np.array([len(take.body_pos_m) for take in takes], np.float64)
    clips = np.empty((size, CLIP_FRAMES, *takes[0].body_pos_m.shape[1:]), np.float32)
    frames = np.empty((size, CLIP_FRAMES), np.float32)
    for row, index in enumerate(rng.choice(len(takes), size, p=lengths / lengths.sum())):
        take = takes[index]
        begin = int(rng.integers(len(take.body_pos_m) - CLIP_FRAMES + 1))
        clips[row] = take.body_pos_m[begin : begin + CLIP_FRAMES]
        frames[row] = random_time_map(
            CLIP_FRAMES, NET_FPS, rng,
            beat_times_s=take.motion_beat_times_s - begin / NET_FPS, share=rng.uniform(0.2, 1.0),
        )  # fmt: skip
    flip = rng.random(size) < mirrored_share
    clips = np.where(flip[:, None, None, None], mirrored(clips), clips)
    clips = turned(centred(clips), rng.uniform(-np.pi / 6, np.pi / 6, size))
    clips = clips * rng.uniform(0.9, 1.1, (size, 1, 1, 1)).astype(np.float32)
    warped = centred(np.stack([resampled(clip, at) for clip, at in zip(clips, frames, strict=True)]))
    return WarpedPairs(torch.from_numpy(centred(clips)), torch.from_numpy(warped), torch.from_numpy(frames))


def density_loss(
    estimator: nn.Module, decoder: nn.Module, pairs: WarpedPairs, config: DensityConfig
) -> Tensor:
    """Equation 2; unless the config asks for it alone, plus equivariance and location."""
    n = len(pairs.body)
    density, content = estimator(torch.cat([pairs.body, pairs.warped]))
    outputs = DensityOutputs(density[:n], density[n:], content[:n], content[n:])
    reconstruction = equation_2(decoder, pairs, outputs, content_weight=config.content_weight)
    if config.loss == "paper":
        return reconstruction
    followed = at_frames(outputs.density, pairs.frames)  # the density, warped as the motion was
    loss = config.reconstruction_weight * reconstruction
    loss = (
        loss + config.equivariance_weight * (outputs.warped_density - standardised(followed)).square().mean()
    )
    return loss + config.location_weight * location_loss(
        outputs.warped_density, outputs.density, pairs.frames, temperature=config.temperature
    )


def equation_2(
    decoder: nn.Module, pairs: WarpedPairs, outputs: DensityOutputs, *, content_weight: float
) -> Tensor:
    """Four reconstructions, each density with each content, and the contents' distance; means, not sums."""
    o = outputs
    built = decoder(
        torch.cat([o.density, o.warped_density, o.density, o.warped_density]),
        torch.cat([o.content, o.warped_content, o.warped_content, o.content]),
    )
    wanted = torch.cat([pairs.body, pairs.warped, pairs.body, pairs.warped])
    return 4 * functional.mse_loss(built, wanted) + content_weight * functional.mse_loss(
        o.content, o.warped_content
    )


def location_loss(query: Tensor, target: Tensor, frames: Tensor, *, temperature: float) -> Tensor:
    """Ours: where DTW would look. Every half second of the warped density must resemble the density at
    its true source frames more than the same a tenth of a second to a second beside them.

    Cross-entropy over shifts, from mean squared differences over the window; one frame off is no error,
    because the warp itself is known to no better.
    """
    n_frames = target.shape[1]
    shifts = torch.arange(-RANGE_FRAMES, RANGE_FRAMES + 1, device=target.device)  # (S,)
    shifts = shifts[(shifts == 0) | (shifts.abs() > 1)]
    at = frames[:, None, :] + shifts[None, :, None]  # (B, S, T)
    inside = (at >= 0) & (at <= n_frames - 1)
    squared = (query[:, None] - at_frames(target, at.flatten(1)).view_as(at)).square()
    costs = functional.avg_pool1d(squared, WINDOW_FRAMES, stride=2)  # (B, S, T')
    valid = -functional.max_pool1d(-inside.float(), WINDOW_FRAMES, stride=2) > 0  # windows wholly inside
    logits = torch.where(valid, -costs / temperature, torch.full_like(costs, -1e4))
    true = int((shifts == 0).nonzero())
    return -functional.log_softmax(logits, dim=1)[:, true].mean()


def at_frames(curves: Tensor, frames: Tensor) -> Tensor:
    """Curves (B, T) at fractional frames (B, N), linear between neighbours; the ends hold."""
    at = frames.clamp(0, curves.shape[1] - 1)
    low = at.long().clamp(max=curves.shape[1] - 2)
    weight = at - low
    return curves.gather(1, low) * (1 - weight) + curves.gather(1, low + 1) * weight
