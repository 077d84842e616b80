"""Documents of glTF: damaged ones, and counts in their animations."""

from __future__ import annotations

import json
import re
import struct

import numpy as np
import pytest
from synthetic_characters import CHARACTERS, write_character
from synthetic_motions import stepping

from choreograph.characters.character import read_character
from choreograph.core.counts import DATA_SET, Figure
from choreograph.core.errors import FormatError, ParameterError
from choreograph.formats.glb import dance_document
from choreograph.formats.gltf import read_rig
from choreograph.formats.gltf_document import KEY, GltfDocument, marks_of, read_gltf, start_s, with_marks
from choreograph.formats.register import read_take, save_motion
from choreograph.formats.usd import ANIMATION_PATH
from choreograph.formats.writer import distinct
from choreograph.pipeline.counting import CountedFile, count_file, save_counts


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


TABLE = "time_s,number,figure\n" + "".join(
    f"{0.3 + 0.5 * beat},{beat % 4 + 1},{'box' if beat == 4 else ''}\n" for beat in range(18)
)


@pytest.fixture
def counted(tmp_path) -> CountedFile:
    """A motion of 10 s with 18 counts of its own."""
    save_motion(tmp_path / "take.bvh", stepping(10 * 30, seed=1))
    (tmp_path / "take.counts.csv").write_text(TABLE)
    return count_file(tmp_path / "take.bvh")


def assert_same_counts(again: CountedFile, counted: CountedFile) -> None:
    assert np.allclose(again.counts.times_s, counted.counts.times_s, atol=1e-4)
    assert again.counts.numbers.tolist() == counted.counts.numbers.tolist()
    assert (again.counts.metre, again.is_sure) == (counted.counts.metre, True)
    assert [(f.name, f.n_counts) for f in again.figures] == [(f.name, f.n_counts) for f in counted.figures]
    assert [loop.n_counts for loop in again.loops] == [loop.n_counts for loop in counted.loops]


def test_counts_come_back_from_a_glb(tmp_path, counted):
    save_counts(tmp_path / "counted.glb", counted)
    again = count_file(tmp_path / "counted.glb")
    assert_same_counts(again, counted)
    assert again.counts.source == DATA_SET and again.figures[0].name == "box"
    stated = read_gltf(tmp_path / "counted.glb").json["animations"][0]["extras"][KEY]
    assert stated["numbers"] == counted.facts()["numbers"] and stated["loops"] == counted.facts()["loops"]
    (tmp_path / "counted.counts.csv").write_text("time_s,number\n1,1\n2,2\n")
    assert len(count_file(tmp_path / "counted.glb").counts) == 2  # what lies beside it is newer


def test_a_glb_is_kept_but_for_its_counts(tmp_path, counted):
    write_character(tmp_path / "hero.glb", CHARACTERS["mixamo"])
    document = read_character(tmp_path / "hero.glb").dancing(counted.take.motion)
    (tmp_path / "dance.glb").write_bytes(document.to_glb())
    (tmp_path / "dance.counts.csv").write_text(TABLE)
    save_counts(tmp_path / "counted.glb", count_file(tmp_path / "dance.glb"))
    before, after = read_gltf(tmp_path / "dance.glb"), read_gltf(tmp_path / "counted.glb")
    after.json["animations"][0].pop("extras")
    assert after.json == before.json
    assert_same_counts(count_file(tmp_path / "counted.glb"), counted)


def test_counts_are_those_of_the_keys(counted):
    """The first key of an animation need not be at 0 s."""
    document = dance_document(counted.take.motion)
    data = document.json["animations"][0]
    times_s = document.array(data["samplers"][0]["input"])
    later = document.accessor((times_s + 2.5).astype(np.float32), bounds=True)
    for sampler in data["samplers"]:
        sampler["input"] = later
    marked = with_marks(document, counted.facts())
    own = marked.json["animations"][0]
    assert start_s(marked, own) == 2.5
    assert own["extras"][KEY]["times_s"][0] == pytest.approx(2.8, abs=1e-4)
    counts, figures = marks_of(marked, own)
    assert np.allclose(counts.times_s, counted.counts.times_s, atol=1e-4)
    assert figures[0].start_s == pytest.approx(counted.figures[0].start_s, abs=1e-4)
    assert "extras" not in document.json["animations"][0]


def test_counts_come_back_from_usd(tmp_path, counted):
    pxr = pytest.importorskip("pxr.Usd")
    for suffix in ("usda", "usdc"):
        save_counts(tmp_path / f"a.{suffix}", counted)
        stage = pxr.Stage.Open(str(tmp_path / f"a.{suffix}"))
        facts, stated = counted.facts(), stage.GetRootLayer().customLayerData[KEY]
        assert list(stated["times_s"]) == facts["times_s"] and list(stated["numbers"]) == facts["numbers"]
        assert stated["metre"] == 4 and stated["loops"]["loop_1"] == facts["loops"][0]
        assert stated["figures"]["figure_1"]["name"] == "box"
        samples = stage.GetPrimAtPath(ANIMATION_PATH).GetAttribute("count")
        found_s = np.array(samples.GetTimeSamples()) / stage.GetTimeCodesPerSecond()
        assert np.allclose(found_s, facts["times_s"])
        assert [samples.Get(time) for time in samples.GetTimeSamples()] == facts["numbers"]


def test_counts_that_are_not_certain_are_not_taken(counted):
    document = with_marks(dance_document(counted.take.motion), {**counted.facts(), "is_sure": False})
    counts, figures = marks_of(document, document.json["animations"][0])
    assert len(counts) == 0 and figures == ()


@pytest.mark.parametrize(
    "change",
    [{"times_s": [2.0, 1.0], "numbers": [1, 2]}, {"numbers": [1]}, {"metre": 99}, {"figures": [3]},
     {"confidence": "high"}, {"times_s": "now"}],
)  # fmt: skip
def test_damaged_counts_are_refused(tmp_path, counted, change):
    marked = with_marks(dance_document(counted.take.motion), counted.facts())
    marked.json["animations"][0]["extras"][KEY] |= change
    (tmp_path / "a.glb").write_bytes(marked.to_glb())
    with pytest.raises(FormatError, match=r"a\.glb: expected choreograph_counts"):
        read_take(tmp_path / "a.glb")


def test_extras_of_others_are_kept_and_not_read():
    document = GltfDocument.empty("x")
    document.json["animations"] = [{"extras": {"mine": 1}}, {"extras": 3}]
    for animation in document.json["animations"]:
        assert len(marks_of(document, animation)[0]) == 0
    facts = {"times_s": [], "numbers": [], "loops": [], "figures": [], "name": "x"}
    marked = with_marks(document, facts)
    assert marked.json["animations"][0]["extras"]["mine"] == 1
    assert "name" not in marked.json["animations"][1]["extras"][KEY]


def test_a_song_has_no_animation_to_write(tmp_path, counted):
    song = CountedFile("a", "song", 9.0, counted.counts, (), (Figure("A", 0, 1, 2),), True)
    for suffix in ("glb", "usda"):
        with pytest.raises(ParameterError, match="counts of an animation"):
            save_counts(tmp_path / f"a.{suffix}", song)
    save_counts(tmp_path / "a.json", song)
    assert json.loads((tmp_path / "a.json").read_text())["figures"][0]["name"] == "A"
