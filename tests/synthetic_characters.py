"""Characters as rigging programs write them: names, rest poses, bone axes, units and helper bones of each."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from choreograph.formats.glb import _add_mesh
from choreograph.formats.gltf_document import GltfDocument
from choreograph.motion import rotations as rot
from choreograph.motion.kinematics import forward
from choreograph.motion.skeleton import Skeleton, canonical_skeleton
from choreograph.motion.skinned_mesh import build_mannequin, skin_matrices

_LIMBS = ("hip", "knee", "ankle", "foot", "collar", "shoulder", "elbow", "wrist")
MIXAMO = {
    "pelvis": "mixamorig:Hips", "spine1": "mixamorig:Spine", "spine2": "mixamorig:Spine1",
    "spine3": "mixamorig:Spine2", "neck": "mixamorig:Neck", "head": "mixamorig:Head",
} | {
    f"{side}_{part}": f"mixamorig:{side.title()}{name}"
    for side in ("left", "right")
    for part, name in zip(
        _LIMBS, ("UpLeg", "Leg", "Foot", "ToeBase", "Shoulder", "Arm", "ForeArm", "Hand"), strict=True
    )
}  # fmt: skip
UNREAL = {
    "pelvis": "pelvis", "spine1": "spine_01", "spine2": "spine_02", "spine3": "spine_03", "neck": "neck_01",
    "head": "head",
} | {
    f"{side}_{part}": f"{name}_{side[0]}"
    for side in ("left", "right")
    for part, name in zip(
        _LIMBS, ("thigh", "calf", "foot", "ball", "clavicle", "upperarm", "lowerarm", "hand"), strict=True
    )
}  # fmt: skip
RIGIFY = {
    "pelvis": "spine", "spine1": "spine.001", "spine2": "spine.002", "spine3": "spine.003",
    "neck": "spine.004", "head": "spine.006",
} | {
    f"{side}_{part}": f"{name}.{side[0].upper()}"
    for side in ("left", "right")
    for part, name in zip(
        _LIMBS, ("thigh", "shin", "foot", "toe", "shoulder", "upper_arm", "forearm", "hand"), strict=True
    )
}  # fmt: skip
VRM = {
    "pelvis": "hips", "spine1": "spine", "spine2": "chest", "spine3": "upperChest", "neck": "neck",
    "head": "head",
} | {
    f"{side}_{part}": f"{side}{name}"
    for side in ("left", "right")
    for part, name in zip(
        _LIMBS,
        ("UpperLeg", "LowerLeg", "Foot", "Toes", "Shoulder", "UpperArm", "LowerArm", "Hand"),
        strict=True,
    )
}  # fmt: skip


@dataclass(frozen=True)
class Spec:
    """How a character is made from the canonical body."""

    names: dict[str, str]  # canonical -> its own
    size: float = 1.0
    arms: float = 1.0  # length against the canonical body's
    legs: float = 1.0
    arms_down_rad: float = 0.0  # of an A pose
    along: str = "y"  # axis of a bone that points to its child; "": all bones have the world's axes
    units_per_m: float = 1.0  # of the bones, under an armature that scales them back
    heading_rad: float = 0.0  # where it looks in its file
    root: bool = False  # a bone on the floor above the pelvis, with IK bones
    twist: bool = False  # twist bones in arms and legs
    posed: bool = False  # saved with an arm and a knee bent
    vrm: bool = False
    fingers: str = (
        ""  # names of their bones, such as "{Side}Hand{Finger}{n}", or "" for hands without fingers
    )
    left_out: tuple[str, ...] = ("left_hand", "right_hand")
    extra: dict[str, str] = field(default_factory=dict)


NAMELESS = {name: f"bone_{i:02d}" for i, name in enumerate(canonical_skeleton().names)}
CHARACTERS = {
    "mixamo": Spec(MIXAMO, units_per_m=100.0),
    "unreal": Spec(UNREAL, arms_down_rad=0.8, along="x", root=True, twist=True),
    "vrm": Spec(VRM, along="", vrm=True),
    "vrm that looks back": Spec(VRM, along="", vrm=True, heading_rad=np.pi),
    "child": Spec(MIXAMO, size=0.5),
    "long arms": Spec(UNREAL, arms=1.4, along="x"),
    "stocky": Spec(VRM, legs=0.7, arms=0.85, along="", vrm=True, arms_down_rad=0.6),
    "rigify": Spec(RIGIFY, arms_down_rad=0.3),
    "posed": Spec(MIXAMO, posed=True),
    "nameless": Spec(NAMELESS, arms_down_rad=0.5),
    "nameless that looks aside": Spec(NAMELESS, heading_rad=np.pi / 2, root=True),
    "without toes": Spec(
        VRM, size=1.1, along="", vrm=True, left_out=("left_hand", "right_hand", "left_foot", "right_foot")
    ),
    "few spine bones": Spec(
        MIXAMO, left_out=("left_hand", "right_hand", "spine2", "spine3"), arms_down_rad=0.7
    ),
}


@dataclass(frozen=True, eq=False)
class Made:
    """The bones of a made character in the world, bind pose."""

    names: list[str]
    parents: list[int]
    pos_m: np.ndarray  # (B, 3)
    quat: np.ndarray  # (B, 4)
    part: list[str]  # canonical name, or ""


def figure_of(spec: Spec) -> Skeleton:
    """The character's body in a T pose with its soles on the floor, canonical names, before it is sized."""
    body = canonical_skeleton()
    offsets_m = body.offsets_m.copy()
    for joint, name in enumerate(body.names):
        if name.endswith(("elbow", "wrist", "hand")):
            offsets_m[joint] *= spec.arms
        if name.endswith(("knee", "ankle")):
            offsets_m[joint] *= spec.legs
    legs = [body.index(f"left_{part}") for part in ("hip", "knee", "ankle", "foot")]
    offsets_m[0] = [0.0, -offsets_m[legs, 1].sum(), 0.0]  # the sole is as low as the ball of the foot
    kept = [joint for joint, name in enumerate(body.names) if name not in spec.left_out]
    parents = []
    for joint in kept:
        parent = int(body.parents[joint])
        while parent >= 0 and parent not in kept:
            offsets_m[joint] += offsets_m[parent]
            parent = int(body.parents[parent])
        parents.append(kept.index(parent) if parent >= 0 else -1)
    return Skeleton(tuple(body.names[joint] for joint in kept), np.array(parents), offsets_m[kept])


def bind_pose_of(spec: Spec, figure: Skeleton) -> tuple[np.ndarray, np.ndarray]:
    """World positions (J, 3) in metres and turns (J, 4) from the T pose of the figure's joints, as bound."""
    local = np.tile(rot.IDENTITY, (figure.n_joints, 1))
    local[0] = rot.about_y(spec.heading_rad)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        down = np.array([0.0, 0.0, -sign * spec.arms_down_rad])
        local[figure.index(f"{side}_shoulder")] = rot.from_rotvec(down)
    pos_m, turns = forward(figure, rot.rotate(local[0], figure.offsets_m[0]), local)
    return spec.size * pos_m, turns


def bones_of(spec: Spec) -> Made:
    """Bones, parents first."""
    figure = figure_of(spec)
    pos_m, _ = bind_pose_of(spec, figure)
    at = dict(zip(figure.names, pos_m, strict=True))
    names, parents, where, roles = [], [], [], []

    def add(name: str, parent: int, pos_m: np.ndarray, role: str = "") -> int:
        names.append(name)
        parents.append(parent)
        where.append(pos_m)
        roles.append(role)
        return len(names) - 1

    root = add("root", -1, np.zeros(3)) if spec.root else -1
    index: dict[str, int] = {}
    for joint, name in enumerate(figure.names):
        above = index[figure.names[figure.parents[joint]]] if joint else root
        index[name] = add(spec.names[name], above, pos_m[joint], name)
    for a, b, name in _twisted(spec):
        add(name, index[a], 0.5 * (at[a] + at[b]))
    for side in ("left", "right") if spec.fingers else ():
        wrist_m, arm = at[f"{side}_wrist"], at[f"{side}_wrist"] - at[f"{side}_elbow"]
        along = arm / np.linalg.norm(arm)
        front = rot.rotate(rot.about_y(spec.heading_rad), np.array([0.0, 0.0, 1.0]))
        for finger, out in zip(("Thumb", "Index", "Middle", "Ring", "Pinky"), range(2, -3, -1), strict=True):
            above = index[f"{side}_wrist"]
            start_m = wrist_m + (0.02 if finger == "Thumb" else 0.09) * along + 0.02 * out * front
            way = along + front if finger == "Thumb" else along
            for number in range(4):
                name = spec.fingers.format(Side=side.title(), s=side[0], Finger=finger, n=number + 1)
                above = add(name, above, start_m + 0.03 * number * way / np.linalg.norm(way))
    if spec.root:
        foot_root = add("ik_foot_root", root, np.zeros(3))
        for side in ("left", "right"):
            add(f"ik_foot_{side[0]}", foot_root, at[f"{side}_ankle"])
    places = np.array(where)
    return Made(names, parents, places, _axes(spec, parents, places), roles)


def _twisted(spec: Spec) -> list[tuple[str, str, str]]:
    """Limbs that have a twist bone: where they begin and end, and its name."""
    limbs = (("shoulder", "elbow"), ("elbow", "wrist"), ("hip", "knee"), ("knee", "ankle"))
    return [
        (f"{side}_{start}", f"{side}_{end}",
         spec.names[f"{side}_{start}"].replace("_" + side[0], f"_twist_01_{side[0]}"))
        for side in ("left", "right") for start, end in limbs if spec.twist
    ]  # fmt: skip


def _axes(spec: Spec, parents: list[int], pos_m: np.ndarray) -> np.ndarray:
    """World rotations of the bones: an axis along each, towards the mean of its children."""
    quat = np.tile(rot.IDENTITY, (len(parents), 1))
    if not spec.along:
        return quat
    axis = np.eye(3)["xyz".index(spec.along)]
    for bone in range(len(parents)):
        children = [i for i, parent in enumerate(parents) if parent == bone]
        ahead = pos_m[children].mean(axis=0) - pos_m[bone] if children else np.zeros(3)
        if np.linalg.norm(ahead) > 1e-3:
            quat[bone] = rot.between(axis, ahead / np.linalg.norm(ahead))
        elif parents[bone] >= 0:
            quat[bone] = quat[parents[bone]]
    return quat


def write_character(path: Path, spec: Spec) -> Made:
    """Write a character with the mannequin's skin."""
    made = bones_of(spec)
    document = GltfDocument.empty("tests")
    n, scale = len(made.names), spec.units_per_m
    roots = [i for i in range(n) if made.parents[i] < 0]
    local = []
    for bone, parent in enumerate(made.parents):
        if parent < 0:
            local.append((scale * made.pos_m[bone], made.quat[bone]))
        else:
            back = rot.invert(made.quat[parent])
            offset = rot.rotate(back, made.pos_m[bone] - made.pos_m[parent])
            local.append((scale * offset, rot.multiply(back, made.quat[bone])))
    if spec.posed:
        for part, turn in (("left_elbow", (0.0, 0.0, 1.0)), ("right_knee", (0.8, 0.0, 0.0))):
            bone = made.part.index(part)
            offset, quat = local[bone]
            local[bone] = offset, rot.multiply(quat, rot.from_rotvec(np.array(turn)))
    for bone, (offset, quat) in enumerate(local):
        children = [i for i in range(n) if made.parents[i] == bone]
        node = {
            "name": made.names[bone],
            "translation": offset.tolist(),
            "rotation": np.roll(quat, -1).clip(-1.0, 1.0).tolist(),
        }
        document.add("nodes", node | ({"children": children} if children else {}))
    inverse = np.tile(np.eye(4), (n, 1, 1))
    inverse[:, :3, :3] = rot.to_matrix(rot.invert(made.quat))
    inverse[:, :3, 3] = -rot.rotate(rot.invert(made.quat), scale * made.pos_m)
    columns = inverse.transpose(0, 2, 1).reshape(-1, 16).astype(np.float32)
    skin = document.add(
        "skins", {"joints": list(range(n)), "inverseBindMatrices": document.accessor(columns)}
    )
    mesh = _add_body(document, made, spec)
    body = document.add("nodes", {"name": "Body", "mesh": mesh, "skin": skin})
    scene = [body]
    if scale == 1.0:
        scene += roots
    else:
        armature = {"name": "Armature", "children": roots, "scale": [1 / scale] * 3}
        scene.append(document.add("nodes", armature))
    document.add("scenes", {"nodes": scene})
    document.json["scene"] = 0
    if spec.vrm:
        bones = {made.names[i]: {"node": i} for i in range(n) if made.part[i]}
        meta = {"name": "test", "authors": ["tests"], "licenseUrl": "https://vrm.dev/licenses/1.0/"}
        vrm = {"specVersion": "1.0", "meta": meta, "humanoid": {"humanBones": bones}}
        document.json["extensions"] = {"VRMC_vrm": vrm}
        document.json["extensionsUsed"] = ["VRMC_vrm"]
    path.write_bytes(document.to_glb())
    return made


def _add_body(document: GltfDocument, made: Made, spec: Spec) -> int:
    """The mannequin as the character's skin; what is around the middle of a limb goes with its twist bone."""
    figure = figure_of(replace(spec, left_out=()))  # joints without a bone have a body nevertheless
    mesh = build_mannequin(figure)
    pos_m, turns = bind_pose_of(spec, figure)
    matrices = skin_matrices(mesh, pos_m / spec.size, turns)[mesh.joints]  # (V, 2, 4, 4)
    points = np.einsum("vk,vkij,vj->vi", mesh.weights, matrices[..., :3, :3], mesh.vertices_m)
    points += np.einsum("vk,vki->vi", mesh.weights, matrices[..., :3, 3])
    normals = np.einsum("vk,vkij,vj->vi", mesh.weights, matrices[..., :3, :3], mesh.normals)
    bones: list[int] = []
    for name, parent in zip(figure.names, figure.parents, strict=True):
        bones.append(made.part.index(name) if name in made.part else bones[parent])
    joints = np.array(bones)[mesh.joints]
    for start, end, name in _twisted(spec):
        a, b = (figure.rest_pos_m()[figure.index(part)] for part in (start, end))
        along = (mesh.vertices_m - a) @ (b - a) / ((b - a) @ (b - a))
        near = (joints == made.part.index(start)) & (np.abs(along - 0.5) < 0.25)[:, None]
        joints[near] = made.names.index(name)
    once = joints[:, :1] == joints[:, 1:]  # (V, 1) both of a vertex's joints are of one bone
    worn = replace(
        mesh,
        weights=np.where(once, [[1.0, 0.0]], mesh.weights).astype(np.float32),
        vertices_m=(spec.units_per_m * spec.size * points).astype(np.float32),
        normals=(normals / np.linalg.norm(normals, axis=1, keepdims=True)).astype(np.float32),
        joints=joints.astype(np.int32),
    )
    return _add_mesh(document, worn, np.zeros(3))
