"""Folders of several layouts: all are read, the rest is named with the reason, bad files all at once."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path

import numpy as np
import pytest
from command_line import run
from synthetic_markers import markers_on, write_c3d
from synthetic_motions import stepping, swaying
from synthetic_repertoire import write_clicks

import choreograph as cg
from choreograph.core.errors import FormatError, ParameterError, UnreadableFilesError
from choreograph.formats.fbx import VARIABLE, find_blender
from choreograph.formats.manifest import SkippedFile
from choreograph.formats.register import import_takes, read_source, save_motion
from choreograph.library.building.options import BuildOptions
from choreograph.library.building.takes import measured_takes
from choreograph.library.notes import Note
from choreograph.motion import rotations as rot

MOTION = swaying(60)


@pytest.fixture
def no_blender(monkeypatch, tmp_path):
    monkeypatch.setenv(VARIABLE, str(tmp_path / "nothing"))


def write_dance(folder: Path, name: str, shared_data: Path) -> None:
    """A take of dance-with-melody; its motion is cut to a second, to be read quickly."""
    (folder / name).mkdir()
    data = json.loads((shared_data / "dance-with-melody" / "DANCE_W_23" / "skeletons.json").read_text())
    data = {"length": 25, "center": data["center"][:25], "skeletons": data["skeletons"][:25]}
    (folder / name / "skeletons.json").write_text(json.dumps(data))
    (folder / name / "config.json").write_text(json.dumps({"start_position": 0, "end_position": 25}))
    write_clicks(folder / name / "audio.mp3", duration_s=1.0)


def mixed(folder: Path) -> Path:
    """BVH, C3D, GLB and NPZ, AIST++ and AMASS beside them, a manifest, and what is not read."""
    save_motion(folder / "a.bvh", MOTION)
    write_clicks(folder / "a.wav", duration_s=2.0)
    write_c3d(folder / "b.c3d", markers_on(swaying(90, fps=80.0)))
    save_motion(folder / "c.glb", MOTION)
    save_motion(folder / "d.npz", MOTION)
    poses, trans = rot.to_rotvec(MOTION.local_quat).reshape(MOTION.n_frames, -1), MOTION.root_pos_m
    np.savez(
        folder / "e.npz",
        poses=np.hstack([poses[:, :66], np.zeros((60, 90))]),
        trans=trans,
        mocap_framerate=30.0,
    )
    np.savez(folder / "shape.npz", betas=np.zeros(10))
    for name in ("f.fbx", "tune.mp3", "scene.blend", "other.counts.csv", "manifest.xlsx", "poses.pkl"):
        (folder / name).write_bytes(b"x")
    (folder / "below").mkdir()
    save_motion(folder / "below" / "g.bvh", MOTION)
    (folder / "manifest.csv").write_text("name,genre,licence\na,waltz,CC0\ne,house,\nf,tango,\n")
    return folder


def test_all_layouts_of_a_folder_are_read_and_the_rest_is_named(tmp_path, no_blender):
    found = list(read_source(mixed(tmp_path)))
    takes = {take.name: take for take in found if not isinstance(take, SkippedFile)}
    skipped = {
        file.path.relative_to(tmp_path).as_posix(): file for file in found if isinstance(file, SkippedFile)
    }
    assert sorted(takes) == ["a", "b", "c", "d", "e"]
    assert takes["a"].song_path == tmp_path / "a.wav"
    assert [takes[name].credits.genre for name in "ae"] == ["waltz", "house"]
    assert takes["e"].credits.source.startswith("AMASS")  # what a row leaves empty stays
    reasons = {
        "f.fbx": "Blender", "tune.mp3": "music that belongs to no take", "scene.blend": "Blender scene",
        "shape.npz": "SMPL poses", "other.counts.csv": "without a motion", "manifest.xlsx": "CSV",
        "poses.pkl": "AIST", "below/g.bvh": "subfolders",
    }  # fmt: skip
    assert sorted(skipped) == sorted(reasons)
    assert all(reasons[name] in file.why and file.error is None for name, file in skipped.items())


def test_dance_with_melody_beside_other_takes(tmp_path, shared_data, no_blender):
    for number in range(1, 8):
        write_dance(tmp_path, f"DANCE_W_{number}", shared_data)
    mixed(tmp_path)
    _, notes = measured_takes([tmp_path], BuildOptions(lock_feet=False), None)
    takes = [take.name for take in import_takes(tmp_path)]
    assert takes == [*(f"DANCE_W_{number}" for number in range(1, 8)), "e", "a", "b", "c", "d"]
    for name in ("f.fbx", "tune.mp3", "scene.blend", "shape.npz", "below/g.bvh"):
        assert sum(note.kind == "skipped file" and note.subject == name for note in notes) == 1, name


@pytest.mark.skipif(find_blender() is None, reason="no Blender on this machine")
@pytest.mark.slow
def test_fbx_in_a_folder_is_read_where_blender_is(tmp_path):
    save_motion(tmp_path / "a.fbx", swaying(90, fps=60.0))
    save_motion(tmp_path / "b.bvh", MOTION)
    (tmp_path / "b.fbx").touch()
    write_clicks(tmp_path / "a.wav", duration_s=2.0)
    (tmp_path / "manifest.csv").write_text("name,genre\na.fbx,waltz\n")
    copy, a, b = read_source(tmp_path)
    assert (a.name, a.credits.genre, a.song_path, a.motion.n_frames) == ("a", "waltz", tmp_path / "a.wav", 90)
    assert b.source_paths == (tmp_path / "b.bvh",)
    assert (copy.path.name, copy.why) == ("b.fbx", "a motion of the same name is read")


def test_a_folder_of_fbx_without_blender_says_what_is_missing(tmp_path, no_blender):
    (tmp_path / "a.fbx").write_bytes(b"x")
    assert list(import_takes(tmp_path)) == []
    with pytest.raises(ParameterError, match=r"a\.fbx.*Blender"):
        measured_takes([tmp_path], BuildOptions(), None)


def with_bad_files(folder: Path) -> Path:
    """Takes, and files that cannot be read, one of them by a path that is too long for a line."""
    for name in ("a", "b", "offset"):
        save_motion(folder / f"{name}.bvh", stepping(30 * 10, period_s=0.5, seed=1))
    (folder / "bad.bvh").write_text("HIERARCHY")
    (folder / ("long" * 50 + ".glb")).write_bytes(b"y")
    (folder / "bad.c3d").write_bytes(b"z")
    (folder / "cut.npz").write_bytes(b"PK")
    (folder / "manifest.csv").write_text("name,audio_offset_s,genre\noffset,soon,waltz\nb,0,house\nnone,,\n")
    return folder


def test_all_bad_files_are_named_in_one_run(tmp_path):
    with pytest.raises(UnreadableFilesError) as caught:
        list(import_takes(with_bad_files(tmp_path)))
    assert isinstance(caught.value, FormatError)
    summary, *lines = str(caught.value).splitlines()
    assert "got 6 that cannot be read" in summary
    for text in ("bad.bvh", "bad.c3d", "long.glb", "cut.npz", "audio_offset_s", "there is no none"):
        assert any(text in line for line in lines), text
    assert len(lines) == 6 and not any("left out" in line or "..." in line for line in lines)


def test_build_db_names_all_bad_files_and_writes_nothing(tmp_path):
    (tmp_path / "takes").mkdir()
    result = run("build-db", with_bad_files(tmp_path / "takes"), "-o", tmp_path / "rep.h5")
    assert result.exit_code == 2
    lines = result.stderr.splitlines()
    assert len(lines) == 7
    assert "--skip-bad" in lines[0] and sum("bad.bvh" in line for line in lines) == 2  # bad.c3d has its name
    assert not (tmp_path / "rep.h5").exists()


def test_skip_bad_builds_from_the_rest_and_notes_each(tmp_path):
    (tmp_path / "takes").mkdir()
    built = cg.build(
        with_bad_files(tmp_path / "takes"), tmp_path / "rep.h5", skip_bad=True, preset="tiny", words=False,
        pretrained="nothing",
    )  # fmt: skip
    # Not the one whose offset is not known.
    assert [take.name for take in built.repertoire.takes] == ["a", "b"]
    unreadable = {note.subject for note in built.details if note.kind == "unreadable file"}
    assert unreadable == {"bad.bvh", "bad.c3d", f"{'long' * 50}.glb", "cut.npz", "manifest.csv", "offset.bvh"}
    assert str(tmp_path) not in str(built.repertoire.notes) and built.repertoire.notes == built.details


def test_a_bad_take_that_is_left_out_is_no_error(tmp_path):
    save_motion(tmp_path / "a.bvh", MOTION)
    (tmp_path / "bad.bvh").write_text("HIERARCHY")
    takes, notes = measured_takes([tmp_path], BuildOptions(leave_out=("bad", "typo")), None)
    assert [m.take.name for m in takes] == ["a"]
    assert Note("unknown take", "typo") in notes


def test_check_prints_a_row_for_each_file_and_builds_nothing(tmp_path, no_blender):
    folder = mixed(tmp_path)
    (folder / "bad.bvh").write_text("HIERARCHY")
    before = sorted(folder.rglob("*"))
    result = run("build-db", folder, "--check", "--leave-out", "d")
    assert result.exit_code == 2 and "bad.bvh" in result.stderr
    head, *rows, total = result.stdout.splitlines()
    assert head.split() == ["file", "rig", "units", "counts", "length", "what", "happens"]
    by_name = {os.path.relpath(row.split("  ")[0], folder): row for row in rows}
    files = {path.relative_to(folder).as_posix() for path in before if path.is_file()}
    assert set(by_name) == files - {"a.wav", "manifest.csv"}
    assert len(rows) == len(by_name)
    assert all(
        word in by_name["a.bvh"] for word in ("pelvis, 24 joints", "metres", "none", "2.0 s", "to a.wav")
    )
    assert "read as b, without music" in by_name["b.c3d"]
    assert "left out" in by_name["d.npz"] and "skipped: music" in by_name["tune.mp3"]
    assert "bad: " in by_name["bad.bvh"]
    assert total == "14 rows: 4 read, 1 bad, 9 not read"
    assert sorted(folder.rglob("*")) == before
    assert run("build-db", folder, "--check", "--skip-bad").exit_code == 0
    (folder / "bad.bvh").unlink()
    assert run("build-db", folder, "--check").exit_code == 0


def test_without_check_an_output_is_required(tmp_path):
    result = run("build-db", tmp_path)
    assert result.exit_code == 2 and "Missing option '-o' / '--output'" in result.stderr


@pytest.fixture
def listings(monkeypatch):
    """Counts how often a folder is listed."""
    counted = []
    for name in ("scandir", "listdir"):
        original = getattr(os, name)

        def counting(path=".", original=original):
            counted.append(path)
            return original(path)

        monkeypatch.setattr(os, name, counting)
    return counted


def test_listing_a_folder_does_not_list_it_again_for_each_take(tmp_path, listings):
    """Of 2,000 takes that took 43 s."""
    numbers = []
    for n_takes in (3, 30):
        folder = tmp_path / f"{n_takes}"
        folder.mkdir()
        for number in range(n_takes):
            (folder / f"{number}.bvh").touch()
            (folder / f"{number}.wav").touch()
        listings.clear()
        found = list(read_source(folder))
        numbers.append(len(listings))
        assert len(found) == 2 * n_takes  # empty files: the takes are bad, so no take is danced to the songs
    assert numbers[0] == numbers[1]


def test_songs_of_aist_are_listed_once(tmp_path, listings):
    for folder in ("motions", "music"):
        (tmp_path / folder).mkdir()
    for number in range(20):
        (tmp_path / "motions" / f"gBR_sBM_cAll_d04_mBR0_ch{number:02}.pkl").touch()
    shutil.copy(
        write_clicks(tmp_path / "music" / "mBR0.wav", duration_s=1.0), tmp_path / "music" / "mBR1.wav"
    )
    listings.clear()
    assert len(list(read_source(tmp_path))) == 22
    assert len(listings) < 20
