"""The cameras of a dance in glTF: one camera node, which the animation of the dance moves."""

from __future__ import annotations

import numpy as np

from choreograph.core.numerics import Floats
from choreograph.formats.gltf_document import GltfDocument
from choreograph.motion import rotations as rot
from choreograph.motion.cameras import ASPECT, FOV_RAD, CameraPath

NAME = "camera"
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
            "name": NAME,
            "camera": filmed.add("cameras", {"name": NAME, "type": "perspective", "perspective": lens}),
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
