"""Counts that are written with an animation come back: from GLB by `count`, from USD by its own library."""

from __future__ import annotations

import json

import numpy as np
import pytest
from synthetic_characters import CHARACTERS, write_character
from synthetic_motions import stepping

from choreograph.characters.gltf_character import read_character
from choreograph.core.counts import DATA_SET, Figure
from choreograph.core.errors import FormatError, ParameterError
from choreograph.formats.count_marks import KEY, marks_of, start_s, with_marks
from choreograph.formats.glb import dance_document
from choreograph.formats.gltf_document import GltfDocument
from choreograph.formats.gltf_files import read_gltf
from choreograph.formats.register import read_take, save_motion
from choreograph.formats.usd import ANIMATION_PATH
from choreograph.pipeline.counting import CountedFile, count_file, save_counts

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
