"""Names of joints in files, rest poses, and programs that a dance is written for."""

from __future__ import annotations

import random
import subprocess
from dataclasses import replace

import bvhio
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic_characters import CHARACTERS, write_character
from synthetic_motions import on_other_axes, stepping, swaying
from synthetic_pages import plan_for

from choreograph.characters.character import read_character
from choreograph.core.errors import ParameterError
from choreograph.formats.bvh import BvhOptions, BvhWriter, parse_bvh, read_bvh, read_text
from choreograph.formats.fbx import find_blender
from choreograph.formats.glb import GlbWriter, clips_document, dance_document
from choreograph.formats.gltf import read_rig
from choreograph.formats.gltf_document import read_gltf
from choreograph.formats.register import import_takes, save_motion
from choreograph.formats.writer import (
    NAMES,
    TARGETS,
    check_target_format,
    clip_name,
    identifiers,
    is_loop,
    name_of_word,
    named_clips,
    prepared,
    text_names,
    with_rest_pose,
    word_of,
)
from choreograph.motion import rotations as rot
from choreograph.motion.bone_map import joint_roles
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import Skeleton
from choreograph.pipeline.saving import SavedParts, save_dance

N_NAMES, N_JOINTS = 10_000, 500
_PIECES = (
    *"{}\"'#%/\\,;:|()[]<>*? \t\n\r\v\f\x00\x01\x1b\x7f\x85\xa0\u2028\u3000\ufeff\ud800\udfff.-_09azéß左ひＬ",
    "🕺", "\u0301", "End", "End Site", "JOINT", "ROOT", "MOTION", "HIERARCHY", "OFFSET", "CHANNELS", "//",
    "%20", "joint0", "\r\nMOTION\nFrames: 1", "Left", "Hips",
)  # fmt: skip


def hostile_names(count: int, seed: int) -> list[str]:
    """Different names; among them an empty one, some of 300 letters, and some that are alike when cleaned."""
    rng = random.Random(seed)
    names = dict.fromkeys(
        ["", "a b", "a_b", "a\tb", "a%20b", "A b", "a  b", *_PIECES, "x" * 300, "x" * 299 + " "]
    )
    while len(names) < count:
        length = 300 if rng.random() < 0.01 else rng.randint(1, 8)
        names["".join(rng.choice(_PIECES) for _ in range(length))[:300]] = None
    found = list(names)[:count]
    rng.shuffle(found)
    return found


def moving(names: list[str], seed: int) -> Motion:
    """Two frames of a tree of joints."""
    rng = np.random.default_rng(seed)
    parents = np.array([-1, *(int(rng.integers(max(0, joint - 9), joint)) for joint in range(1, len(names)))])
    offsets_m = np.zeros((len(names), 3))
    offsets_m[:10] = rng.normal(
        scale=0.1, size=(10, 3)
    )  # bones without length have no mesh, which takes long
    skeleton = Skeleton(tuple(names), parents, offsets_m)
    return Motion(skeleton, np.zeros((2, 3)), np.tile(rot.IDENTITY, (2, len(names), 1)), 30.0)


@pytest.fixture(scope="module")
def motions() -> list[Motion]:
    """Ten thousand names, on the joints of twenty bodies."""
    names = hostile_names(N_NAMES, 34)
    return [moving(names[start : start + N_JOINTS], start) for start in range(0, N_NAMES, N_JOINTS)]


def parents_by_name(names, parents) -> dict[str, str | None]:
    return {name: names[parent] if parent >= 0 else None for name, parent in zip(names, parents, strict=True)}


def test_ten_thousand_names_come_back_from_bvh(motions, tmp_path):
    for motion in motions:
        save_motion(tmp_path / "a.bvh", motion)
        back = parse_bvh(read_text(tmp_path / "a.bvh"))
        skeleton = motion.skeleton
        assert parents_by_name(back.names, back.parents) == parents_by_name(skeleton.names, skeleton.parents)
    motion, _ = read_bvh(tmp_path / "a.bvh")  # by the whole reader, too
    assert set(motion.skeleton.names) == set(motions[-1].skeleton.names)


def test_ten_thousand_names_come_back_from_glb(motions, tmp_path):
    for motion in motions:
        GlbWriter().write(motion, tmp_path / "a.glb")
        rig = read_rig(read_gltf(tmp_path / "a.glb")).rig
        written, skeleton = text_names(motion.skeleton.names), motion.skeleton
        assert len(set(written)) == skeleton.n_joints
        assert parents_by_name(rig.names, rig.parents) == parents_by_name(written, skeleton.parents)
        kept = [
            own == name
            for own, name in zip(written, skeleton.names, strict=True)
            if name.isprintable() and name
        ]
        assert all(kept) and len(kept) > 100


def test_ten_thousand_names_come_back_from_usd(motions, tmp_path):
    pxr = pytest.importorskip("pxr")
    from pxr import Usd, UsdSkel, UsdValidation

    assert pxr
    for place, motion in enumerate(motions):
        path = tmp_path / f"{place}.usdc"
        save_motion(path, motion)
        stage = Usd.Stage.Open(str(path))
        skeleton = UsdSkel.Skeleton(stage.GetPrimAtPath("/Dance/Skeleton"))
        assert tuple(skeleton.GetJointNamesAttr().Get()) == text_names(motion.skeleton.names)
        topology = UsdSkel.Topology(skeleton.GetJointsAttr().Get())
        assert topology.Validate()[0]
        assert list(topology.GetParentIndices()) == motion.skeleton.parents.tolist()
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    errors = UsdValidation.ValidationContext(validators).Validate(stage)
    assert [
        error.GetMessage() for error in errors if error.GetType() == UsdValidation.ValidationErrorType.Error
    ] == []


def test_another_reader_of_bvh_reads_every_joint(motions, tmp_path):
    motion = motions[0]
    save_motion(tmp_path / "a.bvh", motion)
    joints = [joint for joint, _, _ in bvhio.readAsBvh(str(tmp_path / "a.bvh")).Root.layout()]
    assert len(joints) == motion.skeleton.n_joints
    assert {name_of_word(joint.Name) for joint in joints} == set(motion.skeleton.names)


@given(st.lists(st.text(st.characters(), max_size=300), unique=True, max_size=30))
@settings(max_examples=200, deadline=None)
def test_escaped_names_are_words_and_all_different(names):
    words = [word_of(name) for name in names]
    assert [name_of_word(word) for word in words] == names
    for word in words:
        assert word.split() == [word] and not set(word) & set("{}#/\"',") and word.isprintable()
    for found in (text_names(names), identifiers(names)):
        assert len(set(found)) == len(names)
        "".join(found).encode("utf-8")


def test_usual_names_are_written_as_they_are():
    for name in ("LeftUpLeg", "mixamorig:Hips", "thigh_l", "upper_arm.L", "左ひざ", "joint_0", "a|b:c", "1"):
        assert word_of(name) == name and text_names([name]) == (name,)
    assert name_of_word("50%") == "50%" and name_of_word("%FF") == "%FF"  # of other programs


@pytest.mark.slow
@pytest.mark.skipif(find_blender() is None, reason="no Blender on this machine")
def test_blender_reads_every_joint_of_a_bvh(tmp_path):
    short = [name for name in hostile_names(3000, 35) if len(word_of(name).encode()) < 60][:300]
    save_motion(tmp_path / "a.bvh", moving(short, 0))
    script, seen = tmp_path / "look.py", tmp_path / "seen.txt"
    script.write_text(
        "import bpy\n"
        f"bpy.ops.import_anim.bvh(filepath={str(tmp_path / 'a.bvh')!r})\n"
        "names = [bone.name for bone in bpy.context.object.data.bones]\n"
        f"open({str(seen)!r}, 'w', encoding='utf-8').write('\\n'.join(names))\n"
    )
    done = subprocess.run([*find_blender(), str(script)], capture_output=True, text=True, check=False)
    assert seen.exists(), done.stderr
    assert {name_of_word(word) for word in seen.read_text("utf-8").split("\n")} == set(short)


def test_a_body_with_odd_names_is_danced_by_structure(tmp_path):
    """Joints without known names are found by structure after they are read back."""
    motion = swaying(60)
    odd = hostile_names(motion.skeleton.n_joints, 5)
    skeleton = Skeleton(tuple(odd), motion.skeleton.parents, motion.skeleton.offsets_m)
    save_motion(tmp_path / "a.bvh", Motion(skeleton, motion.root_pos_m, motion.local_quat, motion.fps))
    back, _ = read_bvh(tmp_path / "a.bvh")
    assert back.skeleton.roles is not None
    assert odd[motion.skeleton.index("left_knee")] == back.skeleton.names[back.skeleton.roles["left_knee"]]


DOWN = {"t": 0.0, "a": np.sin(np.pi / 4)}


@pytest.mark.parametrize("rest", ["t", "a"])
@pytest.mark.parametrize(
    "motion", [swaying(40), on_other_axes(swaying(40), 3)], ids=["upright", "other axes"]
)
def test_joints_stay_and_the_rest_pose_stands_on_the_floor(motion, rest):
    posed = with_rest_pose(motion, rest)
    assert np.allclose(posed.joint_pos_m(), motion.joint_pos_m(), atol=1e-9)
    pos_m, roles = posed.skeleton.rest_pos_m(), joint_roles(posed.skeleton)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        for start, end in (("shoulder", "elbow"), ("elbow", "wrist")):
            bone = pos_m[roles[f"{side}_{end}"]] - pos_m[roles[f"{side}_{start}"]]
            assert bone[1] / np.linalg.norm(bone) == pytest.approx(-DOWN[rest], abs=1e-6)
            assert sign * bone[0] > 0
    feet = [roles[f"{side}_{part}"] for side in ("left", "right") for part in ("ankle", "foot")]
    assert 0.0 <= pos_m[feet, 1].min() < 0.05


def test_a_bvh_in_an_a_pose_is_read_back_as_the_same_motion(tmp_path):
    motion = swaying(40)
    save_motion(tmp_path / "a.bvh", motion, writer=BvhWriter(BvhOptions(rest="a")))
    back, _ = read_bvh(tmp_path / "a.bvh")
    order = [back.skeleton.names.index(name) for name in motion.skeleton.names]
    assert np.allclose(back.joint_pos_m()[:, order], motion.joint_pos_m(), atol=1e-4)
    assert back.skeleton.rest_pos_m()[:, 1].min() > -0.01  # above the floor


@pytest.mark.parametrize("make", [lambda: with_rest_pose(swaying(4), "i"), lambda: BvhOptions(rest="i")])
def test_other_rest_poses_are_refused(make):
    with pytest.raises(ParameterError, match="t, a"):
        make()


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
