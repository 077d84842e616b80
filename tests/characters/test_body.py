"""Fingers of characters, and hands that stay out of the body."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gltf_worlds import inside_body, node_worlds
from synthetic_characters import CHARACTERS, UNREAL, VRM, Spec, write_character
from synthetic_motions import swaying

from choreograph.characters.body import fingers_of, with_fingers
from choreograph.characters.character import GltfCharacter, figure_skeleton, perform, read_character
from choreograph.core.counts import Figure
from choreograph.formats.gltf import SkinPoints
from choreograph.formats.register import save_motion
from choreograph.motion import rotations as rot
from choreograph.motion.hands import SHAPES, HandSpan, hand_spans
from choreograph.motion.kinematics import forward, move_limb, to_local
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


FRAMES = np.arange(0, 120, 8)


def reaching(depth_m: float) -> Motion:
    """A dancer whose left wrist goes to `depth_m` behind the surface of the belly and back."""
    motion = swaying(120, fps=60.0)
    skeleton = motion.skeleton
    pos_m, quat = forward(skeleton, motion.root_pos_m, motion.local_quat)
    limb = tuple(skeleton.index(f"left_{part}") for part in ("shoulder", "elbow", "wrist"))
    belly = pos_m[:, skeleton.index("spine2")] + np.array([0.0, 0.0, 0.16 - depth_m])
    share = np.sin(np.pi * np.arange(120) / 119)[:, None] ** 2
    target = (1 - share) * pos_m[:, limb[2]] + share * belly
    move_limb(skeleton, limb, pos_m, quat, target, np.array([0.0, -1.0, 0.0]))
    return replace(motion, local_quat=to_local(skeleton, quat))


@pytest.fixture(scope="module")
def mannequin(tmp_path_factory) -> GltfCharacter:
    path = tmp_path_factory.mktemp("body") / "body.glb"
    save_motion(path, swaying(4))
    return read_character(path)


def inside(character: GltfCharacter, motion: Motion, skin: SkinPoints | None) -> float:
    """The share of frames in which the left wrist is inside the body, by the mesh as a player poses it."""
    performance = perform(motion, character.rig, character.bones, skin)
    document = character.with_animation(performance, "dance")
    figure = performance.motion
    wrist_m = figure.joint_pos_m()[FRAMES, figure.skeleton.index("left_wrist")]
    return float(np.mean(inside_body(document, character, FRAMES, wrist_m)))


def test_a_hand_that_would_be_in_the_body_is_led_to_its_surface(mannequin):
    assert inside(mannequin, reaching(0.12), None) > 0.2
    assert inside(mannequin, reaching(0.12), mannequin.skin) == 0.0


def test_the_way_out_and_back_is_smooth(mannequin):
    motion = reaching(0.12)
    wrist = motion.skeleton.index("left_wrist")
    before, after = (
        perform(motion, mannequin.rig, mannequin.bones, skin).motion.joint_pos_m()[:, wrist]
        for skin in (None, mannequin.skin)
    )
    jerk = [np.linalg.norm(np.diff(path, 3, axis=0) * 60.0**3, axis=-1).max() for path in (before, after)]
    assert jerk[1] < jerk[0] + 400.0  # m/s³; a step of 1 cm would be 2,000


def test_hands_outside_are_left_alone(mannequin):
    motion = swaying(60, fps=60.0, seed=4)
    figures = [perform(motion, mannequin.rig, mannequin.bones, skin) for skin in (None, mannequin.skin)]
    for bone, quat in figures[0].local_quat.items():
        assert np.array_equal(quat, figures[1].local_quat[bone])


def test_a_skin_of_few_points_says_nothing(mannequin):
    few = SkinPoints(mannequin.skin.pos_m[:5], mannequin.skin.bone[:5])
    assert inside(mannequin, reaching(0.12), few) == inside(mannequin, reaching(0.12), None)
