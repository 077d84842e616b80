"""Training of the tempo-densities of motion and music: data, losses, schedule (ChoreoGraph, section 3.2)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import interpolate_frames
from choreograph.core.timebase import (
    CLIP_FRAMES,
    CLIP_S,
    MAX_SLOPE,
    MIN_SLOPE,
    MUSIC_FPS,
    NET_FPS,
    SEGMENT_FRAMES,
    frame_times_s,
)
from choreograph.motion.body import mirrored
from choreograph.music.beats import tempo_path_beats
from choreograph.nets.configs import DensityConfig
from choreograph.nets.density import MotionDecoder, MotionDensity, MusicDensity, standardised
from choreograph.nets.inference import MEL_FRAMES
from choreograph.nets.processes import own_rows
from choreograph.nets.style import centred, rotated_about_y
from choreograph.nets.style_training import MelChange, StyleTake, augment_mel
from choreograph.nets.training import TrainingContext, forked_rng, load_pretrained, steps_of_epochs, train

# Training data: clips with known warps, and music with its target density.


MAX_SHIFT_S = 0.5  # of a motion beat by a random warp
MAX_BEAT_DISTANCE_S = 0.35  # a motion beat farther from every music beat is not synchronised
MIN_GAP_S = 0.1  # between knots of the synchronising map. Closer ones would play too fast or too slowly
_MUSIC_PER_MOTION = MUSIC_FPS // NET_FPS


@dataclass(frozen=True, eq=False)
class WarpedPairs:
    """Clips, their random warps, and the time maps between them."""

    body: Tensor  # (B, 160, 21, 3) centred
    warped: Tensor  # (B, 160, 21, 3)
    frames: Tensor  # (B, 160) source frame of every warped frame

    def to(self, device: torch.device) -> WarpedPairs:
        """The pairs on a device."""
        return WarpedPairs(*(getattr(self, field.name).to(device) for field in fields(self)))


def clip_takes(takes: Sequence[StyleTake]) -> list[StyleTake]:
    """The takes with 8 s of motion or more. Raises `ParameterError` if there are none."""
    usable = [take for take in takes if len(take.body_pos_m) >= CLIP_FRAMES]
    if not usable:
        raise ParameterError(f"expected a take of {CLIP_S} s or more to learn tempo-density from, got none")
    return usable


def warped_pairs(
    takes: Sequence[StyleTake],
    size: int,
    rng: np.random.Generator,
    *,
    mirrored_share: float = 0.5,
    augmented: bool = True,
) -> WarpedPairs:
    """Random 8 s clips and their warps.

    `augmented` clips are rotated by up to 30° and scaled by up to 10 %, and some of them mirrored.
    """
    lengths = np.array([len(take.body_pos_m) for take in takes], np.float64)
    clips = np.empty((size, CLIP_FRAMES, *takes[0].body_pos_m.shape[1:]), np.float32)
    frames = np.empty((size, CLIP_FRAMES), np.float32)
    for row, index in enumerate(rng.choice(len(takes), size, p=lengths / lengths.sum())):
        take = takes[index]
        start = int(rng.integers(len(take.body_pos_m) - CLIP_FRAMES + 1))
        clips[row] = take.body_pos_m[start : start + CLIP_FRAMES]
        frames[row] = random_time_map(
            CLIP_FRAMES, NET_FPS, rng,
            beat_times_s=take.motion_beat_times_s - start / NET_FPS, share=rng.uniform(0.2, 1.0),
        )  # fmt: skip
    if augmented:
        flip = rng.random(size) < mirrored_share
        clips = np.where(flip[:, None, None, None], mirrored(clips), clips)
        clips = rotated_about_y(centred(clips), rng.uniform(-np.pi / 6, np.pi / 6, size))
        clips = clips * rng.uniform(0.9, 1.1, (size, 1, 1, 1)).astype(np.float32)
    warped = np.stack([interpolate_frames(clip, at) for clip, at in zip(clips, frames, strict=True)])
    return WarpedPairs(
        torch.from_numpy(centred(clips)), torch.from_numpy(centred(warped)), torch.from_numpy(frames)
    )


def random_time_map(
    n_frames: int,
    fps: float,
    rng: np.random.Generator,
    *,
    beat_times_s: NDArray[np.floating],
    max_shift_s: float = MAX_SHIFT_S,
    share: float = 0.5,
) -> NDArray[np.float64]:
    """Source frame of every warped frame, (T,), from 0 to T - 1: the Random Time-Warper of section 3.2.

    About `share` of the motion beats move by up to `max_shift_s`. The ends stay, and the map is linear in
    between. Unlike in the paper, a shift is limited so that the slope stays in [0.5, 2], the range of the
    warper's paths. Without motion beats inside, knots one second apart move instead.
    """
    if n_frames < 2 or not 0.0 <= share <= 1.0 or max_shift_s < 0:
        raise ParameterError(
            f"expected two frames or more, a share in [0, 1] and a shift of 0 s or more, got {n_frames} "
            f"frames, {share:g} and {max_shift_s:g} s"
        )
    end = n_frames - 1.0
    beats = np.asarray(beat_times_s, np.float64) * fps
    inside = beats[(beats > 1.0) & (beats < end - 1.0)]
    knots = inside if len(inside) else np.arange(fps, end - 1.0, fps)
    source = knots[rng.random(len(knots)) < share] if len(knots) else knots
    source = np.concatenate([[0.0], source, [end]])  # (Q,)
    warped = source.copy()
    shifts = rng.uniform(-max_shift_s * fps, max_shift_s * fps, len(source))
    for i in range(1, len(source) - 1):  # from left to right. Each leaves room for those after it
        gap, rest = source[i] - source[i - 1], end - source[i]
        low = max(warped[i - 1] + gap / MAX_SLOPE, end - rest / MIN_SLOPE)
        high = min(warped[i - 1] + gap / MIN_SLOPE, end - rest / MAX_SLOPE)
        warped[i] = np.clip(source[i] + shifts[i], low, high)
    result: NDArray[np.float64] = np.interp(np.arange(n_frames), warped, source)
    return result


class MusicDensityData:
    """Takes as pairs of music and target density. Raises `ParameterError` if none has 8 s of both."""

    def __init__(
        self, takes: Sequence[StyleTake], motion_density: MotionDensity, *, synchronise: bool, of_clips: bool
    ) -> None:
        self.takes = [take for take in takes if _n_frames(take) >= CLIP_FRAMES]
        if not self.takes:
            raise ParameterError(f"expected a take with {CLIP_S} s of music and motion, got none")
        self._net, self._of_clips = motion_density, of_clips
        self._mels = [take.log_mel[: _MUSIC_PER_MOTION * _n_frames(take)] for take in self.takes]
        if not of_clips:
            self._targets = [target_density(t, motion_density, synchronise=synchronise) for t in self.takes]
        lengths = np.array([_n_frames(take) for take in self.takes], np.float64)
        self._probability = lengths / lengths.sum()
        self.n_clips = float(lengths.sum()) / CLIP_FRAMES  # length in clips of 8 s that do not overlap

    def statistics(self) -> dict[str, NDArray[np.float32]]:
        """Mean and deviation for standardising the input, by the names of the buffers of `MusicDensity`."""
        mel = np.concatenate(self._mels)
        return {"mel_mean": mel.mean(axis=0), "mel_std": mel.std(axis=0) + 1e-3}

    def batch(self, size: int, rng: np.random.Generator, *, augmented: bool = True) -> tuple[Tensor, Tensor]:
        """Random segments: log-mel (B, 240, 96), augmented or as it is, and target density (B, 80).

        With `of_clips`, they are the middles of random clips, and the density is that of the clip alone.
        """
        span = CLIP_FRAMES if self._of_clips else SEGMENT_FRAMES
        middle = (span - SEGMENT_FRAMES) // 2
        takes = rng.choice(len(self.takes), size, p=self._probability).tolist()
        rows = [(take, int(rng.integers(_n_frames(self.takes[take]) - span + 1))) for take in takes]
        first = [_MUSIC_PER_MOTION * (start + middle) for _, start in rows]
        mels = [self._mels[take][frame:][:MEL_FRAMES] for take, frame in zip(takes, first, strict=True)]
        mel = np.array(mels, np.float32)
        if self._of_clips:
            clips = np.stack([self.takes[take].body_pos_m[at : at + CLIP_FRAMES] for take, at in rows])
            target = self._net.clip_densities(clips)[:, middle : middle + SEGMENT_FRAMES]
        else:
            target = np.stack([self._targets[take][at : at + SEGMENT_FRAMES] for take, at in rows])
        if augmented:
            mel = augment_mel(mel, MelChange.drawn(size, rng))
        return torch.from_numpy(mel), torch.from_numpy(target)


def target_density(
    take: StyleTake, motion_density: MotionDensity, *, synchronise: bool
) -> NDArray[np.float32]:
    """The density that the music of a take is trained to predict, (T,) at 20 fps.

    It is the mean of the densities of overlapping windows of 8 s. It has unit variance if the densities of
    `motion_density` have. With `synchronise`, it is warped so that the motion beats fall on the music beats.
    Takes are danced in tempo but often not in phase, and an estimator trained on raw pairs predicts the mean
    over all phases.
    """
    density = motion_density.take_density(take.body_pos_m[: _n_frames(take)])
    if synchronise:
        beats = tempo_path_beats(take.log_mel)
        time_map = synchronising_map(len(density), take.motion_beat_times_s, beats)
        density = interpolate_frames(density, time_map).astype(np.float32)
    if not motion_density.config.unit_variance:
        return density
    result: NDArray[np.float32] = (density - density.mean()) / (density.std() + 1e-5)
    return result


def synchronising_map(
    n_frames: int, motion_beats_s: NDArray[np.floating], music_beats_s: NDArray[np.floating]
) -> NDArray[np.float64]:
    """Source frame of every frame, (T,), of the warp that moves motion beats onto their nearest music beats.

    A music beat and a motion beat are matched if each is the other's nearest and they are at most
    `MAX_BEAT_DISTANCE_S` apart. The map is linear between matches and strictly increasing.
    """
    duration_s = (n_frames - 1) / NET_FPS
    knots, source = [0.0], [0.0]
    for music_beat in music_beats_s:
        if len(motion_beats_s) == 0:
            break
        motion_beat = float(motion_beats_s[np.argmin(np.abs(motion_beats_s - music_beat))])
        nearest = music_beats_s[np.argmin(np.abs(music_beats_s - motion_beat))]
        near = nearest == music_beat and abs(motion_beat - music_beat) <= MAX_BEAT_DISTANCE_S
        gap = min(music_beat - knots[-1], motion_beat - source[-1])  # to the last knot, and to the end
        gap = min(gap, duration_s - music_beat, duration_s - motion_beat)
        if near and gap >= MIN_GAP_S:
            knots.append(float(music_beat))
            source.append(motion_beat)
    times = frame_times_s(n_frames, NET_FPS)
    return np.interp(times, [*knots, duration_s], [*source, duration_s]) * NET_FPS


def _n_frames(take: StyleTake) -> int:
    """Motion frames that have music."""
    return min(len(take.body_pos_m), len(take.log_mel) // _MUSIC_PER_MOTION)


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
    with forked_rng():
        torch.manual_seed(seed)
        estimator, decoder = MotionDensity(config), MotionDecoder(config)
    nets = nn.ModuleDict({"estimator": estimator, "decoder": decoder})
    if pretrained is not None:
        load_pretrained(estimator, "motion_density", pretrained)

    def loss(rng: np.random.Generator, device: torch.device) -> Tensor:
        pairs = warped_pairs(
            usable, config.batch_size, rng, mirrored_share=config.mirrored_share, augmented=config.augmented
        )
        return density_loss(estimator, decoder, own_rows(pairs).to(device), config)

    n_clips = sum(len(take.body_pos_m) for take in usable) / CLIP_FRAMES
    train(
        nets,
        loss,
        name="motion_density",
        n_steps=_n_steps(config, config.steps, n_clips, config.batch_size),
        learning_rate=config.learning_rate,
        weight_decay=config.weight_decay, schedule=config.schedule, seed=seed,
        configuration={**asdict(config), "takes": [take.name for take in usable]}, context=context,
    )  # fmt: skip
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
    of_clips = config.music_target == "clip"
    data = MusicDensityData(takes, motion_density, synchronise=config.synchronise, of_clips=of_clips)
    with forked_rng():
        torch.manual_seed(seed)
        net = MusicDensity(config)
    if pretrained is not None:
        load_pretrained(net, "music_density", pretrained)
    net.load_state_dict({name: torch.from_numpy(v) for name, v in data.statistics().items()}, strict=False)

    def loss(rng: np.random.Generator, device: torch.device) -> Tensor:
        mel, target = data.batch(config.music_batch_size, rng, augmented=config.augmented)
        return functional.mse_loss(net(own_rows(mel).to(device)), own_rows(target).to(device))

    train(
        net,
        loss,
        name="music_density",
        n_steps=_n_steps(config, config.music_steps, data.n_clips, config.music_batch_size),
        learning_rate=config.music_learning_rate,
        weight_decay=config.weight_decay, schedule=config.schedule, seed=seed,
        configuration={**asdict(config), "takes": [take.name for take in data.takes]}, context=context,
    )  # fmt: skip
    return net


def _n_steps(config: DensityConfig, steps: int, n_clips: float, batch_size: int) -> int:
    return steps_of_epochs(config.epochs, n_clips, batch_size) if config.epochs else steps
