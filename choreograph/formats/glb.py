"""Writers of GLB (the mannequin, an animation and a camera) and VRMA (an animation for any VRM avatar)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from choreograph.core.arguments import unexpected
from choreograph.core.numerics import Floats
from choreograph.core.timebase import frame_times_s
from choreograph.formats.gltf_document import INDICES, VERTICES, GltfDocument
from choreograph.formats.writer import DANCE_GENERATOR, GENERATOR, Target, Writer, prepared, text_names
from choreograph.motion import rotations as rot
from choreograph.motion.cameras import ASPECT, FOV_RAD, CameraPath
from choreograph.motion.kinematics import to_local
from choreograph.motion.motion import Motion
from choreograph.motion.retargeting import retarget
from choreograph.motion.skeleton import CANONICAL_JOINTS, canonical_skeleton
from choreograph.motion.skinned_mesh import PARTS, SkinnedMesh, build_mannequin, palette_of

# The camera of a dance: one node, which the animation of the dance moves.


_CAMERA = "camera"
_NEAR_M = 0.05


def with_camera(document: GltfDocument, path: CameraPath) -> GltfDocument:
    """A copy of a document with a camera, which the last animation moves.

    Between the keys of a shot, the camera moves in straight lines. The keys on both sides of a cut are a
    millisecond apart.
    """
    filmed = document.copy()
    lens = {"yfov": FOV_RAD, "znear": _NEAR_M, "aspectRatio": ASPECT}
    times_s, eyes_m, targets_m = path.keys
    quat = camera_quat(eyes_m, targets_m)  # (K, 4)
    node = filmed.add(
        "nodes",
        {
            "name": _CAMERA,
            "camera": filmed.add("cameras", {"name": _CAMERA, "type": "perspective", "perspective": lens}),
            "translation": eyes_m[0].tolist(),
            "rotation": np.roll(quat[0], -1).tolist(),
        },
    )
    scene = filmed.json["scenes"][filmed.json.get("scene", 0)]
    scene["nodes"] = [*scene.get("nodes", []), node]
    filmed.extend_animation(times_s, [(node, "translation", eyes_m), (node, "rotation", quat)])
    return filmed


def camera_quat(eyes_m: Floats, targets_m: Floats) -> Floats:
    """Rotations (K, 4) of cameras without roll, which look along -Z with +Y up, as in glTF and USD."""
    back = eyes_m - targets_m
    back = back / np.linalg.norm(back, axis=1, keepdims=True)
    right = np.cross([0.0, 1.0, 0.0], back)
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    return rot.make_continuous(rot.from_matrix(np.stack([right, np.cross(back, right), back], axis=-1)))


# Dancers.


ANIMATION_NAME = "dance"
_ROUGHNESS = 0.85


class GlbWriter(Writer):
    """Writes glTF 2.0 in one file, in metres with Y up, for Blender, three.js, Godot and Unreal.

    Nodes 0 to J - 1 are the joints. Their rest pose is the bind pose of the mannequin, standing on the floor.
    The animation has a rotation of each joint and a translation of the root, at the rate of the motion.
    """

    format = "glb"
    target: Target | None = None  # the program that the file is for
    clip: str = ANIMATION_NAME  # the name of its animation

    def write(self, motion: Motion, path: Path) -> None:
        """Write `motion`."""
        root, clip = "", ANIMATION_NAME
        if self.target is not None:
            motion, root, clip = prepared(motion, self.target), self.target.root, self.clip
        document = dance_document(motion, root=root, clip=clip)
        if self.camera is not None:
            document = with_camera(document, self.camera)
        path.write_bytes((as_dance(document) if self.is_dance else document).to_glb())


def dance_document(motion: Motion, *, root: str = "", clip: str = ANIMATION_NAME) -> GltfDocument:
    """The document of a dance on the mannequin.

    With the name of a `root`, the path of the hips on the floor is that of a bone above them. It is at the
    origin in the rest pose.
    """
    return _document(motion, {clip: motion}, root)


def clips_document(clips: Mapping[str, Motion], target: Target | None = None) -> GltfDocument:
    """The document of one mannequin with an animation for each motion, by its name, all from 0 s.

    Motions on another skeleton than the first are retargeted to it. The bones are as the program expects, if
    one is given. Raises `ParameterError` if the names of joints are unknown, or there is no motion.
    """
    if not clips:
        raise unexpected("a motion or several", clips)
    skeleton = next(iter(clips.values())).skeleton
    motions = [
        each if each.skeleton.same_as(skeleton) else retarget(each, skeleton) for each in clips.values()
    ]
    together = Motion(
        skeleton,
        np.concatenate([each.root_pos_m for each in motions]),
        np.concatenate([each.local_quat for each in motions]),
        motions[0].fps,
    )  # has the one rest pose of all
    if target is not None:
        together = prepared(together, target)
    ends = np.cumsum([0, *(each.n_frames for each in motions)]).tolist()
    parts = [
        replace(together.sliced(start, stop), fps=each.fps)
        for each, (start, stop) in zip(motions, pairwise(ends), strict=True)
    ]
    return _document(together, dict(zip(clips, parts, strict=True)), "" if target is None else target.root)


def _document(shown: Motion, clips: Mapping[str, Motion], root: str) -> GltfDocument:
    """The mannequin of a motion with animations by their names, and with a bone `root` if it is not ""."""
    document = GltfDocument.empty(GENERATOR)
    first, body = _add_dancer(document, shown, build_mannequin(shown.skeleton, shown), root)
    document.add("scenes", {"name": "dance", "nodes": [first, body]})
    document.json["scene"] = 0
    for name, motion in clips.items():
        add_animation(document, motion, name, first)
    return document


def scene_document(motions: Sequence[Motion], names: Sequence[str]) -> GltfDocument:
    """The document of several dancers on mannequins of their own, with one animation of all.

    Each has a node of its name, which holds its joints, and a body. `motions` have one length and rate.
    """
    document = GltfDocument.empty(GENERATOR)
    groups, tracks = [], []
    for dancer, (motion, name) in enumerate(zip(motions, text_names(names), strict=True)):
        mesh = build_mannequin(motion.skeleton, motion)
        root, body = _add_dancer(document, motion, replace(mesh, palette=palette_of(dancer)))
        document.entry("nodes", body)["name"] = f"{name} body"
        groups += [document.add("nodes", {"name": name, "children": [root]}), body]
        tracks += _tracks(motion, root)
    document.add("scenes", {"name": "dance", "nodes": groups})
    document.json["scene"] = 0
    times_s = frame_times_s(motions[0].n_frames, motions[0].fps)
    document.add_animation(ANIMATION_NAME, times_s, tracks)
    return document


def _add_dancer(
    document: GltfDocument, motion: Motion, mesh: SkinnedMesh, above: str = ""
) -> tuple[int, int]:
    """Add joints, skin and body of a dancer, and a bone `above` the joints if its name is given.

    Return the nodes of the highest bone and of the body.
    """
    floor_m = np.array([0.0, mesh.vertices_m[:, 1].min(), 0.0])
    root = _add_joints(document, motion, mesh, floor_m)
    first = document.add("nodes", {"name": above, "children": [root]}) if above else root
    skin = _add_skin(document, mesh, floor_m, root, first)
    node = {"name": "body", "mesh": _add_mesh(document, mesh, floor_m), "skin": skin}
    return first, document.add("nodes", node)


def as_dance(document: GltfDocument) -> GltfDocument:
    """The document with a generator, at the beginning of the file, that marks it as a dance."""
    asset = {**document.json["asset"], "generator": DANCE_GENERATOR}
    marked = document.copy()
    marked.json = {"asset": asset} | {kind: value for kind, value in marked.json.items() if kind != "asset"}
    return marked


def add_animation(document: GltfDocument, motion: Motion, name: str = ANIMATION_NAME, above: int = 0) -> None:
    """Add the motion as an animation of nodes 0 to J - 1, which are its joints.

    If node 0 has another one `above` it, that has the path on the floor, and node 0 the height.
    """
    tracks = _tracks(motion, 0)
    if above:
        floor = np.array([1.0, 0.0, 1.0])
        tracks[:1] = [
            (above, "translation", motion.root_pos_m * floor),
            (0, "translation", motion.root_pos_m * (1.0 - floor)),
        ]
    document.add_animation(name, frame_times_s(motion.n_frames, motion.fps), tracks)


def _tracks(motion: Motion, root: int) -> list[tuple[int, str, Floats]]:
    """The tracks of a motion whose joints are the nodes from `root` on."""
    quat = rot.make_continuous(motion.local_quat)  # (T, J, 4)
    tracks = [(root, "translation", motion.root_pos_m)]
    tracks += [(root + joint, "rotation", quat[:, joint]) for joint in range(motion.skeleton.n_joints)]
    return tracks


def _add_joints(document: GltfDocument, motion: Motion, mesh: SkinnedMesh, floor_m: Floats) -> int:
    """The joints in the bind pose, as the next nodes. Return the first one."""
    skeleton, root = motion.skeleton, len(document.json.get("nodes", []))
    local = to_local(skeleton, mesh.bind_quat)  # (J, 4)
    for joint, name in enumerate(text_names(skeleton.names)):
        offset = skeleton.offsets_m[joint] if joint else mesh.bind_pos_m[0] - floor_m
        node = {
            "name": name,
            "translation": offset.tolist(),
            "rotation": np.roll(local[joint], -1).clip(-1.0, 1.0).tolist(),  # as `xyzw`
        }
        children = (root + np.flatnonzero(skeleton.parents == joint)).tolist()
        document.add("nodes", node | ({"children": children} if children else {}))
    return root


def _add_skin(document: GltfDocument, mesh: SkinnedMesh, floor_m: Floats, root: int, first: int) -> int:
    """The skin of the joints from node `root` on. A bone `first` above them is in it, and moves no vertex."""
    joints = [*range(root, root + len(mesh.bind_pos_m)), *([first] if first != root else [])]
    inverse = np.tile(np.eye(4), (len(joints), 1, 1))  # (J, 4, 4), or (J + 1, 4, 4)
    inverse[: len(mesh.bind_pos_m), :3, :3] = rot.to_matrix(rot.invert(mesh.bind_quat))
    inverse[: len(mesh.bind_pos_m), :3, 3] = -rot.rotate(
        rot.invert(mesh.bind_quat), mesh.bind_pos_m - floor_m
    )
    columns = inverse.transpose(0, 2, 1).reshape(-1, 16).astype(np.float32)  # glTF stores columns
    skin = {
        "joints": joints, "skeleton": first,
        "inverseBindMatrices": document.accessor(columns),
    }  # fmt: skip
    return document.add("skins", skin)


def _add_mesh(document: GltfDocument, mesh: SkinnedMesh, floor_m: Floats) -> int:
    """The mesh with a primitive and a material for each part of the body."""
    n = len(mesh.vertices_m)
    joints, weights = np.zeros((n, 4), np.uint16), np.zeros((n, 4), np.float32)
    joints[:, :2], weights[:, :2] = mesh.joints, mesh.weights
    joints[weights == 0] = 0  # required by the format
    weights[:, 1] = 1.0 - weights[:, 0]  # a sum of exactly 1
    attributes = {
        "POSITION": document.accessor(
            (mesh.vertices_m - floor_m).astype(np.float32), target=VERTICES, bounds=True
        ),
        "NORMAL": document.accessor(mesh.normals.astype(np.float32), target=VERTICES),
        "JOINTS_0": document.accessor(joints, target=VERTICES),
        "WEIGHTS_0": document.accessor(weights, target=VERTICES),
    }
    index_type = np.uint16 if n <= np.iinfo(np.uint16).max else np.uint32
    primitives = []
    part_of_triangle = mesh.parts[mesh.triangles[:, 0]]
    for part in np.unique(part_of_triangle):
        indices = mesh.triangles[part_of_triangle == part].astype(index_type).ravel()
        material = {
            "name": PARTS[part],
            "pbrMetallicRoughness": {
                "baseColorFactor": [*linear_light(mesh.palette[part]).tolist(), 1.0],
                "metallicFactor": 0.0,
                "roughnessFactor": _ROUGHNESS,
            },
        }
        primitives.append(
            {
                "attributes": attributes,
                "indices": document.accessor(indices, target=INDICES),
                "material": document.add("materials", material),
            }
        )
    return document.add("meshes", {"name": "body", "primitives": primitives})


def linear_light(srgb: NDArray[np.floating]) -> NDArray[np.floating]:
    """sRGB colours, 0 to 1, as linear light."""
    low = srgb <= 0.04045
    return np.where(low, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4).round(6)


VRM_BONES = {
    "pelvis": "hips", "spine1": "spine", "spine2": "chest", "spine3": "upperChest", "neck": "neck",
    "head": "head",
} | {
    f"{side}_{part}": f"{side}{name}"
    for side in ("left", "right")
    for part, name in (
        ("hip", "UpperLeg"), ("knee", "LowerLeg"), ("ankle", "Foot"), ("foot", "Toes"),
        ("collar", "Shoulder"), ("shoulder", "UpperArm"), ("elbow", "LowerArm"), ("wrist", "Hand"),
    )
}  # fmt: skip


class VrmaWriter(Writer):
    """Writes glTF with the extension VRMC_vrm_animation 1.0: the canonical body in a T pose, without a mesh.

    A motion on another skeleton is retargeted first. Avatars apply the animation by the names of their bones
    and the height of their hips.
    """

    format = "vrma"

    def write(self, motion: Motion, path: Path) -> None:
        """Write `motion`. Raises `ParameterError` if its joint names are unknown."""
        body = canonical_skeleton()
        dancer = motion if motion.skeleton.same_as(body) else retarget(motion, body)
        document = GltfDocument.empty(GENERATOR)
        offsets_m = body.offsets_m.copy()
        # Players scale by the height of the hips, so the soles must be on the floor like those of an avatar.
        offsets_m[0, 1] -= body.rest_pos_m()[body.index("left_foot"), 1]
        for joint, name in enumerate(CANONICAL_JOINTS):
            node = {"name": VRM_BONES.get(name, name), "translation": offsets_m[joint].tolist()}
            children = np.flatnonzero(body.parents == joint).tolist()
            document.add("nodes", node | ({"children": children} if children else {}))
        document.add("scenes", {"nodes": [0]})
        document.json["scene"] = 0
        bones = {VRM_BONES[name]: {"node": CANONICAL_JOINTS.index(name)} for name in VRM_BONES}
        document.json["extensionsUsed"] = ["VRMC_vrm_animation"]
        document.json["extensions"] = {
            "VRMC_vrm_animation": {"specVersion": "1.0", "humanoid": {"humanBones": bones}}
        }
        add_animation(document, dancer)
        path.write_bytes((as_dance(document) if self.is_dance else document).to_glb())


WRITERS = (GlbWriter, VrmaWriter)
