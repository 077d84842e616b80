"""FBX by way of Blender: what comes back is what went in; without Blender, a line says what to install.

Set CHOREOGRAPH_BLENDER, or have `blender` on the path; otherwise most of these tests skip.
"""

from __future__ import annotations

import numpy as np
import pytest
from command_line import assert_one_line, run
from gltf_worlds import node_worlds
from synthetic_characters import CHARACTERS, write_character
from synthetic_motions import stepping, swaying

from choreograph.characters.character import perform, read_character
from choreograph.core.errors import FormatError, ParameterError
from choreograph.formats.fbx import VARIABLE, convert, find_blender
from choreograph.formats.gltf_document import read_gltf
from choreograph.formats.register import import_takes, save_motion
from choreograph.pipeline.saving import save_on_character

needs_blender = pytest.mark.skipif(find_blender() is None, reason="no Blender on this machine")


def test_without_blender_a_line_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setenv(VARIABLE, "")
    monkeypatch.setenv("PATH", str(tmp_path))
    assert find_blender() is None
    with pytest.raises(ParameterError, match=r"blender\.org"):
        convert(tmp_path / "a.fbx", tmp_path / "a.glb")
    monkeypatch.chdir(tmp_path)
    save_motion("a.bvh", swaying(10))
    assert_one_line(run("convert", "a.bvh", "a.fbx"), says="blender.org")
    assert_one_line(run("dance", "song.wav", "-o", "a.fbx"), says="blender.org")
    assert not (tmp_path / "a.fbx").exists()


def test_a_blender_that_is_named_and_not_there_is_none(tmp_path, monkeypatch):
    monkeypatch.setenv(VARIABLE, str(tmp_path / "nothing"))
    assert find_blender() is None


def test_a_program_that_makes_nothing_is_said(tmp_path, monkeypatch):
    monkeypatch.setenv(VARIABLE, "true")
    (tmp_path / "a.fbx").write_bytes(b"no FBX")
    with pytest.raises(FormatError, match="did not convert") as refused:
        convert(tmp_path / "a.fbx", tmp_path / "a.glb")
    assert "\n" not in str(refused.value) and not (tmp_path / "a.glb").exists()


@needs_blender
@pytest.mark.slow
def test_a_motion_comes_back_from_fbx(tmp_path):
    motion = swaying(90, fps=60.0)
    save_motion(tmp_path / "a.fbx", motion)
    (take,) = import_takes(tmp_path / "a.fbx")
    assert (take.name, take.motion.n_frames, take.motion.fps) == ("a", 90, 60.0)
    where = [take.motion.skeleton.names.index(name) for name in motion.skeleton.names]
    shift = take.motion.joint_pos_m()[0, where[0]] - motion.joint_pos_m()[0, 0]  # the floor is put at 0
    np.testing.assert_allclose(take.motion.joint_pos_m()[:, where] - shift, motion.joint_pos_m(), atol=1e-3)


@needs_blender
@pytest.mark.slow
@pytest.mark.parametrize("name", ["mixamo", "unreal"])
def test_a_character_in_fbx_dances_in_fbx(tmp_path, name):
    motion, spec = stepping(60, fps=60.0), CHARACTERS[name]
    write_character(tmp_path / "hero.glb", spec)
    convert(tmp_path / "hero.glb", tmp_path / "hero.fbx")
    character = read_character(tmp_path / "hero.fbx")
    found = {role: character.rig.names[bone] for role, bone in character.bones.items()}
    assert found == {role: spec.names[role] for role in found} and len(found) == 22
    save_on_character(tmp_path / "out.fbx", motion, character)
    convert(tmp_path / "out.fbx", tmp_path / "out.glb")
    document = read_gltf(tmp_path / "out.glb")
    names = [node.get("name") for node in document.json["nodes"]]
    shown = node_worlds(document, np.array([0, 30]))[..., :3, 3]
    figure = perform(motion, character.rig, character.bones).motion
    expected = figure.joint_pos_m()[[0, 30]]
    for role, own in found.items():
        np.testing.assert_allclose(
            shown[:, names.index(own)], expected[:, figure.skeleton.index(role)], atol=1e-3
        )


@needs_blender
@pytest.mark.slow
@pytest.mark.parametrize(
    "content", [b"", b"Kaydara FBX Binary  \x00\x1a\x00" + bytes(40), b"; FBX 7.4\n" * 5]
)
def test_a_damaged_file_is_refused_in_a_line(tmp_path, content):
    (tmp_path / "a.fbx").write_bytes(content)
    with pytest.raises(FormatError) as refused:
        list(import_takes(tmp_path / "a.fbx"))
    assert "\n" not in str(refused.value) and "a.fbx" in str(refused.value)
