"""Kinetic and geometric features of whole dances, and the FID and diversity that dance papers report.

Kinetic (Onuma, Faloutsos, Hodgins 2008): of each of 24 joints the mean squared horizontal velocity, the
mean squared vertical velocity and the mean acceleration: 72 numbers. Geometric (Müller, Röder, Clausen
2005): the shares of frames in which 32 relations hold (see `relations`). FID_k and FID_g are the squared
Fréchet distances of a set of dances to real ones in these features; Div_k and Div_g (also Dist_k, Dist_g)
the mean distance between two dances of the set.

Conventions: positions (T, 24, 3) of the canonical joints in metres, Y up, at any rate; both variants first
resample to 60 fps by cubic splines, the rate of AIST++ and of the tables, since windows are five frames
wide. The tables take 20 s of a dance as one sample: so does `features_of`, piece by piece.

Two variants, because the code that the field shares (fairmotion, AIST++, Bailando and their copies) errs:

- "published", for comparison with old tables, computes as they did. Kinetic: a misplaced bracket makes the
  earlier velocity p_t − p_{t−1}/dt, so that "acceleration" is mostly 3600 times the place, and depends on
  where the dancer stands; as in Bailando's evaluation the first frame's pelvis is the origin (AIST++'s takes
  the world's). Bailando's repository has since mended the bracket, so newer tables may have it right.
  Geometric: dt is 1/120 s on 60 fps, so all speeds count double; relations look at wrong
  joints and sides (`relations`); lengths are those of one body model. AI Choreographer's own table comes from
  a still older extractor, as its authors say.
- "corrected": acceleration is one, dt is the frames' own, relations are the original authors', and lengths
  are the dancer's. Place and heading change nothing, and a mirror only exchanges left and right.

Normalisation: each feature by the mean and standard deviation of the real set, as the code of AI
Choreographer and of Bailando does, for FID and diversity alike; `normalised=False` leaves features raw.
A feature that is constant in the real set is only centred ("published" divides by 1e-10, as they do, and
explodes). Nothing is added to a diagonal (see `frechet`), but 72 dimensions want hundreds of dances, and with
fewer the distance is biased upwards: give both sides as many, and show real halves beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial.distance import pdist

from choreograph.errors import ParameterError
from choreograph.metrics import relations
from choreograph.metrics.frechet import fit_gaussian, frechet_distance
from choreograph.motion.body import body_indices
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import CANONICAL_JOINTS
from choreograph.timebase import frame_times_s, seconds_to_frames

Floats = NDArray[np.float64]
Variant = Literal["published", "corrected"]

FEATURE_FPS = 60.0
PIECE_S = 20.0
_WINDOW = 2  # frames on either side that velocities and accelerations are averaged over
_PUBLISHED_RELATION_FPS = 120.0
_PUBLISHED_LENGTHS_M = relations.Lengths(humerus=0.256838, shoulders=0.390848, hips=0.119247)
_PUBLISHED_TINY = 1e-10
_CONSTANT = 1e-9


@dataclass(frozen=True, eq=False)
class DanceFeatures:
    """Features of N dances, or of pieces of them, one row each."""

    kinetic: Floats  # (N, 72)
    geometric: Floats  # (N, 32)
    variant: Variant


def canonical_pos_m(motion: Motion) -> Floats:
    """World positions (T, 24, 3) of the canonical joints, metres; one the rig lacks is at its parent's place.

    Raises `ParameterError` if the rig's names are unknown.
    """
    return motion.joint_pos_m()[:, body_indices(motion.skeleton, CANONICAL_JOINTS)]


def validate(pos_m: NDArray[np.floating], fps: float, variant: Variant) -> Floats:
    """The positions (T, 24, 3) at 60 fps, (T', 24, 3).

    Raises `ParameterError` unless they are finite, last three such frames, and rate and variant are valid.
    """
    if variant not in ("published", "corrected"):
        raise ParameterError(f"expected variant 'published' or 'corrected', got {variant!r}")
    pos = np.asarray(pos_m, np.float64)
    if pos.ndim != 3 or pos.shape[1:] != (len(CANONICAL_JOINTS), 3) or len(pos) == 0:
        raise ParameterError(f"expected positions (T, {len(CANONICAL_JOINTS)}, 3), got {pos.shape}")
    if not np.isfinite(pos).all():
        raise ParameterError("expected finite positions, got nan or infinity")
    if not (np.isfinite(fps) and fps > 0):
        raise ParameterError(f"expected a positive frame rate, got {fps}")
    if fps != FEATURE_FPS and len(pos) > 1:
        times_s = frame_times_s(len(pos), fps)
        wanted_s = frame_times_s(int(times_s[-1] * FEATURE_FPS + 1e-6) + 1, FEATURE_FPS)
        pos = CubicSpline(times_s, pos)(np.minimum(wanted_s, times_s[-1]))
    if len(pos) < 3:
        raise ParameterError(f"expected a dance of at least 3 frames at 60 fps, got {len(pos)}")
    return pos


def kinetic(pos_m: NDArray[np.floating], fps: float, *, variant: Variant = "corrected") -> Floats:
    """Kinetic features (72,) of positions (T, 24, 3): joint by joint m²/s² level, m²/s² upright, m/s².

    Velocities and accelerations are means of five frames (fewer at the ends) before their length is taken.
    Raises `ParameterError` as `validate` does.
    """
    pos, dt_s = validate(pos_m, fps, variant), 1.0 / FEATURE_FPS
    pos = pos - pos[:1, :1]
    velocity = np.diff(pos, axis=0) / dt_s  # (T-1, 24, 3), of frames 1 … T - 1
    acceleration = np.diff(velocity, axis=0) / dt_s  # (T-2, 24, 3), of frames 1 … T - 2
    if variant == "published":
        acceleration = (velocity[1:] - (pos[1:-1] - pos[:-2] / dt_s)) / dt_s
    mean_velocity = _around(velocity, len(velocity))  # (T-1, 24, 3)
    level = np.sum(mean_velocity[..., [0, 2]] ** 2, axis=-1)
    upright = mean_velocity[..., 1] ** 2
    effort = np.linalg.norm(_around(acceleration, len(velocity)), axis=-1)
    return np.stack([level, upright, effort], axis=-1).mean(axis=0).reshape(-1)  # (72,)


def geometric(pos_m: NDArray[np.floating], fps: float, *, variant: Variant = "corrected") -> Floats:
    """Geometric features (32,) of positions (T, 24, 3): shares of frames, 0 … 1.

    Raises `ParameterError` as `validate` does.
    """
    pos = validate(pos_m, fps, variant)
    if variant == "published":
        return relations.shares(relations.PUBLISHED, pos, _PUBLISHED_RELATION_FPS, _PUBLISHED_LENGTHS_M)
    return relations.shares(relations.CORRECTED, pos, FEATURE_FPS, relations.measure_lengths(pos))


def features_of(
    motions: Sequence[Motion], *, variant: Variant = "corrected", piece_s: float = PIECE_S
) -> DanceFeatures:
    """Features of each whole `piece_s` seconds of each motion; of all of it, if it is shorter.

    Raises `ParameterError` if there is no motion, or as `canonical_pos_m` and `validate` do.
    """
    if len(motions) == 0:
        raise ParameterError("expected at least one motion, got none")
    if not piece_s > 0:
        raise ParameterError(f"expected pieces of a positive length, got {piece_s} s")
    rows: tuple[list[Floats], list[Floats]] = ([], [])
    for motion in motions:
        pos = canonical_pos_m(motion)
        length = max(1, seconds_to_frames(piece_s, motion.fps))
        for start in range(0, max(1, len(pos) - length + 1), length):
            for row, feature in zip(rows, (kinetic, geometric), strict=True):
                row.append(feature(pos[start : start + length], motion.fps, variant=variant))
    return DanceFeatures(np.stack(rows[0]), np.stack(rows[1]), variant)


def fid(features: Floats, real: Floats, *, variant: Variant = "corrected", normalised: bool = True) -> float:
    """Squared Fréchet distance of features (N, D) to real ones (N', D).

    Raises `ParameterError` if either has fewer than two rows, or they differ in D.
    """
    _check_sets(features, real)
    sides = (_normalised(side, real, variant) if normalised else side for side in (features, real))
    return frechet_distance(*(fit_gaussian(side) for side in sides))


def diversity(
    features: Floats, real: Floats, *, variant: Variant = "corrected", normalised: bool = True
) -> float:
    """Mean Euclidean distance between two rows of features (N, D), in the spread of the real ones (N', D).

    Raises `ParameterError` as `fid` does.
    """
    _check_sets(features, real)
    return float(pdist(_normalised(features, real, variant) if normalised else features).mean())


def evaluate(dances: DanceFeatures, real: DanceFeatures, *, normalised: bool = True) -> dict[str, float]:
    """FID and diversity of both kinds by name, and the real set's diversity, which is the one to come near.

    Raises `ParameterError` if the variants differ, or a set has fewer than two dances.
    """
    if dances.variant != real.variant:
        raise ParameterError(f"expected features of one variant, got {dances.variant} and {real.variant}")
    scores = {}
    for letter, ours, theirs in (
        ("k", dances.kinetic, real.kinetic),
        ("g", dances.geometric, real.geometric),
    ):
        how = {"variant": real.variant, "normalised": normalised}
        scores[f"fid_{letter}"] = fid(ours, theirs, **how)  # type: ignore[arg-type]
        scores[f"diversity_{letter}"] = diversity(ours, theirs, **how)  # type: ignore[arg-type]
        scores[f"real_diversity_{letter}"] = diversity(theirs, theirs, **how)  # type: ignore[arg-type]
    return scores


def _around(values: Floats, n_frames: int) -> Floats:
    """Means of `values` (N, ...) over the `_WINDOW` rows on either side of row 0 … n_frames - 1."""
    sums = np.concatenate([np.zeros_like(values[:1]), np.cumsum(values, axis=0)])  # (N + 1, ...)
    rows = np.arange(n_frames)
    low, high = np.maximum(rows - _WINDOW, 0), np.minimum(rows + _WINDOW + 1, len(values))
    return (sums[high] - sums[low]) / (high - low).reshape(-1, *[1] * (values.ndim - 1))


def _check_sets(features: Floats, real: Floats) -> None:
    for name, rows in (("dances", features), ("real dances", real)):
        if rows.ndim != 2 or len(rows) < 2 or rows.shape[1] != real.shape[1]:
            raise ParameterError(
                f"expected features (N, {real.shape[-1]}) of 2 or more {name}, got {rows.shape}"
            )


def _normalised(features: Floats, real: Floats, variant: Variant) -> Floats:
    spread = real.std(axis=0)
    divisor = (
        spread + _PUBLISHED_TINY if variant == "published" else np.where(spread > _CONSTANT, spread, 1.0)
    )
    return (features - real.mean(axis=0)) / divisor
