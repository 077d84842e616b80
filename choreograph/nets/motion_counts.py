"""The network that reads counts from motion, how sure they are, and its training on takes with counts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.optimize import minimize
from torch import Tensor, nn

from choreograph.core.counts import FROM_MOTION, Counts
from choreograph.core.errors import ParameterError
from choreograph.core.numerics import interpolate_frames
from choreograph.core.timebase import NET_FPS, frame_times_s, seconds_to_frames
from choreograph.motion.body import BODY_JOINTS, checked_body_pos_m, mirrored
from choreograph.music.bar_pointer import (
    DecodedCounts,
    PhaseCurves,
    PointerConfig,
    count_uncertainty,
    decode_counts,
)
from choreograph.nets.count_phases import (
    N_OUTPUTS,
    MotionCountsConfig,
    Phases,
    PhaseTargets,
    Trunk,
    curves_from,
    phase_loss,
    phases_at,
)
from choreograph.nets.stored import StoredNet
from choreograph.nets.training import TrainingContext, train

# How sure decoded counts are: the share of them that will be right, from what the decoder saw.
#
# A logistic function of a few features of a take and its curves, fitted to takes that the network did not
# see.


Floats = NDArray[np.float64]

N_CONFIDENCE = 5
_STEADY_S = 5.0  # over which curves are to keep one phase to the counts
_SHRINKAGE = 1.0  # of the weights, worth about a take


def confidence_features(curves: PhaseCurves, decoded: DecodedCounts) -> Floats:
    """What speaks for a take's counts, (N_CONFIDENCE,): 1, and means over its frames, each around 0 to 1.

    How far the beat's phase agrees with the counts, how far the bar's, both weighted by concentration, how
    concentrated the beat is, and how steadily it keeps to the counts, whatever its phase against them.
    """
    if not len(decoded.beat_agreement):
        return np.append(1.0, np.zeros(N_CONFIDENCE - 1))
    beat = np.linalg.norm(curves.beat, axis=1)  # (T,)
    bar = np.linalg.norm(curves.bar, axis=2).max(axis=1)
    return np.array(
        [
            1.0,
            np.average(decoded.beat_agreement, weights=beat + 1e-6),
            np.average(decoded.bar_agreement, weights=bar + 1e-6),
            np.log1p(beat).mean(),
            _steadiness(curves, decoded.counts),
        ]
    )


def _steadiness(curves: PhaseCurves, counts: Counts) -> float:
    """In every five seconds, the size of the mean beat vector turned back by the counts, over the mean size.

    The mean over the take, 0 … 1. What has no count keeps no phase for so long, though the best path of all
    agrees with it here and there.
    """
    times_s = frame_times_s(len(curves.beat), curves.fps)
    if len(counts) < 2:
        return 0.0
    in_beats = np.interp(times_s, counts.times_s, np.arange(len(counts)))
    inside = (times_s >= counts.times_s[0]) & (times_s <= counts.times_s[-1])
    vectors = (curves.beat[:, 0] + 1j * curves.beat[:, 1]) * np.exp(-2j * np.pi * in_beats) * inside
    windows = np.array_split(vectors, max(1, round(len(vectors) / curves.fps / _STEADY_S)))
    return float(np.mean([abs(w.sum()) / max(np.abs(w).sum(), 1e-12) for w in windows]))


def confidence_of(features: Floats, weights: Floats) -> float:
    """The expected share of right counts, 0 to 1, of features (N_CONFIDENCE,)."""
    return float(1.0 / (1.0 + np.exp(-features @ weights)))


def fit_confidence(features: Sequence[Floats], share_right: Sequence[float]) -> Floats:
    """Weights (N_CONFIDENCE,) by which `confidence_of` the features of takes is their share of right counts.

    Logistic regression with a little shrinkage. `ParameterError` without a take.
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


# The network that reads counts from motion: body positions at 20 fps to curves of beat and bar phase.
#
# It sees each frame's pose and joint velocities in the root frame, so that it does not matter where on the
# floor, or facing where, something is danced.


_N_JOINTS = len(BODY_JOINTS)
N_FEATURES = _N_JOINTS * 7  # position, velocity, speed
# Songs that are danced to keep their tempo, a dancer counts through, and neighbouring moments err alike.
POINTER = PointerConfig(bpm=(50.0, 220.0), tempo_std=0.002, break_cost=40.0, observations_per_s=1.0)
TEMPI = (0.85, 1.0, 1.18)  # at which a take is read: what holds at one tempo only is not trusted
_ACROSS = tuple(
    [BODY_JOINTS.index(f"{side}_{part}") for part in ("hip", "shoulder")] for side in ("left", "right")
)


class MotionCountsNet(StoredNet):
    """Body positions to phase curves, with the statistics that standardise its features."""

    config_class = MotionCountsConfig
    feature_mean: Tensor
    feature_std: Tensor
    confidence_weights: Tensor  # of `confidence.confidence_features`; confidence is ½ until they are fitted

    def __init__(self, config: MotionCountsConfig) -> None:
        super().__init__()
        self.config = config
        self.feature_dropout = nn.Dropout1d(config.feature_dropout)
        self.trunk = Trunk(N_FEATURES, config.width, config.n_blocks, config.dropout)
        self.head = nn.Conv1d(config.width, N_OUTPUTS, 1)
        with torch.no_grad():  # at first it knows nothing
            for parameter in self.head.parameters():
                parameter.zero_()
        self.register_buffer("feature_mean", torch.zeros(N_FEATURES))
        self.register_buffer("feature_std", torch.ones(N_FEATURES))
        self.register_buffer("confidence_weights", torch.zeros(N_CONFIDENCE))

    def forward(self, body: Tensor, present: Tensor) -> Tensor:
        """Body positions (B, T, 21, 3) at 20 fps, and which frames there are (B, T), to (B, N_OUTPUTS, T)."""
        standard = (motion_features(body) - self.feature_mean) / self.feature_std
        features = self.feature_dropout((standard * present[..., None]).transpose(1, 2))
        result: Tensor = self.head(self.trunk(features))
        return result

    def curves(self, body_pos_m: NDArray[np.floating], tempi: Sequence[float] = TEMPI) -> PhaseCurves:
        """Phase curves of a take's body positions (T, 21, 3) at 20 fps; `ParameterError` if not so.

        The mean of the curves of the take as it is, slower and faster.
        """
        pos_m = checked_body_pos_m(body_pos_m)
        read = [self._curves_at(pos_m, tempo) for tempo in tempi]
        beat, bar = (np.mean([getattr(c, name) for c in read], axis=0) for name in ("beat", "bar"))
        return PhaseCurves(beat, bar, NET_FPS)

    def _curves_at(self, pos_m: NDArray[np.float64], tempo: float) -> PhaseCurves:
        frames = np.arange(max(1, round(len(pos_m) / tempo))) * tempo
        body = torch.from_numpy(interpolate_frames(pos_m, frames).astype(np.float32))[None]
        self.eval()
        with torch.no_grad():
            curves = curves_from(self(body, torch.ones(body.shape[:2]))[0], NET_FPS)
        back = np.arange(len(pos_m)) / tempo
        return PhaseCurves(
            interpolate_frames(curves.beat, back), interpolate_frames(curves.bar, back), NET_FPS
        )

    def counts(self, body_pos_m: NDArray[np.floating]) -> Counts:
        """A take's counts, of body positions (T, 21, 3) at 20 fps; `ParameterError` if not so.

        Their confidence is the share that is expected within 0.15 beat of the true counts.
        """
        curves = self.curves(body_pos_m)
        decoded = decode_counts(curves, POINTER, source=FROM_MOTION)
        features, weights = confidence_features(curves, decoded), self.confidence_weights.double().numpy()
        uncertainty = count_uncertainty(decoded, NET_FPS)
        return replace(decoded.counts, confidence=confidence_of(features, weights), uncertainty=uncertainty)


def motion_features(body: Tensor) -> Tensor:
    """Positions, velocities and speeds of joints in the root frame, (B, T, N_FEATURES)."""
    across = (body[:, :, _ACROSS[0]] - body[:, :, _ACROSS[1]]).sum(dim=2)  # (B, T, 3)
    length = torch.hypot(across[..., 0], across[..., 2]).clamp(min=1e-6)
    cos, sin = (across[..., 0] / length)[..., None], (across[..., 2] / length)[..., None]  # (B, T, 1)
    origin = body[:, :, :1] * body.new_tensor([1.0, 0.0, 1.0])
    velocity = torch.gradient(body, dim=1)[0] * NET_FPS if body.shape[1] > 1 else torch.zeros_like(body)
    parts = [_turned(body - origin, cos, sin), _turned(velocity, cos, sin)]
    return torch.cat([*(part.flatten(2) for part in parts), velocity.norm(dim=-1)], dim=2)


def _turned(vectors: Tensor, cos: Tensor, sin: Tensor) -> Tensor:
    """Vectors (B, T, J, 3) turned about Y so that left is +X."""
    x, y, z = vectors.unbind(dim=-1)
    return torch.stack([cos * x + sin * z, y, cos * z - sin * x], dim=-1)


# Training data of the network that counts motion: takes with counts, cut, played at other tempi, varied.


Float32s = NDArray[np.float32]

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
    body_pos_m: Float32s  # (T, 21, 3) at 20 fps
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

    def _sample(self, index: int, rng: np.random.Generator) -> tuple[Float32s, Float32s, Phases]:
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


def augmented(body: Float32s, rng: np.random.Generator) -> Float32s:
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


# Training of the network that counts motion, by the likelihood of the phases of takes with counts.


_STATISTICS_SAMPLES = 128


def train_motion_counts(
    takes: Sequence[CountedMotion],
    config: MotionCountsConfig,
    *,
    seed: int,
    name: str = "motion_counts",
    context: TrainingContext | None = None,
) -> MotionCountsNet:
    """Train the network; `ParameterError` if no take has counts in bars of 3 or 4."""
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
