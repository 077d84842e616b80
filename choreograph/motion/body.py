"""The 21 body joints that features, networks and costs use, poses in the root frame, and mirror images.

Left and right are exchanged in a mirror image, as a dancer shows who faces another one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np
import scipy
from numpy.typing import NDArray

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats, Indices, frame_blocks
from choreograph.core.timebase import frame_times_s
from choreograph.motion import rotations as rot
from choreograph.motion.bone_map import joint_roles
from choreograph.motion.kinematics import forward
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import CANONICAL_JOINTS, CANONICAL_PARENTS, Skeleton

# The 21 body joints that features, networks and costs use, on any skeleton.


# The canonical body without its hands and its middle spine joint.
BODY_JOINTS = tuple(j for j in CANONICAL_JOINTS if j not in ("spine2", "left_hand", "right_hand"))


def _body_parents() -> tuple[int, ...]:
    parents = []
    for name in BODY_JOINTS:
        parent = CANONICAL_PARENTS[CANONICAL_JOINTS.index(name)]
        while parent >= 0 and CANONICAL_JOINTS[parent] not in BODY_JOINTS:
            parent = CANONICAL_PARENTS[parent]
        parents.append(BODY_JOINTS.index(CANONICAL_JOINTS[parent]) if parent >= 0 else -1)
    return tuple(parents)


BODY_PARENTS = _body_parents()
LEFT_RIGHT = tuple(
    (BODY_JOINTS.index(name), BODY_JOINTS.index(name.replace("left", "right")))
    for name in BODY_JOINTS
    if name.startswith("left")
)


def body_indices(skeleton: Skeleton, joints: Sequence[str] = BODY_JOINTS) -> list[int]:
    """Indices in a rig of the 21 body joints, or of other canonical `joints`.

    A joint that the rig lacks is replaced by its nearest ancestor (in the canonical body) that the rig
    has. Raises `ParameterError` if the rig's names are unknown.
    """
    roles = joint_roles(skeleton)
    indices = []
    for name in joints:
        while name not in roles:
            name = CANONICAL_JOINTS[CANONICAL_PARENTS[CANONICAL_JOINTS.index(name)]]
        indices.append(roles[name])
    return indices


def body_pos_m(motion: Motion, names: Sequence[str] = BODY_JOINTS) -> Floats:
    """World positions of the 21 body joints, or of others (see `body_indices`), (T, 21, 3) in metres."""
    joints = body_indices(motion.skeleton, names)
    pos_m = np.empty((motion.n_frames, len(joints), 3))
    for block in frame_blocks(motion.n_frames):
        root_pos_m, local_quat = motion.root_pos_m[block], motion.local_quat[block]
        pos_m[block] = forward(motion.skeleton, root_pos_m, local_quat)[0][:, joints]
    return pos_m


def checked_body_pos_m(body_pos_m: NDArray[np.floating], fps: float = 1.0) -> Floats:
    """The positions as float64. Raises `ParameterError` unless finite, (T, 21, 3), and `fps` positive."""
    pos = np.asarray(body_pos_m, np.float64)
    if pos.ndim != 3 or pos.shape[1:] != (len(BODY_JOINTS), 3) or len(pos) == 0:
        raise ParameterError(f"expected body positions (T, {len(BODY_JOINTS)}, 3), got {pos.shape}")
    if not np.isfinite(pos).all():
        raise ParameterError("expected finite body positions, got nan or infinity")
    if not (np.isfinite(fps) and fps > 0):
        raise ParameterError(f"expected a positive frame rate, got {fps}")
    return pos


def body_pos_at(body_pos_m: NDArray[np.floating], fps: float, target_fps: float) -> Floats:
    """Body positions (T, 21, 3) resampled by cubic splines, (T', 21, 3), without frames after the last one.

    Raises `ParameterError` as `checked_body_pos_m` does.
    """
    pos = checked_body_pos_m(body_pos_m, fps)
    if fps == target_fps or len(pos) == 1:
        return pos
    times_s = frame_times_s(len(pos), fps)
    n_frames = int(times_s[-1] * target_fps + 1e-6) + 1
    return scipy.interpolate.CubicSpline(times_s, pos)(
        np.minimum(frame_times_s(n_frames, target_fps), times_s[-1])
    )


def mirrored(body_pos_m: NDArray[np.floating]) -> NDArray[np.floating]:
    """Body positions (..., 21, 3) mirrored: X is negated, and left and right joints are swapped."""
    order = np.arange(len(BODY_JOINTS))
    for left, right in LEFT_RIGHT:
        order[[left, right]] = right, left
    return body_pos_m[..., order, :] * np.array([-1.0, 1.0, 1.0])


# Heading and ground position of a body, and poses relative to them (in the root frame).


_PELVIS = BODY_JOINTS.index("pelvis")
_ACROSS = tuple(
    (BODY_JOINTS.index(f"left_{part}"), BODY_JOINTS.index(f"right_{part}")) for part in ("hip", "shoulder")
)


def heading_rad(body_pos_m: Floats) -> Floats:
    """Heading (...) of body positions (..., 21, 3): 0 faces +Z, positive turns towards +X.

    Forward is perpendicular to the mean of hip and shoulder axes, on the ground.
    """
    left, right = (list(side) for side in zip(*_ACROSS, strict=True))
    across = (body_pos_m[..., left, :] - body_pos_m[..., right, :]).sum(axis=-2)  # (..., 3)
    return np.arctan2(-across[..., 2], across[..., 0])  # left is +X when facing +Z


def front_rad(headings_rad: Floats) -> float:
    """The direction that a dancer with these headings (T,) faces most: their circular median.

    It is the one of 72 directions to which the mean distance of the headings is least.
    """
    directions = np.arange(72) * (2 * np.pi / 72)
    away = np.abs((headings_rad[::4, None] - directions + np.pi) % (2 * np.pi) - np.pi)
    return float((directions[int(np.argmin(away.mean(axis=0)))] + np.pi) % (2 * np.pi) - np.pi)


def ground_pos_m(body_pos_m: Floats) -> Floats:
    """Pelvis position projected on the ground, (..., 3) with Y = 0, of body positions (..., 21, 3)."""
    return body_pos_m[..., _PELVIS, :] * np.array([1.0, 0.0, 1.0])


def to_root_frame(body_pos_m: Floats, vectors: Floats | None = None) -> Floats:
    """Poses (..., 21, 3) at heading 0 above the origin, or `vectors` (velocities), which are only rotated."""
    turn_rad = -heading_rad(body_pos_m)[..., None]  # (..., 1)
    if vectors is not None:
        return rot.rotate_about_y(turn_rad, vectors)
    return rot.rotate_about_y(turn_rad, body_pos_m - ground_pos_m(body_pos_m)[..., None, :])


def clips_to_root_frame(body_pos_m: Floats) -> Floats:
    """Clips (..., T, 21, 3), each moved rigidly to heading 0 in the middle frame and mean ground position 0.

    Travel and turning within a clip are kept.
    """
    middle = body_pos_m[..., body_pos_m.shape[-3] // 2, :, :]  # (..., 21, 3)
    turn_rad = -heading_rad(middle)[..., None, None]  # (..., 1, 1)
    mean_ground = ground_pos_m(body_pos_m).mean(axis=-2)[..., None, None, :]  # (..., 1, 1, 3)
    return rot.rotate_about_y(turn_rad, body_pos_m - mean_ground)


# Mirror images of motions on any skeleton.


_POS_SIGNS = np.array([-1.0, 1.0, 1.0])
_QUAT_SIGNS = np.array([1.0, 1.0, -1.0, -1.0])  # a rotation seen in a mirror across X


def mirrored_motion(motion: Motion) -> Motion:
    """The mirror image of a motion: X is negated, and left and right joints exchange their rotations.

    It is exact for a skeleton whose left and right have equal lengths. The heading 0 remains. Raises
    `ParameterError` if the joints of arms and legs cannot be found.
    """
    order = mirrored_joints(motion.skeleton)
    return replace(
        motion,
        root_pos_m=motion.root_pos_m * _POS_SIGNS,
        local_quat=motion.local_quat[:, order] * _QUAT_SIGNS,
    )


@lru_cache(maxsize=16)
def mirrored_joints(skeleton: Skeleton) -> Indices:
    """The joint (J,) on the other side of each joint, or the joint itself in the middle."""
    order = np.arange(skeleton.n_joints)
    roles = joint_roles(skeleton)
    pairs = [(name, name.replace("left_", "right_", 1)) for name in (*skeleton.names, *roles)]
    for one, other in pairs:
        if one == other:
            continue
        for known in (roles, dict(zip(skeleton.names, range(skeleton.n_joints), strict=True))):
            if one in known and other in known:
                order[[known[one], known[other]]] = known[other], known[one]
    return order
