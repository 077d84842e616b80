"""Training data of the network that counts motion: takes with counts, cut, played at other tempi, varied."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from torch import Tensor

from choreograph.counts import Counts
from choreograph.errors import ParameterError
from choreograph.motion.body import mirrored
from choreograph.motion.interpolation import interpolate_frames
from choreograph.nets.counts.motion_config import MotionCountsConfig
from choreograph.nets.counts.phases import Phases, PhaseTargets, phases_at
from choreograph.timebase import NET_FPS, seconds_to_frames

Floats = NDArray[np.float32]

_MAX_RAMP = 0.08  # change of the tempo from the middle of a sample to its end
_JOINT_STD_M = 0.015  # offset of each joint, the same for the whole sample
_NOISE_STD_M = 0.003  # of markers, from frame to frame
_DRIFT_STD_M = 0.02  # of each joint, over a second: how another dancer would move
_SCALE = (0.85, 1.15)  # the dancer's size
_FLOOR_STD_M = 0.02  # error of the floor's height
_FEWEST_KNOWN = 0.25  # of a sample's frames that are counted


@dataclass(frozen=True, eq=False)
class CountedMotion:
    """One take as training data."""

    name: str
    genre: str
    body_pos_m: Floats  # (T, 21, 3) at 20 fps
    counts: Counts
    is_built_in: bool = False


@dataclass(frozen=True, eq=False)
class MotionBatch:
    """Samples of takes, and their phases."""

    body: Tensor  # (B, T, 21, 3) at 20 fps
    present: Tensor  # (B, T) 0 before a take's first and after its last frame
    targets: PhaseTargets

    def to(self, device: torch.device) -> MotionBatch:
        """The batch on a device."""
        return MotionBatch(self.body.to(device), self.present.to(device), self.targets.to(device))


class MotionData:
    """The takes of a training run; `ParameterError` if none has counts in bars of a known metre."""

    def __init__(self, takes: Sequence[CountedMotion], config: MotionCountsConfig) -> None:
        self.takes = [t for t in takes if phases_at(t.counts, _seconds(t)).known.any()]
        if not self.takes:
            raise ParameterError("expected takes with counts in bars of 3 or 4 to learn from, got none")
        self._config = config
        self._probability = _probabilities(self.takes, config.recorded_share)

    def batch(self, size: int, rng: np.random.Generator) -> MotionBatch:
        """Random samples, augmented; built-in and recorded takes, and the genres of each, balanced."""
        rows = [self._sample(int(i), rng) for i in rng.choice(len(self.takes), size, p=self._probability)]
        bodies, present, phases = zip(*rows, strict=True)
        return MotionBatch(
            torch.from_numpy(np.stack(bodies)),
            torch.from_numpy(np.stack(present)),
            PhaseTargets.of(list(phases)),
        )

    def _sample(self, index: int, rng: np.random.Generator) -> tuple[Floats, Floats, Phases]:
        take = self.takes[index]
        n_frames = seconds_to_frames(self._config.window_s, NET_FPS)
        for _ in range(20):  # a take may be counted in parts only
            frames = self._played_frames(len(take.body_pos_m), n_frames, rng)
            phases = phases_at(take.counts, frames / NET_FPS)
            if phases.known.mean() >= _FEWEST_KNOWN:
                break
        present = ((frames >= 0) & (frames <= len(take.body_pos_m) - 1)).astype(np.float32)
        body = interpolate_frames(take.body_pos_m, frames).astype(np.float32)
        if rng.random() < self._config.mirrored_share:
            body = mirrored(body).astype(np.float32)
        return augmented(body, rng), present, phases

    def _played_frames(self, n_taken: int, n_frames: int, rng: np.random.Generator) -> NDArray[np.float64]:
        """Fractional frames of a take (n_frames,) at another tempo, which changes a little on the way."""
        low, high = np.log(self._config.tempo_range)
        tempo = np.exp(rng.uniform(low, high))
        share = np.linspace(-1.0, 1.0, n_frames)
        middle = 0.5 * n_frames * tempo
        offsets = middle * (share + 0.5 * rng.uniform(-_MAX_RAMP, _MAX_RAMP) * (share**2 - 1.0))
        spare = n_taken - n_frames * tempo  # below 0 for a take that is shorter than the sample
        return offsets + middle + rng.uniform(min(spare, 0.0), max(spare, 0.0))


def augmented(body: Floats, rng: np.random.Generator) -> Floats:
    """Body positions (T, 21, 3) of a slightly different dancer, with noise, any heading being alike."""
    n_frames, n_joints, _ = body.shape
    slow = gaussian_filter1d(rng.standard_normal((n_frames // 4 + 2, n_joints, 3)), 3.0, axis=0)
    drift = interpolate_frames(slow / max(float(slow.std()), 1e-6), np.arange(n_frames) / 4.0)
    changed = body * rng.uniform(*_SCALE) + rng.normal(0, _JOINT_STD_M, (1, n_joints, 3))
    changed += _DRIFT_STD_M * rng.random() * drift
    changed += _NOISE_STD_M * rng.random() * rng.standard_normal(body.shape)
    changed[..., 1] += rng.normal(0, _FLOOR_STD_M)
    return changed.astype(np.float32)


def _probabilities(takes: Sequence[CountedMotion], recorded_share: float) -> NDArray[np.float64]:
    """Of drawing each take: as its length within its genre, genres of built-in and recorded takes alike."""
    length = np.array([len(t.body_pos_m) for t in takes], np.float64)
    groups = [(t.is_built_in, t.genre) for t in takes]
    total = {
        group: sum(n for n, g in zip(length, groups, strict=True) if g == group) for group in set(groups)
    }
    n_genres = {kind: sum(g[0] == kind for g in total) for kind in (True, False)}
    share = {True: 1.0 - recorded_share, False: recorded_share}
    weights = np.array(
        [n / total[g] / n_genres[g[0]] * share[g[0]] for n, g in zip(length, groups, strict=True)]
    )
    if min(n_genres.values()) == 0:
        return length / np.array([total[g] for g in groups]) / len(total)
    return weights / weights.sum()


def _seconds(take: CountedMotion) -> NDArray[np.float64]:
    return np.arange(len(take.body_pos_m)) / NET_FPS
