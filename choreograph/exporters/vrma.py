"""VRMA writer: a VRM animation, for any VRM avatar."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from choreograph.exporters._base import GENERATOR, Writer
from choreograph.exporters.glb import add_animation, as_dance
from choreograph.gltf import GltfDocument
from choreograph.motion.motion import Motion
from choreograph.motion.retargeting import retarget
from choreograph.motion.skeleton import CANONICAL_JOINTS, canonical_skeleton

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
    """glTF with the extension VRMC_vrm_animation 1.0: the canonical body's bones in a T pose, without a mesh.

    A motion on another skeleton is retargeted first. Avatars apply it by the names of their bones and the
    height of their hips.
    """

    format = "vrma"

    def write(self, motion: Motion, path: Path) -> None:
        """Write `motion`; `ParameterError` if its joint names are unknown."""
        body = canonical_skeleton()
        dancer = motion if motion.skeleton.same_as(body) else retarget(motion, body)
        document = GltfDocument.empty(GENERATOR)
        offsets_m = body.offsets_m.copy()
        # Players scale by the height of the hips, so the soles must be on the floor as an avatar's are.
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
