"""Markers or positions of joints over time: fits a skeleton to them, and measures a skeleton from them.

The fit is top-down and in closed form. The pelvis is a rigid body, the bend of the trunk is distributed over
the spine, and each limb is fitted by swing and twist. The swing points a bone in its direction. The twist
about it follows from the bend axis of knee or elbow, and is interpolated smoothly while the limb is straight.
Gauss-Newton steps then spread the residual along each limb.

`measure_skeleton` gives the canonical hierarchy with the bone lengths of markers, `cluster_bodies` tells
several dancers apart by them, and `resized` brings markers of one body to the size of another.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
import scipy

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats
from choreograph.motion import rotations as rot
from choreograph.motion.bone_map import joint_roles
from choreograph.motion.cleaning import bridge_flips, smoothed_angle
from choreograph.motion.kinematics import forward, to_local
from choreograph.motion.skeleton import CANONICAL_JOINTS, Skeleton, canonical_skeleton, descendants

# Gauss-Newton refinement of fitted rotations, which spreads the residual along each limb.


_DAMPING_M2 = 0.003  # limits rotations with little influence on the targets, such as twists of straight limbs


def refine(
    skeleton: Skeleton,
    root_pos_m: Floats,
    local_quat: Floats,
    targets_m: Mapping[int, Floats],
    refined: Sequence[int],
    *,
    sweeps: int = 2,
) -> tuple[Floats, Floats]:
    """Root positions (T, 3) and local rotations (T, J, 4) with a smaller sum of squared distances.

    `targets_m` maps joints to target positions (T, 3) in metres. `refined` are the joints whose rotation
    may change. Each sweep moves the root by the mean residual, then rotates one joint after the other,
    with all its descendants, by a damped Gauss-Newton step.
    """
    pos_m, global_quat = forward(skeleton, root_pos_m, local_quat)
    below = [descendants(skeleton.parents, joint)[1:] for joint in range(skeleton.n_joints)]
    joints = np.array(sorted(targets_m))
    target_m = np.stack([targets_m[joint] for joint in joints], axis=1)  # (T, R, 3)
    for _ in range(sweeps):
        pos_m = pos_m + np.mean(target_m - pos_m[:, joints], axis=1, keepdims=True)
        for joint in refined:
            is_below = np.isin(joints, below[joint])
            if not is_below.any():
                continue
            center = pos_m[:, joint, None]
            step = _gauss_newton_rotation(pos_m[:, joints[is_below]] - center, target_m[:, is_below] - center)
            moved = below[joint]
            pos_m[:, moved] = center + rot.rotate(step[:, None], pos_m[:, moved] - center)
            rotated = [joint, *moved]
            global_quat[:, rotated] = rot.multiply(step[:, None], global_quat[:, rotated])
    return pos_m[:, 0], rot.make_continuous(to_local(skeleton, global_quat))


def _gauss_newton_rotation(current: Floats, target: Floats) -> Floats:
    """World rotation (T, 4) about the origin that brings points (T, R, 3) closer to `target`."""
    eye = np.eye(3)
    inertia = np.sum(current**2, axis=(1, 2))[:, None, None] * eye - np.einsum(
        "tri,trj->tij", current, current
    )  # (T, 3, 3)
    torque = np.cross(current, target).sum(axis=1)  # (T, 3)
    return rot.from_rotvec(np.linalg.solve(inertia + _DAMPING_M2 * eye, torque[..., None])[..., 0])


# Fitting of a skeleton to positions of markers or joints over time.


# Points beside the canonical joints, which determine the rotations of foot and head.
LANDMARKS = ("left_heel", "right_heel", "left_temple", "right_temple")
REQUIRED_ROLES = tuple(
    f"{side}_{part}"
    for side in ("left", "right")
    for part in ("hip", "knee", "ankle", "shoulder", "elbow", "wrist")
)

# Joints whose rotations are refined together at the end, in this order.
_REFINED = (
    "pelvis",
    "spine1",
    "neck",
    *(
        f"{s}_{p}"
        for p in ("hip", "knee", "ankle", "collar", "shoulder", "elbow", "wrist")
        for s in ("left", "right")
    ),
)
_TWIST_SMOOTH_S = 0.12  # smoothing time of twists where their weight is low
# Weights of a limb's twist, relative to sin(bend) for the bend axis of knee or elbow.
_FOOT_WEIGHT = 0.3  # for the direction of the foot
_REST_WEIGHT = 0.05  # for no twist at all, where nothing else is known
_NECK_WEIGHT = 1.3  # of the neck against the temples, which get swapped: above 1 the head never flips
_BRIDGE_S = 0.16
_PASSES = 3  # after each but the last the root moves by the mean residual


def fit_positions(
    skeleton: Skeleton, pos_m: Floats, roles: Sequence[str], *, fps: float
) -> tuple[Floats, Floats]:
    """Root positions (T, 3) and local rotations (T, J, 4) that bring `skeleton` closest to `pos_m`.

    Parameters
    ----------
    skeleton : in any rest pose, with joint names that `joint_roles` supports
    pos_m : float array (T, R, 3)   metres, Y up
    roles : R names                 canonical joints and `LANDMARKS`. At least `REQUIRED_ROLES`
    fps : float                     rate of `pos_m`

    Heels are used if the skeleton has them, as end sites of the ankles.

    Raises
    ------
    ParameterError   if a required role is missing, shapes disagree, or a position is not finite
    """
    pos_m = np.asarray(pos_m, np.float64)  # (T, R, 3)
    missing = [role for role in REQUIRED_ROLES if role not in roles]
    unknown = [role for role in roles if role not in CANONICAL_JOINTS and role not in LANDMARKS]
    if missing or unknown:
        raise ParameterError(
            f"expected canonical joints, missing {missing or 'none'}, unknown {unknown or 'none'}"
        )
    if pos_m.ndim != 3 or pos_m.shape[1:] != (len(roles), 3) or len(pos_m) == 0:
        raise ParameterError(f"expected positions (T, {len(roles)}, 3), got {pos_m.shape}")
    if not np.isfinite(pos_m).all():
        raise ParameterError("expected finite positions, got nan or infinity: fill the gaps first")
    targets = {role: pos_m[:, index] for index, role in enumerate(roles)}
    fit = _Fit(skeleton, joint_roles(skeleton), targets, (_TWIST_SMOOTH_S * fps) ** 2)
    root_pos_m, local_quat = fit.solve()
    joints = joint_roles(skeleton)
    joint_targets = {joints[role]: target for role, target in targets.items() if role in joints}
    refined = [joints[role] for role in _REFINED if role in joints]
    root_pos_m, local_quat = refine(skeleton, root_pos_m, local_quat, joint_targets, refined)
    return root_pos_m, bridge_flips(local_quat, max(1, round(_BRIDGE_S * fps)))


def fit_error_m(
    skeleton: Skeleton, root_pos_m: Floats, local_quat: Floats, pos_m: Floats, roles: Sequence[str]
) -> Floats:
    """Distances (T, R') in metres between fitted and given positions, of those `roles` that are joints."""
    indices = joint_roles(skeleton)
    pairs = [(column, indices[role]) for column, role in enumerate(roles) if role in indices]
    joint_pos_m, _ = forward(skeleton, root_pos_m, local_quat)  # (T, J, 3)
    columns, joints = np.array(pairs).T
    return np.linalg.norm(joint_pos_m[:, joints] - pos_m[:, columns], axis=-1)


@dataclass
class _Fit:
    """The state of one fit: the world rotations solved so far, by joint."""

    skeleton: Skeleton
    joints: Mapping[str, int]
    targets: Mapping[str, Floats]  # role -> (T, 3)
    twist_smoothing: float  # frames squared
    global_quat: dict[int, Floats] = field(default_factory=dict)  # joint -> world rotation (T, 4)
    root_pos_m: Floats = field(init=False)  # (T, 3)

    def __post_init__(self) -> None:
        self.rest_m = self.skeleton.rest_pos_m()  # (J, 3)
        self.left = rot.unit(self.rest_m[self.joints["left_hip"]] - self.rest_m[self.joints["right_hip"]])
        middle = [self._rest_middle("shoulder"), self._rest_middle("hip")]
        up = middle[0] - middle[1]
        self.up = rot.unit(up - self.left * (up @ self.left))
        self.front = np.cross(self.left, self.up)

    def solve(self) -> tuple[Floats, Floats]:
        """Root positions (T, 3) in metres and local rotations (T, J, 4), limb by limb from the pelvis."""
        self._pelvis()
        fitted_roles = [role for role in self.targets if role in self.joints]
        target = np.stack([self.targets[role] for role in fitted_roles], axis=1)  # (T, R', 3)
        for last in range(_PASSES):
            self._trunk()
            for side in ("left", "right"):
                self._leg(side)
                self._arm(side)
            self._head()
            if last == _PASSES - 1:
                break
            fitted = np.stack([self._pos(self.joints[role]) for role in fitted_roles], axis=1)
            self.root_pos_m = self.root_pos_m + np.mean(target - fitted, axis=1)
        world = np.stack(
            [self._rotation(joint) for joint in range(self.skeleton.n_joints)], axis=1
        )  # (T, J, 4)
        return self.root_pos_m, rot.make_continuous(to_local(self.skeleton, world))

    def _rest_middle(self, part: str) -> Floats:
        return 0.5 * (self.rest_m[self.joints[f"left_{part}"]] + self.rest_m[self.joints[f"right_{part}"]])

    def _middle(self, part: str) -> Floats:
        return 0.5 * (self.targets[f"left_{part}"] + self.targets[f"right_{part}"])  # (T, 3)

    def _rotation(self, joint: int) -> Floats:
        """World rotation (T, 4). An unsolved joint has that of its parent."""
        while joint not in self.global_quat:
            joint = int(self.skeleton.parents[joint])
        return self.global_quat[joint]

    def _pos(self, joint: int) -> Floats:
        """World position (T, 3) by forward kinematics from the rotations solved so far."""
        pos = self.root_pos_m
        chain = []
        while self.skeleton.parents[joint] >= 0:
            chain.append(joint)
            joint = int(self.skeleton.parents[joint])
        for link in chain:
            pos = pos + rot.rotate(
                self._rotation(int(self.skeleton.parents[link])), self.skeleton.offsets_m[link]
            )
        return pos

    def _rest_vector(self, source: int, target: int) -> Floats:
        return self.rest_m[target] - self.rest_m[source]

    def _pelvis(self) -> None:
        """Pelvis rotation from the hips and the joint above, and the root position where they fit best."""
        pelvis = self.joints["pelvis"]
        above = next(
            (role for role in ("spine1", "pelvis") if role in self.targets and role in self.joints), None
        )
        middle = self._rest_middle("hip")
        if above and np.linalg.norm(self.rest_m[self.joints[above]] - middle) > 0.03:
            rest_up, up = self.rest_m[self.joints[above]] - middle, self.targets[above] - self._middle("hip")
        else:
            rest_up, up = (
                self._rest_middle("shoulder") - middle,
                self._middle("shoulder") - self._middle("hip"),
            )
        across = self.targets["left_hip"] - self.targets["right_hip"]
        rotation = _frame_to_quat(across, up, _basis(self.left, rest_up))
        for joint in {0, pelvis}:
            self.global_quat[joint] = rotation
        fixed = [role for role in ("left_hip", "right_hip", above) if role]
        self.root_pos_m = np.mean(
            [
                self.targets[role] - rot.rotate(rotation, self.rest_m[self.joints[role]] - self.rest_m[0])
                for role in fixed
            ],
            axis=0,
        )

    def _trunk(self) -> None:
        """Bend from pelvis to shoulders, spread evenly over the spine, which then aims at the shoulders."""
        spine = [self.joints[role] for role in ("spine1", "spine2", "spine3") if role in self.joints]
        if not spine:
            return
        pelvis = self.global_quat[self.joints["pelvis"]]
        base = self._pos(spine[0])
        rest_up = self._rest_middle("shoulder") - self.rest_m[spine[0]]
        across = self.targets["left_shoulder"] - self.targets["right_shoulder"]
        chest = _frame_to_quat(self._middle("shoulder") - base, across, _basis(rest_up, self.left))
        bend = rot.to_rotvec(rot.multiply(chest, rot.invert(pelvis)))  # (T, 3)
        for step, joint in enumerate(spine, start=1):
            self.global_quat[joint] = rot.multiply(rot.from_rotvec(bend * (step / len(spine))), pelvis)
        shoulders = np.zeros(3)
        for side in ("left", "right"):
            first = self.joints.get(f"{side}_collar", self.joints[f"{side}_shoulder"])
            anchor = int(self.skeleton.parents[first])
            reach = self._rest_vector(anchor, self.joints[f"{side}_shoulder"])
            shoulders = shoulders + 0.5 * (self._pos(anchor) + rot.rotate(self._rotation(anchor), reach))
        correction = rot.between(shoulders - base, self._middle("shoulder") - base)
        for joint in spine:
            self.global_quat[joint] = rot.multiply(correction, self.global_quat[joint])

    def _swing(self, joint: int, child: int, target: Floats) -> Floats:
        """World rotation of `joint`: its parent's, then the shortest rotation that points it at `target`."""
        parent = self._rotation(int(self.skeleton.parents[joint]))
        current = rot.rotate(parent, self._rest_vector(joint, child))
        return rot.multiply(rot.between(current, target - self._pos(joint)), parent)

    def _head(self) -> None:
        neck, head = self.joints.get("neck"), self.joints.get("head")
        if neck is None or head is None or "head" not in self.targets:
            return
        self.global_quat[neck] = self._swing(neck, head, self.targets["head"])
        self.global_quat[head] = self.global_quat[neck]
        if "left_temple" in self.targets and "right_temple" in self.targets:
            across = self.targets["left_temple"] - self.targets["right_temple"]
            neck_left = rot.rotate(self.global_quat[neck], self.left)
            swing = rot.between(neck_left, _NECK_WEIGHT * neck_left + rot.unit(across))
            self.global_quat[head] = rot.multiply(swing, self.global_quat[neck])

    def _arm(self, side: str) -> None:
        shoulder, elbow, wrist = (self.joints[f"{side}_{part}"] for part in ("shoulder", "elbow", "wrist"))
        collar, hand = self.joints.get(f"{side}_collar"), self.joints.get(f"{side}_hand")
        if collar is not None:
            self.global_quat[collar] = self._swing(collar, shoulder, self.targets[f"{side}_shoulder"])
        rest_axis = np.cross(self._rest_vector(shoulder, elbow), self.front)
        self._hinge(shoulder, elbow, wrist, f"{side}_elbow", f"{side}_wrist", rest_axis, None)
        if hand is not None and f"{side}_hand" in self.targets:
            self.global_quat[wrist] = self._swing(wrist, hand, self.targets[f"{side}_hand"])

    def _leg(self, side: str) -> None:
        hip, knee, ankle = (self.joints[f"{side}_{part}"] for part in ("hip", "knee", "ankle"))
        foot = self.joints.get(f"{side}_foot")
        across = None
        if f"{side}_foot" in self.targets:
            rear = self.targets.get(f"{side}_heel", self.targets[f"{side}_ankle"])
            shank = self.targets[f"{side}_knee"] - self.targets[f"{side}_ankle"]
            across = np.cross(shank, self.targets[f"{side}_foot"] - rear)
        self._hinge(hip, knee, ankle, f"{side}_knee", f"{side}_ankle", self.left, across)
        if foot is None or across is None:
            return
        self.global_quat[ankle] = self._swing(ankle, foot, self.targets[f"{side}_foot"])
        heels = self.skeleton.tips_m[self.skeleton.tip_parents == ankle]  # (E', 3)
        if f"{side}_heel" in self.targets and len(heels):
            rest = _basis(self._rest_vector(ankle, foot), heels[0])
            start = self._pos(ankle)
            toe, heel = self.targets[f"{side}_foot"] - start, self.targets[f"{side}_heel"] - start
            self.global_quat[ankle] = _frame_to_quat(toe, heel, rest)

    def _hinge(
        self,
        upper: int,
        middle: int,
        end: int,
        middle_role: str,
        end_role: str,
        rest_axis: Floats,
        axis_hint: Floats | None,
    ) -> None:
        """Swing both bones of a limb to their targets, and twist the upper so that its hinge bends there."""
        swing = self._swing(upper, middle, self.targets[middle_role])
        bone = rot.unit(self.targets[middle_role] - self._pos(upper))
        lower = rot.unit(self.targets[end_role] - self.targets[middle_role])
        axis = np.cross(bone, lower)  # (T, 3), its length is sin(bend)
        if axis_hint is not None:
            axis = axis + _FOOT_WEIGHT * rot.unit(axis_hint)
        bone_rest = rot.unit(self._rest_vector(upper, middle))
        rest_axis = rot.unit(rest_axis - bone_rest * (rest_axis @ bone_rest))
        untwisted = rot.rotate(swing, rest_axis)
        perpendicular = np.cross(bone, untwisted)
        twist = smoothed_angle(
            np.sum(axis * untwisted, axis=-1) + _REST_WEIGHT,
            np.sum(axis * perpendicular, axis=-1),
            self.twist_smoothing * _REST_WEIGHT,
        )
        self.global_quat[upper] = rot.multiply(rot.from_rotvec(bone * twist[:, None]), swing)
        self.global_quat[middle] = self._swing(middle, end, self.targets[end_role])


def _basis(first: Floats, second: Floats) -> Floats:
    """Right-handed orthonormal columns (..., 3, 3): along `first`, then towards `second`."""
    x = rot.unit(first)
    y = rot.unit(second - x * np.sum(x * second, axis=-1, keepdims=True))
    return np.stack([x, y, np.cross(x, y)], axis=-1)


def _frame_to_quat(first: Floats, second: Floats, rest: Floats) -> Floats:
    return rot.from_matrix(_basis(first, second) @ rest.T)


# The canonical hierarchy with bone lengths measured from marker positions.


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
        return membership / membership.sum(axis=1, keepdims=True)


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
    return path[:, None] + (pos_m - middle[:, None]) * size[:, None, None]


def _bone_lengths_m(pos_m: Floats, roles: Sequence[str]) -> Floats:
    index = list(roles).index
    pairs = [(f"{s}_{a}", f"{s}_{b}") for s in ("left", "right") for a, b in _CLUSTERED_BONES]
    vectors = np.stack([pos_m[:, index(a)] - pos_m[:, index(b)] for a, b in pairs], axis=1)
    return np.linalg.norm(vectors, axis=-1)  # (T, L)


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
    rest = _rest_trunk(measured)
    tips: dict[str, list[Floats]] = {}
    for side, sign in (("left", 1.0), ("right", -1.0)):
        _rest_leg(measured, side, rest, tips)
        _rest_arm(measured, side, sign, rest, tips)
    tips["head"] = [np.array([0.0, 0.12, 0.0])]
    return _assemble(rest, tips)


def _length(measured: Mapping[str, Floats], a: str, b: str) -> float:
    return float(np.mean(np.linalg.norm(measured[a] - measured[b], axis=-1)))


def _rest_trunk(measured: Mapping[str, Floats]) -> dict[str, Floats]:
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


def _rest_leg(
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


def _rest_arm(
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
