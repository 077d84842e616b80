"""Training of the music's tempo-density on that of the takes (ChoreoGraph, section 3.2, equation 3)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from choreograph.errors import ParameterError
from choreograph.features.tempo_path import tempo_path_beats
from choreograph.nets.density.config import DensityConfig
from choreograph.nets.density.model import MotionDensity, MusicDensity
from choreograph.nets.density.random_warp import resampled
from choreograph.nets.style.data import StyleTake, augmented_mel
from choreograph.nets.style.model import MEL_FRAMES
from choreograph.nets.training import TrainingContext, load_pretrained, train
from choreograph.timebase import CLIP_FRAMES, CLIP_S, MUSIC_FPS, NET_FPS, SEGMENT_FRAMES, frame_times_s

NEAR_S = 0.35  # a motion beat farther from any music beat stays where it is
MIN_GAP_S = 0.1  # knots of the synchronising warp nearer than this would run too fast or too slow
_MUSIC_PER_MOTION = MUSIC_FPS // NET_FPS


def train_music_density(
    takes: Sequence[StyleTake],
    motion_density: MotionDensity,
    config: DensityConfig,
    *,
    seed: int,
    context: TrainingContext | None = None,
    start: Mapping[str, NDArray] | None = None,
) -> MusicDensity:
    """Train the music's estimator; `ParameterError` if no take has 8 s of music and motion."""
    usable = [take for take in takes if _n_frames(take) >= CLIP_FRAMES]
    if not usable:
        raise ParameterError(f"expected a take with {CLIP_S} s of music and motion, got none")
    mels = [take.log_mel[: _MUSIC_PER_MOTION * _n_frames(take)] for take in usable]
    targets = [target_density(take, motion_density, synchronise=config.synchronise) for take in usable]
    chance = np.array([len(target) for target in targets], np.float64)
    chance /= chance.sum()
    every = np.concatenate(mels)
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        net = MusicDensity(config)
    if start is not None:
        load_pretrained(net, "music_density", start)
    statistics = {"mel_mean": every.mean(axis=0), "mel_std": every.std(axis=0) + 1e-3}
    net.load_state_dict({key: torch.from_numpy(v) for key, v in statistics.items()}, strict=False)

    def loss(rng: np.random.Generator, device: torch.device) -> Tensor:
        mel = np.empty((config.music_batch_size, MEL_FRAMES, every.shape[1]), np.float32)
        wanted = np.empty((config.music_batch_size, SEGMENT_FRAMES), np.float32)
        for row, index in enumerate(rng.choice(len(usable), len(mel), p=chance)):
            begin = int(rng.integers(len(targets[index]) - SEGMENT_FRAMES + 1))
            mel[row] = mels[index][_MUSIC_PER_MOTION * begin :][:MEL_FRAMES]
            wanted[row] = targets[index][begin : begin + SEGMENT_FRAMES]
        heard = torch.from_numpy(augmented_mel(mel, rng)).to(device)
        return functional.mse_loss(net(heard), torch.from_numpy(wanted).to(device))

    train(
        net, loss, name="music_density", n_steps=config.music_steps,
        learning_rate=config.music_learning_rate, weight_decay=config.weight_decay, seed=seed,
        configuration={**asdict(config), "takes": [take.name for take in usable]}, context=context,
    )  # fmt: skip
    return net


def target_density(
    take: StyleTake, motion_density: MotionDensity, *, synchronise: bool
) -> NDArray[np.float32]:
    """What the music should call for, (T,) at 20 fps, with unit variance over the take.

    The motion's density in windows of 8 s whose middles count (equation 3's Middle), and with
    `synchronise` that of the take after its motion beats were moved onto the music's: takes are danced
    in tempo, but hardly in phase, and an estimator of raw pairs learns their mean.
    """
    density = motion_density.take_density(take.body_pos_m[: _n_frames(take)])
    if synchronise:
        beats = tempo_path_beats(take.log_mel)
        density = resampled(density, synchronising_map(len(density), take.motion_beat_times_s, beats))
    return (density - density.mean()) / (density.std() + 1e-5)


def synchronising_map(
    n_frames: int, motion_beats_s: NDArray[np.floating], music_beats_s: NDArray[np.floating]
) -> NDArray[np.float64]:
    """Source frame of every frame, (T,), of the warp that moves motion beats onto their nearest music beats.

    Each music beat takes the motion beat nearest to it, if that one is nearest to no other and at most
    `NEAR_S` away; in between the map is linear, and time never turns back.
    """
    duration_s = (n_frames - 1) / NET_FPS
    knots, source = [0.0], [0.0]
    for beat in music_beats_s:
        if len(motion_beats_s) == 0:
            break
        mine = float(motion_beats_s[np.argmin(np.abs(motion_beats_s - beat))])
        back = music_beats_s[np.argmin(np.abs(music_beats_s - mine))]
        room = min(beat - knots[-1], mine - source[-1], duration_s - beat, duration_s - mine)
        if back == beat and abs(mine - beat) <= NEAR_S and room >= MIN_GAP_S:
            knots.append(float(beat))
            source.append(mine)
    times = frame_times_s(n_frames, NET_FPS)
    return np.interp(times, [*knots, duration_s], [*source, duration_s]) * NET_FPS


def _n_frames(take: StyleTake) -> int:
    """Motion frames that have music."""
    return min(len(take.body_pos_m), len(take.log_mel) // _MUSIC_PER_MOTION)
