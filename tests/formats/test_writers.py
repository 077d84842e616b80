"""Writers: files read back as written, are reproducible, and are written atomically."""

from __future__ import annotations

import errno
import resource

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic_motions import on_other_axes, swaying

from choreograph.core.errors import ChoreographError, FormatError, ParameterError
from choreograph.core.files import atomic_path, sha256_of
from choreograph.formats.bvh import BvhOptions, BvhWriter, read_bvh
from choreograph.formats.npz import NpzWriter, read_npz
from choreograph.formats.register import get_writer, save_motion
from choreograph.formats.writer import NAMES
from choreograph.motion.bone_map import joint_roles
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import CANONICAL_JOINTS, Skeleton


def by_name(motion: Motion) -> dict[str, np.ndarray]:
    return dict(zip(motion.skeleton.names, np.moveaxis(motion.joint_pos_m(), 1, 0), strict=True))


@pytest.mark.parametrize("farthest", [1.0, 999_999.0, 1e13])
def test_numbers_of_bvh_have_the_characters_of_python(tmp_path, farthest):
    known = [0.0, -0.0, -1e-9, 5.1e-6, 0.999994, 0.999996, 9.999996, -10.0, 99.5, -540.0]
    scaled = np.random.default_rng(0).uniform(-farthest, farthest, (40, 3))
    root = np.concatenate([np.resize(known, (4, 3)), scaled])
    motion = Motion(swaying(1).skeleton, root, np.tile(swaying(1).local_quat, (44, 1, 1)), 60.0)
    save_motion(tmp_path / "a.bvh", motion, writer=BvhWriter(BvhOptions(units_per_m=1.0)))
    lines = (tmp_path / "a.bvh").read_text().split("Frame Time")[1].splitlines()[1:]
    assert [line.split(" ")[:3] for line in lines] == [[f"{x:.5f}" for x in row] for row in root.tolist()]


@pytest.mark.parametrize("order", ["XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX"])
def test_bvh_round_trip_twice(tmp_path, order):
    motion = on_other_axes(swaying(40), 3)
    for name in ("a.bvh", "b.bvh"):
        save_motion(tmp_path / name, motion, writer=BvhWriter(BvhOptions(order=order)))
        back, _ = read_bvh(tmp_path / name)
        before, after = by_name(motion), by_name(back)
        assert max(np.abs(before[joint] - after[joint]).max() for joint in before) < 1e-4
        assert (back.fps, len(back.skeleton.tips_m)) == (motion.fps, 5)
        motion = back


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10**6), n_joints=st.integers(2, 12))
def test_bvh_of_any_hierarchy(tmp_path_factory, seed, n_joints):
    rng = np.random.default_rng(seed)
    parents = [-1] + [int(rng.integers(0, joint)) for joint in range(1, n_joints)]
    skeleton = Skeleton(
        tuple(f"b{i}" for i in range(n_joints)), np.array(parents), rng.normal(size=(n_joints, 3))
    )
    quat = rng.normal(size=(3, n_joints, 4))
    quat /= np.linalg.norm(quat, axis=-1, keepdims=True)
    motion = Motion(skeleton, rng.normal(size=(3, 3)), quat, 60.0)
    path = tmp_path_factory.mktemp("any") / "x.bvh"
    save_motion(path, motion)
    back, _ = read_bvh(path)
    before, after = by_name(motion), by_name(back)
    # With unknown joint names the reader infers the size: compare up to scale.
    scale = np.ptp(np.stack(list(after.values()))) / np.ptp(np.stack(list(before.values())))
    assert max(np.abs(scale * before[j] - after[j]).max() for j in before) < 1e-3


@pytest.mark.parametrize("naming", NAMES)
def test_names_of_other_programs_are_known_again(tmp_path, naming):
    motion = swaying(20)
    save_motion(tmp_path / "a.bvh", motion, writer=BvhWriter(BvhOptions(naming=naming)))
    back, _ = read_bvh(tmp_path / "a.bvh")
    names = [NAMES[naming].get(name, name) for name in motion.skeleton.names]
    assert set(back.skeleton.names) == set(names)
    found = {role: back.skeleton.names[joint] for role, joint in joint_roles(back.skeleton).items()}
    body = [role for role in CANONICAL_JOINTS if not role.endswith("_hand")]
    assert {role: found.get(role) for role in body} == {role: NAMES[naming].get(role, role) for role in body}


def test_npz_round_trip_is_exact(tmp_path):
    motion = swaying()
    save_motion(tmp_path / "a.npz", motion)
    back = read_npz(tmp_path / "a.npz")
    assert np.array_equal(back.root_pos_m, motion.root_pos_m)
    assert np.array_equal(back.local_quat, motion.local_quat)
    assert back.fps == motion.fps
    assert back.skeleton.same_as(motion.skeleton, tolerance_m=0)
    assert np.array_equal(back.skeleton.tips_m, motion.skeleton.tips_m)
    with np.load(tmp_path / "a.npz") as arrays:
        assert arrays["poses"].shape == (motion.n_frames, 72)


@pytest.mark.parametrize("suffix", ["bvh", "npz"])
def test_same_bytes_each_time(tmp_path, suffix):
    for name in ("a", "b"):
        save_motion(tmp_path / f"{name}.{suffix}", swaying())
    assert sha256_of(tmp_path / f"a.{suffix}") == sha256_of(tmp_path / f"b.{suffix}")


@pytest.mark.parametrize("keep", [0, 10, 400, 3000])
def test_damaged_npz_is_refused(tmp_path, keep):
    save_motion(tmp_path / "a.npz", swaying())
    cut = tmp_path / "cut.npz"
    cut.write_bytes((tmp_path / "a.npz").read_bytes()[:keep])
    with pytest.raises(FormatError, match=r"cut\.npz"):
        read_npz(cut)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"root_pos_m": np.zeros((20, 3), complex)}, "numbers below 1e"),
        ({"offsets_m": np.full((24, 3), 1e300)}, "numbers below 1e"),
        ({"parents": np.full(24, np.nan)}, "numbers below 1e"),
        ({"fps": np.float64(0)}, "frame rate above 0"),
        ({"fps": np.float64(1e-6)}, "up to an hour"),
        ({"tip_parents": np.full(5, 24)}, "end sites"),
        ({"tip_parents": np.zeros(4, int)}, "end sites"),
        ({"names": np.array([f"{i}" for i in range(5000)])}, "of at most 4096 joints"),
        ({"root_pos_m": np.zeros((50_000_000, 3), np.float64)}, "MiB of arrays, got more"),
    ],
)
def test_npz_of_impossible_arrays_is_refused(tmp_path, changes, message):
    save_motion(tmp_path / "a.npz", swaying(20))
    with np.load(tmp_path / "a.npz") as archive:
        arrays = dict(archive)
    if len(changes.get("names", ())):
        changes |= {"parents": np.arange(5000) - 1, "offsets_m": np.zeros((5000, 3))}
    np.savez_compressed(tmp_path / "b.npz", **(arrays | changes))
    with pytest.raises(FormatError, match=message) as refused:
        read_npz(tmp_path / "b.npz")
    assert "b.npz" in str(refused.value) and "\n" not in str(refused.value)


def test_npz_of_something_else_or_with_objects_is_refused(tmp_path):
    np.savez(tmp_path / "b.npz", a=1)
    with pytest.raises(FormatError, match="root_pos_m"):
        read_npz(tmp_path / "b.npz")
    np.savez(
        tmp_path / "c.npz", **dict.fromkeys(("root_pos_m", "local_quat", "fps"), np.array([print], object))
    )
    with pytest.raises(FormatError):
        read_npz(tmp_path / "c.npz")


def test_unknown_formats_and_options(tmp_path):
    with pytest.raises(ParameterError, match="bvh, npz"):
        save_motion(tmp_path / "a.xyz", swaying())
    with pytest.raises(ParameterError, match="ZXY"):
        BvhOptions(order="ZZY")
    assert isinstance(get_writer("NPZ"), NpzWriter)


def test_a_missing_folder_or_a_folder_as_target_is_refused(tmp_path):
    for path in (tmp_path / "none" / "a.bvh", tmp_path):
        with pytest.raises(ParameterError, match="folder"), atomic_path(path):
            pytest.fail("the body ran")


def test_a_failure_leaves_the_old_file_and_nothing_else(tmp_path):
    target = tmp_path / "a.bvh"
    target.write_text("old")

    def half_write(failure: BaseException) -> None:
        with atomic_path(target) as path:
            path.write_text("half")
            raise failure

    with pytest.raises(ChoreographError, match="No space left"):
        half_write(OSError(errno.ENOSPC, "No space left on device"))
    with pytest.raises(KeyboardInterrupt):
        half_write(KeyboardInterrupt())
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


@pytest.mark.parametrize("suffix", ["bvh", "npz"])
def test_a_full_disk_is_one_line(tmp_path, suffix):
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (5000, limits[1]))
    try:
        with pytest.raises(ChoreographError, match="cannot write"):
            save_motion(tmp_path / f"a.{suffix}", swaying(600))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert not list(tmp_path.iterdir())
