"""The body of a character: feet that stay on the floor, hands that stay out of the body, poses of fingers.

Fingers have the shapes of `motion.hands` on characters that have bones of fingers.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import scipy
from numpy.typing import NDArray

from choreograph.core.numerics import Floats
from choreograph.formats.gltf import Rig, SkinPoints
from choreograph.motion import rotations as rot
from choreograph.motion.contacts import estimate_floor_m, smooth_cover, sole_pos_m
from choreograph.motion.hands import (
    BENDS_DEG,
    SEGMENTS,
    SHAPES,
    HandSpan,
    bend_axis,
    shape_shares,
    thumb_goal,
)
from choreograph.motion.kinematics import forward, move_limb, to_local
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import Skeleton, canonical_skeleton, descendants

# The shape of the body around its bones.


_FEWEST = 12  # points of a part that define its shape
_ELLIPSES = 4  # of a part
_WITHIN = (4.0, 96.0)  # percentiles of points between which an ellipse extends
_THIGH_FROM = 0.2  # of the thigh, above which the trunk covers the hip
_UP = np.array([0.0, 1.0, 0.0])


@dataclass(frozen=True, eq=False)
class BodyPart:
    """A stack of ellipses that moves with a joint. Its measures are those of the rest pose in the world."""

    joint: int
    start_m: Floats  # (3,) of its axis
    end_m: Floats  # (3,)
    across: Floats  # (2, 3) unit, the axes of the ellipses
    middle_m: Floats  # (S, 2) of ellipses at even distances along the axis
    radii_m: Floats  # (S, 2)

    def way_out_m(self, point_m: Floats, radius_m: float) -> Floats:
        """The shift (T, 3) of a ball around a point (T, 3) to the surface, 0 if it is outside.

        Points are of consecutive frames, in the space of the rest pose. While the ball is inside, it is moved
        in one direction, which the frames near the surface determine. At the axis, all directions are equal.
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
            # The ray ends where |(flat + t way) / radii| = 1.
            a, b = np.sum((way / radii[span]) ** 2, axis=-1), np.sum(normals * way, axis=-1)
            reach = (-b + np.sqrt(np.maximum(b**2 - a * (size[span] ** 2 - 1.0), 0.0))) / np.maximum(a, 1e-9)
            shift[span] = reach[:, None] * way
        return shift @ self.across

    def depth_m(self, point_m: Floats) -> float:
        """The depth of the deepest of points (N, 3) of the rest pose, negative if all are outside."""
        flat, radii, inside = self._across(point_m, 0.0)
        depth = (1.0 - np.linalg.norm(flat / radii, axis=-1)) * radii.min(axis=-1)
        return float(np.max(np.where(inside, depth, -1.0)))

    def _across(self, point_m: Floats, radius_m: float) -> tuple[Floats, Floats, NDArray[np.bool_]]:
        """Points (T, 2) from the middle of their ellipse, its radii (T, 2), and whether it exists (T,)."""
        axis = self.end_m - self.start_m
        along = (point_m - self.start_m) @ axis / (axis @ axis)  # (T,)
        flat = (point_m - self.start_m) @ self.across.T - self._at(along, self.middle_m)
        return flat, self._at(along, self.radii_m) + radius_m, (along >= 0.0) & (along <= 1.0)

    def _at(self, along: Floats, values: Floats) -> Floats:
        """Values (S, 2) of the ellipses, interpolated at shares (T,) of the axis, (T, 2)."""
        places = (np.arange(len(values)) + 0.5) / len(values)
        return np.stack([np.interp(along, places, column) for column in values.T], axis=-1)


def body_parts(
    skeleton: Skeleton, bone_of_joint: Sequence[int], skin: SkinPoints, front: Floats
) -> tuple[BodyPart, ...]:
    """Trunk, head and thighs of a figure from the points of its skin.

    `front` (3,) is the direction that it faces in its rest pose. Parts with too few points are left out. A
    part that contains a hand in the rest pose, because of clothes or hair, is made thinner.
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
    """The points (V, 3) of the pelvis and of the thighs beside it."""
    beside = []
    for side in ("left", "right"):
        hip, knee = skeleton.index(f"{side}_hip"), skeleton.index(f"{side}_knee")
        start, end = skeleton.rest_pos_m()[[hip, knee]]
        along = (points[hip] - start) @ (end - start) / ((end - start) @ (end - start))
        beside.append(points[hip][along < _THIGH_FROM])
    return np.concatenate([points[0], *beside])


def _axes(skeleton: Skeleton, points: Sequence[Floats]) -> dict[int, tuple[Floats, Floats]]:
    """The ends of the axis of each part, (3,) each, by its joint."""
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
    # The trunk extends down to the beginning of the parts of the thighs.
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
        near = np.argsort(np.abs(along - place))  # the points at this level, or the nearest few
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


# Hands.


_EASE_S = 0.12  # on each side, over which a hand is moved out and back
_PASSES = 3  # a hand that is moved out of one part may be in another
_PALM = 0.35  # of the forearm, from the wrist to the thickest place of the hand
_THICKNESS = 0.08  # of the forearm, half the thickness of a hand


def keep_hands_out(figure: Motion, parts: Sequence[BodyPart], front: Floats) -> Motion:
    """The figure with wrists and palms moved to the surface of the body while they are inside of it.

    `front` (3,) is the direction that the figure faces in its rest pose, to which elbows bend. Hands keep
    their rotation. The motion changes only while they are inside, and during the easing before and after.
    """
    skeleton = figure.skeleton
    pos_m, quat = forward(skeleton, figure.root_pos_m, figure.local_quat)  # (T, J, 3), (T, J, 4)
    rest = skeleton.rest_pos_m()
    ease = max(2, round(_EASE_S * figure.fps))
    moved = False
    for side in ("left", "right"):
        shoulder, elbow, wrist = (skeleton.index(f"{side}_{part}") for part in ("shoulder", "elbow", "wrist"))
        bone = rest[elbow] - rest[shoulder]
        axis = np.cross(bone, front)
        axis = axis / max(float(np.linalg.norm(axis)), 1e-9)
        forearm = rest[wrist] - rest[elbow]
        for _ in range(_PASSES):
            palm = pos_m[:, wrist] + rot.rotate(quat[:, wrist], _PALM * forearm)
            radius = _THICKNESS * float(np.linalg.norm(forearm))
            shift = _way_out([pos_m[:, wrist], palm], parts, pos_m, quat, rest, radius, ease)
            if not shift.any():
                break
            hinge = rot.rotate(quat[:, elbow], axis)
            move_limb(skeleton, (shoulder, elbow, wrist), pos_m, quat, pos_m[:, wrist] + shift, hinge)
            pos_m = forward(skeleton, figure.root_pos_m, to_local(skeleton, quat))[0]
            moved = True
    return replace(figure, local_quat=rot.make_continuous(to_local(skeleton, quat))) if moved else figure


def _way_out(
    points_m: Sequence[Floats],
    parts: Sequence[BodyPart],
    pos_m: Floats,
    quat: Floats,
    rest_m: Floats,
    radius_m: float,
    ease: int,
) -> Floats:
    """The smooth shift (T, 3) that brings points (T, 3) of a hand out of the part they are deepest in."""
    shift = np.zeros((len(pos_m), 3))
    for part in parts:
        at, turned = pos_m[:, part.joint], quat[:, part.joint]
        for point in points_m:
            in_rest = rot.rotate(rot.invert(turned), point - at) + rest_m[part.joint]
            way = part.way_out_m(in_rest, radius_m)
            farther = np.linalg.norm(way, axis=-1) > np.linalg.norm(shift, axis=-1)
            shift[farther] = rot.rotate(turned, way)[farther]
    if not shift.any():
        return shift
    smooth = scipy.ndimage.gaussian_filter1d(shift, ease / 2.0, axis=0, mode="nearest")
    smooth /= np.maximum(np.linalg.norm(smooth, axis=-1, keepdims=True), 1e-12)
    return smooth_cover(np.linalg.norm(shift, axis=-1), ease)[:, None] * smooth


# Feet. With other proportions, feet at the ends of legs that have the directions of the dancer's would slide,
# float and sink.


_SHIFT_S = 0.03  # over which the shift of the feet is smoothed
_HEADING_S = 0.5  # over which the heading of a stance is smoothed, because hips swing over standing feet
_FRONT = np.array([0.0, 0.0, 1.0])


def placed_feet(dancer: Motion, figure: Motion) -> tuple[Motion, Floats]:
    """The figure with its hips on the path of the dancer, and the shift (T, 2, 3) of its feet.

    The path is scaled by the length of the legs. The balls of the feet are moved to the scaled positions of
    the dancer's on the ground, and the lowest points of the soles to their scaled height. Otherwise feet of
    another length would slide, and on tiptoe float or sink. The part of the shift that is common to all
    frames is left out. Its height moves the hips, and its position is the stance of the figure.
    """
    scale = _leg_m(figure.skeleton) / _leg_m(dancer.skeleton)
    hips = [[skeleton.index(f"{side}_hip") for side in ("left", "right")]
            for skeleton in (dancer.skeleton, figure.skeleton)]  # fmt: skip
    path = scale * dancer.joint_pos_m()[:, hips[0]].mean(axis=1)
    at_origin = figure.joint_pos_m()[:, hips[1]].mean(axis=1)
    placed = replace(figure, root_pos_m=path - at_origin)
    dancers = _sole_pos_m(dancer, _dancers_soles()) - [0.0, estimate_floor_m(sole_pos_m(dancer)), 0.0]
    own = _sole_pos_m(placed, figure.skeleton.tips_m.reshape(2, -1, 3))  # (T, 2, P, 3) heel, ball, …
    shift_m = scale * dancers[:, :, 1] - own[:, :, 1]  # (T, 2, 3)
    shift_m[..., 1] = scale * dancers[..., 1].min(axis=-1) - own[..., 1].min(axis=-1)
    height_m = float(np.median(shift_m[..., 1]))
    shift_m[..., 1] -= height_m
    shift_m -= _stance_m(placed, shift_m)
    shift_m = scipy.ndimage.gaussian_filter1d(shift_m, _SHIFT_S * figure.fps, axis=0, mode="nearest")
    return placed.moved(shift_m=np.array([0.0, height_m, 0.0])), shift_m


def _stance_m(figure: Motion, shift_m: Floats) -> Floats:
    """The common part of shifts (T, 2, 3) on the ground, relative to the smoothed heading of the hips."""
    ahead = rot.rotate(figure.local_quat[:, 0], _FRONT)
    ahead = scipy.ndimage.gaussian_filter1d(ahead, _HEADING_S * figure.fps, axis=0, mode="nearest")
    heading = rot.about_y(np.arctan2(ahead[:, 0], ahead[:, 2]))[:, None]  # (T, 1, 4)
    common_m = np.median(rot.rotate(rot.invert(heading), shift_m), axis=0) * [1.0, 0.0, 1.0]  # (2, 3)
    return rot.rotate(heading, np.broadcast_to(common_m, shift_m.shape))


def _dancers_soles() -> Floats:
    """Vectors (2, 2, 3) from the ankles of the canonical body to its soles below heel and ball."""
    body = canonical_skeleton()
    rest = body.rest_pos_m()
    feet = [[rest[body.index(f"{side}_{part}")] for part in ("ankle", "foot")] for side in ("left", "right")]
    return np.stack([sole_offsets_m(ankle, [ankle, ball], ball[1]) for ankle, ball in feet])


def _sole_pos_m(motion: Motion, soles_m: Floats) -> Floats:
    """Points of both soles (T, 2, P, 3) from their offsets `soles_m` (2, P, 3) to the ankles."""
    pos_m, quat = forward(motion.skeleton, motion.root_pos_m, motion.local_quat)  # (T, J, 3), (T, J, 4)
    ankles = [motion.skeleton.index(f"{side}_ankle") for side in ("left", "right")]
    return pos_m[:, ankles, None] + rot.rotate(quat[:, ankles, None], soles_m)


def sole_offsets_m(ankle_m: Floats, points_m: Sequence[Floats], floor_m: float) -> Floats:
    """Vectors (P, 3) from an ankle (3,) to the sole below points (3,) of its foot."""
    return np.stack([point * [1, 0, 1] + [0, floor_m, 0] - ankle_m for point in points_m])


def _leg_m(skeleton: Skeleton) -> float:
    """Mean length of both legs, hip to ankle along the bones."""
    rest = skeleton.rest_pos_m()
    chains = [
        [skeleton.index(f"{side}_{part}") for part in ("hip", "knee", "ankle")] for side in ("left", "right")
    ]
    return float(np.linalg.norm(np.diff(rest[chains], axis=1), axis=-1).sum(axis=-1).mean())


# Fingers.


_FINGERS = {
    "thumb": re.compile(r"thumb|親指", re.IGNORECASE),
    "index": re.compile(r"index|人指|人差指", re.IGNORECASE),
    "middle": re.compile(r"middle|mid\d|中指", re.IGNORECASE),
    "ring": re.compile(r"ring|薬指", re.IGNORECASE),
    "pinky": re.compile(r"pinky|pinkie|little|小指", re.IGNORECASE),
}
_NO_SEGMENT = re.compile(r"metacarpal|carpal|palm|twist|_end$|_nub$", re.IGNORECASE)


@dataclass(frozen=True)
class Finger:
    """A finger in the bind pose of a rig."""

    side: str  # "left" or "right"
    name: str  # "thumb", "index", "middle", "ring" or "pinky"
    bones: tuple[int, ...]  # from the hand to the tip, at most three


def fingers_of(rig: Rig, bones: Mapping[str, int]) -> list[Finger]:
    """The fingers below the hands of a rig, found by the names of their bones."""
    found = []
    for side in ("left", "right"):
        below = descendants(rig.parents, bones[f"{side}_wrist"])[1:]
        for name, pattern in _FINGERS.items():
            own = [b for b in below if pattern.search(rig.names[b]) and not _NO_SEGMENT.search(rig.names[b])]
            chain: list[int] = []
            for bone in own:
                if not chain or rig.parents[bone] == chain[-1]:
                    chain.append(bone)
            if chain:
                found.append(Finger(side, name, tuple(chain[:SEGMENTS])))
    return found


def with_fingers(
    figure: Motion,
    rig: Rig,
    bones: Mapping[str, int],
    joint_of: Mapping[int, int],
    spans: Sequence[HandSpan] = (),
) -> Motion:
    """The motion of a figure with fingers in the shapes of `spans`, and relaxed elsewhere.

    The joints of the figure are the bones `joint_of`. A hand without an index finger and another one to tell
    the palm by keeps its bind pose. Without such fingers, the motion is returned as it is.
    """
    fingers = fingers_of(rig, bones)
    weights = shape_shares(figure.n_frames, figure.fps, spans)  # (T, S)
    _, turned = forward(figure.skeleton, figure.root_pos_m, figure.local_quat)  # (T, J, 4)
    moved: set[int] = set()
    for side in ("left", "right"):
        hand = {finger.name: finger for finger in fingers if finger.side == side}
        wrist = bones[f"{side}_wrist"]
        frame = _palm(rig, wrist, hand)
        if frame is None:
            continue
        for finger in hand.values():
            axis, bent_rad = _bends(rig, finger, *frame)
            angles_rad = weights @ bent_rad  # (T, N) from the bind pose
            for bone, angle_rad in zip(finger.bones, angles_rad.T, strict=True):
                quat = rot.multiply(turned[:, joint_of[wrist]], rot.from_rotvec(angle_rad[:, None] * axis))
                for below in descendants(figure.skeleton.parents, joint_of[bone]):
                    turned[:, below] = quat
            moved |= {joint_of[bone] for bone in finger.bones}
    if not moved:
        return figure
    local = figure.local_quat.copy()
    changed = sorted(moved)
    local[:, changed] = rot.make_continuous(to_local(figure.skeleton, turned)[:, changed])
    return replace(figure, local_quat=local)


def _palm(rig: Rig, wrist: int, hand: Mapping[str, Finger]) -> tuple[Floats, Floats] | None:
    """The directions (3,) out of the palm and from the index finger to the smallest one, in the bind pose."""
    first = hand.get("index")
    last = next((hand[name] for name in ("pinky", "ring", "middle") if name in hand), None)
    if first is None or last is None:
        return None
    index_m, last_m = (rig.bind_pos_m[finger.bones[0]] for finger in (first, last))
    along, across = (index_m + last_m) / 2 - rig.bind_pos_m[wrist], last_m - index_m
    palm = np.cross(across, along) if first.side == "left" else np.cross(along, across)
    length = float(np.linalg.norm(palm))
    if length < 1e-9:
        return None
    return palm / length, across / np.linalg.norm(across)


def _bends(rig: Rig, finger: Finger, palm: Floats, across: Floats) -> tuple[Floats, Floats]:
    """The axis (3,) of a finger, and the angles (S, N) of its segments from the bind pose in each shape."""
    directions = _directions(rig, finger)  # (N, 3)
    goal = thumb_goal(palm, across) if finger.name == "thumb" else palm
    straight = directions[0] - (directions[0] @ goal) * goal
    straight /= max(float(np.linalg.norm(straight)), 1e-9)
    axis = bend_axis(directions[0], goal)
    bends = np.array([BENDS_DEG[shape][finger.name][: len(finger.bones)] for shape in SHAPES])
    angles = np.cumsum(np.radians(bends), axis=1)  # (S, N) of each segment
    if finger.name != "thumb":
        angles = angles - np.arctan2(directions @ goal, directions @ straight)
    return axis, angles


def _directions(rig: Rig, finger: Finger) -> Floats:
    """The directions (N, 3) of the segments of a finger in the bind pose, up to the tip if it has a bone."""
    directions: list[Floats] = []
    for bone in finger.bones:
        children = np.flatnonzero(rig.parents == bone)
        ahead = rig.bind_pos_m[children].mean(axis=0) - rig.bind_pos_m[bone] if len(children) else np.zeros(3)
        length = float(np.linalg.norm(ahead))
        if length > 1e-9:
            directions.append(ahead / length)
        elif directions:
            directions.append(directions[-1])
        else:
            along = rig.bind_pos_m[bone] - rig.bind_pos_m[rig.parents[bone]]
            directions.append(along / max(float(np.linalg.norm(along)), 1e-9))
    return np.array(directions)
