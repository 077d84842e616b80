"""Built-in takes on characters: feet stand on the floor and slide no more, hands stay out of the body.

The characters have the skin of the mannequin. The tests measure this skin as a player poses it.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
from gltf_worlds import inside_body, node_worlds, skinned_vertices_m
from synthetic_characters import CHARACTERS, write_character

from choreograph.characters.character import perform, read_character
from choreograph.evaluation.metrics.physical import foot_slide_cm_s
from choreograph.library.repertoire import starter_repertoire
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion import Motion

FRAMES = np.arange(0, 100, 5)


@lru_cache(maxsize=4)
def take(name: str) -> Motion:
    repertoire = starter_repertoire()
    return repertoire.motion(repertoire.take_index(name), 8.0, 12.0)[0]


@pytest.mark.parametrize("name", CHARACTERS)
def test_feet_are_on_the_floor_and_slide_no_more_than_the_dancers(tmp_path, name):
    spec, motion = CHARACTERS[name], take("contemporary-01")
    write_character(tmp_path / "a.glb", spec)
    character = read_character(tmp_path / "a.glb")
    performance = perform(motion, character.rig, character.bones, character.skin)
    document = character.with_animation(performance, "dance")
    lowest_m = skinned_vertices_m(document, node_worlds(document, FRAMES))[..., 1].min(axis=1)
    assert np.median(np.abs(lowest_m)) < 0.005 and lowest_m.min() > -0.03
    at_our_size = body_pos_m(performance.motion) / (spec.size * spec.legs)
    danced_cm_s = foot_slide_cm_s(body_pos_m(motion), motion.fps)
    assert foot_slide_cm_s(at_our_size, motion.fps) < 1.1 * danced_cm_s + 0.3


@pytest.mark.parametrize("name", ["long arms", "stocky", "child"])
def test_hands_are_not_in_the_body(tmp_path, name):
    motion = take("hip-hop-01")
    write_character(tmp_path / "a.glb", CHARACTERS[name])
    character = read_character(tmp_path / "a.glb")
    performance = perform(motion, character.rig, character.bones, character.skin)
    document, figure = character.with_animation(performance, "dance"), performance.motion
    for side in ("left", "right"):
        wrist_m = figure.joint_pos_m()[FRAMES, figure.skeleton.index(f"{side}_wrist")]
        assert not inside_body(document, character, FRAMES, wrist_m).any()
