"""`Rig`: the bones of a character as its file has them, and how they lie in the bind pose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from choreograph.motion import rotations as rot
from choreograph.motion.rig_structure import PosedBones

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Rig:
    """Bones, every parent before its children; there may be several roots.

    The bind pose is the one that the skin was bound in, which is where rotations are measured from; the rest
    transforms are what the file says of each bone against its parent, and may be of another pose.
    """

    names: tuple[str, ...]  # (B,)
    parents: NDArray[np.int64]  # (B,) -1 for a root
    bind_pos_m: Floats  # (B, 3) in the world, Y up
    bind_quat: Floats  # (B, 4) in the world, wxyz
    rest_translation: Floats  # (B, 3) against the parent, in the parent's units
    rest_quat: Floats  # (B, 4)
    rest_scale: Floats  # (B, 3)
    floor_m: float  # height of the lowest point of the skin in the bind pose

    @property
    def n_bones(self) -> int:
        """Number of bones B."""
        return len(self.names)

    def rest_world(self) -> Floats:
        """World matrices (B, 4, 4) of the rest transforms."""
        return world_matrices(self.parents, self.rest_translation, self.rest_quat, self.rest_scale)

    @property
    def posed(self) -> PosedBones:
        """The bones in the bind pose."""
        return PosedBones(self.names, self.parents, self.bind_pos_m)


def distinct(names: Sequence[str]) -> tuple[str, ...]:
    """The names, those that repeat with their place: "arm", "arm #7"."""
    taken = set(names)
    seen: set[str] = set()
    found = []
    for place, name in enumerate(names):
        own = name
        while own in seen or (own != name and own in taken):
            own = f"{own} #{place}"
        seen.add(own)
        found.append(own)
    return tuple(found)


def world_matrices(parents: NDArray[np.int64], translation: Floats, quat: Floats, scale: Floats) -> Floats:
    """World matrices (B, ..., 4, 4) of bones from their transforms (B, ..., D) against their parents."""
    local = matrices(translation, quat, scale)
    world = np.empty_like(local)
    for bone, parent in enumerate(parents):
        world[bone] = local[bone] if parent < 0 else world[parent] @ local[bone]
    return world


def matrices(translation: Floats, quat: Floats, scale: Floats) -> Floats:
    """Matrices (..., 4, 4) of translations (..., 3), rotations (..., 4) and scales (..., 3)."""
    matrix = np.zeros((*quat.shape[:-1], 4, 4))
    matrix[..., :3, :3] = rot.to_matrix(quat) * scale[..., None, :]
    matrix[..., :3, 3] = translation
    matrix[..., 3, 3] = 1.0
    return matrix


def rotations_of(matrix: Floats) -> Floats:
    """The rotations (..., 4) nearest to the upper left of matrices (..., 4, 4) that may scale."""
    left, _, right = np.linalg.svd(matrix[..., :3, :3])
    proper = left @ right
    flip = np.ones((*proper.shape[:-2], 3))
    flip[..., 2] = np.sign(np.linalg.det(proper))  # a mirrored bone has no rotation: the nearest one
    return rot.from_matrix((left * flip[..., None, :]) @ right)
