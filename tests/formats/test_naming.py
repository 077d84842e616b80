"""Names of joints of any content come back from files, and none is lost."""

from __future__ import annotations

import random
import subprocess

import bvhio
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic_motions import swaying

from choreograph.formats.bvh import read_bvh
from choreograph.formats.bvh_text import parse_bvh, read_text
from choreograph.formats.fbx import find_blender
from choreograph.formats.glb import GlbWriter
from choreograph.formats.gltf_files import read_gltf
from choreograph.formats.gltf_rig import read_rig
from choreograph.formats.register import save_motion
from choreograph.formats.writer import identifiers, name_of_word, text_names, word_of
from choreograph.motion import rotations as rot
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import Skeleton

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
