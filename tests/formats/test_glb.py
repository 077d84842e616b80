"""GLB files: what they show is the dance, worked out by the format's own rules."""

from __future__ import annotations

import numpy as np
import pytest
from gltf_worlds import node_worlds, skinned_vertices_m
from synthetic_motions import on_other_axes, swaying

from choreograph.formats.gltf_files import read_gltf
from choreograph.formats.register import save_motion
from choreograph.motion.kinematics import forward
from choreograph.motion.motion import Motion
from choreograph.motion.skinned_mesh import build_mannequin, skin_matrices


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
