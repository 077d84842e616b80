"""How far a character's body reaches around its bones: what its hands must stay out of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from choreograph.gltf import SkinPoints
from choreograph.motion import rotations as rot
from choreograph.motion.skeleton import Skeleton

Floats = NDArray[np.float64]

_FEWEST = 12  # points of a part that say its shape
_ELLIPSES = 4  # of a part
_WITHIN = (4.0, 96.0)  # percentiles of an ellipse's points that it reaches from and to
_THIGH_FROM = 0.2  # of the thigh: above it is the hip, which the trunk covers
_UP = np.array([0.0, 1.0, 0.0])


@dataclass(frozen=True, eq=False)
class BodyPart:
    """A stack of ellipses that moves with a joint; its measures are of the rest pose, in the world."""

    joint: int
    start_m: Floats  # (3,) of its axis
    end_m: Floats  # (3,)
    across: Floats  # (2, 3) unit, the axes of the ellipses
    middle_m: Floats  # (S, 2) of ellipses at even distances along the axis
    radii_m: Floats  # (S, 2)

    def way_out_m(self, point_m: Floats, radius_m: float) -> Floats:
        """The shift (T, 3) that brings a ball around a point (T, 3) to the surface; 0 where it is outside.

        Points are of consecutive frames, as they lie in the rest pose. While it is inside it is brought out
        one way, which the frames near the surface say: at the axis all ways are equally far.
        """
        flat, radii, inside = self._across(point_m, radius_m)
        size = np.linalg.norm(flat / radii, axis=-1)
        inside &= size < 1.0
        shift = np.zeros((len(point_m), 2))
        steps = np.flatnonzero(np.diff(inside, prepend=False, append=False))
        for start, stop in zip(steps[::2], steps[1::2], strict=True):
            span = slice(start, stop)
            normals = flat[span] / radii[span] ** 2
            way = np.sum(normals * size[span, None] ** 2, axis=0)
            way = way / max(float(np.linalg.norm(way)), 1e-9)
            # The end of the ray: |(flat + t way) / radii| = 1.
            a, b = np.sum((way / radii[span]) ** 2, axis=-1), np.sum(normals * way, axis=-1)
            reach = (-b + np.sqrt(np.maximum(b**2 - a * (size[span] ** 2 - 1.0), 0.0))) / np.maximum(a, 1e-9)
            shift[span] = reach[:, None] * way
        return shift @ self.across

    def depth_m(self, point_m: Floats) -> float:
        """How deep the deepest of points (N, 3) of the rest pose is inside; negative if all are outside."""
        flat, radii, inside = self._across(point_m, 0.0)
        depth = (1.0 - np.linalg.norm(flat / radii, axis=-1)) * radii.min(axis=-1)
        return float(np.max(np.where(inside, depth, -1.0)))

    def _across(self, point_m: Floats, radius_m: float) -> tuple[Floats, Floats, NDArray[np.bool_]]:
        """Points (T, 2) against the middle of the ellipse beside them, its radii (T, 2), and whether it is
        between the ends of the axis."""
        axis = self.end_m - self.start_m
        along = (point_m - self.start_m) @ axis / (axis @ axis)  # (T,)
        flat = (point_m - self.start_m) @ self.across.T - self._at(along, self.middle_m)
        return flat, self._at(along, self.radii_m) + radius_m, (along >= 0.0) & (along <= 1.0)

    def _at(self, along: Floats, values: Floats) -> Floats:
        """Values (S, 2) of the ellipses at shares (T,) of the axis, (T, 2)."""
        places = (np.arange(len(values)) + 0.5) / len(values)
        return np.stack([np.interp(along, places, column) for column in values.T], axis=-1)


def body_parts(
    skeleton: Skeleton, bone_of_joint: Sequence[int], skin: SkinPoints, front: Floats
) -> tuple[BodyPart, ...]:
    """Trunk, head and thighs of a figure by the points that its skin has around them.

    `front` (3,) is where it looks in its rest pose. Parts with too few points are left out; all are made
    thinner where hands would be inside of them in the rest pose, since clothes and hair reach farther.
    """
    rest = skeleton.rest_pos_m()
    points = [skin.pos_m[skin.bone == bone] for bone in bone_of_joint]
    left = np.cross(_UP, front)
    parts = []
    points[0] = _with_hips(skeleton, points)
    for joint, (start_m, end_m) in _axes(skeleton, points).items():
        own = points[joint]
        if len(own) >= _FEWEST and np.linalg.norm(end_m - start_m) > 1e-3:
            parts.append(_part(joint, start_m, end_m, own, left))
    return tuple(_thinner(part, rest, skeleton) for part in parts)


def _with_hips(skeleton: Skeleton, points: Sequence[Floats]) -> Floats:
    """The pelvis's points (V, 3) and those of the thighs beside it."""
    beside = []
    for side in ("left", "right"):
        hip, knee = skeleton.index(f"{side}_hip"), skeleton.index(f"{side}_knee")
        start, end = skeleton.rest_pos_m()[[hip, knee]]
        along = (points[hip] - start) @ (end - start) / ((end - start) @ (end - start))
        beside.append(points[hip][along < _THIGH_FROM])
    return np.concatenate([points[0], *beside])


def _axes(skeleton: Skeleton, points: Sequence[Floats]) -> dict[int, tuple[Floats, Floats]]:
    """Where the axis of each part begins and ends, (3,) each, by its joint."""
    rest = skeleton.rest_pos_m()
    neck = skeleton.names.index("neck") if "neck" in skeleton.names else None
    top = skeleton.index("left_shoulder") if neck is None else neck
    path = [int(skeleton.parents[top])]
    while path[-1] > 0:
        path.append(int(skeleton.parents[path[-1]]))
    path = path[::-1]
    shoulders = rest[[skeleton.index(f"{side}_shoulder") for side in ("left", "right")]].mean(axis=0)
    axes = {joint: (rest[joint], rest[above]) for joint, above in pairwise(path)}
    axes[path[-1]] = rest[path[-1]], shoulders if neck is None else rest[neck]
    if "head" in skeleton.names and len(points[skeleton.index("head")]):
        head = skeleton.index("head")
        axes[head] = rest[head], rest[head] * [1, 0, 1] + [0, float(points[head][:, 1].max()), 0]
    for side in ("left", "right"):
        hip, knee = rest[[skeleton.index(f"{side}_hip"), skeleton.index(f"{side}_knee")]]
        axes[skeleton.index(f"{side}_hip")] = hip + _THIGH_FROM * (knee - hip), knee
    # The trunk goes down to where the thighs begin to be parts of their own.
    start, end = axes[0]
    thighs = np.mean([axes[skeleton.index(f"{side}_hip")][0] for side in ("left", "right")], axis=0)
    axes[0] = start * [1, 0, 1] + thighs * [0, 1, 0], end
    return axes


def _part(joint: int, start_m: Floats, end_m: Floats, points_m: Floats, left: Floats) -> BodyPart:
    axis = end_m - start_m
    first = left - axis * (left @ axis) / (axis @ axis)
    first = first / np.linalg.norm(first)
    across = np.stack([first, np.cross(axis / np.linalg.norm(axis), first)])
    flat = (points_m - start_m) @ across.T  # (V, 2)
    along = (points_m - start_m) @ axis / (axis @ axis)
    low, high = [], []
    for place in (np.arange(_ELLIPSES) + 0.5) / _ELLIPSES:
        near = np.argsort(np.abs(along - place))  # those that are level with it, or the nearest few
        n_level = np.count_nonzero(np.abs(along - place) < 0.75 / _ELLIPSES)
        level = flat[near[: max(n_level, _FEWEST)]]
        low.append(np.percentile(level, _WITHIN[0], axis=0))
        high.append(np.percentile(level, _WITHIN[1], axis=0))
    lows, highs = np.array(low), np.array(high)  # (S, 2)
    radii_m = np.maximum((highs - lows) / 2, 1e-3)
    return BodyPart(joint, start_m, end_m, across, (lows + highs) / 2, radii_m)


def _thinner(part: BodyPart, rest_m: Floats, skeleton: Skeleton) -> BodyPart:
    wrists = rest_m[[skeleton.index(f"{side}_wrist") for side in ("left", "right")]]
    depth_m = part.depth_m(wrists)
    if depth_m <= 0:
        return part
    return replace(part, radii_m=np.maximum(part.radii_m - depth_m, 1e-3))


def place_in_rest(points_m: Floats, joint_pos_m: Floats, joint_quat: Floats, rest_pos_m: Floats) -> Floats:
    """World points (T, 3) as they lie in the rest pose of a joint at (T, 3), turned by (T, 4)."""
    return rot.rotate(rot.invert(joint_quat), points_m - joint_pos_m) + rest_pos_m
