"""Positions over time -> one dancer's skeleton: the canonical hierarchy with measured bones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.vq import kmeans2
from scipy.ndimage import gaussian_filter1d

from choreograph.errors import ParameterError
from choreograph.motion.marker_fitting import REQUIRED_ROLES
from choreograph.motion.skeleton import CANONICAL_JOINTS, Skeleton, canonical_skeleton

Floats = NDArray[np.float64]

_TELLING_BONES = (("hip", "knee"), ("knee", "ankle"))  # the longest, and rigid
_PELVIS_HEIGHT = 0.45  # of the way from between the hips to the lower spine
_COLLAR_REACH = 0.3  # of half the shoulders' width, where the collar bone starts
_NECK_RISE_M = 0.02  # of the neck's base over the line between the shoulders
_TOES_M = 0.06  # from the ball of the foot to the tip of the toes


@dataclass(frozen=True, eq=False)
class Bodies:
    """Several dancers told apart by their bones."""

    lengths_m: Floats  # (N, L) of the bones in `_TELLING_BONES`
    skeletons: tuple[Skeleton, ...]  # (N,)

    def shares(self, pos_m: Floats, roles: Sequence[str], fps: float) -> Floats:
        """How far each frame belongs to each body, (T, N), rows sum to 1: 0 or 1 but for short fades."""
        lengths = gaussian_filter1d(_telling_lengths(pos_m, roles), 0.2 * fps, axis=0, mode="nearest")
        nearest = np.argmin(np.linalg.norm(lengths[:, None] - self.lengths_m, axis=-1), axis=1)  # (T,)
        shares = np.eye(len(self.lengths_m))[nearest]
        shares = gaussian_filter1d(shares, 0.2 * fps, axis=0, mode="nearest")
        return shares / shares.sum(axis=1, keepdims=True)


def measure_bodies(pos_m: Floats, roles: Sequence[str], n_bodies: int) -> Bodies:
    """Frames (T, R, 3) of several dancers grouped by bone lengths (k-means), and a skeleton for each group.

    Raises `ParameterError` as `measure_skeleton`, or if there are fewer frames than bodies.
    """
    if not 1 <= n_bodies <= len(pos_m):
        raise ParameterError(f"expected 1 to {len(pos_m)} bodies for as many frames, got {n_bodies}")
    lengths = _telling_lengths(pos_m, roles)
    _, labels = kmeans2(lengths, n_bodies, minit="++", rng=np.random.default_rng(0))
    groups = [labels == k for k in range(n_bodies) if (labels == k).any()]
    return Bodies(
        np.stack([np.median(lengths[group], axis=0) for group in groups]),
        tuple(measure_skeleton(pos_m[group], roles) for group in groups),
    )


def size_ratio(skeleton: Skeleton, other: Skeleton) -> float:
    """By what `skeleton` is multiplied to be as large as `other`, of the same hierarchy.

    Least squares over the joints of both rest poses, each about its middle.
    """
    own, wanted = (pos - pos.mean(axis=0) for pos in (skeleton.rest_pos_m(), other.rest_pos_m()))  # (J, 3)
    return float(np.sum(own * wanted) / np.sum(own**2))


def resized(pos_m: Floats, size: Floats, floor_m: float) -> Floats:
    """Positions (T, R, 3) of a dancer `size` (T,) times as large, over a floor at `floor_m`; it stays there.

    The path on the ground is scaled step by step, so feet at rest stay at rest whatever the size, and
    where the size changes the dancer goes on from where it is.
    """
    middle = pos_m.mean(axis=1)  # (T, 3)
    steps = np.diff(middle, axis=0) * (0.5 * (size[1:] + size[:-1]))[:, None]
    path = np.concatenate([middle[:1], middle[:1] + np.cumsum(steps, axis=0)])  # (T, 3)
    path[:, 1] = floor_m + (middle[:, 1] - floor_m) * size
    return path[:, None] + (pos_m - middle[:, None]) * size[:, None, None]


def _telling_lengths(pos_m: Floats, roles: Sequence[str]) -> Floats:
    index = list(roles).index
    pairs = [(f"{s}_{a}", f"{s}_{b}") for s in ("left", "right") for a, b in _TELLING_BONES]
    vectors = np.stack([pos_m[:, index(a)] - pos_m[:, index(b)] for a, b in pairs], axis=1)
    return np.linalg.norm(vectors, axis=-1)  # (T, L)


def measure_skeleton(pos_m: Floats, roles: Sequence[str]) -> Skeleton:
    """The canonical 24-joint body with the bone lengths that positions show on average.

    Parameters
    ----------
    pos_m : float array (T, R, 3)   metres, Y up; frames of one dancer, in any order
    roles : R names                 as in `fit_positions`; "spine1" and "head" are needed, too

    Left and right are measured apart: markers are placed by hand. Heels become end sites of the
    ankles. Joints nobody sees (pelvis, middle spine, neck, collars) are put between those seen.

    Raises `ParameterError` if a needed role is missing.
    """
    needed = (*REQUIRED_ROLES, "spine1", "head", "left_foot", "right_foot", "left_heel", "right_heel")
    missing = [role for role in needed if role not in roles]
    if missing:
        raise ParameterError(f"expected positions of all major joints, missing {', '.join(missing)}")
    seen = {role: pos_m[:, index] for index, role in enumerate(roles)}  # role -> (T, 3)
    rest = _trunk(seen)
    tips: dict[str, list[Floats]] = {}
    for side, sign in (("left", 1.0), ("right", -1.0)):
        _leg(seen, side, rest, tips)
        _arm(seen, side, sign, rest, tips)
    tips["head"] = [np.array([0.0, 0.12, 0.0])]
    return _assemble(rest, tips)


def _length(seen: Mapping[str, Floats], a: str, b: str) -> float:
    return float(np.mean(np.linalg.norm(seen[a] - seen[b], axis=-1)))


def _trunk(seen: Mapping[str, Floats]) -> dict[str, Floats]:
    """Rest places of the trunk's joints, hips' middle at the origin, X left, Y up."""
    hips = 0.5 * (seen["left_hip"] + seen["right_hip"])
    shoulders = 0.5 * (seen["left_shoulder"] + seen["right_shoulder"])
    half_hips = 0.5 * _length(seen, "left_hip", "right_hip")
    half_shoulders = 0.5 * _length(seen, "left_shoulder", "right_shoulder")
    low = float(np.mean(np.linalg.norm(seen["spine1"] - hips, axis=-1)))
    high = low + float(np.mean(np.linalg.norm(shoulders - seen["spine1"], axis=-1)))
    neck = high + _NECK_RISE_M
    head = high + float(np.mean(np.linalg.norm(seen["head"] - shoulders, axis=-1)))
    heights = {"pelvis": _PELVIS_HEIGHT * low, "spine1": low, "neck": neck, "head": head}
    heights |= {"spine2": low + (high - low) / 3, "spine3": low + (high - low) * 2 / 3}
    rest = {role: np.array([0.0, height, 0.0]) for role, height in heights.items()}
    for side, sign in (("left", 1.0), ("right", -1.0)):
        rest[f"{side}_hip"] = np.array([sign * half_hips, 0.0, 0.0])
        rest[f"{side}_shoulder"] = np.array([sign * half_shoulders, high, 0.0])
        rest[f"{side}_collar"] = np.array([sign * half_shoulders * _COLLAR_REACH, high, 0.0])
    return rest


def _leg(
    seen: Mapping[str, Floats], side: str, rest: dict[str, Floats], tips: dict[str, list[Floats]]
) -> None:
    hip, knee, ankle, foot, heel = (f"{side}_{part}" for part in ("hip", "knee", "ankle", "foot", "heel"))
    down = np.array([0.0, -1.0, 0.0])
    rest[knee] = rest[hip] + down * _length(seen, hip, knee)
    rest[ankle] = rest[knee] + down * _length(seen, knee, ankle)
    # Standing, heel and ball lie level: the ankle is the top of the triangle of the three lengths.
    to_heel, to_foot, sole = _length(seen, ankle, heel), _length(seen, ankle, foot), _length(seen, heel, foot)
    ahead = np.clip((to_foot**2 + sole**2 - to_heel**2) / (2.0 * sole), 0.0, to_foot)
    height = float(np.sqrt(to_foot**2 - ahead**2))
    rest[foot] = rest[ankle] + np.array([0.0, -height, ahead])
    tips[ankle] = [np.array([0.0, -height, ahead - sole])]
    tips[foot] = [np.array([0.0, 0.0, _TOES_M])]


def _arm(
    seen: Mapping[str, Floats], side: str, sign: float, rest: dict[str, Floats], tips: dict[str, list[Floats]]
) -> None:
    chain = [f"{side}_{part}" for part in ("shoulder", "elbow", "wrist", "hand")]
    for upper, lower in pairwise(chain):
        length = _length(seen, upper, lower) if lower in seen else 0.085
        rest[lower] = rest[upper] + np.array([sign * length, 0.0, 0.0])
    tips[chain[-1]] = [np.array([sign * 0.06, 0.0, 0.0])]


def _assemble(rest: Mapping[str, Floats], tips: Mapping[str, list[Floats]]) -> Skeleton:
    parents = canonical_skeleton().parents
    places = np.stack([rest[name] for name in CANONICAL_JOINTS])  # (24, 3)
    sole = min(
        place[1] + tip[0][1] for name, tip in tips.items() if "ankle" in name for place in [rest[name]]
    )
    offsets = places - places[np.maximum(parents, 0)]
    offsets[0] = places[0] - [0.0, sole, 0.0]
    owners = [CANONICAL_JOINTS.index(name) for name, several in tips.items() for _ in several]
    return Skeleton(
        names=CANONICAL_JOINTS,
        parents=parents,
        offsets_m=offsets,
        tip_parents=np.array(owners),
        tips_m=np.array([tip for several in tips.values() for tip in several]),
    )
