"""Parts of a dance kept, the rest danced anew, by every engine: judged by the motion."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from command_line import run

import choreograph as cg
from choreograph.choreography.enforcement import danced_motifs
from choreograph.core.errors import ParameterError
from choreograph.plan.plan import PlannedWord

pytestmark = pytest.mark.slow

SONG = cg.example_songs()["house"]
SPAN_S = 20.0
FEW = {"candidates": 16}  # of the graph: nothing here is about the best path
KEEP = [cg.Keep(0.0, 6.0), cg.Keep(13.0, SPAN_S)]


@pytest.fixture(scope="module")
def old():
    return cg.dance(SONG, duration_s=SPAN_S, **FEW)


@pytest.fixture(scope="module", params=["graph", "mixer", "rollout"])
def new(request, old):
    few = FEW if request.param == "graph" else {}
    return cg.dance(SONG, duration_s=SPAN_S, engine=request.param, existing=old, keep=KEEP, seed=1, **few)


def frames(dance, keep):
    return slice(round(keep.start_s * dance.motion.fps), round(keep.end_s * dance.motion.fps))


def test_what_is_kept_is_the_existing_dance_to_the_bit_and_the_gap_is_not(old, new):
    assert new.motion.n_frames == old.motion.n_frames
    for keep in KEEP:
        part = frames(new, keep)
        assert np.array_equal(new.motion.root_pos_m[part], old.motion.root_pos_m[part])
        assert np.array_equal(new.motion.local_quat[part], old.motion.local_quat[part])
    gap = frames(new, cg.Keep(7.0, 12.0))
    dot = np.abs(np.sum(new.motion.local_quat[gap] * old.motion.local_quat[gap], axis=-1))
    assert 2 * np.arccos(dot.clip(max=1.0)).max() > 0.5  # rad


def test_the_plan_says_from_which_take_every_second_comes(old, new):
    (edit,) = new.plan.edits
    assert (edit.start_s, edit.end_s, edit.request) == (6.0, 13.0, "plan 6-13 again")
    assert replace(new.plan, edits=()) == old.plan
    blocks = new.plan.blocks
    for at_s in (0.5, 3.0, 5.9, 13.1, 19.5):  # as in the existing dance, where that is kept
        sources = [
            [(b.source, b.source_s(at_s)) for b in plan.blocks if b.start_s <= at_s < b.end_s]
            for plan in (old.plan, new.plan)
        ]
        assert sources[0] == sources[1]
    assert blocks[0].start_s == 0.0 and blocks[-1].end_s == pytest.approx(new.plan.duration_s)
    for before, after in pairwise(blocks):
        assert before.end_s == pytest.approx(after.start_s, abs=2e-3)
    assert cg.Plan.from_json(new.plan.to_json()) == new.plan


def test_the_plan_is_rendered_again_and_edited(old, new):
    starter = cg.starter_repertoire()
    if not new.plan.from_takes:  # a network danced the gap
        with pytest.raises(ParameterError, match="rollout engine, which holds motifs"):
            cg.render(new.plan, starter)
        return
    again = cg.render(new.plan, starter)
    assert np.array_equal(again.root_pos_m, new.motion.root_pos_m)
    assert np.array_equal(again.local_quat, new.motion.local_quat)
    data = json.loads(new.plan.to_json())
    # A word in the middle of the gap is danced from another second.
    middle = next(word for word in data["edits"][0]["words"] if word["start_s"] > 9.0)
    middle["source_start_s"], middle["source_end_s"] = 1.0, 1.0 + middle["end_s"] - middle["start_s"]
    edited = cg.render(cg.Plan.from_json(json.dumps(data)), starter)
    inside, outside = frames(new, cg.Keep(9.0, 10.0)), frames(new, KEEP[0])
    assert np.array_equal(edited.local_quat[outside], new.motion.local_quat[outside])
    assert np.abs(edited.local_quat[inside] - new.motion.local_quat[inside]).max() > 0.1
    with pytest.raises(ParameterError, match="expected no existing dance"):
        cg.render(old.plan, starter, existing=old.motion)


def test_what_is_left_at_an_end_is_danced_or_kept_too(old):
    kept = cg.dance(SONG, existing=old, keep=[cg.Keep(0.4, 5.0), cg.Keep(12.0, 19.3)], **FEW)
    assert [note for note in kept.notes if "are kept" in note] == [
        "the first 0.40 s and the last 0.70 s of the existing dance are kept: too short to be planned again"
    ]
    assert np.array_equal(kept.motion.root_pos_m[-1], old.motion.root_pos_m[-1])
    keep = cg.Keep(1.2, 18.8)
    for engine in ({"engine": "mixer"}, FEW):
        danced = cg.dance(SONG, existing=old, keep=[keep], seed=3, **engine)
        part = frames(danced, keep)
        assert np.array_equal(danced.motion.local_quat[part], old.motion.local_quat[part])
        steps_m = np.linalg.norm(np.diff(danced.motion.root_pos_m, axis=0), axis=1)
        assert steps_m.max() < 0.06  # a frame: no jump where what is kept begins and ends
        assert not any("are kept" in note for note in danced.notes)


def test_a_take_is_pinned_in_the_whole_gap(old):
    take = cg.starter_repertoire().takes[0].name
    for engine in ({"engine": "mixer"}, FEW):
        made = cg.dance(
            SONG, existing=old, keep=[cg.Keep(0.0, 10.0), cg.Keep(14.0, SPAN_S)],
            pins=[cg.TakePin(10.0, 14.0, take)], **engine,
        )  # fmt: skip
        for at_s in (10.2, 12.0, 13.8):
            assert [b.source for b in made.plan.blocks if b.start_s <= at_s < b.end_s] == [take]


def test_the_part_of_an_existing_plan_is_danced_by_default(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    asked = ("dance", SONG, "--set", "candidates=16", "-q")
    first = run(*asked, "--start", "0:10", "--duration", "12", "-o", "old.json")
    assert first.exit_code == 0, first.output
    keep = ("--keep", "0-0:05", "--keep", "9-12")
    new = run(*asked, "--existing", "old.json", *keep, "-o", "new.json", "-o", "new.npz")
    assert new.exit_code == 0, new.output
    plan = cg.Plan.read("new.json")
    assert (plan.start_s, plan.duration_s) == (10.0, 12.0)
    loaded = cg.load_song(SONG, start_s=10.0, duration_s=12.0)
    made = cg.dance(loaded, existing="old.json", keep=[cg.Keep(0, 5), cg.Keep(9, 12)], **FEW)
    assert made.plan == plan
    with pytest.raises(ParameterError, match="expected a song from 10 s of its file on"):
        cg.dance(cg.load_song(SONG, start_s=11.0), existing="old.json", keep=[cg.Keep(0, 5)])
    # The plan holds the existing dance, which may be lost.
    (tmp_path / "old.json").unlink()
    again = run("dance", SONG, "--plan", "new.json", "-o", "again.npz", "-q")
    assert again.exit_code == 0, again.output
    assert (tmp_path / "again.npz").read_bytes() == (tmp_path / "new.npz").read_bytes()
    third = run(*asked, "--existing", "new.json", "--keep", "3-12", "-o", "third.npz")
    assert third.exit_code == 0, third.output


def test_a_motion_file_is_kept_by_its_name(old, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    old.save("old.npz")
    asked = ("dance", SONG, "--duration", SPAN_S, "--set", "candidates=16", "-q")
    new = run(*asked, "--existing", "old.npz", "--keep", "0-9", "-o", "new.json", "-o", "new.npz")
    assert new.exit_code == 0, new.output
    plan = cg.Plan.read("new.json")
    assert plan.kept_of == "old.npz" and plan.blocks[0].source == "old.npz"
    for other in (old.motion.resampled(30.0), old.motion.sliced(0, 600)):
        with pytest.raises(ParameterError, match=r"expected an existing dance of 20\.0 s at 60 fps"):
            cg.render(plan, cg.starter_repertoire(), existing=other)
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "old.npz").rename(tmp_path / "elsewhere" / "kept.npz")
    lost = run("dance", "--plan", "new.json", "-o", "x.npz")
    assert lost.exit_code == 2 and "give it with --existing" in lost.output
    given = run("dance", "--plan", "new.json", "--existing", "elsewhere/kept.npz", "-o", "x.npz", "-q")
    assert given.exit_code == 0, given.output
    assert (tmp_path / "x.npz").read_bytes() == (tmp_path / "new.npz").read_bytes()


@pytest.mark.parametrize(
    ("name", "said"),
    [("old.json", "expected an existing dance as .bvh, .npz"), ("../old.npz", "in its folder")],
)
def test_a_plan_keeps_a_motion_file_in_its_folder(old, tmp_path, name, said):
    old.save(tmp_path / "old.json")
    whole = PlannedWord(0.0, SPAN_S, 0, "", 0.0, SPAN_S, cg.Credits(), kept=name)
    kept = replace(old.plan, seconds=(), words=(whole,), engine="mixer")
    (tmp_path / "me.json").write_text(kept.to_json())
    refused = run("dance", "--plan", tmp_path / "me.json", "-o", tmp_path / "x.npz")
    assert refused.exit_code == 2 and said in refused.output.replace("\n", " ")


def test_a_pin_in_the_gap_is_danced_or_said(old):
    starter = cg.starter_repertoire()
    motif = int(np.bincount(starter.vocabulary.word_motif).argmax())
    made = cg.dance(
        SONG, duration_s=SPAN_S, engine="mixer", existing=old, keep=KEEP, pins=[cg.MotifPin(9.6, motif)]
    )
    bounds_s = np.array([b for b in made.plan.music_beats_s if 6.5 < b < 12.5])
    slot = int(np.searchsorted(bounds_s, 9.6, side="right")) - 1
    assert (danced_motifs(made.motion, bounds_s, starter)[slot] == motif) == (not made.unmet)


def test_from_the_command_line(old, tmp_path):
    for name in ("old.npz", "old.bvh", "old.json"):
        old.save(tmp_path / name)
    keep = ("--keep", "0-6", "--keep", "13-20")
    asked = ("dance", SONG, "--duration", SPAN_S, "--set", "candidates=16", *keep, "-q")
    for name in ("old.npz", "old.bvh", "old.json"):
        made = run(
            *asked, "--existing", tmp_path / name, "-o", tmp_path / "new.npz", "-o", tmp_path / "new.json"
        )
        assert made.exit_code == 0, made.output
        plan = json.loads((tmp_path / "new.json").read_text(encoding="utf-8"))
        assert {word["kept"] for word in plan["words"]} - {""} == ({name} if name != "old.json" else set())
    before, after = (np.load(tmp_path / name) for name in ("old.npz", "new.npz"))
    assert set(before.files) == set(after.files)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--keep", "0-6"), "expected --existing beside --keep"),
        (("--existing", "old.txt", "--keep", "0-6"), "expected an existing dance as .bvh, .npz or .json"),
        (("--existing", "none.npz", "--keep", "0-6"), "none.npz"),
        (("--existing", "old.npz"), "expected --keep, --swap"),
        (("--existing", "old.npz", "--keep", "0-6", "--fps", "30"), "leave out fps"),
        (("--existing", "old.npz", "--keep", "0-6", "--pin", "3=motif:1"), "move it into a gap"),
        (("--existing", "old.npz", "--keep", "0-6", "--duration", "10"), "is it to another song"),
    ],
)
def test_what_cannot_be_kept_is_said_in_one_line(old, tmp_path, monkeypatch, options, said):
    monkeypatch.chdir(tmp_path)
    old.save(tmp_path / "old.npz")
    made = run(
        "dance", SONG, *(() if "--duration" in options else ("--duration", SPAN_S)), *options, "-o", "a.bvh"
    )
    assert made.exit_code == 2 and said in made.output.replace("\n", " ")
    assert not (tmp_path / "a.bvh").exists()
