"""glTF files read as the format says, in all their forms."""

from __future__ import annotations

import base64
import json
import struct
import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from choreograph.core.errors import FormatError
from choreograph.formats.gltf import read_rig, read_skin_points
from choreograph.formats.gltf_document import GltfDocument, read_gltf


def as_gltf(document: GltfDocument, folder, *, embedded: bool):
    """The document as text, with its buffer in it or beside it."""
    data, binary = as_parts(document)
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


def as_parts(document: GltfDocument) -> tuple[dict, bytes]:
    """The JSON and the buffer of a document."""
    content = document.to_glb()
    n_json = struct.unpack_from("<I", content, 12)[0]
    return json.loads(content[20 : 20 + n_json]), content[28 + n_json :]


@pytest.mark.parametrize("name", ["EXT_meshopt_compression", "KHR_meshopt_compression"])
def test_what_is_compressed_is_named_with_the_cure(glb, tmp_path, name):
    """The views of the plain data lie in a buffer that is not in the file, which is no damage."""
    data, binary = as_parts(read_gltf(glb))
    data |= {"extensionsUsed": [name, "KHR_mesh_quantization"], "extensionsRequired": [name]}
    data["buffers"] = [
        {"byteLength": len(binary), "uri": "data:application/octet-stream;base64,AAAA"},
        {"byteLength": len(binary), "extensions": {name: {"fallback": True}}},
    ]
    for view in data["bufferViews"]:
        compressed = {"buffer": 0, "byteLength": 3, "byteStride": 4, "mode": "ATTRIBUTES", "count": 1}
        view |= {"buffer": 1, "extensions": {name: compressed}}
    (tmp_path / "b.gltf").write_text(json.dumps(data))
    with pytest.raises(FormatError, match=name) as refused:
        read_gltf(tmp_path / "b.gltf")
    message = str(refused.value)
    assert "damaged" not in message and "without compression" in message and "gltfpack" in message
    assert len(message) < 300 + len(str(tmp_path))


def test_plain_data_beside_compressed_data_are_read(glb, tmp_path):
    """Where compression is not required, the views have the plain data, too."""
    document = read_gltf(glb)
    data, _ = as_parts(document)
    for view in data["bufferViews"]:
        view["extensions"] = {"EXT_meshopt_compression": {"buffer": 0, "byteOffset": 0, "byteLength": 3}}
    changed = GltfDocument(data | {"extensionsUsed": ["EXT_meshopt_compression"]}, as_parts(document)[1])
    (tmp_path / "b.glb").write_bytes(changed.to_glb())
    rigs = [read_rig(read_gltf(path)).rig for path in (glb, tmp_path / "b.glb")]
    np.testing.assert_array_equal(rigs[0].bind_pos_m, rigs[1].bind_pos_m)


HARMLESS = (
    "KHR_texture_transform", "KHR_materials_unlit", "KHR_materials_pbrSpecularGlossiness",
    "KHR_texture_basisu", "EXT_texture_webp", "KHR_lights_punctual", "KHR_mesh_quantization",
    "KHR_draco_mesh_compression",
    "KHR_materials_variants", "KHR_animation_pointer", "EXT_mesh_gpu_instancing", "VRMC_vrm", "MSFT_lod",
)  # fmt: skip


@pytest.mark.parametrize("name", HARMLESS)
def test_required_extensions_that_rigs_do_not_need_are_read(glb, name):
    document = read_gltf(glb)
    document.json |= {"extensionsUsed": [name], "extensionsRequired": [name]}
    glb.write_bytes(document.to_glb())
    assert read_rig(read_gltf(glb)).rig.n_bones > 20


def test_a_mesh_that_draco_compresses_leaves_the_rig_to_be_read(glb):
    """Its accessors state their bounds and have no data."""
    document = read_gltf(glb)
    plain = read_rig(document)
    for mesh in document.json["meshes"]:
        for primitive in mesh["primitives"]:
            for index in (*primitive["attributes"].values(), primitive["indices"]):
                document.json["accessors"][index].pop("bufferView", None)
            view = {"bufferView": 0, "attributes": {"POSITION": 0}}
            primitive["extensions"] = {"KHR_draco_mesh_compression": view}
    document.json["extensionsRequired"] = ["KHR_draco_mesh_compression"]
    glb.write_bytes(document.to_glb())
    read = read_gltf(glb)
    found = read_rig(read)
    np.testing.assert_array_equal(found.rig.bind_pos_m, plain.rig.bind_pos_m)
    assert found.rig.floor_m == plain.rig.floor_m
    assert len(read_skin_points(read, found).pos_m) == 0


def test_quantised_points_lie_where_plain_ones_do(glb):
    """KHR_mesh_quantization: points as normalised integers, whose bounds are integers, too."""
    document = read_gltf(glb)
    plain = read_rig(document)
    points = read_skin_points(document, plain).pos_m
    primitives = [p for mesh in document.json["meshes"] for p in mesh["primitives"]]
    positions = {primitive["attributes"]["POSITION"] for primitive in primitives}
    size = max(float(np.abs(document.array(index)).max()) for index in positions)  # of what becomes 1
    for skin in document.json["skins"]:
        inverse = document.array(skin["inverseBindMatrices"]).reshape(-1, 4, 4)
        inverse[:, :3] *= size
        skin["inverseBindMatrices"] = document.accessor(inverse.reshape(-1, 16).astype(np.float32))
    for index in positions:
        rows = np.round(32767 * document.array(index) / size).astype("<i2")
        document.json["accessors"][index] = {
            "bufferView": document.view(np.pad(rows, ((0, 0), (0, 1))).tobytes(), byteStride=8),
            "componentType": 5122, "normalized": True, "count": len(rows), "type": "VEC3",
            "min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist(),
        }  # fmt: skip
    glb.write_bytes(document.to_glb())
    read = read_gltf(glb)
    found = read_rig(read)
    np.testing.assert_allclose(read_skin_points(read, found).pos_m, points, atol=1e-3)
    assert found.rig.floor_m == pytest.approx(plain.rig.floor_m, abs=1e-3)


@pytest.mark.parametrize("has_view", [True, False])
@pytest.mark.parametrize("places", ["u1", "u2", "u4"])
def test_sparse_accessors(has_view, places):
    document = GltfDocument.empty("tests")
    rows = np.arange(12, dtype=np.float32).reshape(4, 3)
    index = document.accessor(rows)
    entry = document.json["accessors"][index]
    kind = {"u1": 5121, "u2": 5123, "u4": 5125}[places]
    entry["sparse"] = {
        "count": 2,
        "indices": {"bufferView": document.view(np.array([1, 3], places).tobytes()), "componentType": kind},
        "values": {"bufferView": document.view(np.full((2, 3), 9, np.float32).tobytes())},
    }
    if not has_view:
        entry.pop("bufferView")
        rows[:] = 0
    rows[[1, 3]] = 9
    np.testing.assert_array_equal(document.array(index), rows)


def test_images_of_any_type_are_told_apart(glb, tmp_path):
    for name, first in (("a.png", b"\x89PNG"), ("b.webp", b"RIFF1234WEBP"), ("c.ktx2", b"\xabKTX 20")):
        (tmp_path / name).write_bytes(first)
    (tmp_path / "d.jpg").write_bytes(b"\xff\xd8\xff")
    document = read_gltf(glb)
    document.json["images"] = [{"uri": name} for name in ("a.png", "b.webp", "c.ktx2", "d.jpg", "a.png")]
    read = read_gltf(as_gltf(document, tmp_path, embedded=True)).json["images"]
    assert [image["mimeType"].removeprefix("image/") for image in read] == [
        "png",
        "webp",
        "ktx2",
        "jpeg",
        "png",
    ]
    assert read[4] == read[0]


BIG_BYTES = 10_000_000


def a_buffer_again_and_again(data: dict) -> None:
    data["buffers"] = [{"uri": "big.bin", "byteLength": 1}] * 100


def a_buffer_by_100_names(data: dict) -> None:
    data["buffers"] = [{"uri": "./" * i + "big.bin", "byteLength": 1} for i in range(100)]


def itself(data: dict) -> None:
    data["buffers"] += [{"uri": "b.gltf", "byteLength": 1}] * 99
    data["padding"] = "x" * BIG_BYTES


def an_image_again_and_again(data: dict) -> None:
    data["images"] = [{"uri": "./" * i + "big.bin"} for i in range(100)]


def a_data_uri_again_and_again(data: dict) -> None:
    text = "data:;base64," + "A" * (BIG_BYTES // 100)
    data["images"] = [{"uri": text} for _ in range(100)]


@pytest.mark.parametrize(
    "refer",
    [
        a_buffer_again_and_again, a_buffer_by_100_names, itself, an_image_again_and_again,
        a_data_uri_again_and_again,
    ],
    ids=lambda refer: refer.__name__,
)  # fmt: skip
def test_100_references_take_the_memory_of_one(glb, tmp_path, refer):
    """They took 2.1 GB, 21 times as much as allowed here."""
    data, binary = as_parts(read_gltf(glb))
    (tmp_path / "big.bin").write_bytes(binary + bytes(BIG_BYTES - len(binary)))
    data["buffers"] = [{"uri": "big.bin", "byteLength": BIG_BYTES}]
    refer(data)
    (tmp_path / "b.gltf").write_text(json.dumps(data))
    tracemalloc.start()
    try:
        document = read_gltf(tmp_path / "b.gltf")
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 10 * BIG_BYTES
    assert read_rig(document).rig.n_bones > 20


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
