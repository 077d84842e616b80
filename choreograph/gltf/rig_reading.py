"""Rigs in glTF documents: nodes, skins and bind matrices to a `Rig`."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.errors import FormatError
from choreograph.gltf._structure import MAX_ENTRIES
from choreograph.gltf.document import GltfDocument
from choreograph.gltf.rig import Rig, rotations_of, world_matrices
from choreograph.motion import rotations as rot
from choreograph.motion.skeleton import MAX_JOINTS

Floats = NDArray[np.float64]

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
        return found[0]
    return world[above] if above >= 0 else np.eye(4)


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
