"""Fréchet distances: FPD of poses and FMD of movements (ChoreoGraph, section 4.2.1, Table 1).

Conventions: a pose is the local rotations of the joints that all motions share by role, as exponential maps
(rotation vectors in radians, angle at most π) at 20 Hz, not normalised. A movement is three consecutive poses
of one motion. All poses of a set form one Gaussian, so long dances weigh more. The distance is
‖m - m'‖² + tr(C + C' - 2 (C C')^½), in rad². Lower is closer.

Root: its position and heading (the rotation about the vertical) are left out. Its lean stays in as the
rotation of the pelvis. So FPD does not depend on where the dancer is, and FMD depends neither on travelling
nor on turning. The paper does not say what it did with the root. Transflower's code, which it follows, keeps
height and steps.

Skeletons: a joint's rotation is relative to its nearest shared ancestor, so extra joints in between do no
harm, and bone lengths do not matter. Rest poses must agree, because the same pose has other rotations
otherwise. Rigs with different rest poses raise an error: retarget one side first.

Regularisation: none. tr (C C')^½ is the sum of the singular values of FᵀF' with C = FFᵀ, which is exact for
singular covariances too, where the usual matrix square root fails. Small samples still bias the distance
upwards, more so with fewer samples per dimension (3 per joint, 9 for FMD), and the frames of one dance are
hardly independent. So compare sets of equal size, and report the distance between `halves` of the
real dances with it. The paper's values (9.87 ± 0.01 for all systems) depend on its skeleton. We could
not reproduce their scale.

References: a distance between sets of dances means little alone. The floor is the distance between two
halves of the real dances, split by song (`halves`). The ceiling is the distance of a body that stands still,
or whose joints or frames are shuffled, from the real dances (`CHANCE`). Other distances have the same
references.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats, Indices, default_numerics
from choreograph.core.timebase import NET_FPS
from choreograph.motion import rotations as rot
from choreograph.motion.bone_map import joint_roles
from choreograph.motion.kinematics import forward
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import CANONICAL_JOINTS, CANONICAL_PARENTS, Skeleton

POSE_FPS = NET_FPS
MOVEMENT_POSES = 3
_REST_TOLERANCE_RAD = np.radians(20.0)
_LIMBS = tuple(
    (f"{side}_{joint}", f"{side}_{end}")
    for side in ("left", "right")
    for joint, end in (("shoulder", "elbow"), ("elbow", "wrist"), ("hip", "knee"), ("knee", "ankle"))
)


@dataclass(frozen=True, eq=False)
class Gaussian:
    """Mean and covariance of a set of samples."""

    mean: Floats  # (D,)
    covariance: Floats  # (D, D), of n - 1 degrees of freedom
    n_samples: int

    @cached_property
    def factor(self) -> Floats:
        """F (D, D) with FFᵀ = C. Eigenvalues that are negative through rounding count as 0."""
        values, vectors = np.linalg.eigh(self.covariance)
        result: Floats = vectors * np.sqrt(np.maximum(values, 0.0))
        return result


def fit_gaussian(samples: NDArray[np.floating]) -> Gaussian:
    """Fit a Gaussian to samples (N, D). `ParameterError` unless N is at least 2 and all are finite.

    Examples
    --------
    >>> cg.metrics.frechet.fit_gaussian(np.array([[0.0], [2.0]])).covariance
    array([[2.]])
    """
    samples = np.asarray(samples, np.float64)
    if samples.ndim != 2 or samples.shape[0] < 2 or samples.shape[1] == 0:
        raise ParameterError(f"expected samples (N, D) with N of at least 2, got {samples.shape}")
    if not np.isfinite(samples).all():
        raise ParameterError("expected finite samples, got nan or infinity")
    return Gaussian(
        samples.mean(axis=0), np.cov(samples, rowvar=False).reshape(2 * [samples.shape[1]]), len(samples)
    )


def frechet_distance(a: Gaussian, b: Gaussian) -> float:
    """Squared Fréchet (2-Wasserstein) distance between two Gaussians, in the samples' unit squared.

    It is ‖m - m'‖² + tr(C + C' - 2 (C C')^½), 0 for equal Gaussians. Lower is better. Raises `ParameterError`
    if they differ in dimension.

    Examples
    --------
    >>> samples = np.random.default_rng(0).normal(size=(100, 3))
    >>> one, moved = (cg.metrics.frechet.fit_gaussian(samples + shift) for shift in (0.0, 1.0))
    >>> round(cg.metrics.frechet.frechet_distance(one, moved), 6)
    3.0
    """
    if a.mean.shape != b.mean.shape:
        raise ParameterError(f"expected Gaussians of one dimension, got {len(a.mean)} and {len(b.mean)}")
    common = np.linalg.svd(a.factor.T @ b.factor, compute_uv=False).sum()
    spread = np.trace(a.covariance) + np.trace(b.covariance) - 2.0 * common
    return float(np.sum((a.mean - b.mean) ** 2) + max(spread, 0.0))


def validate(motions: Sequence[Motion]) -> tuple[str, ...]:
    """The joint roles that all motions share, in canonical order.

    Raises `ParameterError` if there is no motion, the joint names of a rig are unknown, or rest poses differ.

    Examples
    --------
    >>> motion, _ = cg.starter_repertoire().motion(0, 0.0, 4.0)  # 4 s of a built-in take
    >>> len(cg.metrics.frechet.validate([motion]))
    24
    """
    if len(motions) == 0:
        raise ParameterError("expected at least one motion, got none")
    skeletons = list({id(motion.skeleton): motion.skeleton for motion in motions}.values())
    roles = [joint_roles(skeleton) for skeleton in skeletons]
    for skeleton in skeletons[1:]:
        _check_rest(skeletons[0], skeleton)
    return tuple(role for role in CANONICAL_JOINTS if all(role in has for has in roles))


def poses_rad(motion: Motion, roles: Sequence[str]) -> Floats:
    """Exponential maps (T', 3 R) of the joints with these roles at 20 Hz, without position and heading.

    Examples
    --------
    >>> motion, _ = cg.starter_repertoire().motion(0, 0.0, 4.0)  # 4 s of a built-in take
    >>> cg.metrics.frechet.poses_rad(motion, ["left_knee", "right_knee"]).shape[1]
    6
    """
    motion = motion.resampled(POSE_FPS)
    joints = joint_roles(motion.skeleton)
    world = forward(motion.skeleton, motion.root_pos_m, motion.local_quat)[1]  # (T', J, 4)
    local = np.empty((motion.n_frames, len(roles), 4))
    for slot, role in enumerate(roles):
        parent = _parent_among(role, roles)
        quat = world[:, joints[role]]
        above = rot.about_y(rot.yaw(quat)) if parent is None else world[:, joints[parent]]
        local[:, slot] = rot.multiply(rot.invert(above), quat)
    return rot.to_rotvec(local).reshape(motion.n_frames, -1)


def movements_of(poses: Floats) -> Floats:
    """Each pose (T, D) of a motion with the two after it, (T - 2, 3 D). Empty if T is below 3.

    Examples
    --------
    >>> cg.metrics.frechet.movements_of(np.array([[0.0], [1.0], [2.0], [3.0]]))
    array([[0., 1., 2.],
           [1., 2., 3.]])
    """
    n = max(len(poses) - MOVEMENT_POSES + 1, 0)
    return np.concatenate([poses[i : i + n] for i in range(MOVEMENT_POSES)], axis=1)


def gaussians(motions: Sequence[Motion], roles: Sequence[str]) -> dict[str, Gaussian]:
    """The Gaussians of the poses ("fpd") and of the movements ("fmd") of motions.

    Fit the real ones once, then compare those of each song with them. Raises `ParameterError` if there are
    fewer than two movements in all.

    Examples
    --------
    >>> motion, _ = cg.starter_repertoire().motion(0, 0.0, 4.0)  # 4 s of a built-in take
    >>> cg.metrics.frechet.gaussians([motion], ["left_knee"])["fmd"].mean.shape
    (9,)
    """
    poses = [poses_rad(motion, roles) for motion in motions]
    movements = [movements_of(p) for p in poses]
    return {"fpd": fit_gaussian(np.concatenate(poses)), "fmd": fit_gaussian(np.concatenate(movements))}


def fpd(dances: Sequence[Motion], real: Sequence[Motion]) -> float:
    """Fréchet pose distance between two sets of motions, in rad². Lower is better.

    Raises as `evaluate` does.

    Examples
    --------
    >>> motion, _ = cg.starter_repertoire().motion(0, 0.0, 4.0)  # 4 s of a built-in take
    >>> round(cg.metrics.frechet.fpd([motion], [motion]), 6)  # a set against itself
    0.0
    """
    return evaluate(dances, real)["fpd"]


def fmd(dances: Sequence[Motion], real: Sequence[Motion]) -> float:
    """Fréchet movement distance between two sets of motions, in rad². Lower is better.

    Raises as `evaluate` does.

    Examples
    --------
    >>> motion, _ = cg.starter_repertoire().motion(0, 0.0, 4.0)  # 4 s of a built-in take
    >>> held = cg.metrics.frechet.still(motion, np.random.default_rng(0))
    >>> cg.metrics.frechet.fmd([held], [motion]) > cg.metrics.frechet.fmd([motion], [motion])
    True
    """
    return evaluate(dances, real)["fmd"]


@default_numerics()
def evaluate(dances: Sequence[Motion], real: Sequence[Motion]) -> dict[str, float]:
    """FPD and FMD by name, in rad². 0 for equal sets. Lower is better.

    The paper compares the dances to one song with all real ones and averages over songs. A single dance does
    not cover the variety of a whole set, so even a real dance is far from the others. Report real dances
    measured in the same way. Raises `ParameterError` as `validate` and `gaussians` do.

    Examples
    --------
    >>> motion, _ = cg.starter_repertoire().motion(0, 0.0, 4.0)  # 4 s of a built-in take
    >>> scores = cg.metrics.frechet.evaluate([motion], [motion])
    >>> {name: round(value, 6) for name, value in scores.items()}
    {'fpd': 0.0, 'fmd': 0.0}
    """
    roles = validate([*dances, *real]) if dances and real else validate(())
    ours, theirs = gaussians(dances, roles), gaussians(real, roles)
    return {name: frechet_distance(ours[name], theirs[name]) for name in ours}


def _parent_among(role: str, roles: Sequence[str]) -> str | None:
    parent = CANONICAL_PARENTS[CANONICAL_JOINTS.index(role)]
    while parent >= 0 and CANONICAL_JOINTS[parent] not in roles:
        parent = CANONICAL_PARENTS[parent]
    return CANONICAL_JOINTS[parent] if parent >= 0 else None


def _check_rest(one: Skeleton, other: Skeleton) -> None:
    for joint, end in _LIMBS:
        bones = []
        for skeleton in (one, other):
            roles, rest_m = joint_roles(skeleton), skeleton.rest_pos_m()
            bone = rest_m[roles[end]] - rest_m[roles[joint]]
            bones.append(bone / np.maximum(np.linalg.norm(bone), 1e-12))
        angle = np.arccos(np.clip(np.dot(*bones), -1.0, 1.0))
        if angle > _REST_TOLERANCE_RAD:
            raise ParameterError(
                f"expected rigs with the same rest pose, got {joint} {np.degrees(angle):.0f}° apart: "
                "retarget one side to the other's skeleton first"
            )


# References for a distance: halves of the real data as the floor, chance dances as the ceiling.


def halves(groups: Sequence[str], rng: np.random.Generator) -> tuple[Indices, Indices]:
    """Split items 0 … len(groups) - 1 into halves (N,), (N',) so that no group (song, dancer) is in both.

    Groups are drawn in random order and go to the half that has fewer items so far. Raises `ParameterError`
    if there are fewer than two groups.

    Examples
    --------
    >>> songs = ["a", "a", "b", "b"]
    >>> one, other = cg.metrics.frechet.halves(songs, np.random.default_rng(0))
    >>> {songs[i] for i in one} & {songs[i] for i in other}
    set()
    """
    names = np.asarray(groups)
    different = np.unique(names)
    if len(different) < 2:
        raise ParameterError(f"expected items of at least 2 groups to halve, got {len(different)}")
    parts: tuple[list[int], list[int]] = ([], [])
    for group in rng.permutation(different):
        min(parts, key=len).extend(np.flatnonzero(names == group).tolist())
    return np.sort(np.array(parts[0])), np.sort(np.array(parts[1]))


def still(motion: Motion, rng: np.random.Generator) -> Motion:
    """The motion frozen in one random frame.

    Examples
    --------
    >>> motion, _ = cg.starter_repertoire().motion(0, 0.0, 4.0)  # 4 s of a built-in take
    >>> held = cg.metrics.frechet.still(motion, np.random.default_rng(0))
    >>> held.n_frames == motion.n_frames, np.ptp(held.root_pos_m, axis=0)
    (True, array([0., 0., 0.]))
    """
    return motion.sampled(np.full(motion.n_frames, float(rng.integers(motion.n_frames))))


def shuffled_joints(motion: Motion, rng: np.random.Generator) -> Motion:
    """The motion with the rotations of all joints but the root permuted, in the same way in all frames.

    Examples
    --------
    >>> motion, _ = cg.starter_repertoire().motion(0, 0.0, 4.0)  # 4 s of a built-in take
    >>> shuffled = cg.metrics.frechet.shuffled_joints(motion, np.random.default_rng(0))
    >>> bool(np.allclose(shuffled.local_quat[:, 0], motion.local_quat[:, 0]))
    True
    """
    order = np.concatenate([[0], 1 + rng.permutation(motion.skeleton.n_joints - 1)])
    return replace(motion, local_quat=motion.local_quat[:, order])


def shuffled_frames(motion: Motion, rng: np.random.Generator) -> Motion:
    """The motion with its poses in random order and its root path unchanged.

    The set of poses stays the same at this rate only: resample before shuffling, not after.

    Examples
    --------
    >>> motion, _ = cg.starter_repertoire().motion(0, 0.0, 4.0)  # 4 s of a built-in take
    >>> shuffled = cg.metrics.frechet.shuffled_frames(motion, np.random.default_rng(0))
    >>> bool(np.allclose(shuffled.root_pos_m, motion.root_pos_m))
    True
    """
    quat = motion.local_quat[rng.permutation(motion.n_frames)]
    return replace(motion, local_quat=rot.make_continuous(quat))


CHANCE: Mapping[str, Callable[[Motion, np.random.Generator], Motion]] = {
    "still": still,
    "joints shuffled": shuffled_joints,
    "frames shuffled": shuffled_frames,
}
