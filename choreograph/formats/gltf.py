"""glTF: rigs with their bind matrices and skins, and their animations as takes, for any bind pose.

`read_rig` gives the bones of a document, `read_skin_points` the points of its skin in the bind pose, and
`read` its animations. Rotations are measured from the bind pose, in which the skin was bound.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.core.counts import Counts, Figure
from choreograph.core.errors import FormatError, ParameterError
from choreograph.core.numerics import Floats
from choreograph.core.timebase import STORE_FPS, frame_times_s
from choreograph.formats.axes_and_units import unit_m
from choreograph.formats.gltf_document import MAX_ENTRIES, GltfDocument, marks_of, read_gltf
from choreograph.formats.writer import distinct
from choreograph.motion import rotations as rot
from choreograph.motion.bone_map import PosedBones, roles_by_names, take_bones
from choreograph.motion.kinematics import to_local
from choreograph.motion.motion import LONGEST_S, MAX_FRAME_JOINTS, Credits, Motion, Take
from choreograph.motion.skeleton import MAX_JOINTS, Skeleton, descendants

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
_FARTHEST = 1e15  # position of a bone in any unit, from which further results are finite
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
    if not (np.abs(bind) < _FARTHEST).all():
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


# Animations as takes.


# Key times (K,), values and interpolation by bone and property.
Tracks = dict[tuple[int, str], tuple[Floats, Floats, str]]

LAYOUT = "a single NAME.glb, .gltf or .vrma with animations of a skeleton"
READS_BONE_MAP = True
SUFFIXES = (".glb", ".gltf", ".vrma")
_MAX_ANIMATIONS = 4096
_BLOCK_POSES = 1 << 18  # frames × bones at a time
_LARGEST = 1e12  # position or scale in any unit, tested so that NaN fails
_ROUNDED_TIME = 2.0**-22  # of a step between two keys, relative to their time
_WIDTHS = {"rotation": 4, "translation": 3, "scale": 3}


def read(path: Path, bone_map: Mapping[str, str] | None = None) -> Iterator[Take]:
    """The animations as takes without music, named after the file and, if several, the animation."""
    read = _read_animations(path, bone_map)
    for name, one in read.items():
        own = path.stem if len(read) == 1 else f"{path.stem}-{name}"
        yield Take(
            own, one.motion, Credits(source=path.name), source_paths=(path,), notes=one.notes,
            counts=one.counts, figures=one.figures,
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Animation:
    """An animation as it was read."""

    motion: Motion
    notes: tuple[str, ...]
    counts: Counts  # that are stated with it
    figures: tuple[Figure, ...]


def read_gltf_motions(
    path: str | Path, bone_map: Mapping[str, str] | None = None
) -> dict[str, tuple[Motion, tuple[str, ...]]]:
    """The animations of a glTF file by name: the motion of the rig from its hips down, and notes.

    Motions are at 60 fps, or at the rate of their keys if that is lower. Rotations are measured from the bind
    pose, which is the rest pose of the skeleton. If the names of the bones are unknown, or `bone_map` is
    given, the skeleton has `roles` for the bones that were found. Raises `FormatError` if the file is
    damaged, or has no animation or no body.
    """
    return {name: (one.motion, one.notes) for name, one in _read_animations(path, bone_map).items()}


def _read_animations(path: str | Path, bone_map: Mapping[str, str] | None) -> dict[str, _Animation]:
    """The animations of a file by name. Raises as `read_gltf_motions`."""
    document = read_gltf(path, images=False)
    animations = document.json.get("animations", [])
    if not animations:
        raise FormatError(f"{path}: expected an animation, got none: export it with its animations")
    if len(animations) > _MAX_ANIMATIONS:
        raise FormatError(f"{path}: expected at most {_MAX_ANIMATIONS} animations, got {len(animations)}")
    found = read_rig(document)
    reader = _TrackReader(document, {node: bone for bone, node in enumerate(found.nodes)})
    motions: dict[str, _Animation] = {}
    try:
        human = {bone: name for name, bone in found.human_bones.items()}
        names = [human.get(bone, name) for bone, name in enumerate(found.rig.names)]
        body = _Body.of(replace(found.rig, names=distinct(names, form="{} #{}")), bone_map)
        for number, animation in enumerate(animations):
            tracks = reader.tracks(animation)
            if tracks:  # other animations move a camera or a prop
                name = animation.get("name") or f"{number + 1}"
                while name in motions:
                    name = f"{name} {number + 1}"
                motions[name] = _Animation(*body.motion(tracks), *marks_of(document, animation))
    except (FormatError, ParameterError) as error:
        raise FormatError(f"{path}: {str(error).removeprefix(f'{path}: ')}") from None
    if not motions:
        raise FormatError(f"{path}: expected an animation of the skeleton, got animations of other nodes")
    return motions


@dataclass(eq=False)
class _Body:
    """The bones of a rig from the hips down."""

    rig: Rig
    below: list[int]  # (J,) bones, the pelvis first
    skeleton: Skeleton  # in metres
    metres: float  # per unit of the file
    notes: tuple[str, ...]  # on the unit and the bones
    poses_left: int = MAX_FRAME_JOINTS  # frames × bones that further animations may have

    @classmethod
    def of(cls, rig: Rig, bone_map: Mapping[str, str] | None) -> _Body:
        """The body of a rig. Raises `FormatError` or `ParameterError` if there is none."""
        roles, found_note = take_bones(rig.posed, bone_map=bone_map)
        below, parents, offsets = rig.below(_pelvis(rig) if roles is None else roles["pelvis"])
        joint_of = {bone: joint for joint, bone in enumerate(below)}
        names = tuple(rig.names[bone] for bone in below)
        known = None if roles is None else {role: joint_of[bone] for role, bone in roles.items()}
        skeleton = Skeleton(names, parents, offsets, roles=known)
        metres, note = unit_m(skeleton, rig.bind_pos_m[None, below])
        notes = tuple(line for line in (found_note, note if metres != 1.0 else "") if line)
        return cls(rig, below, replace(skeleton, offsets_m=metres * offsets), metres, notes)

    def motion(self, tracks: Tracks) -> tuple[Motion, tuple[str, ...]]:
        """One animation, and notes on how the rig was read."""
        times_s, fps = _frame_times(tracks)
        self.poses_left -= len(times_s) * self.rig.n_bones
        if self.poses_left < 0:
            raise FormatError(f"expected at most {MAX_FRAME_JOINTS} frames of bones, got more: export parts")
        n_block = max(1, _BLOCK_POSES // self.rig.n_bones)
        blocks = [self._posed(tracks, times_s[at : at + n_block]) for at in range(0, len(times_s), n_block)]
        root, turned = (np.concatenate(parts) for parts in zip(*blocks, strict=True))
        quat = rot.make_continuous(to_local(self.skeleton, turned))
        return Motion(self.skeleton, self.metres * root, quat, fps), self.notes

    def _posed(self, tracks: Tracks, times_s: Floats) -> tuple[Floats, Floats]:
        """Positions of the pelvis (T, 3) and rotations of the bones from their bind pose (T, J, 4)."""
        rig, n_frames = self.rig, len(times_s)
        local = {"translation": rig.rest_translation, "rotation": rig.rest_quat, "scale": rig.rest_scale}
        sampled = {path: np.repeat(rest[:, None], n_frames, axis=1) for path, rest in local.items()}
        for (bone, path), (keys_s, values, kind) in tracks.items():
            sampled[path][bone] = _sampled(keys_s, values, kind, path, times_s)
        with np.errstate(over="ignore", invalid="ignore"):
            world = world_matrices(
                rig.parents, sampled["translation"], sampled["rotation"], sampled["scale"]
            )[self.below]  # (J, T, 4, 4)
        if not (np.abs(world) < _LARGEST).all():
            raise FormatError("expected bones at finite positions, got some that are too far: damaged?")
        now = np.moveaxis(rotations_of(world), 0, 1)
        return world[0, :, :3, 3], rot.multiply(now, rot.invert(rig.bind_quat[self.below]))


class _TrackReader:
    """Reads the tracks of the animations of a document. Shared data is read once."""

    def __init__(self, document: GltfDocument, bone_of: dict[int, int]) -> None:
        self.document = document
        self.bone_of = bone_of  # node -> bone
        self.values_left = document.n_plausible_values
        self.arrays: dict[tuple[int, bool], Floats] = {}  # (accessor, whether of rotations) -> its values

    def tracks(self, animation: dict[str, Any]) -> Tracks:
        """The tracks of an animation that move bones, the first of each bone and property."""
        samplers = animation.get("samplers", [])
        tracks: Tracks = {}
        read: dict[tuple[int, str], tuple[Floats, Floats, str]] = {}  # by sampler and property
        for channel in animation.get("channels", []):
            target, index = channel.get("target", {}), channel.get("sampler", -1)
            bone, path = self.bone_of.get(target.get("node", -1)), target.get("path", "")
            if bone is None or path not in _WIDTHS or (bone, path) in tracks:
                continue
            if not 0 <= index < len(samplers):
                raise FormatError("expected a sampler for every channel: the file is damaged")
            if (index, path) not in read:
                read[index, path] = self._track(samplers[index], path)
            tracks[bone, path] = read[index, path]
        return tracks

    def _track(self, sampler: dict[str, Any], path: str) -> tuple[Floats, Floats, str]:
        kind = sampler.get("interpolation", "LINEAR")
        keys_s = self._array(sampler.get("input"))
        values = self._array(sampler.get("output"), of_rotations=path == "rotation")
        n_values = len(keys_s) * (3 if kind == "CUBICSPLINE" else 1)
        if keys_s.ndim != 1 or values.shape != (n_values, _WIDTHS[path]) or (np.diff(keys_s) < 0).any():
            raise FormatError(f"expected increasing keys with a {path} each: damaged")
        return keys_s, values, kind

    def _array(self, index: int | None, *, of_rotations: bool = False) -> Floats:
        """The values of an accessor, rotations as `wxyz`."""
        self.document.entry("accessors", index)
        key = index or 0, of_rotations
        if key not in self.arrays:
            self.values_left -= self.document.n_values(index)
            if self.values_left < 0:
                raise FormatError("expected keys of its own in each track, got data that is used too often")
            values = self.document.array(index)
            if not (np.abs(values) < _LARGEST).all():
                raise FormatError("expected finite keys and values: the file is damaged")
            self.arrays[key] = np.roll(values, 1, axis=-1) if of_rotations else values
        return self.arrays[key]


def _frame_times(tracks: Tracks) -> tuple[Floats, float]:
    """Frame times (T,) from the first key to the last, and their rate."""
    keys = [keys_s for keys_s, _, _ in tracks.values()]
    start_s, end_s = min(k[0] for k in keys), max(k[-1] for k in keys)
    if end_s - start_s > LONGEST_S:
        raise FormatError(f"expected an animation of up to an hour, got {end_s - start_s:.0f} s")
    longest = max(keys, key=len)
    native = _rate(longest) if (np.diff(longest) > 0).any() else STORE_FPS
    fps = min(STORE_FPS, round(native, 3)) if native >= 1.0 else STORE_FPS
    rounding = max(1e-3, _ROUNDED_TIME * end_s * fps)  # of the last key, in frames
    n_frames = 1 + int(np.floor((end_s - start_s) * fps + rounding))
    return start_s + frame_times_s(n_frames, fps), fps


def _rate(keys_s: Floats) -> float:
    """Keys a second, from the median step. Times have 32 bits, so that all steps together are more exact."""
    steps = np.diff(np.asarray(keys_s, np.float64))
    steps = steps[steps > 0]
    rate = 1.0 / float(np.median(steps))
    of_all = float(np.round(steps * rate).sum() / steps.sum())
    rounding = _ROUNDED_TIME * float(keys_s[-1]) * rate  # of a step, relative to it
    return of_all if abs(of_all / rate - 1.0) <= rounding else rate


def _sampled(keys_s: Floats, values: Floats, kind: str, path: str, times_s: Floats) -> Floats:
    """Values (T, D) at times (T,), interpolated as the format defines."""
    if kind == "CUBICSPLINE":
        into, values, out = np.moveaxis(values.reshape(len(keys_s), 3, -1), 1, 0)
        if len(keys_s) > 1 and (np.diff(keys_s) > 0).all():
            return _cubic(keys_s, values, into, out, path, times_s)
    later = np.searchsorted(keys_s, times_s, side="right").clip(1)  # (T,) the first key after each time
    if kind == "STEP":
        return values[later - 1]
    after = later.clip(max=max(len(keys_s) - 1, 1))
    low, high = after - 1, after.clip(max=len(keys_s) - 1)
    gap = np.maximum(keys_s[high] - keys_s[low], 1e-9)
    weight = ((times_s - keys_s[low]) / gap).clip(0.0, 1.0)
    if path == "rotation":
        return rot.slerp(rot.normalize(values[low]), rot.normalize(values[high]), weight)
    return values[low] + weight[:, None] * (values[high] - values[low])


def _cubic(keys_s: Floats, values: Floats, into: Floats, out: Floats, path: str, times_s: Floats) -> Floats:
    """Cubic Hermite splines whose tangents at a key differ on its two sides."""
    inside = times_s.clip(keys_s[0], keys_s[-1])
    low = np.searchsorted(keys_s, inside, side="right").clip(1, len(keys_s) - 1) - 1
    gap = (keys_s[low + 1] - keys_s[low])[:, None]
    u = (inside - keys_s[low])[:, None] / gap  # (T, 1) 0 to 1 between two keys
    found = (
        (1 + 2 * u) * (1 - u) ** 2 * values[low]
        + u * (1 - u) ** 2 * gap * out[low]
        + u**2 * (3 - 2 * u) * values[low + 1]
        + u**2 * (u - 1) * gap * into[low + 1]
    )
    return rot.normalize(found) if path == "rotation" else found


def _pelvis(rig: Rig) -> int:
    """The pelvis by the names of the bones. Raises `ParameterError` if they are unknown."""
    pelvis = roles_by_names(("", *rig.names), (-1, *(rig.parents + 1).tolist()))["pelvis"] - 1
    if pelvis < 0:
        raise ParameterError("expected one body, got limbs below different roots")
    return pelvis
