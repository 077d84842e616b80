"""Characters as rigging programs write them: names, rest poses, bone axes, units and helper bones of each."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from choreograph.gltf import VERTICES, GltfDocument
from choreograph.motion import rotations as rot
from choreograph.motion.skeleton import canonical_skeleton

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
    arms_down_rad: float = 0.0  # of an A pose
    along: str = "y"  # axis of a bone that points to its child; "": all bones have the world's axes
    units_per_m: float = 1.0  # of the bones, under an armature that scales them back
    heading_rad: float = 0.0  # where it looks in its file
    root: bool = False  # a bone on the floor above the pelvis, with IK bones
    twist: bool = False  # twist bones in arms and legs
    posed: bool = False  # saved with an arm and a knee bent
    vrm: bool = False
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
    "rigify": Spec(RIGIFY, arms_down_rad=0.3),
    "posed": Spec(MIXAMO, posed=True),
    "nameless": Spec(NAMELESS, arms_down_rad=0.5),
    "nameless that looks aside": Spec(NAMELESS, heading_rad=np.pi / 2, root=True),
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


def bones_of(spec: Spec) -> Made:
    """Bones, parents first."""
    body = canonical_skeleton()
    rest, parts = body.rest_pos_m(), [n for n in body.names if n not in spec.left_out]
    pos = {name: rest[body.index(name)].copy() for name in body.names}
    for side, sign in (("left", 1.0), ("right", -1.0)):
        start = pos[f"{side}_shoulder"].copy()
        down = rot.from_rotvec(np.array([0.0, 0.0, -sign * spec.arms_down_rad]))
        for part in ("elbow", "wrist", "hand"):
            pos[f"{side}_{part}"] = start + spec.arms * rot.rotate(down, pos[f"{side}_{part}"] - start)
    turn = rot.about_y(spec.heading_rad)
    names, parents, where, roles = [], [], [], []

    def add(name: str, parent: int, pos_m: np.ndarray, role: str = "") -> int:
        names.append(name)
        parents.append(parent)
        where.append(spec.size * rot.rotate(turn, pos_m))
        roles.append(role)
        return len(names) - 1

    root = add("root", -1, np.zeros(3)) if spec.root else -1
    index: dict[str, int] = {}
    for name in parts:
        parent = int(body.parents[body.index(name)])
        while parent >= 0 and body.names[parent] not in index:
            parent = int(body.parents[parent])
        above = index[body.names[parent]] if parent >= 0 else root
        index[name] = add(spec.names[name], above, pos[name], name)
    if spec.twist:
        for side in ("left", "right"):
            for start, end in (("shoulder", "elbow"), ("elbow", "wrist"), ("hip", "knee"), ("knee", "ankle")):
                a, b = f"{side}_{start}", f"{side}_{end}"
                name = spec.names[a].replace("_" + side[0], f"_twist_01_{side[0]}")
                add(name, index[a], 0.5 * (pos[a] + pos[b]))
    if spec.root:
        foot_root = add("ik_foot_root", root, np.zeros(3))
        for side in ("left", "right"):
            add(f"ik_foot_{side[0]}", foot_root, pos[f"{side}_ankle"])
    pos_m = np.array(where)
    return Made(names, parents, pos_m, _axes(spec, parents, pos_m), roles)


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
    """Write a character with a skin of a tetrahedron at each bone."""
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
    mesh = _add_mesh(document, made, scale, spec)
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


def _add_mesh(document: GltfDocument, made: Made, scale: float, spec: Spec) -> int:
    corners = 0.02 * np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    points = made.pos_m[:, None] + spec.size * corners  # (B, 4, 3)
    points[..., 1] = np.maximum(points[..., 1], 0.0)  # the soles are on the floor
    feet = [i for i, part in enumerate(made.part) if part.endswith("foot")]
    points[feet, 1, 1] = 0.0
    n = len(made.names)
    joints = np.zeros((n, 4, 4), np.uint16)
    joints[..., 0] = np.arange(n)[:, None]
    weights = np.zeros((n, 4, 4), np.float32)
    weights[..., 0] = 1.0
    triangles = np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])
    indices = (4 * np.arange(n)[:, None, None] + triangles).astype(np.uint16).ravel()
    rows = scale * points.reshape(-1, 3)
    attributes = {
        "POSITION": document.accessor(rows.astype(np.float32), target=VERTICES, bounds=True),
        "JOINTS_0": document.accessor(joints.reshape(-1, 4), target=VERTICES),
        "WEIGHTS_0": document.accessor(weights.reshape(-1, 4), target=VERTICES),
    }
    primitive = {"attributes": attributes, "indices": document.accessor(indices)}
    return document.add("meshes", {"primitives": [primitive]})
