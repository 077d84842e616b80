"""What a glTF file shows, worked out from the format's own rules and nothing of the program's retargeting."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from choreograph.characters.character import GltfCharacter
from choreograph.formats.gltf_document import GltfDocument

BODY = ("pelvis", "spine1", "spine2", "spine3", "neck", "head", "left_hip", "right_hip")


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


def inside_body(
    document: GltfDocument, character: GltfCharacter, frames: np.ndarray, points_m: np.ndarray
) -> np.ndarray:
    """Whether points (T, 3) are inside trunk, head or thighs of a character (T,), by its mesh as posed."""
    primitives = document.json["meshes"][0]["primitives"]
    joints, weights = (document.array(primitives[0]["attributes"][k]) for k in ("JOINTS_0", "WEIGHTS_0"))
    moved_by = np.take_along_axis(joints, weights.argmax(axis=1)[:, None], axis=1)[:, 0].astype(int)
    (skin,) = document.json["skins"]
    body = [skin["joints"].index(character.nodes[character.bones[n]]) for n in BODY if n in character.bones]
    of_body = np.isin(moved_by, body)
    triangles = np.concatenate([document.array(p["indices"]).astype(int).reshape(-1, 3) for p in primitives])
    triangles = triangles[of_body[triangles].all(axis=1)]
    corners_m = skinned_vertices_m(document, node_worlds(document, frames))[:, triangles]  # (T, F, 3, 3)
    return np.array([winding(point, own) > 0.5 for point, own in zip(points_m, corners_m, strict=True)])


def winding(point_m: np.ndarray, corners_m: np.ndarray) -> float:
    """How often triangles (F, 3, 3) go around a point (3,): about 1 inside of them, 0 outside."""
    a, b, c = np.moveaxis(corners_m - point_m, 1, 0)
    la, lb, lc = (np.linalg.norm(side, axis=-1) for side in (a, b, c))
    volume = np.sum(a * np.cross(b, c), axis=-1)
    below = la * lb * lc + (a * b).sum(-1) * lc + (b * c).sum(-1) * la + (c * a).sum(-1) * lb
    return abs(float(np.sum(2.0 * np.arctan2(volume, below)))) / (4.0 * np.pi)
