"""Rigs in glTF documents: nodes, skins and bind matrices to a `Rig`."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.errors import FormatError
from choreograph.gltf.document import GltfDocument
from choreograph.gltf.rig import Rig, rotations_of, world_matrices
from choreograph.motion import rotations as rot

Floats = NDArray[np.float64]

MAX_BONES = 4096
_SAME = 0.01  # of the scale: joints agree within it on how the skin lies in the world
_SMALLEST = 1e-6  # scale of a bone
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
    bind, lowest_m = world.copy(), []
    skins = []
    for index, of_skin in enumerate(joints if "skins" in document.json else []):
        own = [bone_of[node] for node in of_skin]
        inverse = _inverse_binds(document, index, len(own))
        in_world = _skin_in_world(world, own, inverse, int(of_bones[min(own)]))
        bind[own] = in_world @ np.linalg.inv(inverse)
        lowest_m += _lowest_m(document, index, in_world)
        skins.append(SkinInWorld(tuple(own), in_world))
    floor_m = min(lowest_m, default=float(bind[:, 1, 3].min()))
    rig = Rig(names, of_bones, bind[:, :3, 3], rotations_of(bind), translation, quat, scale, floor_m)
    human = {name: bone_of[node] for name, node in _human_bones(document).items() if node in bone_of}
    return GltfRig(rig, tuple(order), human, tuple(skins))


def _joints(document: GltfDocument) -> list[list[int]]:
    """The joints of every skin, or of none the nodes that are animated; `FormatError` if there are none."""
    groups = [skin.get("joints") for skin in document.json.get("skins", [])]
    if not groups:
        turned = {c.get("target", {}).get("node") for a in document.json.get("animations", [])
                  for c in a.get("channels", []) if isinstance(c, dict)}  # fmt: skip
        groups = [sorted(node for node in turned if isinstance(node, int))]
    for joints in groups:
        if not (isinstance(joints, list) and joints and all(isinstance(j, int) for j in joints)):
            raise FormatError(f"{document.name}: expected a skeleton, got none, or a damaged one")
    return groups


def _node_parents(document: GltfDocument) -> dict[int, int]:
    """The parent of every node that has one; `FormatError` for loops and two parents."""
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
    try:
        if "matrix" in entry:
            matrix = np.asarray(entry["matrix"], np.float64).reshape(4, 4).T
            parts = matrix[:3, 3], rotations_of(matrix), np.linalg.norm(matrix[:3, :3], axis=0)
        else:
            translation = np.asarray(entry.get("translation", (0, 0, 0)), np.float64).reshape(3)
            quat = np.roll(np.asarray(entry.get("rotation", (0, 0, 0, 1)), np.float64).reshape(4), 1)
            parts = translation, quat, np.asarray(entry.get("scale", (1, 1, 1)), np.float64).reshape(3)
        if not np.isfinite(np.concatenate(parts)).all() or np.linalg.norm(parts[1]) < _SMALLEST:
            raise ValueError
    except (ValueError, TypeError, np.linalg.LinAlgError) as error:
        raise FormatError(f"{name}: expected numbers as a node's transform, got something else") from error
    return parts[0], rot.normalize(parts[1]), parts[2]


def _inverse_binds(document: GltfDocument, skin: int, n_joints: int) -> Floats:
    """The inverse bind matrices (J, 4, 4) of a skin; identities where it has none, as the format says."""
    accessor = document.entry("skins", skin).get("inverseBindMatrices")
    if accessor is None:
        return np.tile(np.eye(4), (n_joints, 1, 1))
    stored = document.array(accessor)
    if stored.shape != (n_joints, 16):
        raise FormatError(f"{document.name}: expected a bind matrix for every joint: the file is damaged")
    inverse = stored.reshape(-1, 4, 4).transpose(0, 2, 1)
    if not np.isfinite(inverse).all() or (np.abs(np.linalg.det(inverse[:, :3, :3])) < _SMALLEST**3).any():
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


def _lowest_m(document: GltfDocument, skin: int, in_world: Floats) -> list[float]:
    """Heights of the lowest points of a skin's meshes in the bind pose, by the bounds that the file says."""
    heights = []
    for node in document.json.get("nodes", []):
        if node.get("skin") != skin or "mesh" not in node:
            continue
        for primitive in document.entry("meshes", node["mesh"]).get("primitives", []):
            position = document.entry("accessors", primitive.get("attributes", {}).get("POSITION"))
            bounds = np.array([position.get("min", []), position.get("max", [])], np.float64)
            if bounds.shape == (2, 3) and np.isfinite(bounds).all():
                corners = np.array(list(product(*bounds.T)))  # (8, 3)
                heights.append(float((corners @ in_world[:3, :3].T + in_world[:3, 3])[:, 1].min()))
    return heights


def _human_bones(document: GltfDocument) -> dict[str, int]:
    """The nodes of a VRM's bones by VRM's names; empty for other files."""
    extensions = document.json.get("extensions", {})
    if not isinstance(extensions, dict):
        return {}
    newer = (
        (extensions.get("VRMC_vrm") or extensions.get("VRMC_vrm_animation") or {})
        .get("humanoid", {})
        .get("humanBones", {})
    )
    if isinstance(newer, dict) and newer:
        return {name: b["node"] for name, b in newer.items() if isinstance(b, dict) and "node" in b}
    older = extensions.get("VRM", {}).get("humanoid", {}).get("humanBones", [])
    return {b["bone"]: b["node"] for b in older if isinstance(b, dict) and {"bone", "node"} <= set(b)}
