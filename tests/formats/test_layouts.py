"""Layouts: what is detected, what is read from names and manifests, what is refused."""

from __future__ import annotations

import os
import pickle
import re
from dataclasses import replace

import numpy as np
import pytest
from synthetic_motions import swaying

from choreograph.core.counts import ANNOTATED, Figure
from choreograph.core.errors import FormatError, ParameterError
from choreograph.formats import aist as aist_layout
from choreograph.formats.npz import read_npz
from choreograph.formats.register import import_takes, save_motion
from choreograph.motion import rotations as rot
from choreograph.motion.body import BODY_JOINTS, body_pos_m

MOTION = swaying(30)


def take_folder(tmp_path, *names):
    for name in names:
        save_motion(tmp_path / f"{name}.bvh", MOTION)
    return tmp_path


def smpl_arrays(motion):
    return rot.to_rotvec(motion.local_quat).reshape(motion.n_frames, -1), motion.root_pos_m


def aist(tmp_path, name="gBR_sBM_cAll_d04_mBR0_ch01", **changes):
    poses, trans = smpl_arrays(MOTION)
    content = {
        "smpl_poses": poses,
        "smpl_trans": trans * 93.0,
        "smpl_scaling": np.array([93.0]),
        "smpl_loss": 0.1,
    }
    content = {key: value for key, value in (content | changes).items() if value is not None}
    (tmp_path / "motions").mkdir(exist_ok=True)
    (tmp_path / "motions" / f"{name}.pkl").write_bytes(
        pickle.dumps(content, protocol=changes.get("protocol", 4))
    )
    return tmp_path


def amass(path, *, fps=120.0, key="mocap_framerate"):
    poses, trans = smpl_arrays(MOTION)
    to_z_up = rot.from_rotvec(np.array([np.pi / 2, 0, 0]))
    poses = np.hstack([poses[:, :66], np.zeros((len(poses), 90))])
    poses[:, :3] = rot.to_rotvec(rot.multiply(to_z_up, rot.from_rotvec(poses[:, :3])))
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savez(path, poses=poses, trans=rot.rotate(to_z_up, trans), gender="neutral", **{key: fps})


def assert_same_poses(motion, tolerance_m=1e-3):
    ours, synthetic = body_pos_m(motion), body_pos_m(MOTION)
    assert np.abs((ours - ours[:, :1]) - (synthetic - synthetic[:, :1])).max() < tolerance_m


def test_folder_with_songs_and_manifest(tmp_path):
    take_folder(tmp_path, "a", "b", "c")
    for song in ("a.WAV", "tune.mp3"):
        (tmp_path / song).touch()
    (tmp_path / "manifest.csv").write_bytes(
        "\ufeffname,genre,performer,licence,source,audio_offset_s,song\r\n"
        'b,salsa,Zoë,CC BY 4.0,"home, sweet",1.5,tune.mp3\r\n'.encode()
    )
    a, b, c = import_takes(tmp_path)
    assert (a.name, a.song_path, a.song_name) == ("a", tmp_path / "a.WAV", "a")
    assert (b.credits.genre, b.credits.performer, b.credits.source) == ("salsa", "Zoë", "home, sweet")
    assert (b.song_path, b.song_start_s, b.song_name) == (tmp_path / "tune.mp3", 1.5, "tune")
    assert b.source_paths == (tmp_path / "b.bvh", tmp_path / "tune.mp3")
    assert (c.song_path, c.song_name) == (None, "")
    assert_same_poses(a.motion)


@pytest.mark.parametrize(
    ("manifest", "message"),
    [("name,tempo\na,3\n", "tempo"), ("genre\nx\n", "name"), ("name,genre\nz,x\n", r"z\.bvh"), ("", "name"),
     ("name,audio_offset_s\na,soon\n", "soon"), ("name,song\na,none.mp3\n", "none.mp3"),
     ("name\na\na\n", "twice"),
     ("name,audio_offset_s\na,nan\n", "nan"), ("name,genre\na\n", "cells"), ("name,genre\na,b,c\n", "cells")],
)  # fmt: skip
def test_invalid_manifests_are_refused(tmp_path, manifest, message):
    (take_folder(tmp_path, "a") / "manifest.csv").write_text(manifest)
    with pytest.raises(FormatError, match=message):
        list(import_takes(tmp_path))


def test_counts_beside_a_take_in_the_manifest_and_as_beats(tmp_path):
    take_folder(tmp_path, "a", "b", "c", "d")
    table = "time_s,number,figure\n0.1,2,turn\n0.4,3,\n0.8,1,\n"
    (tmp_path / "a.counts.csv").write_text(table)
    (tmp_path / "b.counts.csv").write_text(table)
    (tmp_path / "other.csv").write_text("time_s,number\n0.2,0\n0.9,0\n")
    (tmp_path / "manifest.csv").write_text("name,counts,beats\nb,other.csv,\nc,,0.25 0.5 0.75\n")
    a, b, c, d = import_takes(tmp_path)
    assert (a.counts.numbers.tolist(), a.counts.metre, a.counts.source) == ([2, 3, 1], 3, ANNOTATED)
    assert a.figures == (Figure("turn", 0.1, 0.8, 2),)
    assert a.source_paths == (tmp_path / "a.bvh", tmp_path / "a.counts.csv")
    assert b.counts.times_s.tolist() == [0.2, 0.9]  # the manifest's file, not the one beside
    assert (c.counts.times_s.tolist(), c.counts.metre) == ([0.25, 0.5, 0.75], 0)
    assert not len(d.counts) and d.figures == ()


def test_counts_beside_a_single_file(tmp_path):
    save_motion(tmp_path / "a.npz", MOTION)
    (tmp_path / "a.counts.csv").write_text("time_s,number\n0.2,1\n")
    (take,) = import_takes(tmp_path / "a.npz")
    assert take.counts.times_s.tolist() == [0.2]


@pytest.mark.parametrize(
    ("manifest", "beside", "message"),
    [
        ("name,counts\na,none.csv\n", "", "none.csv"),
        ("name,counts,beats\na,a.counts.csv,1\n", "time_s,number\n0.2,1\n", "got both"),
        ("name,beats\na,0.1 soon\n", "", "with spaces, got '0.1 soon'"),
        ("name,beats\na,0.5 0.4\n", "", "increasing"),
        ("name,beats\na,0.5;0.6\n", "", "with spaces"),
        ("name,beats\na,nan\n", "", "increasing"),
        ("name,beats\na,0.5 1.6\n", "", r"within the 1\.00 s of a, got 0\.50 to 1\.60 s"),
        ("name,beats\na,-0.5 0.6\n", "", "got -0.50"),
        ("name\na\n", "time_s,number\n0.2,1\n1.7,2\n", "not of the song"),
        ("name\na\n", "time_s\n0.2\n", r"a\.counts\.csv"),
    ],
)
def test_invalid_counts_are_refused(tmp_path, manifest, beside, message):
    (take_folder(tmp_path, "a") / "manifest.csv").write_text(manifest)
    if beside:
        (tmp_path / "a.counts.csv").write_text(beside)
    with pytest.raises(FormatError, match=message) as caught:
        list(import_takes(tmp_path))
    assert "\n" not in str(caught.value)


def test_a_damaged_take_is_named_not_skipped(tmp_path):
    (take_folder(tmp_path, "a") / "b.bvh").write_text("HIERARCHY")
    with pytest.raises(FormatError, match=r"b\.bvh"):
        list(import_takes(tmp_path))


def test_unknown_joint_names_are_reported_with_the_file(tmp_path):
    path = take_folder(tmp_path, "a") / "a.bvh"
    in_a_line = re.sub(r"OFFSET .*", "OFFSET 0 1 0", path.read_text())  # what structure says nothing of
    path.write_text(in_a_line.replace("knee", "bla"))
    with pytest.raises(FormatError, match=r"a\.bvh: .*left_knee"):
        list(import_takes(tmp_path))


def test_takes_come_at_60_fps_at_most_and_on_the_floor(tmp_path):
    high = swaying(120, fps=120.0).moved(shift_m=np.array([0.0, 3.0, 0.0]))
    save_motion(tmp_path / "a.bvh", high)
    (take,) = import_takes(tmp_path / "a.bvh")
    assert (take.motion.fps, take.motion.n_frames) == (60.0, 60)
    assert any("floor" in note for note in take.notes)
    assert -0.2 < take.motion.joint_pos_m()[..., 1].min() < 0.1


@pytest.mark.parametrize(("swings_hz", "is_noted"), [(2.0, False), (4.0, True)])
def test_an_impossible_acceleration_gets_a_note(tmp_path, swings_hz, is_noted):
    """0.1 m sin(2πft) accelerates by 0.1 (2πf)² at most: 16 and 63 m/s². Twice the frame rate makes it four
    times as much."""
    calm = swaying(120, fps=60.0)
    swing_m = 0.1 * np.sin(2 * np.pi * swings_hz * np.arange(120) / 60.0)
    root_pos_m = np.array([0, 0.9, 0]) + np.outer(swing_m, [1, 0, 0])
    save_motion(tmp_path / "a.npz", replace(calm, root_pos_m=root_pos_m))
    (take,) = import_takes(tmp_path / "a.npz")
    assert any("frame rate" in note for note in take.notes) == is_noted


def test_an_npz_of_this_program_is_a_take(tmp_path):
    save_motion(tmp_path / "a.npz", MOTION)
    (take,) = import_takes(tmp_path / "a.npz")
    assert_same_poses(take.motion)
    assert take.motion.skeleton.same_as(MOTION.skeleton) and take.credits.source == "a.npz"


@pytest.mark.parametrize("protocol", [0, 2, 4, 5])
def test_aist(tmp_path, protocol):
    aist(tmp_path, protocol=protocol)
    aist(tmp_path, "gPO_sBM_cAll_d10_mPO1_ch02")
    aist(tmp_path, "unnamed")
    (tmp_path / "ignore_list.txt").write_text("gPO_sBM_cAll_d10_mPO1_ch02\n")
    (tmp_path / "music").mkdir()
    (tmp_path / "music" / "mBR0.mp3").touch()
    take, unnamed = import_takes(tmp_path)
    assert (take.credits.genre, take.credits.performer, take.credits.source) == ("break", "d04", "AIST++")
    assert (take.song_name, take.song_path) == ("mBR0", tmp_path / "music" / "mBR0.mp3")
    assert take.motion.fps == 60
    assert_same_poses(take.motion)
    assert np.allclose(np.ptp(take.motion.root_pos_m, axis=0), np.ptp(MOTION.root_pos_m, axis=0))
    assert unnamed.credits.genre == ""
    assert unnamed.notes


@pytest.mark.parametrize(
    ("song", "n_counts", "bpm"),
    [("mBR0", 16, 80), ("mKR5", 16, 130), ("mHO0", 16, 110), ("mHO5", 64, 135), ("mJB3", 64, 110)],
)
def test_aist_dances_are_counted_by_their_names(song, n_counts, bpm):
    counts = aist_layout.counts_by_name(song, n_counts * 60 / bpm)
    assert (counts.metre, counts.source) == (4, "data set")
    assert np.allclose(counts.times_s[:n_counts], np.arange(n_counts) * 60 / bpm)
    assert list(counts.numbers[:5]) == [1, 2, 3, 4, 1]
    # A frame more or less is of the recording. Two beats more show another tempo.
    for frames, is_counted in ((-1, True), (1, True), (round(2 * 3600 / bpm), False)):
        counts = aist_layout.counts_by_name(song, n_counts * 60 / bpm + frames / 60)
        assert (len(counts) > 0) == is_counted
        assert not len(counts) or counts.times_s[-1] <= n_counts * 60 / bpm + frames / 60


@pytest.mark.parametrize(("song", "duration_s"), [("", 12.0), ("mBR6", 12.0), ("mBR0", 0.1), ("mBR0", 13.5)])
def test_other_aist_dances_are_not_counted_by_their_names(song, duration_s):
    assert not len(aist_layout.counts_by_name(song, duration_s))


def test_an_aist_take_has_counts_if_it_lasts_whole_bars(tmp_path):
    still = {"smpl_poses": np.zeros((720, 72)), "smpl_trans": np.zeros((720, 3))}
    aist(tmp_path, "gBR_sBM_cAll_d04_mBR0_ch01", **still)
    aist(tmp_path, "gBR_sBM_cAll_d04_mBR3_ch01", **still)
    counted, uncounted = import_takes(tmp_path)
    assert np.allclose(counted.counts.times_s[:3], [0.0, 0.75, 1.5])
    assert not any("counted" in note for note in counted.notes)
    assert not len(uncounted.counts) and any("mBR3" in note for note in uncounted.notes)


def test_aist_pickles_of_older_numpy(tmp_path):
    folder = aist(tmp_path, protocol=2)
    path = next((folder / "motions").iterdir())
    path.write_bytes(path.read_bytes().replace(b"numpy._core.", b"numpy.core."))
    assert len(list(import_takes(folder))) == 1


class _Runs:
    def __reduce__(self):
        return os.system, ("touch ran",)


@pytest.mark.parametrize(
    ("changes", "message"),
    [({"evil": _Runs()}, "system"), ({"smpl_trans": None}, "smpl_trans"),
     ({"smpl_scaling": np.array([0.0])}, "scaling"),
     ({"smpl_scaling": np.ones(3)}, "scaling"), ({"smpl_poses": np.zeros((30, 71))}, r"\(30, 71\)"),
     ({"smpl_poses": np.full((30, 72), np.nan)}, "finite"), ({"smpl_poses": "text"}, "numbers"),
     ({"smpl_poses": np.zeros((0, 72)), "smpl_trans": np.zeros((0, 3))}, "no frame")],
)  # fmt: skip
def test_aist_pickles_that_are_refused(tmp_path, monkeypatch, changes, message):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(FormatError, match=message) as caught:
        list(import_takes(aist(tmp_path, **changes)))
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "ran").exists()


@pytest.mark.parametrize(
    "content", [b"", b"garbage", b"\x80\x04", pickle.dumps([1]), pickle.dumps({"a": 1})[:-3]]
)
def test_aist_files_that_are_no_pickles(tmp_path, content):
    path = next((aist(tmp_path) / "motions").iterdir())
    path.write_bytes(content)
    with pytest.raises(FormatError, match=path.name):
        list(import_takes(tmp_path))


@pytest.mark.parametrize("key", ["mocap_framerate", "mocap_frame_rate"])
def test_amass(tmp_path, key):
    amass(tmp_path / "ACCAD" / "s1" / "walk_poses.npz", key=key)
    np.savez(tmp_path / "ACCAD" / "s1" / "shape.npz", betas=np.zeros(10))
    (take,) = import_takes(tmp_path)
    assert (take.name, take.credits.performer, take.credits.source) == (
        "ACCAD/s1/walk_poses",
        "s1",
        "AMASS ACCAD",
    )
    assert (take.motion.fps, take.motion.n_frames) == (60.0, 15)
    head, feet = BODY_JOINTS.index("head"), BODY_JOINTS.index("left_foot")
    pos = body_pos_m(take.motion)
    assert (pos[:, head, 1] - pos[:, feet, 1]).min() > 1.0
    (alone,) = import_takes(tmp_path / "ACCAD" / "s1" / "walk_poses.npz")
    assert alone.name == "walk_poses"


def test_amass_with_an_invalid_rate(tmp_path):
    amass(tmp_path / "walk_poses.npz", fps=0.0)
    with pytest.raises(FormatError, match="frame rate"):
        list(import_takes(tmp_path))


def test_an_unknown_layout_lists_the_known_ones(tmp_path):
    with pytest.raises(ParameterError, match="empty"):
        list(import_takes(tmp_path))
    (tmp_path / "notes.txt").touch()
    for source in (tmp_path, tmp_path / "notes.txt"):
        with pytest.raises(ParameterError, match=r"AIST\+\+.*AMASS.*bvh"):
            list(import_takes(source))
    with pytest.raises(ParameterError, match="no such"):
        list(import_takes(tmp_path / "none"))


def test_bodies_beyond_reach_are_refused(tmp_path):
    """Their precision would be lost, and what is written of them could not be read."""
    amass(tmp_path / "near.npz")
    with np.load(tmp_path / "near.npz") as archive:
        arrays = dict(archive)
    np.savez(tmp_path / "far.npz", **arrays | {"trans": arrays["trans"] + 2e6})
    with pytest.raises(FormatError, match=r"far\.npz: expected a body within 1e\+06 m, got one at 2e\+06 m"):
        list(import_takes(tmp_path / "far.npz"))


def test_bodies_without_a_size_are_refused_in_every_format(tmp_path):
    save_motion(tmp_path / "a.npz", MOTION)
    with np.load(tmp_path / "a.npz") as archive:
        arrays = dict(archive)
    np.savez(tmp_path / "b.npz", **arrays | {"offsets_m": 0.0 * arrays["offsets_m"]})
    with pytest.raises(FormatError, match=r"b\.npz: all joints are in the same place"):
        list(import_takes(tmp_path / "b.npz"))


def test_quaternions_of_an_npz_are_made_unit(tmp_path):
    save_motion(tmp_path / "exact.npz", MOTION)
    with np.load(tmp_path / "exact.npz") as archive:
        arrays = dict(archive)
    for name, scale in (("rounded", 1.002), ("none", 0.0)):
        np.savez(tmp_path / f"{name}.npz", **arrays | {"local_quat": scale * arrays["local_quat"]})
    np.testing.assert_array_equal(read_npz(tmp_path / "exact.npz").local_quat, MOTION.local_quat)
    np.testing.assert_allclose(read_npz(tmp_path / "rounded.npz").local_quat, MOTION.local_quat, atol=1e-12)
    with pytest.raises(FormatError, match="quaternions of length 1, got some of length 0"):
        read_npz(tmp_path / "none.npz")
