"""FID_k, FID_g and diversity, as dance papers report them, and the kinetic and geometric features they use.

Kinetic features (Onuma, Faloutsos, Hodgins 2008): for each of 24 joints the mean squared horizontal velocity,
the mean squared vertical velocity and the mean acceleration, 72 numbers. Geometric features (Müller, Röder,
Clausen 2005): the shares of frames in which 32 relations hold (see `GeometricRelation`). FID_k and FID_g
are squared Fréchet distances between a set of dances and real dances in these features. Div_k and Div_g (also
called Dist_k and Dist_g) are the mean distance between two dances of the set.

Conventions: positions (T, 24, 3) of the canonical joints in metres, Y up, at any rate. Both variants first
resample to 60 fps by cubic splines, the rate of AIST++ and of the published tables, because windows are five
frames wide. The tables use 20 s of a dance as one sample, and so does `features_of`.

There are two variants because the code that the field shares (fairmotion, AIST++, Bailando and their copies)
has bugs:

- "published" reproduces that code, for comparison with old tables. Kinetic: a misplaced bracket makes the
  earlier velocity p_t − p_{t−1}/dt, so the "acceleration" is mostly 3600 times the position and depends on
  where the dancer stands. As in Bailando's evaluation, the origin is the pelvis in the first frame (AIST++
  uses the world origin). Bailando's repository has since fixed the bracket, so newer tables may be right.
  Geometric: dt is 1/120 s at 60 fps, so all speeds count double. Some relations use the wrong joints or sides
  (`_CORRECTIONS`). Lengths are those of one body model. AI Choreographer's own table comes from a
  still older feature extractor, as its authors say.
- "corrected": a true acceleration, the true dt, the relations of the original authors, and the dancer's own
  lengths. Position and heading change nothing, and a mirror only swaps left and right.

Normalisation: each feature by the mean and standard deviation of the real set, for both FID and diversity, as
in the code of AI Choreographer and Bailando. `normalised=False` leaves features raw. A feature that is
constant in the real set is only centred ("published" divides by 1e-10, as that code does, and explodes).
Covariances are not regularised (see `frechet`), but 72 dimensions need hundreds of dances: with fewer the
distance is biased upwards. Compare sets of equal size, and report the distance between two halves of the real
set with it.

Müller, Röder, Clausen (Efficient content-based retrieval of motion capture data, SIGGRAPH 2005) describe a
frame by boolean relations between joints. fairmotion chose 32 of them ("manual"), which AIST++ and Bailando
share. Here a relation is a measure (a signed distance, speed or angle) and the open range in which it holds.
Lengths are in units of the dancer's humerus, shoulder width or hip width, speeds in those units per second.
`PUBLISHED_RELATIONS` are what the public code computes, `CORRECTED_RELATIONS` what the original authors'
toolbox does. They differ in the rows of `_CORRECTIONS`, each with its reason. Neither has the toolbox's
windows and hysteresis.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial.distance import pdist

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats, default_numerics
from choreograph.core.timebase import frame_times_s, seconds_to_frames
from choreograph.evaluation.metrics.frechet import fit_gaussian, frechet_distance
from choreograph.motion.body import body_indices
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import CANONICAL_JOINTS

# Geometric relations between joints: the 32 features of FID_g, as tables of joints.


# Points that relations may name: the joints, and the two ends of the vertical.
_POINTS = (*CANONICAL_JOINTS, "origin", "up")


class Lengths(NamedTuple):
    """The dancer's lengths in metres, the units of the thresholds."""

    humerus: float
    shoulders: float
    hips: float


@dataclass(frozen=True)
class GeometricRelation:
    """A measure of joints, and the open range in which the relation holds."""

    measure: str  # a key of MEASURES
    joints: tuple[str, ...]
    above: float = -np.inf  # in `unit`s. For speeds, in `unit`s per second
    below: float = np.inf
    unit: Literal["humerus", "shoulders", "hips", "degree"] = "humerus"


def _measure_lengths(pos_m: Floats) -> Lengths:
    """Measure the dancer's lengths in positions (T, 24, 3), metres: medians over time, humeri averaged."""

    def length_m(a: str, b: str) -> float:
        ends = [pos_m[:, CANONICAL_JOINTS.index(name)] for name in (a, b)]
        return float(np.median(np.linalg.norm(ends[1] - ends[0], axis=-1)))

    humeri = [length_m(f"{side}_shoulder", f"{side}_elbow") for side in ("left", "right")]
    return Lengths(
        sum(humeri) / 2, length_m("left_shoulder", "right_shoulder"), length_m("left_hip", "right_hip")
    )


def _relation_shares(
    relations: tuple[GeometricRelation, ...], pos_m: Floats, fps: float, lengths_m: Lengths
) -> Floats:
    """Share of the frames 1 … T - 1 of positions (T, 24, 3) in which each relation holds, (R,), 0 … 1.

    A relation whose direction is undefined (two of its joints coincide) does not hold.
    """
    points = np.concatenate([pos_m, np.zeros((len(pos_m), 2, 3))], axis=1)  # (T, 26, 3)
    points[:, -1, 1] = 1.0
    now = dict(zip(_POINTS, np.moveaxis(points[1:], 1, 0), strict=True))  # name -> (T-1, 3)
    velocity = dict(zip(_POINTS, np.moveaxis(np.diff(points, axis=0) * fps, 1, 0), strict=True))
    now["lowest"] = pos_m[1:, :, 1].min(axis=1)[:, None] * np.array([0.0, 1.0, 0.0])  # (T-1, 3)
    units = {**lengths_m._asdict(), "degree": 1.0}
    shares_held = []
    for relation in relations:
        value = MEASURES[relation.measure](now, velocity, *relation.joints)  # (T-1,)
        low, high = (limit * units[relation.unit] for limit in (relation.above, relation.below))
        shares_held.append(np.mean((value > low) & (value < high)))
    return np.array(shares_held)


_Points = dict[str, Floats]  # name -> (T-1, 3)


def _beyond(now: _Points, _: _Points, start: str, end: str, origin: str, point: str) -> Floats:
    """How far `point` is from `origin` in the direction start → end, metres."""
    return _dot(_unit(now[end] - now[start]), now[point] - now[origin])


def _off_plane(now: _Points, _: _Points, a: str, b: str, c: str, point: str) -> Floats:
    """Signed distance of `point` from the plane through a, b, c along (c - a) x (b - a), metres."""
    return _dot(_normal(now, a, b, c), now[point] - now[a])


def _speed_along(now: _Points, velocity: _Points, start: str, end: str, origin: str, point: str) -> Floats:
    """Speed of `point` relative to `origin` in the direction start → end, m/s."""
    return _dot(_unit(now[end] - now[start]), velocity[point] - velocity[origin])


def _speed_off_plane(now: _Points, velocity: _Points, a: str, b: str, c: str, point: str) -> Floats:
    """Speed of `point` relative to a, perpendicular to the plane through a, b, c, m/s."""
    return _dot(_normal(now, a, b, c), velocity[point] - velocity[a])


def _speed(_: _Points, velocity: _Points, point: str) -> Floats:
    """Speed of `point`, m/s."""
    result: Floats = np.linalg.norm(velocity[point], axis=-1)
    return result


def _height(now: _Points, _: _Points, point: str) -> Floats:
    """Height of `point` above the body's lowest joint, metres."""
    return (now[point] - now["lowest"])[:, 1]


def _angle(now: _Points, _: _Points, a: str, b: str, c: str, d: str) -> Floats:
    """Angle between the directions a → b and c → d, degrees, 0 … 180."""
    cosine = _dot(_unit(now[b] - now[a]), _unit(now[d] - now[c]))
    return np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))


MEASURES: dict[str, Callable[..., Floats]] = {
    "beyond": _beyond,
    "off_plane": _off_plane,
    "speed_along": _speed_along,
    "speed_off_plane": _speed_off_plane,
    "speed": _speed,
    "height": _height,
    "angle": _angle,
}


def _unit(vector: Floats) -> Floats:
    """Unit vectors (..., 3), or nan, which lies in no range, where the direction is undefined."""
    norm = np.linalg.norm(vector, axis=-1, keepdims=True)
    result: Floats = np.divide(vector, norm, out=np.full_like(vector, np.nan), where=norm > 1e-9)
    return result


def _normal(now: _Points, a: str, b: str, c: str) -> Floats:
    return _unit(np.cross(now[c] - now[a], now[b] - now[a]))


def _dot(a: Floats, b: Floats) -> Floats:
    result: Floats = np.sum(a * b, axis=-1)
    return result


def _pair(relation: GeometricRelation) -> tuple[GeometricRelation, GeometricRelation]:
    """A relation of the right side, and the same with left and right swapped."""
    flip = {"left": "right", "right": "left"}
    joints = (name.split("_") for name in relation.joints)
    return relation, replace(
        relation, joints=tuple("_".join(flip.get(word, word) for word in words) for words in joints)
    )


def _row(measure: str, joints: str, **limits: float | str) -> GeometricRelation:
    return GeometricRelation(measure, tuple(joints.split()), **limits)  # type: ignore[arg-type]


PUBLISHED_RELATIONS: tuple[GeometricRelation, ...] = (
    *_pair(_row("speed_off_plane", "neck right_hip left_hip right_wrist", above=1.8)),  # hand back / forward
    *_pair(_row("beyond", "spine3 neck neck right_wrist", above=0.2)),  # hand above the neck
    *_pair(_row("speed_along", "spine1 spine3 spine1 spine3", above=1.8)),  # chest away from the belly
    *_pair(
        _row("angle", "right_elbow right_shoulder right_elbow right_wrist", above=0, below=110, unit="degree")
    ),
    _row("beyond", "left_shoulder right_shoulder left_wrist right_wrist", above=2.5, unit="shoulders"),
    _row("speed_along", "left_wrist right_wrist left_wrist right_wrist", above=1.4),  # hands move apart
    *_pair(_row("speed_along", "right_wrist pelvis right_wrist left_wrist", above=1.4)),
    *_pair(_row("speed", "right_wrist", above=2.5)),
    *_pair(_row("off_plane", "pelvis left_hip left_foot right_ankle", above=0.38)),  # foot in front / behind
    *_pair(_row("height", "right_ankle", above=1.2)),
    _row("beyond", "left_hip right_hip left_ankle right_ankle", above=2.1, unit="hips"),  # feet apart
    *_pair(_row("angle", "right_knee right_hip right_knee right_ankle", above=0, below=110, unit="degree")),
    *_pair(_row("speed", "right_ankle", above=2.5)),
    *_pair(_row("angle", "neck pelvis right_shoulder right_elbow", above=25, below=180, unit="degree")),
    *_pair(_row("angle", "neck pelvis right_hip right_knee", above=50, below=180, unit="degree")),
    _row("off_plane", "right_ankle neck left_ankle pelvis", above=0.5),  # pelvis in front of neck and feet
    _row("angle", "neck pelvis origin up", above=70, below=110, unit="degree"),  # spine horizontal
    *_pair(_row("height", "right_wrist", below=1.2)),  # a hand near the ground
    _row("speed", "pelvis", above=2.3),
)

_CORRECTIONS: dict[int, GeometricRelation] = {
    # Both hands use the same normal of the torso plane, pointing forward.
    0: _row("speed_off_plane", "neck left_hip right_hip right_wrist", above=1.8),
    # j4 relative to j3 along j1 → j2: the hand rises, not the chest away from the belly.
    **dict(enumerate(_pair(_row("speed_along", "spine1 spine3 spine3 right_wrist", above=1.8)), start=4)),
    # The same fix: hands meet, hands leave the body.
    9: _row("speed_along", "left_wrist right_wrist right_wrist left_wrist", above=1.4),
    **dict(
        enumerate(_pair(_row("speed_along", "right_wrist pelvis right_wrist pelvis", above=1.4)), start=10)
    ),
    # A foot behind the other leg, on both sides. With that leg's toes, a standing foot would count as behind.
    14: _row("off_plane", "pelvis left_ankle left_hip right_ankle", above=0.38),
    15: _row("off_plane", "pelvis right_hip right_ankle left_ankle", above=0.38),
    # The pelvis behind the plane of neck and feet: the body bends or sits.
    27: _row("off_plane", "left_ankle neck right_ankle pelvis", above=0.5),
}
CORRECTED_RELATIONS: tuple[GeometricRelation, ...] = tuple(
    _CORRECTIONS.get(i, row) for i, row in enumerate(PUBLISHED_RELATIONS)
)


Variant = Literal["published", "corrected"]

FEATURE_FPS = 60.0
PIECE_S = 20.0
_WINDOW = 2  # frames on either side, over which velocities and accelerations are averaged
_PUBLISHED_RELATION_FPS = 120.0
_PUBLISHED_LENGTHS_M = Lengths(humerus=0.256838, shoulders=0.390848, hips=0.119247)
_PUBLISHED_TINY = 1e-10
_CONSTANT = 1e-9


@dataclass(frozen=True, eq=False)
class DanceFeatures:
    """Features of N dances or pieces of dances, one row each."""

    kinetic: Floats  # (N, 72)
    geometric: Floats  # (N, 32)
    variant: Variant


def canonical_pos_m(motion: Motion) -> Floats:
    """World positions (T, 24, 3) of the canonical joints in metres.

    A joint that the rig lacks is at its parent. Raises `ParameterError` if the joint names of the rig are
    unknown.

    Examples
    --------
    >>> motion, _ = cg.starter_repertoire().motion(0, 0.0, 4.0)  # 4 s of a built-in take
    >>> cg.metrics.fid.canonical_pos_m(motion).shape[1:]
    (24, 3)
    """
    return motion.joint_pos_m()[:, body_indices(motion.skeleton, CANONICAL_JOINTS)]


def validate(pos_m: NDArray[np.floating], fps: float, variant: Variant) -> Floats:
    """Positions (T, 24, 3) resampled to 60 fps, (T', 24, 3).

    Raises `ParameterError` unless positions are finite, T' is at least 3, and rate and variant are valid.

    Examples
    --------
    >>> cg.metrics.fid.validate(np.zeros((30, 24, 3)), 30.0, "corrected").shape
    (59, 24, 3)
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
    """Kinetic features (72,) of positions (T, 24, 3): per joint m²/s² horizontal, m²/s² vertical, m/s².

    Velocities and accelerations are averaged over five frames (fewer at the ends) before their length is
    taken. Raises `ParameterError` as `validate` does.

    Examples
    --------
    >>> pos_m = np.zeros((60, 24, 3))
    >>> pos_m[:, :, 0] = 2.0 * np.arange(60)[:, None] / 60  # along x at 2 m/s
    >>> cg.metrics.fid.kinetic(pos_m, 60.0).reshape(24, 3)[0].round(6)
    array([4., 0., 0.])
    """
    pos, dt_s = validate(pos_m, fps, variant), 1.0 / FEATURE_FPS
    pos = pos - pos[:1, :1]
    velocity = np.diff(pos, axis=0) / dt_s  # (T-1, 24, 3), of frames 1 … T - 1
    acceleration = np.diff(velocity, axis=0) / dt_s  # (T-2, 24, 3), of frames 1 … T - 2
    if variant == "published":
        acceleration = (velocity[1:] - (pos[1:-1] - pos[:-2] / dt_s)) / dt_s
    mean_velocity = _windowed_mean(velocity, len(velocity))  # (T-1, 24, 3)
    horizontal = np.sum(mean_velocity[..., [0, 2]] ** 2, axis=-1)
    vertical = mean_velocity[..., 1] ** 2
    effort = np.linalg.norm(_windowed_mean(acceleration, len(velocity)), axis=-1)
    result: Floats = np.stack([horizontal, vertical, effort], axis=-1).mean(axis=0).reshape(-1)  # (72,)
    return result


def geometric(pos_m: NDArray[np.floating], fps: float, *, variant: Variant = "corrected") -> Floats:
    """Geometric features (32,) of positions (T, 24, 3): shares of the frames, 0 to 1.

    Raises `ParameterError` as `validate` does.

    Examples
    --------
    >>> motion, _ = cg.starter_repertoire().motion(0, 0.0, 4.0)  # 4 s of a built-in take
    >>> shares = cg.metrics.fid.geometric(cg.metrics.fid.canonical_pos_m(motion), motion.fps)
    >>> shares.shape, bool(shares.min() >= 0), bool(shares.max() <= 1)
    ((32,), True, True)
    """
    pos = validate(pos_m, fps, variant)
    if variant == "published":
        return _relation_shares(PUBLISHED_RELATIONS, pos, _PUBLISHED_RELATION_FPS, _PUBLISHED_LENGTHS_M)
    return _relation_shares(CORRECTED_RELATIONS, pos, FEATURE_FPS, _measure_lengths(pos))


def features_of(
    motions: Sequence[Motion], *, variant: Variant = "corrected", piece_s: float = PIECE_S
) -> DanceFeatures:
    """Features of each full piece of `piece_s` seconds of each motion. A shorter motion is one piece.

    Raises `ParameterError` if there is no motion, and as `canonical_pos_m` and `validate` do.

    Examples
    --------
    >>> motion, _ = cg.starter_repertoire().motion(0, 0.0, 4.0)  # 4 s of a built-in take
    >>> cg.metrics.fid.features_of([motion], piece_s=1.0).kinetic.shape
    (4, 72)
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
    """Squared Fréchet distance between features (N, D) and those of real dances (N', D). Lower is better.

    0 means equal means and covariances. Raises `ParameterError` if a set has fewer than two rows, or the sets
    differ in D.

    Examples
    --------
    >>> real = np.random.default_rng(0).normal(size=(200, 4))
    >>> one_spread_off = real + real.std(axis=0)
    >>> abs(round(cg.metrics.fid.fid(real, real), 6)), round(cg.metrics.fid.fid(one_spread_off, real), 6)
    (0.0, 4.0)
    """
    _check_sets(features, real)
    sides = (_normalised(side, real, variant) if normalised else side for side in (features, real))
    return frechet_distance(*(fit_gaussian(side) for side in sides))


def diversity(
    features: Floats, real: Floats, *, variant: Variant = "corrected", normalised: bool = True
) -> float:
    """Mean Euclidean distance between two rows of features (N, D), normalised by the real ones (N', D).

    Nearer to that of the real dances is better. Raises `ParameterError` as `fid` does.

    Examples
    --------
    >>> real = np.array([[0.0], [2.0]])  # of standard deviation 1
    >>> cg.metrics.fid.diversity(real, real), cg.metrics.fid.diversity(np.ones((2, 1)), real)
    (2.0, 0.0)
    """
    _check_sets(features, real)
    return float(pdist(_normalised(features, real, variant) if normalised else features).mean())


@default_numerics()
def evaluate(dances: DanceFeatures, real: DanceFeatures, *, normalised: bool = True) -> dict[str, float]:
    """FID and diversity for both kinds of features by name, and the diversity of the real set as the target.

    Raises `ParameterError` if the variants differ, or a set has fewer than two dances.

    Examples
    --------
    >>> motion, _ = cg.starter_repertoire().motion(0, 0.0, 4.0)  # 4 s of a built-in take
    >>> features = cg.metrics.fid.features_of([motion], piece_s=1.0)
    >>> scores = cg.metrics.fid.evaluate(features, features)  # a set against itself
    >>> round(scores["fid_k"], 6) == 0, scores["diversity_k"] == scores["real_diversity_k"]
    (True, True)
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


def _windowed_mean(values: Floats, n_frames: int) -> Floats:
    """Means of `values` (N, ...) over up to `_WINDOW` rows on either side of rows 0 … n_frames - 1."""
    sums = np.concatenate([np.zeros_like(values[:1]), np.cumsum(values, axis=0)])  # (N + 1, ...)
    rows = np.arange(n_frames)
    low, high = np.maximum(rows - _WINDOW, 0), np.minimum(rows + _WINDOW + 1, len(values))
    result: Floats = (sums[high] - sums[low]) / (high - low).reshape(-1, *[1] * (values.ndim - 1))
    return result


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
    result: Floats = (features - real.mean(axis=0)) / divisor
    return result
