"""glTF files read as the format says, in all their forms; damaged and hostile ones refused in a line."""

from __future__ import annotations

import base64
import json
import re
import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic_characters import CHARACTERS, write_character

from choreograph.errors import FormatError
from choreograph.gltf import GltfDocument, read_gltf, read_rig
from choreograph.gltf.rig import distinct


@pytest.fixture
def glb(tmp_path):
    write_character(tmp_path / "a.glb", CHARACTERS["mixamo"])
    return tmp_path / "a.glb"


def as_gltf(document: GltfDocument, folder, *, embedded: bool):
    """The document as text, with its buffer in it or beside it."""
    content = document.to_glb()
    n_json = struct.unpack_from("<I", content, 12)[0]
    data, binary = json.loads(content[20 : 20 + n_json]), content[28 + n_json :]
    uri = "data:application/octet-stream;base64," + base64.b64encode(binary).decode()
    if not embedded:
        uri = "a%20buffer.bin"
        (folder / "a buffer.bin").write_bytes(binary)
    data["buffers"][0]["uri"] = uri
    (folder / "a.gltf").write_text(json.dumps(data), encoding="utf-8")
    return folder / "a.gltf"


@pytest.mark.parametrize("embedded", [True, False])
def test_all_forms_of_a_file_are_the_same_document(glb, tmp_path, embedded):
    document = read_gltf(glb)
    other = read_gltf(as_gltf(document, tmp_path, embedded=embedded))
    assert other.to_glb() == document.to_glb() == glb.read_bytes()


def test_images_beside_a_file_come_into_it(glb, tmp_path):
    (tmp_path / "skin.png").write_bytes(b"\x89PNG and more")
    document = read_gltf(glb)
    document.json["images"] = [{"uri": "skin.png"}]
    read = read_gltf(as_gltf(document, tmp_path, embedded=True))
    (image,) = read.json["images"]
    assert "uri" not in image and image["mimeType"] == "image/png"
    view = read.json["bufferViews"][image["bufferView"]]
    assert read.to_glb().count(b"\x89PNG and more") == 1 and view["byteLength"] == 13


@given(
    st.integers(1, 40),
    st.sampled_from([1, 2, 3, 4]),
    st.sampled_from(["f4", "u1", "u2", "u4"]),
    st.integers(0, 3),
)
@settings(max_examples=40, deadline=None)
def test_arrays_come_back_as_they_went_in(n, width, dtype, before):
    rng = np.random.default_rng(n)
    rows = (100 * rng.random((n, width) if width > 1 else n)).astype(dtype)
    document = GltfDocument.empty("tests")
    document.view(bytes(before))
    index = document.accessor(rows, bounds=True)
    np.testing.assert_array_equal(document.array(index), rows.astype(float))
    assert document.json["accessors"][index]["max"] == np.atleast_1d(rows.max(axis=0)).tolist()


def test_strides_and_normalised_integers(tmp_path):
    document = GltfDocument.empty("tests")
    interleaved = np.array([[-32767, 32767, 5, 5], [0, 16384, 5, 5]], "<i2")
    view = document.view(interleaved.tobytes(), byteStride=8)
    index = document.add(
        "accessors",
        {"bufferView": view, "componentType": 5122, "count": 2, "type": "VEC2", "normalized": True},
    )
    np.testing.assert_allclose(document.array(index), [[-1, 1], [0, 16384 / 32767]])


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
    assert f"expected {where}" in str(refused.value)


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
    assert distinct(["a", "b", "a", "a #2", "a"]) == ("a", "b", "a #2 #2", "a #2", "a #4")


@pytest.mark.parametrize(
    "change",
    [
        {"bufferView": 99}, {"count": 10**9}, {"count": 0}, {"componentType": 1}, {"type": "MAT9"},
        {"sparse": {}}, {"byteOffset": 10**12},
    ],
)  # fmt: skip
def test_an_accessor_that_lies_outside_is_refused(change):
    document = GltfDocument.empty("tests")
    index = document.accessor(np.zeros((3, 3), np.float32))
    document.json["accessors"][index] |= change
    with pytest.raises(FormatError):
        document.array(index)
