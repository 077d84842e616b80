"""Changes of a glTF document that dances, as programs write them: its motion stays the same."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from synthetic_characters import CHARACTERS, write_character
from synthetic_motions import swaying

from choreograph.characters.character import read_character
from choreograph.formats.gltf_document import GltfDocument
from choreograph.formats.register import save_motion

INTEGERS = {"i1": (5120, 127), "i2": (5122, 32767), "u1": (5121, 255), "u2": (5123, 65535)}
Edit = Callable[[GltfDocument], object]


@cache
def dancing(spec: str) -> GltfDocument:
    """A character of a rig that dances; to be copied before it is changed."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "a.glb"
        if spec == "mannequin":
            save_motion(path, swaying(40))
            return read_character(path).document
        write_character(path, CHARACTERS[spec])
        return read_character(path).dancing(swaying(40))


def entries(document: GltfDocument, kind: str) -> list[dict]:
    return document.json.setdefault(kind, [])


def primitives(document: GltfDocument) -> list[dict]:
    return [primitive for mesh in entries(document, "meshes") for primitive in mesh["primitives"]]


def samplers(document: GltfDocument, path: str) -> list[dict]:
    (animation,) = entries(document, "animations")
    return [animation["samplers"][c["sampler"]] for c in animation["channels"] if c["target"]["path"] == path]


def replaced(
    document: GltfDocument, index: int, rows: np.ndarray, *, stride: int = 0, **more: object
) -> None:
    """Give an accessor other numbers of another type."""
    component = {"f4": 5126, **{name: number for name, (number, _) in INTEGERS.items()}}[rows.dtype.str[1:]]
    row_bytes = rows.dtype.itemsize * rows.shape[1]
    packed = np.zeros((len(rows), max(stride, row_bytes)), np.uint8)
    packed[:, :row_bytes] = np.ascontiguousarray(rows).view(np.uint8).reshape(len(rows), -1)
    entry = entries(document, "accessors")[index]
    strided = {"byteStride": stride} if stride else {}
    entry |= {"bufferView": document.view(packed.tobytes(), **strided), "componentType": component, **more}
    entry.pop("byteOffset", None)


def rotations_as(dtype: str) -> Edit:
    """Rotations as normalised integers."""

    def edit(document: GltfDocument) -> None:
        for sampler in samplers(document, "rotation"):
            rows = np.round(document.array(sampler["output"]) * INTEGERS[dtype][1]).astype(dtype)
            replaced(document, sampler["output"], rows, normalized=True)

    return edit


def attribute_as(name: str, dtype: str) -> Edit:
    """A mesh's joints or weights as integers."""

    def edit(document: GltfDocument) -> None:
        normalised = {"normalized": True} if name.startswith("WEIGHTS") else {}
        for index in {primitive["attributes"][name] for primitive in primitives(document)}:
            scale = INTEGERS[dtype][1] if normalised else 1
            rows = np.round(document.array(index) * scale).astype(dtype)
            replaced(document, index, rows, stride=max(4, rows.dtype.itemsize * 4), **normalised)

    return edit


def quantised(document: GltfDocument) -> None:
    """Points as integers that are not normalised; the bind matrices scale them back."""
    document.json["extensionsRequired"] = document.json["extensionsUsed"] = ["KHR_mesh_quantization"]
    indices = {primitive["attributes"]["POSITION"] for primitive in primitives(document)}
    size = max(np.abs(document.array(index)).max() for index in indices) / 32767
    for index in indices:
        rows = np.round(document.array(index) / size).astype("i2")
        bounds = {"min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist()}
        replaced(document, index, rows, stride=8, **bounds)
    for skin in entries(document, "skins"):
        inverse = document.array(skin["inverseBindMatrices"]).reshape(-1, 4, 4)
        inverse[:, :3] *= size
        replaced(document, skin["inverseBindMatrices"], inverse.reshape(-1, 16).astype("f4"))


def interleaved(document: GltfDocument) -> None:
    """Points, joints and weights of a vertex beside each other in one view."""
    first = primitives(document)[0]["attributes"]
    names = ("POSITION", "JOINTS_0", "WEIGHTS_0")
    kinds = (("f4", 5126), ("u2", 5123), ("f4", 5126))
    parts = [document.array(first[name]).astype(kind) for name, (kind, _) in zip(names, kinds, strict=True)]
    raw = [part.view(np.uint8).reshape(len(part), -1) for part in parts]
    view = document.view(np.hstack(raw).tobytes(), byteStride=sum(part.shape[1] for part in raw))
    offset = 0
    for name, (_, component), part in zip(names, kinds, raw, strict=True):
        entry = entries(document, "accessors")[first[name]]
        entry |= {"bufferView": view, "byteOffset": offset, "componentType": component}
        offset += part.shape[1]


def sparse(document: GltfDocument, index: int, *, has_view: bool) -> None:
    """Some or all rows of an accessor listed apart."""
    rows = document.array(index).astype("f4")
    places = np.arange(0 if not has_view else len(rows) // 2, len(rows), dtype="u2")
    entry = entries(document, "accessors")[index]
    entry["sparse"] = {
        "count": len(places),
        "indices": {"bufferView": document.view(places.tobytes()), "componentType": 5123},
        "values": {"bufferView": document.view(rows[places].tobytes())},
    }
    if has_view:
        rows[places] = 0
        replaced(document, index, rows)
    else:
        entry.pop("bufferView")


def sparse_keys(document: GltfDocument) -> None:
    for sampler in samplers(document, "rotation"):
        sparse(document, sampler["output"], has_view=False)


def sparse_points(document: GltfDocument) -> None:
    for index in {primitive["attributes"]["POSITION"] for primitive in primitives(document)}:
        sparse(document, index, has_view=True)


def interpolated(kind: str) -> Edit:
    """All tracks by another interpolation; tangents of splines are flat."""

    def edit(document: GltfDocument) -> None:
        for path in ("rotation", "translation"):
            for sampler in samplers(document, path):
                sampler["interpolation"] = kind
                if kind == "CUBICSPLINE":
                    rows = document.array(sampler["output"]).astype("f4")
                    triplets = np.stack([0 * rows, rows, 0 * rows], axis=1).reshape(-1, rows.shape[1])
                    sampler["output"] = document.accessor(triplets)

    return edit


def by_default(document: GltfDocument) -> None:
    for sampler in entries(document, "animations")[0]["samplers"]:
        sampler.pop("interpolation")


def as_matrices(document: GltfDocument) -> None:
    """Nodes that no track moves by their matrix."""
    moved = {channel["target"]["node"] for channel in entries(document, "animations")[0]["channels"]}
    for number, node in enumerate(entries(document, "nodes")):
        scale = node.pop("scale", None) if number not in moved else None
        if scale:
            node["matrix"] = np.diag([*scale, 1.0]).ravel().tolist()


def under(**transform: object) -> Edit:
    """All under a node of another place, size or heading."""

    def edit(document: GltfDocument) -> None:
        scene = entries(document, "scenes")[0]
        scene["nodes"] = [document.add("nodes", {"name": "World", "children": scene["nodes"], **transform})]

    return edit


def with_camera(document: GltfDocument) -> None:
    lens = {"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1}}
    node = document.add("nodes", {"name": "Camera", "camera": document.add("cameras", lens)})
    entries(document, "scenes")[0]["nodes"].append(node)
    animation = entries(document, "animations")[0]
    places = document.accessor(np.zeros((2, 3), "f4"))
    animation["samplers"].append({"input": document.accessor(np.array([0, 1], "f4")), "output": places})
    target = {"node": node, "path": "translation"}
    animation["channels"].append({"sampler": len(animation["samplers"]) - 1, "target": target})


def with_camera_animation(document: GltfDocument) -> None:
    with_camera(document)
    (animation,) = entries(document, "animations")
    channel = animation["channels"].pop()
    document.add(
        "animations", {"samplers": [animation["samplers"].pop()], "channels": [channel | {"sampler": 0}]}
    )


def with_morph_targets(document: GltfDocument) -> None:
    for primitive in primitives(document):
        primitive["targets"] = [{"POSITION": primitive["attributes"]["POSITION"]}]
    animation = entries(document, "animations")[0]
    times, weights = (document.accessor(np.array([0, 1], "f4")) for _ in range(2))
    animation["samplers"].append({"input": times, "output": weights})
    body = next(i for i, node in enumerate(entries(document, "nodes")) if "mesh" in node)
    target = {"node": body, "path": "weights"}
    animation["channels"].append({"sampler": len(animation["samplers"]) - 1, "target": target})


def with_pointer(document: GltfDocument) -> None:
    """KHR_animation_pointer moves something that is no node."""
    animation = entries(document, "animations")[0]
    pointer = {"KHR_animation_pointer": {"pointer": "/materials/0/emissiveFactor"}}
    animation["channels"].append({"sampler": 0, "target": {"path": "pointer", "extensions": pointer}})
    document.json["extensionsUsed"] = ["KHR_animation_pointer"]


def with_extras(document: GltfDocument) -> None:
    for kind in ("nodes", "skins", "meshes", "accessors", "bufferViews", "animations"):
        for entry in entries(document, kind):
            entry["extras"] = {"a": [1, None, {"b": "ü"}]}
    document.json["extras"] = "text"


def requiring(*names: str) -> Edit:
    def edit(document: GltfDocument) -> None:
        document.json["extensionsRequired"] = document.json["extensionsUsed"] = list(names)

    return edit


def with_lights(document: GltfDocument) -> None:
    document.json["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "point"}]}}
    document.add("nodes", {"extensions": {"KHR_lights_punctual": {"light": 0}}})
    requiring("KHR_lights_punctual")(document)


def compressed_by_draco(document: GltfDocument) -> None:
    for primitive in primitives(document):
        for index in primitive["attributes"].values():
            entries(document, "accessors")[index].pop("bufferView", None)
        primitive["extensions"] = {"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {}}}
    requiring("KHR_draco_mesh_compression")(document)


def as_vrm_0(document: GltfDocument) -> None:
    bones = document.json["extensions"].pop("VRMC_vrm")["humanoid"]["humanBones"]
    older = [{"bone": name, "node": bone["node"], "useDefaultValues": True} for name, bone in bones.items()]
    older += [{"bone": "jaw", "node": -1}]
    document.json["extensions"]["VRM"] = {"humanoid": {"humanBones": older}}
    document.json["extensionsUsed"] = ["VRM"]


def of_bodies(change: Callable[[int, dict], object]) -> Edit:
    """Change every node that is no joint."""

    def edit(document: GltfDocument) -> None:
        joints = {joint for skin in entries(document, "skins") for joint in skin["joints"]}
        for number, node in enumerate(entries(document, "nodes")):
            if number not in joints:
                change(number, node)

    return edit


def of_names(change: Callable[[str], str]) -> Edit:
    def edit(document: GltfDocument) -> None:
        for node in entries(document, "nodes"):
            node["name"] = change(node.get("name", ""))

    return edit


def with_two_skins(document: GltfDocument) -> None:
    """Clothes on the same joints."""
    skin = document.add("skins", dict(entries(document, "skins")[0]))
    body = next(node for node in entries(document, "nodes") if "mesh" in node)
    entries(document, "scenes")[0]["nodes"].append(document.add("nodes", body | {"skin": skin}))


def with_skin_of_some(document: GltfDocument) -> None:
    """Gloves, on a few of the joints."""
    skin = entries(document, "skins")[0]
    few = {"joints": skin["joints"][:3], "inverseBindMatrices": skin["inverseBindMatrices"]}
    document.add("skins", few)


def without_skin(document: GltfDocument) -> None:
    """Bones as nodes alone, as programs write motion without a body."""
    for kind in ("skins", "meshes"):
        document.json.pop(kind)
    of_bodies(lambda _, node: [node.pop(key, None) for key in ("mesh", "skin")])(document)


def with_joints_in_another_order(document: GltfDocument) -> None:
    for skin in entries(document, "skins"):
        inverse = document.array(skin["inverseBindMatrices"]).astype("f4")
        skin["inverseBindMatrices"] = document.accessor(inverse[::-1].copy())
        skin["joints"].reverse()


def with_scale_tracks(document: GltfDocument) -> None:
    animation = entries(document, "animations")[0]
    ones = document.accessor(np.ones((2, 3), "f4"))
    times = document.accessor(np.array([0, 1], "f4"))
    for node in {channel["target"]["node"] for channel in animation["channels"]}:
        target = {"node": node, "path": "scale"}
        animation["channels"].append({"sampler": len(animation["samplers"]), "target": target})
        animation["samplers"].append({"input": times, "output": ones})


def with_times(change: Callable[[np.ndarray], np.ndarray]) -> Edit:
    """Key times that are changed."""

    def edit(document: GltfDocument) -> None:
        for index in {sampler["input"] for sampler in entries(document, "animations")[0]["samplers"]}:
            times = change(document.array(index)).astype("f4")
            bounds = {"min": [float(times.min())], "max": [float(times.max())]}
            replaced(document, index, times[:, None], **bounds)

    return edit


def with_few_keys(document: GltfDocument) -> None:
    """Rotations by three keys; they are as they were at the first."""
    for sampler in samplers(document, "rotation"):
        kept = [0, 7, 39]
        times, rows = (document.array(sampler[end]).astype("f4")[kept] for end in ("input", "output"))
        sampler |= {"input": document.accessor(times, bounds=True), "output": document.accessor(rows)}


def with_one_key(document: GltfDocument) -> None:
    """A track of one key for each bone that is still."""
    for sampler in samplers(document, "rotation")[5:8]:
        times, rows = (document.array(sampler[end]).astype("f4")[:1] for end in ("input", "output"))
        sampler |= {"input": document.accessor(times, bounds=True), "output": document.accessor(rows)}


def without(key: str) -> Edit:
    return lambda document: document.json.pop(key)


def without_bounds(document: GltfDocument) -> None:
    for entry in entries(document, "accessors"):
        for end in ("min", "max"):
            entry.pop(end, None)


def with_greatest_bounds(document: GltfDocument) -> None:
    """Bounds of morph targets that were never measured."""
    rows = document.accessor(np.zeros((2, 3), "f4"))
    entries(document, "accessors")[rows] |= {"min": [3.4028234663852886e38] * 3, "max": [-3.4e38] * 3}


def with_more_binds(document: GltfDocument) -> None:
    for skin in entries(document, "skins"):
        inverse = document.array(skin["inverseBindMatrices"]).astype("f4")
        skin["inverseBindMatrices"] = document.accessor(
            np.vstack([inverse, np.eye(4, dtype="f4").reshape(1, 16)])
        )


def with_props(document: GltfDocument) -> None:
    hand = entries(document, "skins")[0]["joints"][-1]
    for number in range(500):
        prop = document.add("nodes", {"name": f"Prop {number}", "translation": [0, number / 100, 0]})
        entries(document, "nodes")[hand].setdefault("children", []).append(prop)


def with_an_empty_animation(document: GltfDocument) -> None:
    document.add("animations", {"name": "empty", "channels": [], "samplers": []})
