"""Rigs in glTF documents: bones, bind matrices and points of the skin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.core.errors import FormatError
from choreograph.core.numerics import Floats, descendants
from choreograph.formats.gltf_document import MAX_ENTRIES, GltfDocument
from choreograph.motion import rotations as rot
from choreograph.motion.bone_map import PosedBones
from choreograph.motion.skeleton import MAX_JOINTS

# The bones of a character.


@dataclass(frozen=True, eq=False)
class Rig:
    """Bones, every parent before its children. There may be several roots.

    Rotations are measured from the bind pose, in which the skin was bound. The rest transforms are those of
    the nodes in the file, which may be in another pose.
    """

    names: tuple[str, ...]  # (B,)
    parents: NDArray[np.int64]  # (B,) -1 for a root
    bind_pos_m: Floats  # (B, 3) in the world, Y up
    bind_quat: Floats  # (B, 4) in the world, wxyz
    rest_translation: Floats  # (B, 3) from the parent, in its units
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

    def below(self, top: int) -> tuple[list[int], NDArray[np.int64], Floats]:
        """The bones (J,) from one down as joints of a skeleton: their parents (J,) and offsets (J, 3)."""
        bones = descendants(self.parents, top)
        joint_of = {bone: joint for joint, bone in enumerate(bones)}
        parents = np.array([-1, *(joint_of[int(self.parents[bone])] for bone in bones[1:])])
        offsets_m = self.bind_pos_m[bones].copy()
        offsets_m[1:] -= self.bind_pos_m[self.parents[bones[1:]]]
        return bones, parents, offsets_m


def world_matrices(parents: NDArray[np.int64], translation: Floats, quat: Floats, scale: Floats) -> Floats:
    """World matrices (B, ..., 4, 4) of bones from their local transforms (B, ..., D)."""
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
    """The rotations (..., 4) nearest to matrices (..., 4, 4), which may have scale."""
    left, _, right = np.linalg.svd(matrix[..., :3, :3])
    proper = left @ right
    flip = np.ones((*proper.shape[:-2], 3))
    flip[..., 2] = np.sign(np.linalg.det(proper))  # the nearest rotation of a mirrored bone
    return rot.from_matrix((left * flip[..., None, :]) @ right)


# Nodes, skins and bind matrices to a `Rig`.


MAX_BONES = MAX_JOINTS
_MAX_SKIN_JOINTS = 1 << 18  # of all skins. Every mesh on a body may have its own
_SAME = 0.01  # of the scale, within which joints agree on the transform of the skin
_SMALLEST = 1e-6  # scale of a bone
_LARGEST = 1e15  # position of a bone in any unit, from which further results are finite
_MAX_DEPTH = 512


@dataclass(frozen=True, eq=False)
class GltfRig:
    """A rig and its nodes in the document."""

    rig: Rig
    nodes: tuple[int, ...]  # (B,) of the document
    human_bones: dict[str, int]  # bone by its name in VRM, empty for other files
    skins: tuple[SkinInWorld, ...] = ()


@dataclass(frozen=True, eq=False)
class SkinInWorld:
    """A skin of the document: its joints as bones, and the transform of its space in the bind pose."""

    bones: tuple[int, ...]  # (J,)
    matrix: Floats  # (4, 4)


def read_rig(document: GltfDocument) -> GltfRig:
    """The rig of a document: the joints of its skins, or its animated nodes if it has no skin.

    Raises `FormatError` if the document is damaged, or has no skeleton or over 4096 bones.
    """
    parents = _node_parents(document)
    joints = _joints(document)
    order = _order(document, sorted({joint for of_skin in joints for joint in of_skin}), parents)
    bone_of = {node: bone for bone, node in enumerate(order)}
    entries = [document.entry("nodes", node) for node in order]
    local = [_local(entry, document.name) for entry in entries]
    of_bones = np.array([bone_of.get(parents.get(node, -1), -1) for node in order])
    names = tuple(str(entry.get("name", f"node {node}")) for entry, node in zip(entries, order, strict=True))
    translation, quat, scale = (np.array([part[i] for part in local]) for i in range(3))
    world = world_matrices(of_bones, translation, quat, scale)
    bind, boxes = world.copy(), _boxes_of_skins(document)
    lowest_m: list[float] = []
    skins = []
    for index, of_skin in enumerate(joints if document.json.get("skins") else []):
        own = [bone_of[node] for node in of_skin]
        inverse = _inverse_binds(document, index, len(own))
        in_world = _skin_in_world(world, own, inverse, int(of_bones[min(own)]))
        bind[own] = in_world @ np.linalg.inv(inverse)
        lowest_m += [
            float((corners @ in_world[:3, :3].T + in_world[:3, 3])[:, 1].min()) for corners in boxes[index]
        ]
        skins.append(SkinInWorld(tuple(own), in_world))
    if not (np.abs(bind) < _LARGEST).all():
        raise FormatError(
            f"{document.name}: expected bones at finite positions, got some that are too far: damaged?"
        )
    floor_m = min(lowest_m, default=float(bind[:, 1, 3].min()))
    rig = Rig(names, of_bones, bind[:, :3, 3], rotations_of(bind), translation, quat, scale, floor_m)
    human = {name: bone_of[node] for name, node in _human_bones(document).items() if node in bone_of}
    return GltfRig(rig, tuple(order), human, tuple(skins))


def _joints(document: GltfDocument) -> list[list[int]]:
    """The joints of every skin, or the animated nodes. Raises `FormatError` if there are none."""
    groups = [skin.get("joints", []) for skin in document.json.get("skins", [])]
    if not groups:
        animations = document.json.get("animations", [])
        targets = [c.get("target", {}) for a in animations for c in a.get("channels", [])]
        groups = [sorted({target["node"] for target in targets if "node" in target})]
    if not all(groups):
        raise FormatError(f"{document.name}: expected a skeleton, got none: export it with its bones")
    if sum(map(len, groups)) > _MAX_SKIN_JOINTS:
        raise FormatError(f"{document.name}: expected at most {_MAX_SKIN_JOINTS} joints of skins, got more")
    return groups


def _node_parents(document: GltfDocument) -> dict[int, int]:
    """The parent of every node that has one. Raises `FormatError` for two parents."""
    parents: dict[int, int] = {}
    for node, entry in enumerate(document.json.get("nodes", [])):
        for child in entry.get("children", []):
            document.entry("nodes", child)
            if child in parents:
                raise FormatError(f"{document.name}: expected one parent of each node, got two: damaged")
            parents[child] = node
    return parents


def _order(document: GltfDocument, joints: list[int], parents: dict[int, int]) -> list[int]:
    """The joints and all nodes above them, parents first."""
    paths: dict[int, int] = {}  # node -> depth
    for joint in joints:
        document.entry("nodes", joint)
        path = [joint]
        while path[-1] in parents:
            path.append(parents[path[-1]])
            if len(path) > _MAX_DEPTH:
                raise FormatError(f"{document.name}: expected bones up to {_MAX_DEPTH} deep, got deeper ones")
        paths |= {node: len(path) - 1 - i for i, node in enumerate(path)}
        if len(paths) > MAX_BONES:
            raise FormatError(f"{document.name}: expected at most {MAX_BONES} bones, got more")
    return sorted(paths, key=lambda node: (paths[node], node))


def _local(entry: dict[str, Any], name: str) -> tuple[Floats, Floats, Floats]:
    """Translation (3,), rotation (4,) `wxyz` and scale (3,) of a node."""
    if "matrix" in entry:
        matrix = np.array(entry["matrix"], np.float64).reshape(4, 4).T
        return matrix[:3, 3], rotations_of(matrix), np.linalg.norm(matrix[:3, :3], axis=0)
    quat = np.roll(np.array(entry.get("rotation", (0, 0, 0, 1)), np.float64), 1)
    if np.linalg.norm(quat) < _SMALLEST:
        raise FormatError(f"{name}: expected a rotation of each node, got a quaternion of length 0: damaged")
    translation, scale = (
        np.array(entry.get(key, default), np.float64)
        for key, default in (("translation", (0, 0, 0)), ("scale", (1, 1, 1)))
    )
    return translation, rot.normalize(quat), scale


def _inverse_binds(document: GltfDocument, skin: int, n_joints: int) -> Floats:
    """The inverse bind matrices (J, 4, 4) of a skin, identities if it has none."""
    accessor = document.entry("skins", skin).get("inverseBindMatrices")
    if accessor is None:
        return np.tile(np.eye(4), (n_joints, 1, 1))
    stated = document.entry("accessors", accessor)
    if stated.get("type") != "MAT4" or stated.get("count", 0) < n_joints:
        raise FormatError(f"{document.name}: expected a bind matrix for every joint: the file is damaged")
    inverse = document.array(accessor, most=n_joints).reshape(-1, 4, 4).transpose(0, 2, 1)
    if not np.isfinite(inverse).all() or (np.abs(np.linalg.det(inverse)) < _SMALLEST**3).any():
        raise FormatError(f"{document.name}: expected bind matrices that can be inverted: damaged")
    return inverse


def _skin_in_world(world: Floats, bones: list[int], inverse: Floats, above: int) -> Floats:
    """The transform (4, 4) from the space of a skin to the world.

    All joints agree on it if the file was saved in its bind pose. Otherwise it is that of the node above the
    first joint.
    """
    found = world[bones] @ inverse  # (J, 4, 4)
    size = max(float(np.abs(found[0, :3, :3]).max()), _SMALLEST)
    if np.abs(found[:, :3, :3] - found[0, :3, :3]).max() < _SAME * size:
        in_world: Floats = found[0]
    else:
        in_world = world[above] if above >= 0 else np.eye(4)
    return in_world


def _boxes_of_skins(document: GltfDocument) -> dict[int, list[Floats]]:
    """The corners (8, 3) of the meshes on each skin, from their bounds, in the space of the skin."""
    boxes: dict[int, list[Floats]] = {skin: [] for skin in range(len(document.json.get("skins", [])))}
    left = MAX_ENTRIES
    for node in document.json.get("nodes", []):
        if "mesh" not in node or node.get("skin") not in boxes:
            continue
        primitives = document.entry("meshes", node["mesh"]).get("primitives", [])
        left -= len(primitives)
        if left < 0:
            raise FormatError(f"{document.name}: expected at most {MAX_ENTRIES} meshes on skins, got more")
        for primitive in primitives:
            low, high = document.bounds(primitive.get("attributes", {}).get("POSITION"))
            if len(low) == len(high) == 3:
                boxes[node["skin"]].append(np.array(list(product(*zip(low, high, strict=True))), np.float64))
    return boxes


def _human_bones(document: GltfDocument) -> dict[str, int]:
    """The nodes of the bones of a VRM by their names in VRM, empty for other files."""
    extensions = document.json.get("extensions", {})
    newer = extensions.get("VRMC_vrm") or extensions.get("VRMC_vrm_animation") or {}
    bones = newer.get("humanoid", {}).get("humanBones", {})
    if bones:
        return {name: bone["node"] for name, bone in bones.items() if "node" in bone}
    older = extensions.get("VRM", {}).get("humanoid", {}).get("humanBones", [])
    return {bone["bone"]: bone["node"] for bone in older if {"bone", "node"} <= set(bone)}


# The points of the skin in the bind pose, each with the bone of the largest weight.


_ATTRIBUTES = ("POSITION", "JOINTS_0", "WEIGHTS_0")
_SHARED_BY = 4  # skins that may share the bytes of a point
_MOST = 40_000  # points of a mesh that are used, enough for the shape of a body


@dataclass(frozen=True, eq=False)
class SkinPoints:
    """Points of a skin."""

    pos_m: Floats  # (V, 3) in the world, bind pose
    bone: NDArray[np.int64]  # (V,) of the rig


def read_skin_points(document: GltfDocument, found: GltfRig) -> SkinPoints:
    """The points of all meshes on the rig, without those of compressed meshes.

    Raises `FormatError` if a mesh is damaged, or meshes share the same bytes too often.
    """
    values_left = _SHARED_BY * document.n_plausible_values
    points, bones = [np.zeros((0, 3))], [np.zeros(0, np.int64)]
    read = set()  # primitives of several materials share their points
    for node in document.json.get("nodes", []):
        skin = node.get("skin")
        if not isinstance(skin, int) or not 0 <= skin < len(found.skins) or "mesh" not in node:
            continue
        for primitive in document.entry("meshes", node["mesh"]).get("primitives", []):
            attributes = [primitive.get("attributes", {}).get(name) for name in _ATTRIBUTES]
            if (skin, *attributes) in read or None in attributes:
                continue
            read.add((skin, *attributes))
            if all(_is_plain(document, index) for index in attributes):
                values_left -= sum(document.n_values(index) for index in attributes)
                if values_left < 0:
                    raise FormatError(
                        f"{document.name}: expected data of its own for each mesh, got shared data"
                    )
                of_mesh = _points(document, attributes, found.skins[skin])
                points.append(of_mesh.pos_m)
                bones.append(of_mesh.bone)
    return SkinPoints(np.concatenate(points), np.concatenate(bones))


def _points(document: GltfDocument, attributes: Sequence[int], skin: SkinInWorld) -> SkinPoints:
    pos, joints, weights = (document.array(index) for index in attributes)
    n = len(pos)
    if pos.shape != (n, 3) or joints.shape != (n, 4) or weights.shape != (n, 4):
        raise FormatError(f"{document.name}: expected a joint and a weight for every point: damaged")
    step = -(-n // _MOST)
    pos, joints, weights = pos[::step], joints[::step].astype(int), weights[::step]
    joint = np.take_along_axis(joints, weights.argmax(axis=1)[:, None], axis=1)[:, 0]
    if joint.min() < 0 or joint.max() >= len(skin.bones) or not np.isfinite(pos).all():
        raise FormatError(f"{document.name}: expected points with joints of the skin, got others: damaged")
    return SkinPoints(pos @ skin.matrix[:3, :3].T + skin.matrix[:3, 3], np.array(skin.bones)[joint])


def _is_plain(document: GltfDocument, index: int) -> bool:
    """Whether an accessor has data. Accessors of Draco meshes do not."""
    entry = document.entry("accessors", index)
    return "bufferView" in entry or "sparse" in entry
