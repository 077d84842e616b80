"""Functions shared by the networks: conversion to arrays, inference in batches, and kinematics in torch."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict
from typing import Any, ClassVar, Self

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import default_numerics, torch_imported
from choreograph.motion.body import body_indices
from choreograph.motion.skeleton import Skeleton
from choreograph.nets.configs import check_fields

torch_imported()

# Conversion of networks to arrays and back, and inference in batches.


_BATCH_SIZE = 128  # at inference


class StoredNet(nn.Module):
    """A network that a file stores as its configuration and its weights."""

    config_class: ClassVar[type]
    config: Any  # of `config_class`

    def to_arrays(self) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
        """Weights by name, and the configuration as a plain dictionary."""
        return {n: v.detach().cpu().numpy() for n, v in self.state_dict().items()}, asdict(self.config)

    @classmethod
    @default_numerics()
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]], config: Mapping[str, Any]) -> Self:
        """The network of `to_arrays`. Raises `ParameterError` if weights and config disagree."""
        config = cls.config_class(**check_fields(cls.config_class, config))
        mismatch = ParameterError(
            f"expected weights of the {cls.__name__} configured, got other shapes: a damaged file"
        )
        try:
            # Shapes alone: a configuration may claim more than memory holds, and weights are not drawn.
            with torch.device("meta"):
                net = cls(config)
        except (RuntimeError, ValueError, TypeError, IndexError, ArithmeticError) as error:
            raise ParameterError(f"{mismatch} ({str(error).splitlines()[0][:80]})") from error
        expected = net.state_dict()
        if {key: tuple(value.shape) for key, value in expected.items()} != {
            key: np.shape(value) for key, value in arrays.items()
        }:
            raise mismatch
        weights = {key: torch.from_numpy(np.array(value)) for key, value in arrays.items()}
        weights = {key: value.to(expected[key].dtype) for key, value in weights.items()}
        net.load_state_dict(weights, assign=True)
        return net.eval()

    def _in_batches(self, n: int, infer: Callable[[slice], Tensor], *row_shape: int) -> NDArray[np.float32]:
        """Rows (n, ...) inferred batch by batch. `row_shape` is needed for n = 0."""
        self.eval()
        with torch.no_grad():
            parts = [infer(slice(i, i + _BATCH_SIZE)).numpy() for i in range(0, n, _BATCH_SIZE)]
        return np.concatenate(parts) if parts else np.zeros((0, *row_shape), np.float32)


# Differentiable forward kinematics: local rotations of any rig to body positions.


def in_float32(values: Tensor) -> torch.autocast:
    """A context without the mixed precision of a training, for the device of `values`."""
    return torch.autocast(values.device.type, enabled=False)


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
        # Joints of one depth are computed together, which takes a few matrix products instead of one per
        # joint.
        self._levels = [
            ([int(skeleton.parents[j]) for j in level], level)
            for d in range(1, max(depth) + 1)
            if (level := [j for j in sorted(needed) if depth[j] == d])
        ]
        self._n_joints = skeleton.n_joints

    def body_pos_m(self, root_pos_m: Tensor, local_quat: Tensor) -> Tensor:
        """Positions (..., 21, 3) of roots (..., 3) and unit local rotations (..., J, 4)."""
        with in_float32(local_quat):
            return self._body_pos_m(root_pos_m, rotation_matrices(local_quat))

    def _body_pos_m(self, root_pos_m: Tensor, local: Tensor) -> Tensor:
        """Positions (..., 21, 3) of roots (..., 3) and local rotation matrices (..., J, 3, 3)."""
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
    return torch.stack(rows, dim=-1).reshape(*quat.shape[:-1], 3, 3)


def geodesic_rad(a: Tensor, b: Tensor) -> Tensor:
    """Angles (...) between unit quaternions (..., 4): ‖log(a⁻¹ b)‖, smooth where they agree."""
    dot = (a * b).sum(dim=-1).abs()
    # |a b*| has real part |dot|. The length of its imaginary part follows without the product.
    imaginary = (1.0 - dot.square()).clamp_min(1e-7).sqrt()
    return 2.0 * torch.atan2(imaginary, dot)
