"""Training of the network for counts of motion, and of its confidence, on takes with counts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.optimize import minimize
from torch import Tensor

from choreograph.core.counts import Counts
from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats, interpolate_frames
from choreograph.core.timebase import NET_FPS, seconds_to_frames
from choreograph.motion.body import mirrored
from choreograph.nets.motion_counts import N_CONFIDENCE, MotionCountsConfig
from choreograph.nets.training import TrainingContext, train
from content.count_networks import MotionCountsNet, motion_features
from content.counted_phases import Phases, PhaseTargets, phase_loss, phases_at

_SHRINKAGE = 1.0  # of the weights, worth about a take


def fit_confidence(features: Sequence[Floats], share_right: Sequence[float]) -> Floats:
    """Weights (N_CONFIDENCE,) for which `confidence_of` the features of takes is their share of right counts.

    They are fitted by logistic regression with a little shrinkage. Raises `ParameterError` without a take.
    """
    if not len(features) or len(features) != len(share_right):
        raise ParameterError(f"expected features of takes and a share for each, got {len(features)}")
    x, y = np.array(features), np.array(share_right, np.float64)
    prior = _SHRINKAGE / len(y) * np.append(1e-3, np.ones(N_CONFIDENCE - 1))  # the offset is free

    def loss(weights: Floats) -> tuple[float, Floats]:
        logits = x @ weights
        value = np.mean(np.logaddexp(0.0, logits) - y * logits) + 0.5 * np.sum(prior * weights**2)
        slope = x.T @ (1.0 / (1.0 + np.exp(-logits)) - y) / len(y) + prior * weights
        return float(value), slope

    result: Floats = minimize(loss, np.zeros(N_CONFIDENCE), jac=True, method="L-BFGS-B").x
    return result


# Training data of the network: takes with counts, cut, played at other tempi and varied.


_MAX_RAMP = 0.08  # change of the tempo from the middle of a sample to its end
_JOINT_STD_M = 0.015  # offset of each joint, the same for the whole sample
_NOISE_STD_M = 0.003  # of markers, from frame to frame
_DRIFT_STD_M = 0.02  # of each joint, over a second, as a difference between dancers
_SCALE = (0.85, 1.15)  # the dancer's size
_FLOOR_STD_M = 0.02  # error of the floor's height
_FEWEST_KNOWN = 0.25  # of a sample's frames that are counted


@dataclass(frozen=True, eq=False)
class CountedMotion:
    """One take as training data."""

    name: str
    genre: str
    body_pos_m: NDArray[np.float32]  # (T, 21, 3) at 20 fps
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
    """The takes of a training run. Raises `ParameterError` if none has counts in bars of a known metre."""

    def __init__(self, takes: Sequence[CountedMotion], config: MotionCountsConfig) -> None:
        self.takes = [t for t in takes if phases_at(t.counts, _seconds(t)).known.any()]
        if not self.takes:
            raise ParameterError("expected takes with counts in bars of 3 or 4 to learn from, got none")
        self._config = config
        self._probability = _probabilities(self.takes, config.recorded_share)

    def batch(self, size: int, rng: np.random.Generator) -> MotionBatch:
        """Random samples, augmented. Built-in and recorded takes, and the genres of each, balanced."""
        rows = [self._sample(int(i), rng) for i in rng.choice(len(self.takes), size, p=self._probability)]
        bodies, present, phases = zip(*rows, strict=True)
        return MotionBatch(
            torch.from_numpy(np.stack(bodies)),
            torch.from_numpy(np.stack(present)),
            PhaseTargets.of(list(phases)),
        )

    def _sample(
        self, index: int, rng: np.random.Generator
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], Phases]:
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
        result: NDArray[np.float64] = offsets + middle + rng.uniform(min(spare, 0.0), max(spare, 0.0))
        return result


def augmented(body: NDArray[np.float32], rng: np.random.Generator) -> NDArray[np.float32]:
    """Body positions (T, 21, 3) of a slightly different dancer, with noise, at any heading."""
    n_frames, n_joints, _ = body.shape
    slow = gaussian_filter1d(rng.standard_normal((n_frames // 4 + 2, n_joints, 3)), 3.0, axis=0)
    drift = interpolate_frames(slow / max(float(slow.std()), 1e-6), np.arange(n_frames) / 4.0)
    changed = body * rng.uniform(*_SCALE) + rng.normal(0, _JOINT_STD_M, (1, n_joints, 3))
    changed += _DRIFT_STD_M * rng.random() * drift
    changed += _NOISE_STD_M * rng.random() * rng.standard_normal(body.shape)
    changed[..., 1] += rng.normal(0, _FLOOR_STD_M)
    return changed.astype(np.float32)


def _probabilities(takes: Sequence[CountedMotion], recorded_share: float) -> NDArray[np.float64]:
    """Probabilities of drawing each take, by its length within its genre, with equally likely genres."""
    length = np.array([len(t.body_pos_m) for t in takes], np.float64)
    groups = [(t.is_built_in, t.genre) for t in takes]
    total = {
        group: sum(n for n, g in zip(length, groups, strict=True) if g == group) for group in set(groups)
    }
    n_genres = {kind: sum(g[0] == kind for g in total) for kind in (True, False)}
    share = {True: 1.0 - recorded_share, False: recorded_share}
    weights: NDArray[np.float64] = np.array(
        [n / total[g] / n_genres[g[0]] * share[g[0]] for n, g in zip(length, groups, strict=True)]
    )
    if min(n_genres.values()) == 0:
        weights = length / np.array([total[g] for g in groups]) / len(total)
        return weights
    weights = weights / weights.sum()
    return weights


def _seconds(take: CountedMotion) -> NDArray[np.float64]:
    return np.arange(len(take.body_pos_m)) / NET_FPS


# Training of the network by the likelihood of the phases of takes with counts.


_STATISTICS_SAMPLES = 128


def train_motion_counts(
    takes: Sequence[CountedMotion],
    config: MotionCountsConfig,
    *,
    seed: int,
    name: str = "motion_counts",
    context: TrainingContext | None = None,
) -> MotionCountsNet:
    """Train the network. Raises `ParameterError` if no take has counts in bars of 3 or 4."""
    data = MotionData(takes, config)
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        net = MotionCountsNet(config)
    features = motion_features(data.batch(_STATISTICS_SAMPLES, np.random.default_rng(seed)).body).flatten(
        0, 1
    )
    net.feature_mean.copy_(features.mean(dim=0))
    net.feature_std.copy_(features.std(dim=0) + 0.01)

    def loss(rng: np.random.Generator, device: torch.device) -> Tensor:
        batch = data.batch(config.batch_size, rng).to(device)
        return phase_loss(net(batch.body, batch.present), batch.targets, bar_weight=config.bar_weight)

    train(
        net,
        loss,
        name=name,
        n_steps=config.steps,
        learning_rate=config.learning_rate,
        weight_decay=config.weight_decay,
        seed=seed,
        configuration={**asdict(config), "takes": sorted(take.name for take in data.takes)},
        context=context,
    )
    return net
