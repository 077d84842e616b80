"""Compressed motion and mesh: round trip, size, and what happens to motion that does not fit."""

from __future__ import annotations

import base64
import zlib

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic_motions import swaying

from choreograph.motion import rotations as rot
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import canonical_skeleton
from choreograph.motion.skinned_mesh import build_mannequin
from choreograph.view.page import ROTVEC_STEP_RAD, CompressedMotion, compress_mesh, compress_motion


def decompressed(compressed: CompressedMotion) -> tuple[np.ndarray, np.ndarray]:
    """Root positions (T, 3) and rotations (T, J, 4), decoded from the description of the format."""
    planes = (
        np.frombuffer(zlib.decompress(base64.b64decode(compressed.text)), np.uint8)
        .astype(np.int64)
        .reshape(2, -1)
    )
    folded = planes[0] + 256 * planes[1]
    change = np.where(folded % 2, -(folded + 1) // 2, folded // 2).reshape(-1, compressed.n_frames)
    steps = np.cumsum(np.cumsum(change, axis=1), axis=1).astype(np.int16)  # (3 + 3J, T)
    root = steps[:3].T * compressed.root_step_m + np.array(compressed.root_origin_m)
    turns = steps[3:].T.reshape(compressed.n_frames, -1, 3) * ROTVEC_STEP_RAD
    return root, rot.from_rotvec(turns)


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1), n_frames=st.integers(1, 9), spread_m=st.sampled_from([0.0, 1.0, 500.0])
)
def test_motion_round_trip(seed, n_frames, spread_m):
    """Also with the largest jumps between frames, and roots far away."""
    rng = np.random.default_rng(seed)
    skeleton = canonical_skeleton()
    quat = rot.normalize(rng.normal(size=(n_frames, skeleton.n_joints, 4)))
    root = spread_m * rng.uniform(-1, 1, (n_frames, 3))
    root_back, quat_back = decompressed(compress_motion(Motion(skeleton, root, quat, 30.0)))
    assert np.abs(root_back - root).max() <= max(2.5e-4, spread_m / 32_000) + 1e-9
    apart_rad = 2 * np.arccos(np.clip(np.abs((quat_back * quat).sum(axis=-1)), 0, 1))
    assert apart_rad.max() < 3e-4  # half a step in each of three directions, and rounding


def test_four_minutes_are_small():
    compressed = compress_motion(swaying(14_400, fps=60.0))
    assert compressed.fps == 60.0
    assert len(compressed.text) < 1_500_000


def test_frame_rate_is_limited_to_60_fps():
    compressed = compress_motion(swaying(240, fps=120.0))
    assert (compressed.fps, compressed.n_frames) == (60.0, 120)


def test_motion_that_does_not_fit_loses_frames_not_joints():
    motion = swaying(600, fps=60.0)
    whole = compress_motion(motion)
    half = compress_motion(motion, max_bytes=len(whole.text) - 1)
    assert half.fps == 30.0
    assert len(half.text) < len(whole.text)
    root, quat = decompressed(half)
    assert np.abs(root - motion.root_pos_m[::2]).max() < 5e-4
    assert quat.shape == (300, motion.skeleton.n_joints, 4)


def test_mesh_round_trip():
    mesh = build_mannequin(canonical_skeleton())
    text, numbers = compress_mesh(mesh)
    data = zlib.decompress(base64.b64decode(text))
    n, f = len(mesh.vertices_m), len(mesh.triangles)
    assert (numbers["vertices"], numbers["triangles"]) == (n, f)
    places = np.frombuffer(data, "<i2", 3 * n).reshape(n, 3) * numbers["step_m"]
    assert np.abs(places - mesh.vertices_m).max() < 1e-4
    assert np.array_equal(np.frombuffer(data, "<u4", 3 * f, 6 * n).reshape(f, 3), mesh.triangles)
    assert np.array_equal(np.frombuffer(data, "<u2", 2 * n, 6 * n + 12 * f).reshape(n, 2), mesh.joints)
    weights = np.frombuffer(data, np.uint8, n, 10 * n + 12 * f) / 255
    assert np.abs(weights - mesh.weights[:, 0]).max() < 0.003
    normals = np.frombuffer(data, np.int8, 3 * n, 11 * n + 12 * f).reshape(n, 3) / 127
    assert np.abs(normals - mesh.normals).max() < 0.005
    assert np.array_equal(np.frombuffer(data, np.uint8, n, 14 * n + 12 * f), mesh.parts)
    assert len(text) < 150_000
