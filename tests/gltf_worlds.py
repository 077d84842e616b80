"""What a glTF file shows, worked out from the format's own rules and nothing of the program's retargeting."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from choreograph.gltf import GltfDocument


def node_worlds(document: GltfDocument, frames: np.ndarray | None = None) -> np.ndarray:
    """World matrices (T, N, 4, 4) of all nodes at frames of the first animation; without, at rest (1, …)."""
    nodes = document.json["nodes"]
    tracks: dict[tuple[int, str], np.ndarray] = {}
    if frames is not None:
        animation = document.json["animations"][0]
        for channel in animation["channels"]:
            target = channel["target"]
            values = document.array(animation["samplers"][channel["sampler"]]["output"])
            tracks[target["node"], target["path"]] = values[frames]
    n = 1 if frames is None else len(frames)
    local = np.zeros((n, len(nodes), 4, 4))
    for index, node in enumerate(nodes):
        values = {
            path: tracks.get((index, path), np.tile(node.get(path, default), (n, 1)))
            for path, default in (
                ("translation", [0.0] * 3), ("rotation", [0.0, 0.0, 0.0, 1.0]), ("scale", [1.0] * 3)
            )
        }  # fmt: skip
        turn = Rotation.from_quat(values["rotation"]).as_matrix()
        local[:, index, :3, :3] = turn * np.asarray(values["scale"], float)[:, None, :]
        local[:, index, :3, 3] = values["translation"]
        local[:, index, 3, 3] = 1.0
    parent = {child: index for index, node in enumerate(nodes) for child in node.get("children", [])}
    world: dict[int, np.ndarray] = {}

    def of(node: int) -> np.ndarray:
        if node not in world:
            world[node] = of(parent[node]) @ local[:, node] if node in parent else local[:, node]
        return world[node]

    return np.stack([of(node) for node in range(len(nodes))], axis=1)


def skinned_vertices_m(document: GltfDocument, worlds: np.ndarray) -> np.ndarray:
    """World positions (T, V, 3) of the vertices of the first skin's mesh."""
    node = next(node for node in document.json["nodes"] if "skin" in node)
    skin = document.json["skins"][node["skin"]]
    inverse = document.array(skin["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1)
    attributes = document.json["meshes"][node["mesh"]]["primitives"][0]["attributes"]
    vertices = document.array(attributes["POSITION"])
    joints = document.array(attributes["JOINTS_0"]).astype(int)
    weights = document.array(attributes["WEIGHTS_0"])
    moved = worlds[:, skin["joints"]] @ inverse  # (T, J, 4, 4)
    of_vertex = np.einsum("vk,tvkij->tvij", weights, moved[:, joints])
    return np.einsum("tvij,vj->tvi", of_vertex[..., :3, :3], vertices) + of_vertex[..., :3, 3]
