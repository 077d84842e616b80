"""Skeleton calibration: the canonical hierarchy with bone lengths measured from marker positions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats
from choreograph.motion.marker_fitting import REQUIRED_ROLES
from choreograph.motion.skeleton import CANONICAL_JOINTS, Skeleton, canonical_skeleton

_CLUSTERED_BONES = (("hip", "knee"), ("knee", "ankle"))  # the longest bones, and rigid
_PELVIS_HEIGHT = 0.45  # of the way from the middle of the hips to the lower spine
_COLLAR_REACH = 0.3  # of half the shoulder width, at which the collar bone starts
_NECK_RISE_M = 0.02  # height of the neck's base above the line between the shoulders
_TOES_M = 0.06  # from the ball of the foot to the tip of the toes


@dataclass(frozen=True, eq=False)
class BodyClusters:
    """Several dancers distinguished by their bone lengths."""

    bone_lengths_m: Floats  # (N, L) of `_CLUSTERED_BONES`, left and right
    skeletons: tuple[Skeleton, ...]  # (N,)

    def membership(self, pos_m: Floats, roles: Sequence[str], fps: float) -> Floats:
        """Membership of each frame in each body, (T, N), rows sum to 1: 0 or 1 except at crossfades."""
        lengths = scipy.ndimage.gaussian_filter1d(
            _bone_lengths_m(pos_m, roles), 0.2 * fps, axis=0, mode="nearest"
        )
        nearest = np.argmin(np.linalg.norm(lengths[:, None] - self.bone_lengths_m, axis=-1), axis=1)  # (T,)
        membership = np.eye(len(self.bone_lengths_m))[nearest]
        membership = scipy.ndimage.gaussian_filter1d(membership, 0.2 * fps, axis=0, mode="nearest")
        shares: Floats = membership / membership.sum(axis=1, keepdims=True)
        return shares


def cluster_bodies(pos_m: Floats, roles: Sequence[str], n_bodies: int) -> BodyClusters:
    """Clusters frames (T, R, 3) of several dancers by bone lengths (k-means), with a skeleton for each.

    Raises `ParameterError` as `measure_skeleton`, or if there are fewer frames than bodies.
    """
    if not 1 <= n_bodies <= len(pos_m):
        raise ParameterError(f"expected 1 to {len(pos_m)} bodies for as many frames, got {n_bodies}")
    lengths = _bone_lengths_m(pos_m, roles)
    from scipy.cluster.vq import kmeans2  # a dance imports this module, and does not need it

    _, labels = kmeans2(lengths, n_bodies, minit="++", rng=np.random.default_rng(0))
    clusters = [labels == k for k in range(n_bodies) if (labels == k).any()]
    return BodyClusters(
        np.stack([np.median(lengths[cluster], axis=0) for cluster in clusters]),
        tuple(measure_skeleton(pos_m[cluster], roles) for cluster in clusters),
    )


def size_ratio(skeleton: Skeleton, other: Skeleton) -> float:
    """The factor that scales `skeleton` to the size of `other`, of the same hierarchy.

    It is the least-squares factor over the joints of both rest poses, each centred.
    """
    source, target = (pos - pos.mean(axis=0) for pos in (skeleton.rest_pos_m(), other.rest_pos_m()))  # (J, 3)
    return float(np.sum(source * target) / np.sum(source**2))


def resized(pos_m: Floats, size: Floats, floor_m: float) -> Floats:
    """Positions (T, R, 3) scaled by `size` (T,) about the floor, which stays at `floor_m`.

    The path on the ground is scaled step by step, so that feet at rest stay at rest at any size, and a change
    of size causes no jump.
    """
    middle = pos_m.mean(axis=1)  # (T, 3)
    steps = np.diff(middle, axis=0) * (0.5 * (size[1:] + size[:-1]))[:, None]
    path = np.concatenate([middle[:1], middle[:1] + np.cumsum(steps, axis=0)])  # (T, 3)
    path[:, 1] = floor_m + (middle[:, 1] - floor_m) * size
    resized_m: Floats = path[:, None] + (pos_m - middle[:, None]) * size[:, None, None]
    return resized_m


def _bone_lengths_m(pos_m: Floats, roles: Sequence[str]) -> Floats:
    index = list(roles).index
    pairs = [(f"{s}_{a}", f"{s}_{b}") for s in ("left", "right") for a, b in _CLUSTERED_BONES]
    vectors = np.stack([pos_m[:, index(a)] - pos_m[:, index(b)] for a, b in pairs], axis=1)
    lengths_m: Floats = np.linalg.norm(vectors, axis=-1)  # (T, L)
    return lengths_m


def measure_skeleton(pos_m: Floats, roles: Sequence[str]) -> Skeleton:
    """The canonical 24-joint body with the mean bone lengths of marker positions.

    Parameters
    ----------
    pos_m : float array (T, R, 3)   metres, Y up, frames of one dancer in any order
    roles : R names                 as in `fit_positions`, and "spine1", "head", feet and heels

    Left and right are measured separately, since markers are placed by hand. Heels become end sites of
    the ankles. Joints without markers (pelvis, middle spine, neck, collars) are interpolated.

    Raises `ParameterError` if a needed role is missing.
    """
    needed = (*REQUIRED_ROLES, "spine1", "head", "left_foot", "right_foot", "left_heel", "right_heel")
    missing = [role for role in needed if role not in roles]
    if missing:
        raise ParameterError(f"expected positions of all major joints, missing {', '.join(missing)}")
    measured = {role: pos_m[:, index] for index, role in enumerate(roles)}  # role -> (T, 3)
    rest = _trunk(measured)
    tips: dict[str, list[Floats]] = {}
    for side, sign in (("left", 1.0), ("right", -1.0)):
        _leg(measured, side, rest, tips)
        _arm(measured, side, sign, rest, tips)
    tips["head"] = [np.array([0.0, 0.12, 0.0])]
    return _assemble(rest, tips)


def _length(measured: Mapping[str, Floats], a: str, b: str) -> float:
    return float(np.mean(np.linalg.norm(measured[a] - measured[b], axis=-1)))


def _trunk(measured: Mapping[str, Floats]) -> dict[str, Floats]:
    """Rest positions of the trunk's joints, the middle of the hips at the origin, X left, Y up."""
    hips = 0.5 * (measured["left_hip"] + measured["right_hip"])
    shoulders = 0.5 * (measured["left_shoulder"] + measured["right_shoulder"])
    half_hips = 0.5 * _length(measured, "left_hip", "right_hip")
    half_shoulders = 0.5 * _length(measured, "left_shoulder", "right_shoulder")
    low = float(np.mean(np.linalg.norm(measured["spine1"] - hips, axis=-1)))
    high = low + float(np.mean(np.linalg.norm(shoulders - measured["spine1"], axis=-1)))
    neck = high + _NECK_RISE_M
    head = high + float(np.mean(np.linalg.norm(measured["head"] - shoulders, axis=-1)))
    heights = {"pelvis": _PELVIS_HEIGHT * low, "spine1": low, "neck": neck, "head": head}
    heights |= {"spine2": low + (high - low) / 3, "spine3": low + (high - low) * 2 / 3}
    rest = {role: np.array([0.0, height, 0.0]) for role, height in heights.items()}
    for side, sign in (("left", 1.0), ("right", -1.0)):
        rest[f"{side}_hip"] = np.array([sign * half_hips, 0.0, 0.0])
        rest[f"{side}_shoulder"] = np.array([sign * half_shoulders, high, 0.0])
        rest[f"{side}_collar"] = np.array([sign * half_shoulders * _COLLAR_REACH, high, 0.0])
    return rest


def _leg(
    measured: Mapping[str, Floats], side: str, rest: dict[str, Floats], tips: dict[str, list[Floats]]
) -> None:
    hip, knee, ankle, foot, heel = (f"{side}_{part}" for part in ("hip", "knee", "ankle", "foot", "heel"))
    down = np.array([0.0, -1.0, 0.0])
    rest[knee] = rest[hip] + down * _length(measured, hip, knee)
    rest[ankle] = rest[knee] + down * _length(measured, knee, ankle)
    # Heel and ball are level in a standing foot. The ankle is the apex of the triangle of the three lengths.
    to_heel, to_foot, sole = (
        _length(measured, ankle, heel),
        _length(measured, ankle, foot),
        _length(measured, heel, foot),
    )
    forward = np.clip((to_foot**2 + sole**2 - to_heel**2) / (2.0 * sole), 0.0, to_foot)
    height = float(np.sqrt(to_foot**2 - forward**2))
    rest[foot] = rest[ankle] + np.array([0.0, -height, forward])
    tips[ankle] = [np.array([0.0, -height, forward - sole])]
    tips[foot] = [np.array([0.0, 0.0, _TOES_M])]


def _arm(
    measured: Mapping[str, Floats],
    side: str,
    sign: float,
    rest: dict[str, Floats],
    tips: dict[str, list[Floats]],
) -> None:
    chain = [f"{side}_{part}" for part in ("shoulder", "elbow", "wrist", "hand")]
    for upper, lower in pairwise(chain):
        length = _length(measured, upper, lower) if lower in measured else 0.085
        rest[lower] = rest[upper] + np.array([sign * length, 0.0, 0.0])
    tips[chain[-1]] = [np.array([sign * 0.06, 0.0, 0.0])]


def _assemble(rest: Mapping[str, Floats], tips: Mapping[str, list[Floats]]) -> Skeleton:
    parents = canonical_skeleton().parents
    rest_m = np.stack([rest[name] for name in CANONICAL_JOINTS])  # (24, 3)
    sole = min(rest[name][1] + tip[0][1] for name, tip in tips.items() if "ankle" in name)
    offsets = rest_m - rest_m[np.maximum(parents, 0)]
    offsets[0] = rest_m[0] - [0.0, sole, 0.0]
    tip_parents = [CANONICAL_JOINTS.index(name) for name, tips_m in tips.items() for _ in tips_m]
    return Skeleton(
        names=CANONICAL_JOINTS,
        parents=parents,
        offsets_m=offsets,
        tip_parents=np.array(tip_parents),
        tips_m=np.array([tip_m for tips_m in tips.values() for tip_m in tips_m]),
    )
