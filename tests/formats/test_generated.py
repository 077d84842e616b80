"""Dances of other systems: every layout gives the poses that it was made from."""

from __future__ import annotations

import io
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from synthetic_motions import swaying

import choreograph as cg
from choreograph.core.errors import FormatError, ParameterError
from choreograph.formats import aist, generated
from choreograph.motion import rotations as rot
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion import Motion

MOTION = swaying(40)
TO_Z_UP = rot.from_rotvec(np.array([np.pi / 2, 0.0, 0.0]))


def z_up(motion: Motion) -> Motion:
    quat = motion.local_quat.copy()
    quat[:, 0] = rot.multiply(TO_Z_UP, quat[:, 0])
    return Motion(motion.skeleton, rot.rotate(TO_Z_UP, motion.root_pos_m), quat, motion.fps)


def edge(motion: Motion, n_values: int = 72) -> dict[str, np.ndarray]:
    rotvec = rot.to_rotvec(motion.local_quat).reshape(motion.n_frames, -1)
    poses = np.zeros((motion.n_frames, n_values), np.float32)
    poses[:, : min(72, n_values)] = rotvec[:, :n_values]
    return {"smpl_poses": poses, "smpl_trans": motion.root_pos_m.astype(np.float32)}


def six_d(motion: Motion, *, contacts: bool, n_joints: int = 22) -> np.ndarray:
    matrix = np.tile(np.eye(3), (motion.n_frames, n_joints, 1, 1))
    matrix[:, :22] = rot.to_matrix(motion.local_quat[:, :22])
    rows = [motion.root_pos_m, matrix[..., :2, :].reshape(motion.n_frames, -1)]
    return np.concatenate([np.ones((motion.n_frames, 4))] * contacts + rows, axis=1)


def matrices(motion: Motion) -> np.ndarray:
    turned = rot.to_matrix(motion.local_quat).reshape(motion.n_frames, -1)
    return np.concatenate([np.zeros((motion.n_frames, 6)), motion.root_pos_m, 1.01 * turned], axis=1)


def far_away() -> np.ndarray:
    """Positions of which one is damaged."""
    pos = MOTION.joint_pos_m().reshape(-1, 72)
    pos[3, 40] = 1e30
    return pos


LAYOUTS = {
    "edge.pkl": (edge(z_up(MOTION)), 30.0),
    "lodge.pkl": (edge(MOTION, 66), 30.0),
    "fingers.pkl": (edge(MOTION, 156), 30.0),
    "full_pose.pkl": ({"full_pose": MOTION.joint_pos_m()}, 60.0),
    "lodge.npy": (six_d(MOTION, contacts=True), 30.0),
    "lodge135.npy": (six_d(z_up(MOTION), contacts=False), 30.0),
    "lodge319.npy": (six_d(MOTION, contacts=True, n_joints=52), 30.0),
    "parts.npy": (six_d(MOTION, contacts=True).reshape(5, 8, 139), 30.0),
    "fact.npy": (matrices(MOTION), 60.0),
    "bailando.pkl.npy": ({"pred_position": MOTION.joint_pos_m().reshape(-1, 72)}, 60.0),
    "joints.npy": (100.0 * MOTION.joint_pos_m(), 60.0),  # in centimetres
    "batch.npy": (MOTION.joint_pos_m()[None], 60.0),
    "body.npy": (MOTION.joint_pos_m()[:, :22], 30.0),
}


def written(folder, name):
    content, path = LAYOUTS[name][0], folder / name
    if name.endswith(".pkl"):
        path.write_bytes(pickle.dumps(content))
    else:
        np.save(path, content)
    return path


@pytest.mark.parametrize("name", LAYOUTS)
def test_every_layout_gives_the_poses_that_it_was_made_from(tmp_path, name):
    path = written(tmp_path, name)
    [take] = generated.read(path)
    fps = LAYOUTS[name][1]
    assert take.motion.fps == fps and any(f"read at {fps:g} fps" in note for note in take.notes)
    assert take.name == name.split(".")[0]
    found, made = body_pos_m(take.motion), body_pos_m(MOTION)
    found, made = (pos - pos[:1, :1] for pos in (found, made))
    fitted = "joints" in name or "pose" in name or "bailando" in name or name in ("batch.npy", "body.npy")
    error_m = np.linalg.norm(found - made, axis=-1)
    assert error_m.mean() < (0.02 if fitted else 1e-4)
    assert cg.load_motion(path).n_frames == MOTION.n_frames


def test_a_pickle_of_aist_is_not_taken(tmp_path):
    path = tmp_path / "gBR_sBM_cAll_d04_mBR0_ch01.pkl"
    path.write_bytes(pickle.dumps({**edge(MOTION), "smpl_scaling": np.array([1.0])}))
    assert aist.detect(path) and not generated.detect(path)
    assert cg.load_motion(path).fps == 60.0


class Harmful:
    def __reduce__(self):
        return (print, ("code ran",))


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ({"smpl_poses": np.zeros((5, 72))}, "got smpl_poses"),
        ({}, "got nothing"),
        ({"smpl_poses": Harmful(), "smpl_trans": 1}, "may run code"),
        ([1, 2], "got list"),
    ],
)
def test_other_pickles_are_refused(tmp_path, content, says, capsys):
    (tmp_path / "a.pkl").write_bytes(pickle.dumps(content))
    np.save(tmp_path / "a.npy", np.array(content, object), allow_pickle=True)
    with pytest.raises(FormatError, match=says):
        cg.load_motion(tmp_path / "a.pkl")
    with pytest.raises((FormatError, ParameterError)):
        cg.load_motion(tmp_path / "a.npy")
    assert "code ran" not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("array", "says"),
    [
        (np.zeros((5, 71)), r"N among 66, 72"),
        (np.zeros((0, 72)), r"got \(0, 72\)"),
        (np.zeros(72), r"got \(72,\)"),
        (np.full((5, 139), np.nan), "finite numbers"),
        (np.zeros((5, 139)), "without a direction"),
        (np.zeros((5, 24, 3)), "no bone lengths"),
        (np.array([["a"] * 72]), "array of numbers"),
        (np.zeros((5, 225), complex), "array of numbers"),
        (MOTION.joint_pos_m()[:1].reshape(1, 72), "two frames or more"),
        (MOTION.joint_pos_m()[:1, :22], "two frames or more"),
        (np.full((5, 139), 1e300), "finite numbers below"),
        (far_away(), "finite numbers below"),
    ],
)
def test_other_arrays_are_refused(tmp_path, array, says):
    np.save(tmp_path / "a.npy", array)
    with pytest.raises(FormatError, match=says):
        cg.load_motion(tmp_path / "a.npy")


@given(cut=st.integers(0, 400), flip=st.integers(0, 400))
def test_damaged_files_are_refused_or_read(tmp_path_factory, cut, flip):
    data = bytearray()
    for content in (LAYOUTS["bailando.pkl.npy"][0], LAYOUTS["lodge.npy"][0][:3]):
        stream = io.BytesIO()
        np.save(stream, np.array(content, object) if isinstance(content, dict) else content)
        data = bytearray(stream.getvalue())
        data[flip % len(data)] ^= 0xFF
        path = tmp_path_factory.mktemp("damaged") / "a.npy"
        path.write_bytes(bytes(data[: len(data) - cut]))
        for found in generated.read(path):
            assert "\n" not in getattr(found, "why", "")
