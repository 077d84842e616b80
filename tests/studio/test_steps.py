"""Scenes of the studio: those of `choreograph.scene`, around the edited dance of the leader."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from synthetic_characters import VRM, Spec, write_character

import choreograph as cg
from choreograph.choreography.edits import Swap
from choreograph.core.errors import ChoreographError, ParameterError
from choreograph.formats.gltf_document import read_gltf
from choreograph.motion.body import mirrored_motion
from choreograph.studio.exports import EXPORTED, export_scene, exports_of_each
from choreograph.studio.steps import StepDances
from choreograph.studio.studio_session import StudioSession

SCHEMA = json.loads(
    (Path(__file__).resolve().parents[2] / "data_schema" / "studio.schema.json").read_text(encoding="utf-8")
)
DUET = {"dancers": 2, "formation": ["pairs"], "relation": ["mirror"]}


def change(studio, changes, **options):
    studio.change_settings(studio.project.revision, changes, **options)
    return studio.state.scene


def is_same(one, other):
    return np.array_equal(one.root_pos_m, other.root_pos_m) and np.array_equal(
        one.local_quat, other.local_quat
    )


def are_same(scene, others):
    return all(is_same(*pair) for pair in zip(scene.planned.motions, others, strict=True))


@pytest.mark.parametrize(
    ("dancers", "formation", "relation"),
    [
        (2, ["pairs"], ["mirror"]),
        (4, ["line", "5-9=circle"], ["canon:2", "6-10=unison"]),
        (3, ["v"], ["free"]),
    ],
)
def test_without_edits_it_is_the_scene_of_the_command(studio, repertoire, song, dancers, formation, relation):
    staged = change(studio, {"dancers": dancers, "formation": formation, "relation": relation})
    scene = cg.scene(song, repertoire, dancers=dancers, formation=formation, relation=relation)
    assert are_same(staged, scene.motions) and staged.planned.plan == scene.plan
    assert len(studio.motion_data()["others"]) == dancers - 1


def test_dancers_leave_the_dance_of_the_leader_and_its_edits_as_they_are(studio):
    studio.edit(1, [Swap(4.0, 6.0)])
    plan, motion = studio.state.dance.plan, studio.state.dance.motion
    change(studio, DUET)
    assert studio.state.dance.plan == plan and is_same(studio.state.dance.motion, motion) and plan.edits
    assert not studio.state.changed


def test_an_edit_is_of_the_leader_and_the_others_follow(studio):
    before = change(studio, DUET).planned.motions
    studio.edit(studio.project.revision, [Swap(4.0, 6.0)])
    leader, other = studio.state.scene.planned.motions
    mirrored = mirrored_motion(leader)
    assert np.abs(other.root_pos_m - mirrored.root_pos_m).max() < 1e-6
    assert np.abs(np.abs(np.sum(other.local_quat * mirrored.local_quat, axis=-1)) - 1.0).max() < 1e-6
    frames = np.flatnonzero((leader.local_quat[:, 1:] != before[0].local_quat[:, 1:]).any(axis=(1, 2)))
    assert len(frames) and abs(frames.mean() / leader.fps - 5.0) < 2.0


def test_undo_and_another_opening_give_the_same_motions(studio, open_session):
    shown = [change(studio, DUET)]
    studio.edit(studio.project.revision, [Swap(4.0, 6.0)])
    shown.append(studio.state.scene)
    shown.append(change(studio, {"dancers": 3, "relation": ["canon:1"]}))
    studio.move(studio.project.revision, back=True)
    assert are_same(studio.state.scene, shown[1].planned.motions) and studio.project.settings.dancers == 2
    studio.move(studio.project.revision, back=False)
    text = studio.file.read_text()
    jsonschema.validate(json.loads(text), SCHEMA)
    studio.close()
    again = open_session()
    assert are_same(again.state.scene, shown[2].planned.motions)
    again.move(again.project.revision, back=True)
    again.move(again.project.revision, back=True)
    assert are_same(again.state.scene, shown[0].planned.motions)
    again.move(again.project.revision, back=True)
    assert again.state.scene is None and "others" not in again.motion_data()


def test_one_dancer_has_a_project_without_dancers(studio):
    assert '"dancers"' not in studio.file.read_text()
    change(studio, DUET)
    change(studio, {"dancers": 1, "formation": ["v"], "relation": ["unison"]})
    last = studio.file.read_text().splitlines()[-3]
    assert '"number":3' in last and '"dancers"' not in last.partition('"settings"')[2]


def test_free_dancers_keep_their_dances_when_the_leader_is_edited(studio, monkeypatch):
    before = change(studio, {"dancers": 3, "relation": ["free"]})
    made = []
    monkeypatch.setattr(StepDances, "made", lambda *given, **more: made.append(given))
    studio.edit(studio.project.revision, [Swap(4.0, 6.0)])
    after = studio.state.scene
    assert not made and [plan.seed for _, plan in after.dances] == [0, 1, 2]
    assert all(one[0] is other[0] for one, other in zip(before.dances[1:], after.dances[1:], strict=True))
    assert after.dances[0][1].edits


def test_a_version_has_its_own_dancers(studio):
    change(studio, DUET)
    studio.keep_version("A")
    change(studio, {"dancers": 4})
    studio.keep_version("B")
    assert [len(studio.motion_data(slot)["others"]) for slot in ("A", "B", "")] == [1, 3, 3]
    facts = studio.facts("A")
    assert facts["frames"] == studio.motion_data("A")["facts"]["frames"]


@pytest.mark.parametrize(
    ("changes", "span", "says"),
    [
        ({"dancers": 2, "formation": ["chorus 9=line"]}, None, "chorus 9"),
        ({"dancers": 2, "relation": ["40-50=mirror"]}, None, "expected a part of the song"),
        ({"dancers": 2, "formation": ["other.json"]}, None, "expected a formation"),
        ({"dancers": 2}, (2.0, 4.0), "expected no part of the dance beside dancers"),
        ({"seed": 2, "relation": ["mirror"]}, (2.0, 4.0), "expected no part of the dance beside dancers"),
    ],
)
def test_what_cannot_be_is_refused_and_nothing_changes(studio, changes, span, says):
    before = studio.file.read_bytes(), studio.state
    with pytest.raises(ChoreographError, match=says) as refused:
        change(studio, changes, span=span)
    assert "\n" not in str(refused.value)
    assert (studio.file.read_bytes(), studio.state) == before


def test_a_change_that_could_not_be_saved_leaves_no_scene(studio, monkeypatch):
    """The number of its step is used again, by a step with other dancers."""
    write = studio._file.write

    def full(project):
        raise ChoreographError("the disk is full")

    monkeypatch.setattr(studio._file, "write", full)
    with pytest.raises(ChoreographError, match="full"):
        change(studio, DUET)
    monkeypatch.setattr(studio._file, "write", write)
    assert studio.state.scene is None
    assert len(change(studio, {"dancers": 3}).planned.motions) == 3


def test_a_setting_of_the_dance_and_dancers_change_together(studio):
    staged = change(studio, {"seed": 4, **DUET})
    assert studio.state.dance.plan.seed == 4 and len(staged.planned.motions) == 2


# Files.


@pytest.fixture
def edited(studio):
    """A duet whose leader was edited."""
    change(studio, DUET)
    studio.edit(studio.project.revision, [Swap(4.0, 6.0)])
    return studio.state


def test_all_formats_are_of_one_file_or_of_one_for_each(tmp_path):
    assert exports_of_each() == ["bvh", "npz", "vrma", "vmd"]
    assert exports_of_each(characters=True) == ["bvh", "glb", "fbx", "npz", "vrma", "vmd"]
    assert set(exports_of_each()) < set(EXPORTED)


def test_a_plan_of_the_scene_renders_the_same(edited, repertoire, tmp_path):
    path = export_scene(tmp_path / "a.json", edited.scene, edited.dance.song_path, None, None, None)
    again = cg.render_scene_plan(cg.ScenePlan.read(path), repertoire)
    assert are_same(edited.scene, again.motions) and again.plan.dances[0].edits


def test_files_of_each_dancer_are_packed(edited, tmp_path):
    staged, song = edited.scene, edited.dance.song_path
    whole = export_scene(tmp_path / "a.npz", staged, song, None, None, None)
    part = export_scene(tmp_path / "b.npz", staged, song, (2.0, 4.5), None, None)
    assert (whole.name, part.name) == ("a-npz.zip", "b-npz.zip")
    with zipfile.ZipFile(part) as file:
        assert file.namelist() == ["b-1.npz", "b-2.npz"]
        file.extractall(tmp_path)
    found = cg.load_motion(tmp_path / "b-2.npz")
    expected = staged.planned.motions[1].sliced(120, 270)
    assert found.n_frames == 150
    assert np.abs(found.root_pos_m - expected.root_pos_m).max() < 1e-3
    data = whole.read_bytes()
    assert export_scene(tmp_path / "a.npz", staged, song, None, None, None).read_bytes() == data


def test_a_part_in_one_file_has_all_skeletons(edited, tmp_path):
    path = export_scene(tmp_path / "a.glb", edited.scene, edited.dance.song_path, (2.0, 4.0), None, None)
    document = read_gltf(path)
    (animation,) = document.json["animations"]
    times_s = document.array(animation["samplers"][0]["input"])
    assert len(document.json["skins"]) == 2 and times_s.max() == pytest.approx(2.0, abs=0.02)


@pytest.mark.parametrize("suffix", ["json", "html"])
def test_a_part_of_a_plan_or_a_page_is_refused(edited, tmp_path, suffix):
    with pytest.raises(ParameterError, match="expected the whole dance"):
        export_scene(tmp_path / f"a.{suffix}", edited.scene, None, (2.0, 4.0), None, None)
    assert not list(tmp_path.glob("a*"))


def test_dancers_have_the_character(edited, tmp_path):
    write_character(tmp_path / "hero.glb", Spec(VRM, size=1.2, along="", vrm=True))
    hero = cg.read_character(tmp_path / "hero.glb")
    path = export_scene(tmp_path / "a.glb", edited.scene, edited.dance.song_path, None, hero, None)
    with zipfile.ZipFile(path) as file:
        assert file.namelist() == ["a-1.glb", "a-2.glb"]
    write_character(tmp_path / "giant.glb", Spec(VRM, size=3.0, along="", vrm=True))
    giant = cg.read_character(tmp_path / "giant.glb")
    with pytest.raises(ParameterError, match="times the size of the takes"):
        export_scene(tmp_path / "b.glb", edited.scene, None, None, giant, None)


def test_a_generated_dance_with_edits_is_made_again_from_the_plan_of_the_scene(folder, tmp_path):
    repertoire = cg.starter_repertoire()
    studio = StudioSession(folder, repertoire)
    try:
        studio.open(folder / "clicks.wav")
        studio.load(None, None, with_dance=False)
        studio.change_settings(studio.project.revision, {"engine": "rollout", "bans": ["motif:5"], **DUET})
        studio.edit(studio.project.revision, [Swap(4.0, 6.0)])
        staged = studio.state.scene
        path = export_scene(tmp_path / "a.json", staged, None, None, None, None)
    finally:
        studio.close()
    plan = cg.ScenePlan.read(path)
    assert plan.requests[0].bans == ("motif:5",) and plan.dances[0].edits
    again = cg.render_scene_plan(plan, repertoire, song_path=folder / "clicks.wav")
    assert are_same(staged, again.motions)
