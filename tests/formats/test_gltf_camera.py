"""The camera of a GLB: one node, where the cameras are, at both sides of each cut."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic_characters import CHARACTERS, write_character
from synthetic_motions import stepping
from synthetic_pages import plan_for

from choreograph.characters.gltf_character import read_character
from choreograph.formats.gltf_camera import camera_quat
from choreograph.formats.gltf_document import GltfDocument
from choreograph.formats.gltf_files import read_gltf
from choreograph.formats.register import import_takes
from choreograph.motion import rotations as rot
from choreograph.motion.cameras import ASPECT, FOV_RAD, plan_cameras
from choreograph.pipeline.saving import SavedParts, save_dance

MOTION = stepping(16 * 30, seed=1)
PATH = plan_cameras([MOTION], "cuts", (4.0, 8.0, 12.0))


def saved(path, **parts) -> GltfDocument:
    save_dance(path, SavedParts(MOTION, plan_for(MOTION), lambda: np.zeros(0), None, **parts))
    return read_gltf(path)


def tracks(document, node) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    (animation,) = document.json["animations"]
    found = {}
    for channel in animation["channels"]:
        if channel["target"]["node"] == node:
            sampler = animation["samplers"][channel["sampler"]]
            found[channel["target"]["path"]] = (
                document.array(sampler["input"]), document.array(sampler["output"])
            )  # fmt: skip
    return found


@pytest.mark.parametrize("on_character", [False, True])
def test_the_camera_is_where_the_path_has_it(tmp_path, on_character):
    character = None
    if on_character:
        write_character(tmp_path / "hero.glb", CHARACTERS["mixamo"])
        character = read_character(tmp_path / "hero.glb")
    document = saved(tmp_path / "a.glb", camera=PATH, character=character)
    (lens,) = [camera["perspective"] for camera in document.json["cameras"]]
    assert (lens["yfov"], lens["aspectRatio"]) == (pytest.approx(FOV_RAD), pytest.approx(ASPECT))
    (node,) = [index for index, node in enumerate(document.json["nodes"]) if "camera" in node]
    assert node in document.json["scenes"][document.json.get("scene", 0)]["nodes"]
    moves, turns = tracks(document, node)["translation"], tracks(document, node)["rotation"]
    for time_s in (0.0, 3.99, 4.0, 7.9, 8.05, 15.0):
        (eye,), (target,) = PATH.at([time_s])
        here = np.array([np.interp(time_s, moves[0], moves[1][:, axis]) for axis in range(3)])
        assert np.allclose(here, eye, atol=2e-3)
        key = np.searchsorted(turns[0], time_s + 1e-5, side="right") - 1
        sight = rot.rotate(np.roll(turns[1][key], 1), np.array([0.0, 0.0, -1.0]))
        assert np.allclose(sight, (target - eye) / np.linalg.norm(target - eye), atol=1e-5)
    assert np.diff(moves[0]).min() > 5e-4 and moves[0][-1] <= MOTION.duration_s + 1e-6


def test_the_motion_is_read_as_without_a_camera(tmp_path):
    (tmp_path / "with").mkdir()
    saved(tmp_path / "a.glb")
    saved(tmp_path / "with" / "a.glb", camera=PATH)
    without, beside = (
        next(iter(import_takes(path))) for path in (tmp_path / "a.glb", tmp_path / "with/a.glb")
    )
    assert beside.motion.skeleton.same_as(without.motion.skeleton)
    assert np.array_equal(beside.motion.root_pos_m, without.motion.root_pos_m)
    assert np.array_equal(beside.motion.local_quat, without.motion.local_quat)
    assert beside.notes == without.notes


def test_a_camera_is_level_and_looks_at_its_target():
    eyes = np.array([[0.0, 1.0, 5.0], [3.0, 0.3, 4.0], [-2.0, 2.0, 6.0]])
    targets = np.array([[0.0, 1.0, 0.0], [0.5, 1.0, 0.0], [0.0, 0.5, 1.0]])
    quat = camera_quat(eyes, targets)
    sight = rot.rotate(quat, np.array([0.0, 0.0, -1.0]))
    assert np.allclose(np.cross(sight, targets - eyes), 0.0, atol=1e-9)
    assert (np.einsum("kj,kj->k", sight, targets - eyes) > 0).all()
    assert np.allclose(rot.rotate(quat, np.array([1.0, 0.0, 0.0]))[:, 1], 0.0, atol=1e-9)  # no roll
