"""Hands stay out of the body of a character, by its posed mesh; where they are outside, nothing changes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gltf_worlds import inside_body
from synthetic_motions import swaying

from choreograph.characters.gltf_character import GltfCharacter, read_character
from choreograph.characters.performance import perform
from choreograph.formats.gltf_rig import SkinPoints
from choreograph.formats.register import save_motion
from choreograph.motion.kinematics import forward, move_limb, to_local
from choreograph.motion.motion import Motion

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
