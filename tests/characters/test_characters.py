"""Characters dance as the dancer does, whatever their names, rest poses, bone axes, units and proportions.

What a written file shows is worked out by the format's own rules (`gltf_worlds`).
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
from gltf_worlds import node_worlds
from synthetic_characters import CHARACTERS, write_character
from synthetic_motions import stepping

from choreograph.characters.character import perform, read_character, rolled
from choreograph.formats.gltf_document import GltfDocument
from choreograph.motion import rotations as rot
from choreograph.motion.kinematics import forward
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import CANONICAL_JOINTS, canonical_skeleton

BONES = (
    ("left_shoulder", "left_elbow"), ("left_elbow", "left_wrist"), ("right_shoulder", "right_elbow"),
    ("right_elbow", "right_wrist"), ("left_hip", "left_knee"), ("right_knee", "right_ankle"),
)  # fmt: skip


@lru_cache(maxsize=1)
def danced() -> Motion:
    return stepping(240, fps=60.0)


@pytest.fixture(params=CHARACTERS)
def dancing(request, tmp_path):
    """A character, how it was made, and the document in which it dances."""
    spec = CHARACTERS[request.param]
    made = write_character(tmp_path / "a.glb", spec)
    character = read_character(tmp_path / "a.glb")
    return spec, made, character, character.dancing(danced())


def worlds(document: GltfDocument, spec, made, frames) -> dict[str, np.ndarray]:
    """World matrices (T, 4, 4) of the bones by canonical name."""
    of_nodes = node_worlds(document, frames)
    names = [node.get("name") for node in document.json["nodes"]]
    return {part: of_nodes[:, names.index(spec.names[part])] for part in made.part if part}


def test_bones_are_found_and_lie_where_they_were_bound(dancing):
    spec, made, character, _ = dancing
    found = {role: character.rig.names[bone] for role, bone in character.bones.items()}
    assert found == {part: spec.names[part] for part in made.part if part}
    index = [character.rig.names.index(name) for name in made.names]
    np.testing.assert_allclose(character.rig.bind_pos_m[index], made.pos_m, atol=1e-6)
    assert character.rig.floor_m == pytest.approx(0.0, abs=1e-6)


def test_limbs_point_where_the_dancers_do(dancing):
    spec, made, _, document = dancing
    frames = np.arange(0, 240, 7)
    bones, source = worlds(document, spec, made, frames), danced().joint_pos_m()[frames]
    for start, end in BONES:
        own = bones[end][:, :3, 3] - bones[start][:, :3, 3]
        dancers = source[:, CANONICAL_JOINTS.index(end)] - source[:, CANONICAL_JOINTS.index(start)]
        cos = np.sum(own * dancers, axis=1) / np.linalg.norm(own, axis=1) / np.linalg.norm(dancers, axis=1)
        # Legs are turned a little to keep the feet where they stand, more if those are long or do not bend.
        of_legs = 8.0 if spec.legs == 1.0 and "left_foot" not in spec.left_out else 15.0
        limit = of_legs if "hip" in start or "knee" in start else 0.1
        assert np.degrees(np.arccos(np.clip(cos, -1, 1))).max() < limit


def test_head_and_chest_turn_as_the_dancers_do(dancing):
    spec, made, _, document = dancing
    frames = np.arange(0, 240, 7)
    bones = worlds(document, spec, made, frames)
    _, quat = forward(canonical_skeleton(), danced().root_pos_m[frames], danced().local_quat[frames])
    facing = rot.about_y(spec.heading_rad)
    chest = next(part for part in ("spine3", "spine2", "spine1") if part in bones)
    for part, joint in ((chest, "spine3"), ("head", "head")):
        turn = rot.from_matrix(bones[part][:, :3, :3] * spec.units_per_m)
        bind = made.quat[made.part.index(part)]
        from_bind = rot.multiply(turn, rot.invert(bind))
        expected = rot.multiply(quat[:, CANONICAL_JOINTS.index(joint)], rot.invert(facing))
        np.testing.assert_allclose(np.abs(np.sum(from_bind * expected, axis=-1)), 1.0, atol=1e-6)


def test_the_hips_travel_by_leg_length(dancing):
    spec, made, _, document = dancing
    frames = np.array([0, 120, 239])
    bones, source = worlds(document, spec, made, frames), danced().joint_pos_m()[frames]
    own = (bones["left_hip"] + bones["right_hip"])[:, :3, 3] / 2
    hips = [CANONICAL_JOINTS.index(name) for name in ("left_hip", "right_hip")]
    expected = spec.size * spec.legs * source[:, hips].mean(axis=1)
    np.testing.assert_allclose(own[:, [0, 2]], expected[:, [0, 2]], atol=1e-4)


def test_nothing_else_of_the_file_is_changed(dancing):
    _, _, character, document = dancing
    before, after = character.document.json, document.json
    for kind in ("nodes", "meshes", "skins", "scenes"):
        assert after[kind] == before[kind]
    assert "animations" not in before
    n = len(before["accessors"])
    assert after["accessors"][:n] == before["accessors"]


def test_a_dance_comes_back_from_a_character(tmp_path):
    """Ours, onto a character, and back: within a centimetre where proportions agree."""
    write_character(tmp_path / "a.glb", CHARACTERS["unreal"])
    character = read_character(tmp_path / "a.glb")
    figure = perform(danced(), character.rig, character.bones).motion
    names = [name for name in figure.skeleton.names if name in CANONICAL_JOINTS]
    own = figure.joint_pos_m()[:, [figure.skeleton.index(name) for name in names]]
    source = danced().joint_pos_m()[:, [CANONICAL_JOINTS.index(name) for name in names]]
    up = np.array([0.0, np.mean(own[..., 1] - source[..., 1]), 0.0])
    assert np.linalg.norm(own - up - source, axis=-1).mean() < 0.01


def test_twist_bones_share_the_roll_of_a_forearm(tmp_path):
    write_character(tmp_path / "a.glb", CHARACTERS["unreal"])
    character = read_character(tmp_path / "a.glb")
    motion = danced()
    quat = motion.local_quat.copy()
    turned = rot.from_rotvec(np.array([1.0, 0.0, 0.0]))  # the left hand rolls about the forearm
    quat[:, CANONICAL_JOINTS.index("left_wrist")] = turned
    figure = perform(
        Motion(motion.skeleton, motion.root_pos_m, quat, 60.0), character.rig, character.bones
    ).motion
    _, world = forward(figure.skeleton, figure.root_pos_m, figure.local_quat)
    twist = figure.skeleton.names.index(f"#{character.rig.names.index('lowerarm_twist_01_l')}")
    elbow, wrist = (figure.skeleton.index(f"left_{part}") for part in ("elbow", "wrist"))
    rest = figure.skeleton.rest_pos_m()
    rolls = [
        np.linalg.norm(rot.to_rotvec(rolled(rot.multiply(rot.invert(world[:, elbow]), world[:, joint]),
                                            rest[wrist] - rest[elbow])), axis=-1)
        for joint in (twist, wrist)
    ]  # fmt: skip
    np.testing.assert_allclose(rolls[1], 1.0, atol=0.01)
    np.testing.assert_allclose(rolls[0], 0.5, atol=0.01)


def test_ik_bones_go_with_the_feet(tmp_path):
    spec = CHARACTERS["unreal"]
    made = write_character(tmp_path / "a.glb", spec)
    document = read_character(tmp_path / "a.glb").dancing(danced())
    frames = np.arange(0, 240, 11)
    of_nodes, names = node_worlds(document, frames), [n.get("name") for n in document.json["nodes"]]
    for side in ("l", "r"):
        ik, foot = (of_nodes[:, names.index(name)][:, :3, 3] for name in (f"ik_foot_{side}", f"foot_{side}"))
        np.testing.assert_allclose(ik, foot, atol=1e-4)
    root = names.index("root")
    assert made.names[0] == "root"
    at_rest = np.repeat(node_worlds(document)[:, root], len(frames), axis=0)
    np.testing.assert_allclose(of_nodes[:, root], at_rest, atol=1e-6)
