"""Every format as Blender has it: joints where the motion has them, on any rest pose and on characters.

Set CHOREOGRAPH_BLENDER, or have `blender` on the path; otherwise these tests skip.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from heads_in_blender import bone_heads_m
from synthetic_characters import CHARACTERS, write_character
from synthetic_motions import swaying

from choreograph.characters.character import perform, read_character
from choreograph.formats.bvh import BvhOptions, BvhWriter
from choreograph.formats.fbx import find_blender
from choreograph.formats.glb import GlbWriter
from choreograph.formats.register import save_motion
from choreograph.formats.writer import NAMES, TARGETS
from choreograph.pipeline.saving import save_on_character

FRAMES = np.sort(np.random.default_rng(20).choice(120, 20, replace=False))
MOTION = swaying(120, fps=60.0)
RIGS = ("mixamo", "unreal", "vrm", "child", "long arms", "stocky", "rigify", "without toes")
DANCES = ("a.bvh", "standing.bvh", "a.glb", "a.fbx", "a.usda", "a.usdc")
PROGRAMS = tuple(name for name in TARGETS if name != "mmd")
FLOOR = np.array([1.0, 0.0, 1.0])

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(find_blender() is None, reason="no Blender on this machine"),
]


@pytest.fixture(scope="module")
def seen(tmp_path_factory):
    """The folder of all files, and where Blender has their bones."""
    folder = tmp_path_factory.mktemp("blender")
    paths = [folder / name for name in DANCES]
    for path in paths:
        writer = BvhWriter(BvhOptions(rest="a", naming="ue")) if path.stem == "standing" else None
        save_motion(path, MOTION, writer=writer)
    for name in RIGS:
        write_character(folder / f"{name}.glb", CHARACTERS[name])
        paths.append(folder / f"{name} dances.glb")
        save_on_character(paths[-1], MOTION, read_character(folder / f"{name}.glb"))
    for name in PROGRAMS:
        writer = GlbWriter()
        writer.target = TARGETS[name]
        paths.append(folder / f"for {name}.glb")
        save_motion(paths[-1], MOTION, writer=writer)
    paths.append(folder / "unreal dances.fbx")
    save_on_character(paths[-1], MOTION, read_character(folder / "unreal.glb"))
    return folder, bone_heads_m(paths, FRAMES, MOTION.fps, folder)


@pytest.mark.parametrize("name", DANCES)
def test_joints_are_where_the_motion_has_them(seen, name):
    heads = seen[1][name]
    names = NAMES["ue" if name == "standing.bvh" else "smpl"]
    for joint, role in enumerate(MOTION.skeleton.names):
        expected = MOTION.joint_pos_m()[FRAMES, joint]
        np.testing.assert_allclose(heads[names.get(role, role)], expected, atol=1e-3, err_msg=role)


@pytest.mark.parametrize("name", [*(f"{name} dances.glb" for name in RIGS), "unreal dances.fbx"])
def test_characters_are_where_they_were_put(seen, name):
    folder, heads = seen
    character = read_character(folder / f"{Path(name).stem.removesuffix(' dances')}.glb")
    figure = perform(MOTION, character.rig, character.bones, character.skin).motion
    for role, bone in character.bones.items():
        expected = figure.joint_pos_m()[FRAMES, figure.skeleton.index(role)]
        found = heads[name][character.rig.names[bone]]
        np.testing.assert_allclose(found, expected, atol=1e-3, err_msg=role)


@pytest.mark.parametrize("name", PROGRAMS)
def test_a_file_for_a_program_has_its_bones_in_metres(seen, name):
    target, heads = TARGETS[name], seen[1][f"for {name}.glb"]
    names, path_m = NAMES[target.naming], MOTION.root_pos_m[FRAMES] * FLOOR
    for joint, role in enumerate(MOTION.skeleton.names):
        expected = MOTION.joint_pos_m()[FRAMES, joint] - (path_m if target.in_place else 0.0)
        np.testing.assert_allclose(heads[names[role]], expected, atol=1e-3, err_msg=role)
    assert set(heads) == {*names.values(), target.root} - {""}
    if target.root:
        np.testing.assert_allclose(heads[target.root], path_m, atol=1e-3)
