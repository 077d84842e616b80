"""Fingers bend towards the palm in the shape of the figure, smoothly. Hands without fingers do not change."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gltf_worlds import node_worlds
from synthetic_characters import CHARACTERS, UNREAL, VRM, Spec, write_character
from synthetic_motions import swaying

from choreograph.characters.fingers import fingers_of, with_fingers
from choreograph.characters.gltf_character import read_character
from choreograph.characters.performance import figure_skeleton, perform
from choreograph.core.counts import Figure
from choreograph.motion import rotations as rot
from choreograph.motion.hands import SHAPES, HandSpan, hand_spans
from choreograph.motion.motion import Motion

MOTION = swaying(120, fps=60.0)
RIGS = {
    "mixamo": replace(CHARACTERS["mixamo"], fingers="mixamorig:{Side}Hand{Finger}{n}"),
    "unreal": Spec(UNREAL, arms_down_rad=0.8, along="x", root=True, fingers="{Finger}_0{n}_{s}"),
    "vrm that looks back": Spec(VRM, vrm=True, along="", heading_rad=np.pi, fingers="J_Bip_{s}_{Finger}{n}"),
}


@pytest.fixture(scope="module", params=RIGS)
def hero(tmp_path_factory, request):
    path = tmp_path_factory.mktemp("hero") / "hero.glb"
    write_character(path, RIGS[request.param])
    return read_character(path)


def still(hero) -> tuple[Motion, dict[int, int]]:
    """A second in the bind pose, and the joints of the bones."""
    skeleton, order = figure_skeleton(hero.rig, hero.bones)
    quat = np.tile(rot.IDENTITY, (60, skeleton.n_joints, 1))
    root_m = np.tile(skeleton.offsets_m[0], (60, 1))
    return Motion(skeleton, root_m, quat, 60.0), {bone: joint for joint, bone in enumerate(order)}


def test_all_fingers_are_found(hero):
    found = fingers_of(hero.rig, hero.bones)
    assert [(f.side, f.name) for f in found] == [
        (side, name) for side in ("left", "right") for name in ("thumb", "index", "middle", "ring", "pinky")
    ]
    assert all(len(finger.bones) == 3 for finger in found)


def test_a_fist_is_closed_and_an_open_hand_is_straight(hero):
    figure, joint_of = still(hero)
    reach, below = {}, {}
    for shape in SHAPES:
        posed = with_fingers(figure, hero.rig, hero.bones, joint_of, [HandSpan(0.0, 9.0, shape)])
        pos_m = posed.joint_pos_m()[30]
        for finger in fingers_of(hero.rig, hero.bones):
            tip = int(np.flatnonzero(hero.rig.parents == finger.bones[-1])[0])
            start, end = pos_m[joint_of[finger.bones[0]]], pos_m[joint_of[tip]]
            key = finger.side, finger.name, shape
            reach[key], below[key] = np.linalg.norm(end - start), (start - end)[1]
    for side in ("left", "right"):
        for name in ("index", "middle", "ring", "pinky"):
            straight, relaxed, fist = (reach[side, name, shape] for shape in ("open", "relaxed", "fist"))
            assert straight == pytest.approx(0.09, abs=1e-6)
            assert 0.07 < relaxed < 0.089 and fist < 0.05
            # The palms are down in these bind poses: the tips go down.
            assert below[side, name, "relaxed"] > below[side, name, "open"] + 0.01
        assert reach[side, "thumb", "fist"] < reach[side, "thumb", "relaxed"] < 0.0901


def test_both_hands_are_mirrored(hero):
    figure, joint_of = still(hero)
    pos_m = with_fingers(figure, hero.rig, hero.bones, joint_of).joint_pos_m()[0]
    fingers = fingers_of(hero.rig, hero.bones)
    for left, right in zip(fingers[:5], fingers[5:], strict=True):
        for a, b in zip(left.bones, right.bones, strict=True):
            assert np.allclose(pos_m[joint_of[a]] * [-1, 1, 1], pos_m[joint_of[b]], atol=1e-6)


def test_shapes_change_smoothly_and_nothing_else_moves(hero):
    figure, joint_of = still(hero)
    spans = [HandSpan(0.3, 0.7, "fist")]
    posed = with_fingers(figure, hero.rig, hero.bones, joint_of, spans)
    own = [joint_of[bone] for finger in fingers_of(hero.rig, hero.bones) for bone in finger.bones]
    others = [joint for joint in range(figure.skeleton.n_joints) if joint not in own]
    assert np.array_equal(posed.local_quat[:, others], figure.local_quat[:, others])
    turns = rot.to_rotvec(rot.multiply(rot.invert(posed.local_quat[:-1]), posed.local_quat[1:]))
    assert np.degrees(np.linalg.norm(turns, axis=-1)).max() < 15  # a frame, of 90 degrees in half a second
    assert not np.allclose(posed.local_quat[30, own], posed.local_quat[0, own], atol=0.1)


def test_what_is_written_has_the_fingers_of_the_figure(hero):
    figures = [Figure("stomp and turn", 1.0, 2.0, 4)]
    document = hero.dancing(MOTION, figures=figures)
    expected = perform(MOTION, hero.rig, hero.bones, hero.skin, hand_spans(figures)).motion
    found = node_worlds(document, np.array([10, 90]))[..., :3, 3]  # (2, N, 3)
    for finger in fingers_of(hero.rig, hero.bones):
        for bone in finger.bones:
            joint = figure_skeleton(hero.rig, hero.bones)[1].index(bone)
            np.testing.assert_allclose(
                found[:, hero.nodes[bone]], expected.joint_pos_m()[[10, 90], joint], atol=1e-4
            )


def test_hands_without_fingers_are_as_they_were(tmp_path):
    write_character(tmp_path / "hero.glb", CHARACTERS["mixamo"])
    hero = read_character(tmp_path / "hero.glb")
    figure, joint_of = still(hero)
    assert with_fingers(figure, hero.rig, hero.bones, joint_of, [HandSpan(0, 1, "fist")]) is figure
    with_one = replace(hero.rig, names=("Index1", *hero.rig.names[1:]))
    assert with_fingers(figure, with_one, hero.bones, joint_of) is figure
