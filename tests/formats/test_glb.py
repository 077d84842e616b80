"""GLB: the mannequin, its animation and the camera."""

from __future__ import annotations

import numpy as np
import pytest
from gltf_worlds import node_worlds, skinned_vertices_m
from synthetic_characters import CHARACTERS, write_character
from synthetic_motions import on_other_axes, stepping, swaying
from synthetic_pages import plan_for

from choreograph.characters.character import read_character
from choreograph.formats.glb import camera_quat
from choreograph.formats.gltf_document import GltfDocument, read_gltf
from choreograph.formats.register import import_takes, save_motion
from choreograph.motion import rotations as rot
from choreograph.motion.cameras import ASPECT, FOV_RAD, plan_cameras
from choreograph.motion.kinematics import forward
from choreograph.motion.motion import Motion
from choreograph.motion.skinned_mesh import build_mannequin, skin_matrices
from choreograph.pipeline.saving import SavedParts, save_dance


@pytest.mark.parametrize(
    "motion", [swaying(90, fps=60.0), on_other_axes(swaying(40), 3)], ids=["ours", "other"]
)
def test_joints_are_where_the_motion_has_them(tmp_path, motion):
    save_motion(tmp_path / "a.glb", motion)
    document = read_gltf(tmp_path / "a.glb")
    frames = np.arange(motion.n_frames)
    pos = node_worlds(document, frames)[:, : motion.skeleton.n_joints, :3, 3]
    np.testing.assert_allclose(pos, motion.joint_pos_m(), atol=1e-5)
    names = [node["name"] for node in document.json["nodes"][: motion.skeleton.n_joints]]
    assert names == list(motion.skeleton.names)
    animation = document.json["animations"][0]
    times = document.array(animation["samplers"][0]["input"])
    np.testing.assert_allclose(times, frames / motion.fps, atol=1e-6)


def test_the_skin_is_the_mannequin(tmp_path):
    motion = swaying(30)
    save_motion(tmp_path / "a.glb", motion)
    document = read_gltf(tmp_path / "a.glb")
    mesh = build_mannequin(motion.skeleton, motion)
    shown = skinned_vertices_m(document, node_worlds(document, np.array([0, 17])))
    pos, quat = forward(motion.skeleton, motion.root_pos_m[[0, 17]], motion.local_quat[[0, 17]])
    matrices = skin_matrices(mesh, pos[1], quat[1])
    expected = np.einsum(
        "vk,vkij,vj->vi", mesh.weights, matrices[mesh.joints][..., :3, :3], mesh.vertices_m
    ) + np.einsum("vk,vki->vi", mesh.weights, matrices[mesh.joints][..., :3, 3])
    np.testing.assert_allclose(shown[1], expected, atol=1e-4)


@pytest.mark.parametrize("motion", [swaying(20), on_other_axes(swaying(20), 1)], ids=["ours", "other"])
def test_at_rest_it_stands_upright_on_the_floor(tmp_path, motion):
    save_motion(tmp_path / "a.glb", motion)
    document = read_gltf(tmp_path / "a.glb")
    vertices = skinned_vertices_m(document, node_worlds(document))[0]
    assert abs(vertices[:, 1].min()) < 1e-5
    assert 1.4 < vertices[:, 1].max() < 2.0


def test_a_minute_is_small_and_the_same_motion_gives_the_same_bytes(tmp_path):
    motion = swaying(3600, fps=60.0)
    for name in ("a.glb", "b.glb"):
        save_motion(tmp_path / name, motion)
    assert (tmp_path / "a.glb").read_bytes() == (tmp_path / "b.glb").read_bytes()
    assert (tmp_path / "a.glb").stat().st_size < 3_000_000


def test_one_frame_is_enough(tmp_path):
    motion = swaying(2)
    save_motion(
        tmp_path / "a.glb", Motion(motion.skeleton, motion.root_pos_m[:1], motion.local_quat[:1], 30.0)
    )
    assert len(read_gltf(tmp_path / "a.glb").json["animations"]) == 1


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
