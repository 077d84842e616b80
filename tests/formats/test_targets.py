"""GLB files for programs: names, rest pose, root bone or in place, clips; the same motion in the world."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from synthetic_characters import CHARACTERS, write_character
from synthetic_motions import on_other_axes, stepping
from synthetic_pages import plan_for

from choreograph.characters.gltf_character import read_character
from choreograph.core.errors import ParameterError
from choreograph.formats.glb import clips_document, dance_document
from choreograph.formats.gltf_files import read_gltf
from choreograph.formats.register import import_takes
from choreograph.formats.targets import (
    TARGETS,
    check_target_format,
    clip_name,
    is_loop,
    named_clips,
    prepared,
)
from choreograph.formats.writer import NAMES
from choreograph.motion import rotations as rot
from choreograph.motion.motion import Motion
from choreograph.pipeline.saving import SavedParts, save_dance

MOTION = stepping(4 * 30, seed=1)
MOTION = replace(MOTION, root_pos_m=MOTION.root_pos_m + np.linspace([0.5, 0, -0.5], [1.5, 0, 1.0], 120))
ENGINES = [name for name in TARGETS if name != "mmd"]


def saved(path, target, **parts):
    plan = replace(plan_for(MOTION), song="My song (live)")
    save_dance(path, SavedParts(MOTION, plan, lambda: np.zeros(0), None, target=target, **parts))
    return read_gltf(path)


def worlds_m(document, frames) -> dict[str, np.ndarray]:
    """Positions in the world of all nodes by name, (F, 3), as the animation moves them."""
    nodes, (animation,) = document.json["nodes"], document.json["animations"]
    moved = {
        (c["target"]["node"], c["target"]["path"]): document.array(
            animation["samplers"][c["sampler"]]["output"]
        )
        for c in animation["channels"]
    }
    parents = {child: node for node, entry in enumerate(nodes) for child in entry.get("children", [])}

    def transform(node, frame):
        at = moved.get(
            (node, "translation"), np.tile(nodes[node].get("translation", [0, 0, 0]), (frame + 1, 1))
        )
        turn = moved.get(
            (node, "rotation"), np.tile(nodes[node].get("rotation", [0, 0, 0, 1]), (frame + 1, 1))
        )
        place, quat = at[frame], np.roll(turn[frame], 1)
        if node not in parents:
            return place, quat
        above_m, above = transform(parents[node], frame)
        return above_m + rot.rotate(above, place), rot.multiply(above, quat)

    return {
        entry["name"]: np.stack([transform(node, frame)[0] for frame in frames])
        for node, entry in enumerate(nodes)
        if "mesh" not in entry
    }


@pytest.mark.parametrize("name", ENGINES)
def test_bones_have_the_names_and_the_places_of_the_motion(tmp_path, name):
    target, frames = TARGETS[name], [0, 30, 77, 119]
    found = worlds_m(saved(tmp_path / "a.glb", name), frames)
    names = NAMES[target.naming]
    expected = MOTION.joint_pos_m()[frames]
    if target.in_place:
        expected = expected - (MOTION.root_pos_m[frames] * [1.0, 0.0, 1.0])[:, None]
    assert set(found) == {names[role] for role in MOTION.skeleton.names} | {target.root} - {""}
    for joint, role in enumerate(MOTION.skeleton.names):
        assert np.allclose(found[names[role]], expected[:, joint], atol=2e-5), role
    if target.root:
        assert np.allclose(found[target.root], MOTION.root_pos_m[frames] * [1.0, 0.0, 1.0], atol=1e-5)


@pytest.mark.parametrize("name", ENGINES)
def test_the_rest_pose_is_a_t_or_an_a(name):
    rest = prepared(MOTION, TARGETS[name]).skeleton
    names, pos_m = NAMES[TARGETS[name].naming], rest.rest_pos_m()
    for side, sign in (("left", 1.0), ("right", -1.0)):
        arm = pos_m[rest.index(names[f"{side}_wrist"])] - pos_m[rest.index(names[f"{side}_shoulder"])]
        below = np.degrees(np.arctan2(-arm[1], sign * arm[0]))
        assert below == pytest.approx({"t": 0.0, "a": 45.0}[TARGETS[name].rest], abs=1.0)
    assert rest.names[0] == names["pelvis"] and abs(pos_m[0, [0, 2]]).max() < 1e-9


@pytest.mark.parametrize("name", ["unreal", "godot"])
def test_a_root_bone_is_the_first_of_the_skeleton_and_moves_no_vertex(tmp_path, name):
    document = saved(tmp_path / "a.glb", name)
    (skin,), nodes = document.json["skins"], document.json["nodes"]
    root = nodes[skin["skeleton"]]
    assert root == {"name": TARGETS[name].root, "children": [0]}  # at the origin in the rest pose
    inverse = document.array(skin["inverseBindMatrices"]).reshape(-1, 4, 4)
    assert len(inverse) == len(skin["joints"]) == 1 + MOTION.skeleton.n_joints
    assert np.array_equal(inverse[skin["joints"].index(skin["skeleton"])], np.eye(4))
    (mesh,) = document.json["meshes"]
    for primitive in mesh["primitives"]:
        joints = document.array(primitive["attributes"]["JOINTS_0"])
        assert joints.max() < MOTION.skeleton.n_joints


def test_what_is_written_for_unreal_is_read_back(tmp_path):
    saved(tmp_path / "a.glb", "unreal")
    saved(tmp_path / "b.glb", None)
    found = []
    for path in (tmp_path / "a.glb", tmp_path / "b.glb"):
        (take,) = import_takes(path)
        pelvis = take.motion.joint_pos_m()[:, take.motion.skeleton.index("pelvis")]
        found.append(pelvis - pelvis[0] * [0.0, 1.0, 0.0])  # readers put the lowest foot on the floor
    assert np.allclose(*found, atol=1e-4)


def test_clips_have_the_song_s_name_and_the_mark_of_a_loop(tmp_path):
    assert saved(tmp_path / "a.glb", "unreal").json["animations"][0]["name"] == "My_song_live"
    assert saved(tmp_path / "a.glb", "godot", loops=True).json["animations"][0]["name"] == "My_song_live-loop"
    assert clip_name("???", TARGETS["unity"], loops=True) == "dance_loop"
    write_character(tmp_path / "hero.glb", CHARACTERS["mixamo"])
    document = saved(tmp_path / "b.glb", "godot", character=read_character(tmp_path / "hero.glb"))
    assert document.json["animations"][-1]["name"] == "My_song_live"


@pytest.mark.parametrize("kind", ["unreal", "mixamo"])
def test_the_root_bone_of_a_character_has_the_path_if_there_is_one(tmp_path, kind):
    write_character(tmp_path / "hero.glb", CHARACTERS[kind])
    hero, places_m = read_character(tmp_path / "hero.glb"), {}
    for name in ("unity", "unreal"):
        path = tmp_path / f"{name}.glb"
        document = saved(path, name, character=hero)
        [take] = import_takes(path)
        pos_m = take.motion.joint_pos_m()  # (T, J, 3)
        places_m[name] = dict(zip(take.motion.skeleton.names, np.moveaxis(pos_m, 1, 0), strict=True))
    with_path, without = places_m["unreal"], places_m["unity"]
    for bone in without.keys() - {"root"}:
        np.testing.assert_allclose(with_path[bone], without[bone], atol=1e-4)
    if kind == "mixamo":
        assert (tmp_path / "unity.glb").read_bytes() == (tmp_path / "unreal.glb").read_bytes()
    else:
        of_root, of_hips = (track_m(document, bone) for bone in ("root", "pelvis"))
        assert np.sort(np.ptp(of_hips, axis=0))[1] < 1e-5  # along the axes of the root bone: only the height
        assert np.ptp(of_root[:, [0, 2]], axis=0).min() > 0.5 and np.ptp(of_root[:, 1]) < 1e-6


def track_m(document, bone: str) -> np.ndarray:
    """The translations (T, 3) of a bone in the only animation."""
    [animation] = document.json["animations"]
    for channel in animation["channels"]:
        target = channel["target"]
        if target["path"] == "translation" and document.json["nodes"][target["node"]]["name"] == bone:
            return document.array(animation["samplers"][channel["sampler"]]["output"])
    raise AssertionError(bone)


def clip(turn, fps=30.0, *, loops=False):
    """A motion of its own, which ends where it begins if it `loops`."""
    made = replace(stepping(60, seed=turn), fps=fps)
    there = np.r_[np.arange(45), np.arange(43, -1, -1)] if loops else np.arange(45)
    return replace(made, root_pos_m=made.root_pos_m[there], local_quat=made.local_quat[there])


@pytest.mark.parametrize("name", [None, *ENGINES])
def test_each_motion_is_a_clip_of_one_body(tmp_path, name):
    target = None if name is None else TARGETS[name]
    made = [("walk one", clip(1)), ("round", clip(2, 24.0, loops=True)), ("walk-one", clip(3))]
    clips = named_clips(made, target)
    assert list(clips) == ["walk_one", f"round{'-loop' if name == 'godot' else '_loop'}", "walk_one_2"]
    document = clips_document(clips, target)
    assert [each["name"] for each in document.json["animations"]] == list(clips)
    assert len(document.json["skins"]) == len(document.json["meshes"]) == 1
    (tmp_path / "all.glb").write_bytes(document.to_glb())
    found = list(import_takes(tmp_path / "all.glb"))
    assert [take.name for take in found] == [f"all-{each}" for each in clips]
    for take, (_, motion) in zip(found, made, strict=True):
        assert take.motion.fps == motion.fps and take.motion.n_frames == motion.n_frames
        expected = motion.joint_pos_m()
        if target is not None and target.in_place:
            expected = expected - (motion.root_pos_m * [1.0, 0.0, 1.0])[:, None]
        names = NAMES["smpl" if target is None else target.naming]
        order = [take.motion.skeleton.index(names.get(role, role)) for role in motion.skeleton.names]
        away = take.motion.joint_pos_m()[:, order] - expected
        assert np.ptp(away[..., 1]) < 1e-4  # readers put each floor at 0
        assert np.abs(away[..., [0, 2]]).max() < 1e-4


def test_clips_of_another_body_are_put_on_the_first(tmp_path):
    other = on_other_axes(clip(2), 2)
    document = clips_document({"a": clip(1), "b": other})
    (tmp_path / "all.glb").write_bytes(document.to_glb())
    second = list(import_takes(tmp_path / "all.glb"))[1].motion
    assert second.skeleton.names == MOTION.skeleton.names
    away = second.joint_pos_m() - clip(2).joint_pos_m()
    assert np.ptp(away, axis=(0, 1)).max() < 0.02
    with pytest.raises(ParameterError, match="a motion or several"):
        clips_document({})


def test_one_clip_has_the_bytes_of_one_dance():
    assert clips_document({"dance": MOTION}).to_glb() == dance_document(MOTION).to_glb()


def test_a_loop_ends_where_it_begins():
    assert is_loop(clip(1, loops=True)) and not is_loop(clip(1))
    assert not is_loop(MOTION.sliced(0, 1))


def test_a_file_without_a_program_has_the_same_bytes_as_before(tmp_path):
    document = saved(tmp_path / "a.glb", None)
    assert [node["name"] for node in document.json["nodes"][:-1]] == list(MOTION.skeleton.names)
    assert document.json["skins"][0]["joints"] == list(range(MOTION.skeleton.n_joints))
    assert document.json["animations"][0]["name"] == "dance"


def test_programs_and_files_that_do_not_fit_are_refused(tmp_path):
    check_target_format("mmd", "a.vmd")
    check_target_format("unreal", "A.GLB")
    for name, path, says in (
        ("mmd", "a.glb", "a file .vmd for mmd"),
        ("unreal", "a.vmd", "a file .glb for unreal"),
        ("maya", "a.glb", "among unreal, unity, vrchat, blender, mmd, godot, got 'maya'"),
    ):
        with pytest.raises(ParameterError, match=says):
            check_target_format(name, path)
    other = replace(MOTION.skeleton, names=tuple(f"j{i}" for i in range(MOTION.skeleton.n_joints)))
    with pytest.raises(ParameterError):
        prepared(Motion(other, MOTION.root_pos_m, MOTION.local_quat, MOTION.fps), TARGETS["unreal"])
