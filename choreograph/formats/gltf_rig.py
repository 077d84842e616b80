"""Rigs in glTF documents: bones, bind matrices, and the points of the skin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.core.errors import FormatError
from choreograph.core.numerics import descendants
from choreograph.formats.gltf_document import MAX_ENTRIES, GltfDocument
from choreograph.motion import rotations as rot
from choreograph.motion.bone_map import PosedBones
from choreograph.motion.skeleton import MAX_JOINTS

# `Rig`: the bones of a character as its file has them, and how they lie in the bind pose.


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

    def below(self, top: int) -> tuple[list[int], NDArray[np.int64], Floats]:
        """The bones (J,) from one down as joints of a skeleton: their parents (J,) and offsets (J, 3)."""
        bones = descendants(self.parents, top)
        joint_of = {bone: joint for joint, bone in enumerate(bones)}
        parents = np.array([-1, *(joint_of[int(self.parents[bone])] for bone in bones[1:])])
        offsets_m = self.bind_pos_m[bones].copy()
        offsets_m[1:] -= self.bind_pos_m[self.parents[bones[1:]]]
        return bones, parents, offsets_m


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


# Rigs in glTF documents: nodes, skins and bind matrices to a `Rig`.


MAX_BONES = MAX_JOINTS
_MAX_SKIN_JOINTS = 1 << 18  # of all skins: meshes that are worn on one body have a skin each
_SAME = 0.01  # of the scale: joints agree within it on how the skin lies in the world
_SMALLEST = 1e-6  # scale of a bone
_LARGEST = 1e15  # place of a bone in any unit; what is computed from it stays finite
_MAX_DEPTH = 512


@dataclass(frozen=True, eq=False)
class GltfRig:
    """A rig, and where it is in its document."""

    rig: Rig
    nodes: tuple[int, ...]  # (B,) of the document
    human_bones: dict[str, int]  # the file's own names of parts of the body (VRM's) -> bone
    skins: tuple[SkinInWorld, ...] = ()


@dataclass(frozen=True, eq=False)
class SkinInWorld:
    """A skin of the document: its joints as bones, and how its own space lies in the world, bind pose."""

    bones: tuple[int, ...]  # (J,)
    matrix: Floats  # (4, 4)


def read_rig(document: GltfDocument) -> GltfRig:
    """The rig of a document: the joints of its skins, without any those nodes that are animated.

    Raises `FormatError` if it is damaged, or has no skeleton, or over 4096 bones.
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
            f"{document.name}: expected bones in reach, got some that are endlessly far: damaged"
        )
    floor_m = min(lowest_m, default=float(bind[:, 1, 3].min()))
    rig = Rig(names, of_bones, bind[:, :3, 3], rotations_of(bind), translation, quat, scale, floor_m)
    human = {name: bone_of[node] for name, node in _human_bones(document).items() if node in bone_of}
    return GltfRig(rig, tuple(order), human, tuple(skins))


def _joints(document: GltfDocument) -> list[list[int]]:
    """The joints of every skin, or of none the nodes that are animated; `FormatError` if there are none."""
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
    """The parent of every node that has one; `FormatError` for two parents."""
    parents: dict[int, int] = {}
    for node, entry in enumerate(document.json.get("nodes", [])):
        for child in entry.get("children", []):
            document.entry("nodes", child)
            if child in parents:
                raise FormatError(f"{document.name}: expected one parent of each node, got two: damaged")
            parents[child] = node
    return parents


def _order(document: GltfDocument, joints: list[int], parents: dict[int, int]) -> list[int]:
    """The joints and all that is above them, parents first."""
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
        raise FormatError(f"{name}: expected a rotation of each node, got one of nothing: damaged")
    translation, scale = (
        np.array(entry.get(key, default), np.float64)
        for key, default in (("translation", (0, 0, 0)), ("scale", (1, 1, 1)))
    )
    return translation, rot.normalize(quat), scale


def _inverse_binds(document: GltfDocument, skin: int, n_joints: int) -> Floats:
    """The inverse bind matrices (J, 4, 4) of a skin; identities where it has none, as the format says."""
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
    """How the skin's own space lies in the world, (4, 4).

    In a file saved in its bind pose all joints agree on it. Of one saved posed, what is above the first joint
    says it.
    """
    found = world[bones] @ inverse  # (J, 4, 4)
    size = max(float(np.abs(found[0, :3, :3]).max()), _SMALLEST)
    if np.abs(found[:, :3, :3] - found[0, :3, :3]).max() < _SAME * size:
        in_world: Floats = found[0]
    else:
        in_world = world[above] if above >= 0 else np.eye(4)
    return in_world


def _boxes_of_skins(document: GltfDocument) -> dict[int, list[Floats]]:
    """The corners (8, 3) of what is worn on each skin, by the bounds that the file says, in its own space."""
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
    """The nodes of a VRM's bones by VRM's names; empty for other files."""
    extensions = document.json.get("extensions", {})
    newer = extensions.get("VRMC_vrm") or extensions.get("VRMC_vrm_animation") or {}
    bones = newer.get("humanoid", {}).get("humanBones", {})
    if bones:
        return {name: bone["node"] for name, bone in bones.items() if "node" in bone}
    older = extensions.get("VRM", {}).get("humanoid", {}).get("humanBones", [])
    return {bone["bone"]: bone["node"] for bone in older if {"bone", "node"} <= set(bone)}


# The points of a character's skin in its bind pose, each with the bone that moves it most.


_ATTRIBUTES = ("POSITION", "JOINTS_0", "WEIGHTS_0")
_SHARED_BY = 4  # skins that the same points may hang on, by their bytes
_MOST = 40_000  # points of a mesh that are taken: a body's shape needs no more


@dataclass(frozen=True, eq=False)
class SkinPoints:
    """Points of a skin."""

    pos_m: Floats  # (V, 3) in the world, bind pose
    bone: NDArray[np.int64]  # (V,) of the rig


def read_skin_points(document: GltfDocument, found: GltfRig) -> SkinPoints:
    """The points of all meshes that are bound to the rig; none of meshes that are stored compressed.

    Raises `FormatError` if a mesh is damaged, or meshes share the same bytes again and again.
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
                    raise FormatError(f"{document.name}: expected meshes of their own data each, got shared")
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
        raise FormatError(f"{document.name}: expected points of the skin's own joints: damaged")
    return SkinPoints(pos @ skin.matrix[:3, :3].T + skin.matrix[:3, 3], np.array(skin.bones)[joint])


def _is_plain(document: GltfDocument, index: int) -> bool:
    """Whether an accessor has data of its own, which those of Draco's meshes do not."""
    entry = document.entry("accessors", index)
    return "bufferView" in entry or "sparse" in entry
