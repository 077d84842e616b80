"""60 sane GLB and glTF files, as programs write them: none is refused, and all hold the same dance."""

from __future__ import annotations

import base64
import json
import struct
from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from acceptance.corpus import SaneFile, assert_read
from acceptance.gltf_edits import (
    Edit,
    as_matrices,
    as_vrm_0,
    attribute_as,
    by_default,
    compressed_by_draco,
    dancing,
    entries,
    interleaved,
    interpolated,
    of_bodies,
    of_names,
    quantised,
    requiring,
    rotations_as,
    sparse_keys,
    sparse_points,
    under,
    with_an_empty_animation,
    with_camera,
    with_camera_animation,
    with_extras,
    with_few_keys,
    with_greatest_bounds,
    with_joints_in_another_order,
    with_lights,
    with_more_binds,
    with_morph_targets,
    with_one_key,
    with_pointer,
    with_props,
    with_scale_tracks,
    with_skin_of_some,
    with_times,
    with_two_skins,
    without,
    without_bounds,
    without_skin,
)

from choreograph.characters.character import read_character
from choreograph.formats.gltf_document import GltfDocument
from choreograph.formats.register import import_takes
from choreograph.motion.body import body_pos_m

WITHIN = 0.02  # of distances between joints; rotations in 8 bits are that coarse


def as_glb(document: GltfDocument, folder: Path) -> Path:
    (folder / "take.glb").write_bytes(document.to_glb())
    return folder / "take.glb"


def parts(document: GltfDocument) -> tuple[dict, bytes]:
    content = document.to_glb()
    n_json = struct.unpack_from("<I", content, 12)[0]
    return json.loads(content[20 : 20 + n_json]), content[28 + n_json :]


def as_text(
    *, media: str = "application/octet-stream", indent: int | None = None, mark: str = ""
) -> Callable:
    """A .gltf with its buffer in it."""

    def write(document: GltfDocument, folder: Path) -> Path:
        data, binary = parts(document)
        data["buffers"][0]["uri"] = f"data:{media};base64,{base64.b64encode(binary).decode()}"
        (folder / "take.gltf").write_text(mark + json.dumps(data, indent=indent), encoding="utf-8")
        return folder / "take.gltf"

    return write


def beside(uri: str, name: str) -> Callable:
    """A .gltf with its buffer beside it."""

    def write(document: GltfDocument, folder: Path) -> Path:
        data, binary = parts(document)
        data["buffers"][0]["uri"] = uri
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(binary)
        (folder / "take.gltf").write_text(json.dumps(data))
        return folder / "take.gltf"

    return write


def in_two_buffers(document: GltfDocument, folder: Path) -> Path:
    data, binary = parts(document)
    data["buffers"] = [{"uri": f"{name}.bin", "byteLength": len(binary)} for name in "ab"]
    for view in data["bufferViews"][::2]:
        view["buffer"] = 1
    for name in "ab":
        (folder / f"{name}.bin").write_bytes(binary)
    (folder / "take.gltf").write_text(json.dumps(data))
    return folder / "take.gltf"


def with_another_chunk(document: GltfDocument, folder: Path) -> Path:
    content = document.to_glb() + struct.pack("<II", 4, 0x12345678) + b"more"
    (folder / "take.glb").write_bytes(content[:8] + struct.pack("<I", len(content)) + content[12:])
    return folder / "take.glb"


def in_capitals(document: GltfDocument, folder: Path) -> Path:
    return as_glb(document, folder).rename(folder / "TAKE.GLB")


def alone(document: GltfDocument, folder: Path) -> Path:
    """Without the pictures that it names, which motion does not need."""
    document.json["images"] = [{"uri": "../textures/skin.png"}]
    return as_text()(document, folder)


PARTS: dict[str, Edit] = {
    "rotations in 16 bits": rotations_as("i2"),
    "rotations in 8 bits": rotations_as("i1"),
    "joints in 8 bits": attribute_as("JOINTS_0", "u1"),
    "joints in 16 bits": attribute_as("JOINTS_0", "u2"),
    "weights in 8 bits": attribute_as("WEIGHTS_0", "u1"),
    "weights in 16 bits": attribute_as("WEIGHTS_0", "u2"),
    "quantised points": quantised,
    "interleaved": interleaved,
    "sparse keys": sparse_keys,
    "sparse points": sparse_points,
    "steps": interpolated("STEP"),
    "splines": interpolated("CUBICSPLINE"),
    "interpolation by default": by_default,
    "matrices": as_matrices,
    "in another place": under(translation=[3.0, 0.0, -2.0]),
    "larger": under(scale=[2.0, 2.0, 2.0]),
    "in another heading": under(rotation=[0.0, 0.6, 0.0, 0.8]),
    "a camera that moves": with_camera,
    "an animation of a camera": with_camera_animation,
    "morph targets": with_morph_targets,
    "an animation of materials": with_pointer,
    "extras": with_extras,
    "materials of extensions": requiring("KHR_materials_unlit", "KHR_texture_transform"),
    "textures of extensions": requiring("KHR_texture_basisu", "EXT_texture_webp"),
    "lights": with_lights,
    "Draco": compressed_by_draco,
    "nodes without names": of_bodies(lambda _, node: node.pop("name", None)),
    "nodes of one name": of_bodies(lambda _, node: node.update(name="Object")),
    "empty children": of_bodies(lambda _, node: node.setdefault("children", [])),
    "names without a colon": of_names(lambda name: name.replace(":", "")),
    "names with another prefix": of_names(lambda name: name.replace("mixamorig:", "mixamorig9:")),
    "names with a path": of_names(lambda name: f"Armature/{name}"),
    "two skins": with_two_skins,
    "a skin of some joints": with_skin_of_some,
    "no skin": without_skin,
    "the skin's skeleton": lambda document: entries(document, "skins")[0].update(skeleton=0),
    "joints in another order": with_joints_in_another_order,
    "more bind matrices": with_more_binds,
    "scale tracks": with_scale_tracks,
    "keys from 1 s": with_times(lambda times: times + 1.0),
    "keys before 0 s": with_times(lambda times: times - 0.5),
    "keys at 24 a second": with_times(lambda times: times * 30 / 24),
    "keys at 120 a second": with_times(lambda times: times / 4),
    "few keys": with_few_keys,
    "one key": with_one_key,
    "no name of the animation": lambda document: entries(document, "animations")[0].pop("name"),
    "an empty animation": with_an_empty_animation,
    "several scenes": lambda document: document.add("scenes", {"name": "other", "nodes": []}),
    "no scene": without("scenes"),
    "no scene that is shown": without("scene"),
    "no bounds": without_bounds,
    "bounds that were not measured": with_greatest_bounds,
    "props": with_props,
    "rights": lambda document: document.json["asset"].update(copyright="©", minVersion="2.0", generator=""),
}  # fmt: skip
FORMS: dict[str, Callable[[GltfDocument, Path], Path]] = {
    "GLB": as_glb,
    "text": as_text(),
    "text of another media type": as_text(media="application/gltf-buffer"),
    "text in lines": as_text(indent=2),
    "text with a byte order mark": as_text(mark="\ufeff"),
    "a buffer beside": beside("take.bin", "take.bin"),
    "a buffer with a space": beside("a%20take.bin", "a take.bin"),
    "a buffer in a folder": beside("data/take.bin", "data/take.bin"),
    "a buffer by ./": beside("./take.bin", "take.bin"),
    "two buffers": in_two_buffers,
    "another chunk": with_another_chunk,
    "a suffix in capitals": in_capitals,
}
RIGS = ("unreal", "vrm", "rigify", "child", "posed", "without toes", "few spine bones", "mannequin")


def sane(name: str, spec: str, edit: Edit | None, write: Callable[[GltfDocument, Path], Path]) -> SaneFile:
    def made(folder: Path) -> Path:
        document = dancing(spec).copy()
        if edit is not None:
            edit(document)
        return write(document, folder)

    return SaneFile(f"{spec}, {name}", made)


FILES = [
    *(sane(name, "mixamo", edit, as_glb) for name, edit in PARTS.items()),
    *(sane(name, "mixamo", None, write) for name, write in FORMS.items()),
    *(sane("as it is", spec, None, as_glb) for spec in RIGS),
    sane("VRM 0", "vrm", as_vrm_0, as_glb),
    sane("rotations in 16 bits and splines", "unreal", interpolated("CUBICSPLINE"), in_two_buffers),
]
WITHOUT_PICTURES = sane("no pictures", "mixamo", None, alone)  # its motion is read


def sizes(motion) -> np.ndarray:
    """Distances between joints in the first frame, in units of the thigh's length."""
    pos_m = body_pos_m(motion)[0]
    apart_m = np.linalg.norm(pos_m[:, None] - pos_m[None], axis=-1)
    return apart_m / apart_m[1, 4]


@cache
def sizes_of(spec: str) -> np.ndarray:
    """As a dance on a rig has them."""
    with TemporaryDirectory() as folder:
        (take,) = import_takes(as_glb(dancing(spec), Path(folder)))
        return sizes(take.motion)


def read_as_the_same_dance(path: Path) -> None:
    """Read a file as a take and as a character."""
    (take,) = import_takes(path)
    apart = np.abs(sizes(take.motion) - sizes_of(path.parent.name.split(",")[0]))
    assert apart.max() < WITHIN, f"{path.parent.name}: {apart.max():.3f}"
    if "no skin" not in path.parent.name and "no pictures" not in path.parent.name:
        assert len(read_character(path).bones) > 15


def test_60_sane_gltf_files_are_read(tmp_path):
    assert_read([*FILES, WITHOUT_PICTURES], read_as_the_same_dance, tmp_path, n_files=60)
