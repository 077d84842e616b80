"""`SkinnedMesh`: a mannequin bound to a skeleton's joints, and its skinning matrices."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats
from choreograph.motion import rotations as rot
from choreograph.motion.mannequin import (
    MeshPiece,
    arm,
    hand,
    head,
    knob,
    leg,
    neck,
    shoe,
    taper,
    trunk,
    vertex_normals,
)
from choreograph.motion.motion import Motion
from choreograph.motion.retargeting import standing_body
from choreograph.motion.skeleton import Skeleton, descendants

# Parts of the mannequin: `SkinnedMesh.parts` are indices into this and into the rows of its `palette`.
PARTS = (
    "torso", "pelvis", "head", "hair", "left_arm", "right_arm", "left_hand", "right_hand", "left_leg",
    "right_leg", "left_shoe", "right_shoe", "extra",
)  # fmt: skip
_PALETTE = {
    "torso": "#46506b", "pelvis": "#3a425a", "head": "#e9c6a4", "hair": "#4a3a33",
    "left_arm": "#f0a578", "right_arm": "#7fb3c8", "left_hand": "#e9c6a4", "right_hand": "#e9c6a4",
    "left_leg": "#d98a5c", "right_leg": "#5b95ae", "left_shoe": "#dad0c6", "right_shoe": "#cbd0d2",
    "extra": "#9a9aa6",
}  # fmt: skip
# Of further dancers of a scene, in place of the colours above, in turn.
_OUTFITS = (
    {"torso": "#7a3b4c", "pelvis": "#4b2a36", "left_arm": "#e0b35a", "right_arm": "#8f8bd0",
     "left_leg": "#c79545", "right_leg": "#6c68ad", "hair": "#2b2320"},
    {"torso": "#2f6b5b", "pelvis": "#27483f", "left_arm": "#e88f8a", "right_arm": "#74c0a4",
     "left_leg": "#c86f6d", "right_leg": "#4f9a80", "hair": "#8a5a32", "head": "#c99670",
     "left_hand": "#c99670", "right_hand": "#c99670"},
    {"torso": "#8a6a2f", "pelvis": "#5a4625", "left_arm": "#d9a0c8", "right_arm": "#9dbb6a",
     "left_leg": "#b577a2", "right_leg": "#77964a", "hair": "#1f1d22", "head": "#8d5f43",
     "left_hand": "#8d5f43", "right_hand": "#8d5f43"},
    {"torso": "#5a4a86", "pelvis": "#3d3460", "left_arm": "#f0c078", "right_arm": "#6fb6bd",
     "left_leg": "#d19a4f", "right_leg": "#4c8f97", "hair": "#b58a4e"},
    {"torso": "#a04f2e", "pelvis": "#5e3423", "left_arm": "#e7d2a0", "right_arm": "#7f9fd6",
     "left_leg": "#bfa56c", "right_leg": "#5c79b0", "hair": "#3a2a22", "head": "#b98058",
     "left_hand": "#b98058", "right_hand": "#b98058"},
    {"torso": "#3d6f94", "pelvis": "#2c4d67", "left_arm": "#ef9a6a", "right_arm": "#c3b3dd",
     "left_leg": "#cc7847", "right_leg": "#9482b8", "hair": "#6b4a35"},
    {"torso": "#5f7a3a", "pelvis": "#425529", "left_arm": "#d98888", "right_arm": "#86c7cf",
     "left_leg": "#b46565", "right_leg": "#5aa0aa", "hair": "#22201f", "head": "#6f4a35",
     "left_hand": "#6f4a35", "right_hand": "#6f4a35"},
)  # fmt: skip
_THICKEST_EXTRA_M = 0.010  # bones that belong to no known body part, on a 1.70 m body
_SHORTEST_BONE_M = 0.01  # a shorter one is not drawn
_FINGER_JOINTS = 4  # without a role below a wrist: a hand with so many has fingers of its own


@dataclass(frozen=True, eq=False)
class SkinnedMesh:
    """A mannequin's surface in its bind pose, with skinning weights for the joints of one skeleton.

    With world positions p (J, 3) and world rotations R of the joints in a pose (`kinematics.forward`),
    the world position of a vertex v with joints j and weights w is

        sum over its two joints of  w · (R_j · inverse(bind_quat_j) · (v − bind_pos_j) + p_j)

    A normal is transformed in the same way, without positions, and normalised. The bind pose stands upright
    and faces +Z. If the rest pose of the skeleton does so, it is the bind pose. Then `bind_quat` are
    identities and `bind_pos_m` the rest positions of the joints. All pieces are closed surfaces, so back
    faces can be culled.
    """

    vertices_m: NDArray[np.float32]  # (V, 3) metres, bind pose
    normals: NDArray[np.float32]  # (V, 3) unit, pointing out of the body
    triangles: NDArray[np.int32]  # (F, 3) vertex indices, counter-clockwise seen from outside
    joints: NDArray[np.int32]  # (V, 2) joint indices of the skeleton
    weights: NDArray[np.float32]  # (V, 2) rows sum to 1
    parts: NDArray[np.int32]  # (V,) index into `PARTS`. All vertices of a triangle share it
    palette: NDArray[np.float32]  # (len(PARTS), 3) sRGB colour of each part, 0 to 1
    bind_pos_m: Floats  # (J, 3) joints' positions in the bind pose
    bind_quat: Floats  # (J, 4) joints' world rotations in the bind pose, wxyz


def palette_of(dancer: int) -> NDArray[np.float32]:
    """The sRGB colours (len(PARTS), 3), 0 to 1, of a dancer of a scene. The first one has the usual ones."""
    named = _PALETTE | (_OUTFITS[(dancer - 1) % len(_OUTFITS)] if dancer else {})
    colours = [[int(named[part][i : i + 2], 16) / 255 for i in (1, 3, 5)] for part in PARTS]
    return np.array(colours, np.float32)


def build_mannequin(skeleton: Skeleton, motion: Motion | None = None) -> SkinnedMesh:
    """A mannequin of 1.5 to 6 thousand triangles around the joints of any skeleton.

    Joints without a role in the body (`rigs.joint_roles`) get a tapered bone each. An unknown skeleton
    is made of tapered bones alone. `motion`, on the same skeleton, is used only if the rest pose does not
    stand, to estimate the bind rotations.
    """
    try:
        body = standing_body(skeleton, motion)
    except ParameterError:
        return _bone_mannequin(skeleton)
    part = {name: index for index, name in enumerate(PARTS)}
    covered = _covered(skeleton, body.roles)
    pieces = [
        trunk(body, part["torso"], part["pelvis"], part["head"]),
        neck(body, part["head"]),
        *head(body, part["head"], part["hair"]),
    ]
    for side in ("left", "right"):
        below = set(descendants(skeleton.parents, body.roles[f"{side}_wrist"]))
        own_fingers = len(below - covered) >= _FINGER_JOINTS
        pieces += arm(body, side, part[f"{side}_arm"], part["torso"])
        pieces += leg(body, side, part[f"{side}_leg"], part["pelvis"])
        pieces += hand(body, side, part[f"{side}_hand"], fingers=not own_fingers)
        pieces.append(shoe(body, side, part[f"{side}_shoe"]))
    pieces += _extra_bones(skeleton, body.bind_pos_m, body.bind_quat, covered, _THICKEST_EXTRA_M * body.scale)
    return _merged_mesh(pieces, body.bind_pos_m, body.bind_quat)


def _covered(skeleton: Skeleton, roles: dict[str, int]) -> set[int]:
    """Joints that the body's pieces cover: those with a role, and all their ancestors."""
    covered: set[int] = set()
    for joint in roles.values():
        while joint >= 0 and joint not in covered:
            covered.add(joint)
            joint = int(skeleton.parents[joint])
    return covered


def _extra_bones(
    skeleton: Skeleton, pos_m: Floats, quat: Floats, covered: set[int], thickest_m: float
) -> list[MeshPiece]:
    """A tapered bone to each joint that is not covered, and to the bone tips of such joints."""
    ends = [(int(skeleton.parents[j]), pos_m[j]) for j in range(1, skeleton.n_joints) if j not in covered]
    for owner, tip in zip(skeleton.tip_parents, skeleton.tips_m, strict=True):
        if owner not in covered:
            ends.append((int(owner), pos_m[owner] + rot.rotate(quat[owner], tip)))
    part, bones = PARTS.index("extra"), []
    for parent, end in ends:
        length = float(np.linalg.norm(end - pos_m[parent]))
        if length > _SHORTEST_BONE_M:
            wide = min(thickest_m, 0.25 * length)
            bones.append(taper(pos_m[parent], end, wide, 0.6 * wide, parent, part, sides=6, rings=2))
    return bones


def _bone_mannequin(skeleton: Skeleton) -> SkinnedMesh:
    pos_m, quat = skeleton.rest_pos_m(), np.tile(rot.IDENTITY, (skeleton.n_joints, 1))
    size_m = max(float(np.ptp(pos_m, axis=0).max()), 10 * _SHORTEST_BONE_M)
    bones = _extra_bones(skeleton, pos_m, quat, set(), 0.03 * size_m)
    ball = knob(pos_m[0], 0.02 * size_m, 0, PARTS.index("extra"))  # something visible for any bones
    return _merged_mesh([ball, *bones], pos_m, quat)


def _merged_mesh(pieces: list[MeshPiece], pos_m: Floats, quat: Floats) -> SkinnedMesh:
    """One mesh of all pieces. A vertex on the border of two parts is duplicated."""
    starts = np.cumsum([0] + [len(piece.vertices_m) for piece in pieces])
    triangles = np.concatenate(
        [piece.triangles + start for piece, start in zip(pieces, starts[:-1], strict=True)]
    )
    vertices = np.concatenate([piece.vertices_m for piece in pieces])
    parts = np.concatenate([piece.parts for piece in pieces])  # (F,)
    normals = vertex_normals(vertices, triangles)
    corners = np.stack([triangles.ravel(), np.repeat(parts, 3)], axis=1)  # (3 F, 2)
    unique, corner_index = np.unique(corners, axis=0, return_inverse=True)
    keep = unique[:, 0]
    return SkinnedMesh(
        vertices_m=vertices[keep].astype(np.float32),
        normals=normals[keep].astype(np.float32),
        triangles=corner_index.reshape(-1, 3).astype(np.int32),
        joints=np.concatenate([piece.joints for piece in pieces])[keep].astype(np.int32),
        weights=np.concatenate([piece.weights for piece in pieces])[keep].astype(np.float32),
        parts=unique[:, 1].astype(np.int32),
        palette=palette_of(0),
        bind_pos_m=pos_m,
        bind_quat=quat,
    )


def skin_matrices(mesh: SkinnedMesh, pos_m: Floats, global_quat: Floats) -> NDArray[np.float32]:
    """Per joint the matrix (..., J, 3, 4) that takes a bind-pose vertex (x, y, z, 1) to the world.

    `pos_m` (..., J, 3) and `global_quat` (..., J, 4) are `kinematics.forward`'s result.
    """
    turns = rot.to_matrix(rot.multiply(global_quat, rot.invert(mesh.bind_quat)))  # (..., J, 3, 3)
    shifts = pos_m - (turns @ mesh.bind_pos_m[..., None])[..., 0]  # (..., J, 3)
    return np.concatenate([turns, shifts[..., None]], axis=-1).astype(np.float32)  # (..., J, 3, 4)
