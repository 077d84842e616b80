# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes skeletons as .glb files and reads their animations, in metres with Y up and quaternions `wxyz`."""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_JSON, _BINARY = 0x4E4F534A, 0x004E4942
_FLOAT, _BYTE = 5126, 5121
_WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}
_POINTS = 0


@dataclass(frozen=True)
class Skeleton:
    """Bones at rest, without scale."""

    names: tuple[str, ...]  # (B,)
    parents: tuple[int, ...]  # (B,) -1 for a root
    translations_m: Floats  # (B, 3) from the parent
    quats: Floats  # (B, 4) relative to the parent
    world: Floats  # (B, 4, 4)
    unit_m: float  # of the local coordinates of the armature
    corners_m: (
        Floats  # (2, 3) lowest and highest corner of the body in the world, from which the floor is taken
    )


@dataclass(frozen=True)
class Tracks:
    """The local rotations and translations of bones in an animation, at frames of one rate."""

    quats: dict[int, Floats]  # (T, 4) by bone
    translations_m: dict[int, Floats]  # (T, 3) by bone

    @property
    def n_frames(self) -> int:
        return max((len(values) for values in self.quats.values()), default=0)


def write_skeleton(path: Path, skeleton: Skeleton) -> None:
    """Write the skeleton with a skin of two points, the corners of the body."""
    inverse = np.linalg.inv(skeleton.world).transpose(0, 2, 1).reshape(-1, 16)
    blocks = [
        (inverse.astype("<f4"), _FLOAT, "MAT4"),
        (skeleton.corners_m.astype("<f4"), _FLOAT, "VEC3"),
        (np.zeros((2, 4), np.uint8), _BYTE, "VEC4"),
        (np.tile([1.0, 0.0, 0.0, 0.0], (2, 1)).astype("<f4"), _FLOAT, "VEC4"),
    ]
    views, accessors, offset = [], [], 0
    for index, (values, kind, shape) in enumerate(blocks):
        views.append({"buffer": 0, "byteOffset": offset, "byteLength": values.nbytes})
        accessors.append({"bufferView": index, "componentType": kind, "count": len(values), "type": shape})
        offset += values.nbytes
    corners = blocks[1][0]
    accessors[1] |= {"min": corners.min(axis=0).tolist(), "max": corners.max(axis=0).tolist()}
    roots = [bone for bone, parent in enumerate(skeleton.parents) if parent < 0]
    body = len(skeleton.names)
    primitive = {"attributes": {"POSITION": 1, "JOINTS_0": 2, "WEIGHTS_0": 3}, "mode": _POINTS}
    document = {
        "asset": {"version": "2.0", "generator": "choreograph for Blender"},
        "scene": 0,
        "scenes": [{"nodes": [*roots, body]}],
        "nodes": [*_nodes(skeleton), {"name": "body", "mesh": 0, "skin": 0}],
        "skins": [{"joints": list(range(body)), "inverseBindMatrices": 0}],
        "meshes": [{"primitives": [primitive]}],
        "buffers": [{"byteLength": offset}],
        "bufferViews": views,
        "accessors": accessors,
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    binary = b"".join(values.tobytes() for values, _, _ in blocks)
    chunks = struct.pack("<II", len(text), _JSON) + text + struct.pack("<II", len(binary), _BINARY) + binary
    path.write_bytes(b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks)


def _nodes(skeleton: Skeleton) -> list[dict]:
    nodes: list[dict] = [
        {"name": name, "translation": translation, "rotation": rotation}
        for name, translation, rotation in zip(
            skeleton.names,
            skeleton.translations_m.tolist(),
            np.roll(skeleton.quats, -1, axis=-1).tolist(),
            strict=True,
        )
    ]
    for bone, parent in enumerate(skeleton.parents):
        if parent >= 0:
            nodes[parent].setdefault("children", []).append(bone)
    return nodes


def read_tracks(path: Path) -> Tracks:
    """The animation that choreograph added to a file of `write_skeleton`. Its first nodes are the bones."""
    data = path.read_bytes()
    (length,) = struct.unpack_from("<I", data, 12)
    document = json.loads(data[20 : 20 + length])
    binary = memoryview(data)[28 + length :]
    tracks: dict[str, dict[int, Floats]] = {"rotation": {}, "translation": {}}
    (animation,) = document["animations"]
    for channel in animation["channels"]:
        target = channel["target"]
        accessor = document["accessors"][animation["samplers"][channel["sampler"]]["output"]]
        tracks[target["path"]][target["node"]] = _array(document, binary, accessor)
    quats = {bone: np.roll(values, 1, axis=-1) for bone, values in tracks["rotation"].items()}
    return Tracks(quats, tracks["translation"])


def _array(document: dict, binary: memoryview, accessor: dict) -> Floats:
    width = _WIDTHS[accessor["type"]]
    view = document["bufferViews"][accessor["bufferView"]]
    start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    values = np.frombuffer(binary, "<f4", accessor["count"] * width, start)
    return values.reshape(-1, width).astype(np.float64)
