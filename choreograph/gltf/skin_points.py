"""The points of a character's skin in its bind pose, each with the bone that moves it most."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from choreograph.errors import FormatError
from choreograph.gltf.document import GltfDocument
from choreograph.gltf.rig_reading import GltfRig, SkinInWorld

Floats = NDArray[np.float64]

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
