"""`Figure`: a mannequin's mesh bound to a skeleton's joints, and what moves it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from choreograph.motion import rotations as rot

Floats = NDArray[np.float64]

# What a vertex belongs to: `Figure.parts` are indices into this, rows of `Figure.palette`.
PARTS = (
    "torso", "pelvis", "head", "hair", "left_arm", "right_arm", "left_hand", "right_hand", "left_leg",
    "right_leg", "left_shoe", "right_shoe", "extra",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Figure:
    """A body's surface in its bind pose, and how its vertices hang on the joints of one skeleton.

    With world positions p (J, 3) and world rotations R of the joints in a pose (`kinematics.forward`),
    a vertex v of joints j and weights w is, in the world,

        sum over its two joints of  w · (R_j · inverse(bind_quat_j) · (v − bind_pos_j) + p_j)

    and a normal n is the same without positions, scaled to unit length. The bind pose stands upright
    facing +Z. Where the skeleton's rest pose does so, it is the rest pose: `bind_quat` are identities
    and `bind_pos_m` the joints' rest places. All pieces are closed surfaces: triangles seen from behind
    need not be drawn.
    """

    vertices_m: NDArray[np.float32]  # (V, 3) metres, bind pose
    normals: NDArray[np.float32]  # (V, 3) unit, pointing out of the body
    triangles: NDArray[np.int32]  # (F, 3) vertex indices, counter-clockwise seen from outside
    joints: NDArray[np.int32]  # (V, 2) joint indices of the skeleton
    weights: NDArray[np.float32]  # (V, 2) rows sum to 1
    parts: NDArray[np.int32]  # (V,) index into `PARTS`; all vertices of a triangle share it
    palette: NDArray[np.float32]  # (len(PARTS), 3) sRGB colour of each part, 0 to 1
    bind_pos_m: Floats  # (J, 3) joints' places in the bind pose
    bind_quat: Floats  # (J, 4) joints' world rotations in the bind pose, wxyz


def skin_matrices(figure: Figure, pos_m: Floats, global_quat: Floats) -> NDArray[np.float32]:
    """Per joint the matrix (..., J, 3, 4) that takes a bind-pose vertex (x, y, z, 1) to the world.

    `pos_m` (..., J, 3) and `global_quat` (..., J, 4) are `kinematics.forward`'s result.
    """
    turns = rot.to_matrix(rot.multiply(global_quat, rot.invert(figure.bind_quat)))  # (..., J, 3, 3)
    shifts = pos_m - (turns @ figure.bind_pos_m[..., None])[..., 0]  # (..., J, 3)
    return np.concatenate([turns, shifts[..., None]], axis=-1).astype(np.float32)  # (..., J, 3, 4)
