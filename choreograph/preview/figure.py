"""`Figure`: a mannequin's mesh bound to a skeleton's joints, and what moves it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from choreograph.errors import ParameterError
from choreograph.motion import rotations as rot
from choreograph.motion.motion import Motion
from choreograph.motion.rigs import joint_roles
from choreograph.motion.skeleton import Skeleton
from choreograph.preview import _anatomy as anatomy
from choreograph.preview._bind import bind_pose
from choreograph.preview._loft import Piece, vertex_normals

Floats = NDArray[np.float64]

# What a vertex belongs to: `Figure.parts` are indices into this, rows of `Figure.palette`.
PARTS = (
    "torso", "pelvis", "head", "hair", "left_arm", "right_arm", "left_hand", "right_hand", "left_leg",
    "right_leg", "left_shoe", "right_shoe", "extra",
)  # fmt: skip
_PALETTE = {
    "torso": "#46506b", "pelvis": "#3a425a", "head": "#e9c6a4", "hair": "#4a3a33",
    "left_arm": "#f0a578", "right_arm": "#7fb3c8", "left_hand": "#e9c6a4", "right_hand": "#e9c6a4",
    "left_leg": "#d98a5c", "right_leg": "#5b95ae", "left_shoe": "#f3ede4", "right_shoe": "#f3ede4",
    "extra": "#9a9aa6",
}  # fmt: skip
_LEG_OF_HEIGHT = 0.462  # hip to ankle over the body's height
_SHORTEST_BONE_M = 0.01  # a shorter one is not drawn


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


def build_figure(skeleton: Skeleton, motion: Motion | None = None) -> Figure:
    """A mannequin of 1.5 to 6 thousand triangles around the joints of any skeleton.

    Joints that play no part of the body (`rigs.joint_roles`) get a tapered bone each; a skeleton without
    a known body is made of such bones alone. `motion`, on the same skeleton, is used only if the rest pose
    does not stand: it tells how the joints are turned against a standing body's.
    """
    try:
        roles = joint_roles(skeleton)
    except ParameterError:
        return _of_bones(skeleton)
    pos_m, quat = bind_pose(skeleton, motion)
    body = _body(skeleton, roles, pos_m, quat)
    index = {name: PARTS.index(name) for name in PARTS}
    pieces = [
        anatomy.trunk(body, index["torso"], index["pelvis"]),
        anatomy.neck(body, index["head"]),
        *anatomy.head(body, index["head"], index["hair"]),
    ]
    for side in ("left", "right"):
        pieces.append(anatomy.yoke(body, side, index["torso"]))
        pieces += anatomy.limb(body, side, ("shoulder", "elbow", "wrist"), index[f"{side}_arm"])
        pieces += anatomy.limb(body, side, ("hip", "knee", "ankle"), index[f"{side}_leg"])
        pieces += anatomy.hand(body, side, index[f"{side}_hand"])
        pieces.append(anatomy.shoe(body, side, index[f"{side}_shoe"]))
    pieces += _extra_bones(skeleton, pos_m, quat, _clothed(skeleton, roles), 0.011 * body.scale)
    return _assembled(pieces, pos_m, quat)


def _body(skeleton: Skeleton, roles: dict[str, int], pos_m: Floats, quat: Floats) -> anatomy.Body:
    legs = [
        float(np.linalg.norm(np.diff(pos_m[[roles[f"{side}_{part}"] for part in ("hip", "knee", "ankle")]],
                                     axis=0), axis=1).sum())
        for side in ("left", "right")
    ]  # fmt: skip
    scale = max(sum(legs) / 2 / _LEG_OF_HEIGHT, 1e-3) / 1.70
    chest = roles.get("spine3", roles.get("spine1", roles["pelvis"]))
    spine = [chest]
    while spine[-1] not in (roles["pelvis"], 0):
        spine.append(int(skeleton.parents[spine[-1]]))
    across = sum(pos_m[roles[f"left_{part}"]] - pos_m[roles[f"right_{part}"]] for part in ("hip", "shoulder"))
    front = np.cross(across, anatomy.UP)
    front = front / max(np.linalg.norm(front), 1e-9)
    return anatomy.Body(pos_m, roles, tuple(spine[::-1]), front, scale, _sole_m(skeleton, roles, pos_m, quat))


def _sole_m(skeleton: Skeleton, roles: dict[str, int], pos_m: Floats, quat: Floats) -> float:
    """Height of the floor under the bind pose: the lowest point of the feet that the skeleton has."""
    owners = [
        roles[f"{side}_{part}"]
        for side in ("left", "right")
        for part in ("ankle", "foot")
        if f"{side}_{part}" in roles
    ]
    heights = list(pos_m[owners, 1])
    for owner, tip in zip(skeleton.tip_parents, skeleton.tips_m, strict=True):
        if owner in owners:
            heights.append(pos_m[owner, 1] + rot.rotate(quat[owner], tip)[1])
    return float(min(heights))


def _clothed(skeleton: Skeleton, roles: dict[str, int]) -> set[int]:
    """Joints that the body's own pieces cover: those with a role, and all above them."""
    covered: set[int] = set()
    for joint in roles.values():
        while joint >= 0 and joint not in covered:
            covered.add(joint)
            joint = int(skeleton.parents[joint])
    return covered


def _extra_bones(
    skeleton: Skeleton, pos_m: Floats, quat: Floats, covered: set[int], thickest_m: float
) -> list[Piece]:
    """A tapered bone to each joint that is not covered, and to the bone ends hanging on those."""
    ends = [(int(skeleton.parents[j]), pos_m[j]) for j in range(1, skeleton.n_joints) if j not in covered]
    for owner, tip in zip(skeleton.tip_parents, skeleton.tips_m, strict=True):
        if owner not in covered:
            ends.append((int(owner), pos_m[owner] + rot.rotate(quat[owner], tip)))
    part, bones = PARTS.index("extra"), []
    for parent, end in ends:
        length = float(np.linalg.norm(end - pos_m[parent]))
        if length > _SHORTEST_BONE_M:
            wide = min(thickest_m, 0.25 * length)
            bones.append(anatomy.taper(pos_m[parent], end, wide, 0.6 * wide, parent, part, sides=6, rings=2))
    return bones


def _of_bones(skeleton: Skeleton) -> Figure:
    pos_m, quat = skeleton.rest_pos_m(), np.tile(rot.IDENTITY, (skeleton.n_joints, 1))
    size_m = max(float(np.ptp(pos_m, axis=0).max()), 10 * _SHORTEST_BONE_M)
    bones = _extra_bones(skeleton, pos_m, quat, set(), 0.03 * size_m)
    knob = anatomy.knob(
        pos_m[0], 0.02 * size_m, 0, PARTS.index("extra")
    )  # something to see, whatever the bones
    return _assembled([knob, *bones], pos_m, quat)


def _assembled(pieces: list[Piece], pos_m: Floats, quat: Floats) -> Figure:
    """One mesh of all pieces; a vertex where two parts meet is one of each."""
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
    colours = [[int(_PALETTE[part][i : i + 2], 16) / 255 for i in (1, 3, 5)] for part in PARTS]
    return Figure(
        vertices_m=vertices[keep].astype(np.float32),
        normals=normals[keep].astype(np.float32),
        triangles=corner_index.reshape(-1, 3).astype(np.int32),
        joints=np.concatenate([piece.joints for piece in pieces])[keep].astype(np.int32),
        weights=np.concatenate([piece.weights for piece in pieces])[keep].astype(np.float32),
        parts=unique[:, 1].astype(np.int32),
        palette=np.array(colours, np.float32),
        bind_pos_m=pos_m,
        bind_quat=quat,
    )


def skin_matrices(figure: Figure, pos_m: Floats, global_quat: Floats) -> NDArray[np.float32]:
    """Per joint the matrix (..., J, 3, 4) that takes a bind-pose vertex (x, y, z, 1) to the world.

    `pos_m` (..., J, 3) and `global_quat` (..., J, 4) are `kinematics.forward`'s result.
    """
    turns = rot.to_matrix(rot.multiply(global_quat, rot.invert(figure.bind_quat)))  # (..., J, 3, 3)
    shifts = pos_m - (turns @ figure.bind_pos_m[..., None])[..., 0]  # (..., J, 3)
    return np.concatenate([turns, shifts[..., None]], axis=-1).astype(np.float32)  # (..., J, 3, 4)
