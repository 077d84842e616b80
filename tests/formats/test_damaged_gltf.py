"""Damaged and hostile glTF files are refused in a line, with what is wrong."""

from __future__ import annotations

import json
import re
import struct

import numpy as np
import pytest

from choreograph.core.errors import FormatError
from choreograph.formats.gltf_document import GltfDocument
from choreograph.formats.gltf_files import read_gltf
from choreograph.formats.gltf_rig import read_rig
from choreograph.formats.writer import distinct


def changed(change):
    def write(path, content):
        n = struct.unpack_from("<I", content, 12)[0]
        data = json.loads(content[20 : 20 + n])
        change(data)
        path.write_text(json.dumps(data), encoding="utf-8")

    return write


HOSTILE = {
    "truncated": lambda path, content: path.write_bytes(content[: len(content) // 2]),
    "cut in its header": lambda path, content: path.write_bytes(content[:10]),
    "of version 1": lambda path, content: path.write_bytes(content[:4] + struct.pack("<I", 1) + content[8:]),
    "without JSON": lambda path, content: path.write_bytes(content[:12]),
    "not JSON": lambda path, content: path.write_text("<html>"),
    "deep JSON": lambda path, content: path.write_text("[" * 200_000),
    "a list": lambda path, content: path.write_text("[]"),
    "of another format": lambda path, content: path.write_text('{"asset": {"version": "1.0"}}'),
    "nodes that are numbers": changed(lambda data: data.update(nodes=[1, 2])),
    "nodes that are no list": changed(lambda data: data.update(nodes={"0": {}})),
    "10⁶ nodes": changed(lambda data: data.update(nodes=[{}] * 1_000_000)),
    "a file elsewhere": changed(lambda data: data["buffers"][0].update(uri="../../../etc/passwd")),
    "an absolute path": changed(lambda data: data["buffers"][0].update(uri="/etc/passwd")),
    "an address": changed(lambda data: data["buffers"][0].update(uri="http://example.com/a.bin")),
    "a buffer that is not there": changed(lambda data: data["buffers"][0].update(uri="none.bin")),
    "no base64": changed(lambda data: data["buffers"][0].update(uri="data:,***")),
    "a NUL in a name": changed(lambda data: data["buffers"][0].update(uri="a%00b.bin")),
    "NaN": changed(lambda data: data["nodes"][0].update(translation=[float("nan"), 0, 0])),
    "10⁷ objects": lambda path, content: path.write_text(
        '{"asset":{"version":"2.0"},"x":[' + "{}," * 10_000_000 + "0]}"
    ),
    "a view of no buffer": changed(lambda data: data["bufferViews"][0].update(buffer=7)),
}


@pytest.mark.parametrize("hostile", HOSTILE)
def test_a_hostile_file_is_refused_in_a_line(glb, hostile):
    path = glb.with_name("b.glb")
    HOSTILE[hostile](path, glb.read_bytes())
    with pytest.raises(FormatError) as refused:
        read_gltf(path)
    assert "\n" not in str(refused.value) and str(path.parent) in str(refused.value)


MISFITS = {
    "nodes[0].translation": [1e300, 0, 0],
    "nodes[0].rotation": [0, 0, 1],
    "nodes[0].scale": "big",
    "nodes[1].children": 5,
    "nodes[1].children[0]": -1,
    "nodes[1].name": "\ud800",
    "skins[0].joints": None,
    "skins[0].joints[2]": "3",
    "skins[0].inverseBindMatrices": [1],
    "meshes[0].primitives[0]": 7,
    "meshes[0].primitives[0].attributes.POSITION": {},
    "accessors[0].count": "3",
    "accessors[0].byteOffset": -8,
    "accessors[0].min": [10**400],
    "bufferViews[0].byteOffset": [0],
    "bufferViews[0].extensions": {"EXT_meshopt_compression": 3},
    "bufferViews[0].buffer": True,
    "extensions.VRMC_vrm.humanoid": [],
}


@pytest.mark.parametrize("where", MISFITS)
def test_what_is_not_as_the_format_says_is_named(glb, where):
    def put(data):
        data["extensions"] = {"VRMC_vrm": {"humanoid": {"humanBones": {}}}}
        *way, last = re.findall(r"\w+", where)
        holder = data
        for key in way:
            holder = holder[int(key) if key.isdigit() else key]
        holder[int(last) if last.isdigit() else last] = MISFITS[where]

    path = glb.with_name("b.glb")
    changed(put)(path, glb.read_bytes())
    with pytest.raises(FormatError, match="damaged") as refused:
        read_rig(read_gltf(path))
    assert f"another value of {where}" in str(refused.value)


def looped(data):
    data["nodes"][3]["children"] = [1]
    data["nodes"][1]["children"] = [3]


BAD_RIGS = {
    "no bones in a skin": lambda data: data["skins"][0].update(joints=[]),
    "a bone that is not there": lambda data: data["skins"][0]["joints"].append(999),
    "a child that is not there": lambda data: data["nodes"][0].update(children=[999]),
    "a loop": looped,
    "a rotation of nothing": lambda data: data["nodes"][0].update(rotation=[0, 0, 0, 0]),
    "10⁵ bones": lambda data: data["skins"][0].update(
        joints=[data["nodes"].append({}) or len(data["nodes"]) - 1 for _ in range(90_000)]
    ),
    "a chain of 10⁴ bones": lambda data: data["nodes"].extend(
        {"children": [len(data["nodes"]) + i + 1]} if i < 9999 else {"children": [0]} for i in range(10_000)
    ),
    "a mesh that is not there": lambda data: data["nodes"][-2].update(mesh=999, skin=0),
}  # fmt: skip


@pytest.mark.parametrize("bad", BAD_RIGS)
def test_a_rig_that_cannot_be_is_refused_in_a_line(glb, bad):
    path = glb.with_name("b.glb")
    changed(BAD_RIGS[bad])(path, glb.read_bytes())
    document = read_gltf(path)
    # As text it has no buffer: the binds are taken to be identities.
    document.json["skins"][0].pop("inverseBindMatrices")
    with pytest.raises(FormatError) as refused:
        read_rig(document)
    assert "\n" not in str(refused.value) and str(path) in str(refused.value)


def test_names_that_repeat_are_told_apart():
    names = distinct(["a", "b", "a", "a #2", "a"], form="{} #{}")
    assert names == ("a", "b", "a #3", "a #2", "a #4")


def sparse(count: int, view: int, kind: int) -> dict:
    indices = {"bufferView": view, "componentType": kind}
    return {"count": count, "indices": indices, "values": {"bufferView": 0}}


@pytest.mark.parametrize(
    "change",
    [
        {"bufferView": 99}, {"count": 10**9}, {"count": 0}, {"componentType": 1}, {"type": "MAT9"},
        {"sparse": {}}, {"byteOffset": 10**12},
        {"sparse": sparse(9, 0, 5121)},
        {"sparse": sparse(1, 9, 5121)},
        {"sparse": sparse(1, 0, 5126)},
    ],
)  # fmt: skip
def test_an_accessor_that_lies_outside_is_refused(change):
    document = GltfDocument.empty("tests")
    index = document.accessor(np.zeros((3, 3), np.float32))
    document.json["accessors"][index] |= change
    with pytest.raises(FormatError):
        document.array(index)
