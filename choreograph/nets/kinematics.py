"""Differentiable forward kinematics: local rotations of any rig to body positions."""

from __future__ import annotations

import torch
from torch import Tensor

from choreograph.motion.body import body_indices
from choreograph.motion.skeleton import Skeleton


class BodyKinematics:
    """Positions of the 21 body joints of one skeleton, for batches of poses."""

    def __init__(self, skeleton: Skeleton) -> None:
        self._offsets = torch.from_numpy(skeleton.offsets_m).float()  # (J, 3)
        self._body = body_indices(skeleton)
        needed = set(self._body)
        for joint in range(skeleton.n_joints - 1, 0, -1):
            if joint in needed:
                needed.add(int(skeleton.parents[joint]))
        depth = [0] * skeleton.n_joints
        for joint in range(1, skeleton.n_joints):
            depth[joint] = depth[skeleton.parents[joint]] + 1
        # Joints of one depth are computed together: a handful of matrix products instead of one a joint.
        self._levels = [
            ([int(skeleton.parents[j]) for j in level], level)
            for d in range(1, max(depth) + 1)
            if (level := [j for j in sorted(needed) if depth[j] == d])
        ]
        self._n_joints = skeleton.n_joints

    def body_pos_m(self, root_pos_m: Tensor, local_quat: Tensor) -> Tensor:
        """Positions (..., 21, 3) of roots (..., 3) and unit local rotations (..., J, 4)."""
        local = rotation_matrices(local_quat)  # (..., J, 3, 3)
        offsets = self._offsets.to(local)
        rotation: list[Tensor] = [local[..., 0, :, :]] * self._n_joints
        position: list[Tensor] = [root_pos_m] * self._n_joints
        for parents, joints in self._levels:
            parent_rotation = torch.stack([rotation[p] for p in parents], dim=-3)  # (..., L, 3, 3)
            parent_position = torch.stack([position[p] for p in parents], dim=-2)  # (..., L, 3)
            level_position = parent_position + (parent_rotation @ offsets[joints][..., None])[..., 0]
            level_rotation = parent_rotation @ local[..., joints, :, :]
            for i, joint in enumerate(joints):
                rotation[joint], position[joint] = level_rotation[..., i, :, :], level_position[..., i, :]
        return torch.stack([position[j] for j in self._body], dim=-2)  # (..., 21, 3)


def rotation_matrices(quat: Tensor) -> Tensor:
    """Rotation matrices (..., 3, 3) of unit quaternions (..., 4), wxyz."""
    w, x, y, z = quat.unbind(dim=-1)
    rows = [
        1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
        2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
        2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
    ]  # fmt: skip
    return torch.stack(rows, dim=-1).unflatten(-1, (3, 3))


def geodesic_rad(a: Tensor, b: Tensor) -> Tensor:
    """Angles (...) between unit quaternions (..., 4): ‖log(a⁻¹ b)‖, smooth where they agree."""
    dot = (a * b).sum(dim=-1).abs()
    # |a b*| has real part |dot|; the length of its imaginary part follows without the product.
    imaginary = (1.0 - dot.square()).clamp_min(1e-7).sqrt()
    return 2.0 * torch.atan2(imaginary, dot)
