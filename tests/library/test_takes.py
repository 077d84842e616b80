"""What a build does to its takes before anything is measured."""

from __future__ import annotations

import shutil
from dataclasses import replace

import numpy as np
import pytest
from synthetic_motions import stepping
from synthetic_repertoire import write_clicks

import choreograph as cg
from choreograph.core import cache
from choreograph.formats.register import save_motion
from choreograph.library.building.options import BuildOptions
from choreograph.library.building.takes import measured_takes
from choreograph.library.notes import Note
from choreograph.motion import rotations as rot
from choreograph.motion.bone_map import joint_roles

# What a build does to its takes before anything is measured.


def test_one_frame_jumps_are_smoothed_and_noted(tmp_path):
    motion = stepping(120, period_s=0.6, seed=1)
    elbow = joint_roles(motion.skeleton)["left_elbow"]
    quat = np.array(motion.local_quat)
    quat[[40, 80], elbow] = rot.multiply(quat[[40, 80], elbow], rot.from_rotvec(np.array([0.0, 2.0, 0.0])))
    save_motion(tmp_path / "jumping.bvh", replace(motion, local_quat=quat))
    save_motion(tmp_path / "smooth.bvh", motion)
    takes, notes = measured_takes([tmp_path], BuildOptions(lock_feet=False), None)
    jumping, smooth = (measured.take for measured in takes)
    jumps = [note for note in notes if note.kind == "jumps"]
    assert jumps == [Note("jumps", "jumping", {"jumps": 2, "limbs": "arms"})]
    assert jumping.notes[-1] == "one-frame jumps of markers were smoothed (2 in arms)"
    difference_m = np.abs(jumping.motion.joint_pos_m() - smooth.motion.joint_pos_m()).max(axis=(1, 2))
    assert set(np.flatnonzero(difference_m > 1e-4)) <= {40, 80}
    assert difference_m.max() < 0.01


# A second build reads what an earlier one measured, and writes the same bytes.


pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def original(tmp_path_factory):
    """Three takes with two songs, and more takes to add."""
    folder = tmp_path_factory.mktemp("original")
    for seed, name in enumerate(("takes/a", "takes/b", "takes/c", "more/d", "more/e")):
        path = folder / f"{name}.bvh"
        path.parent.mkdir(exist_ok=True)
        save_motion(path, stepping(10 * 30, period_s=(0.5, 0.6)[seed % 2], seed=seed))
    write_clicks(folder / "takes" / "a.wav", duration_s=10.0)
    return folder


@pytest.fixture
def folder(original, tmp_path, monkeypatch):
    shutil.copytree(original, tmp_path, dirs_exist_ok=True)
    monkeypatch.setattr(cache, "results_cache", lambda size: cache.DiskCache(tmp_path / "kept", size))
    (tmp_path / "kept").mkdir()
    return tmp_path


def build(folder, name, **options):
    """The bytes of a build, and how many takes were kept of how many."""
    settings = {"preset": "tiny", "words": False, "workers": 1, **options}
    built = cg.build(folder / "takes", folder / f"{name}.h5", **settings)
    told = [note for note in built.notes if "as in an earlier build" in note]
    return built.path.read_bytes(), [note.split(" takes")[0] for note in told]


def test_a_second_build_reads_what_was_measured_and_has_the_same_bytes(folder):
    without, none = build(folder, "without", cache_gb=0.0)
    assert none == [] and not list((folder / "kept").iterdir())
    made, new = build(folder, "made")
    read, known = build(folder, "read")
    assert (new, known) == ([], ["3 of 3"])
    assert without == made == read


def test_of_a_folder_that_has_grown_only_new_takes_are_measured(folder):
    build(folder, "before")
    for path in (folder / "more").iterdir():
        shutil.move(path, folder / "takes")
    grown, known = build(folder, "grown")
    again, _ = build(folder, "again", cache_gb=0.0)
    assert known == ["3 of 5"] and grown == again


def test_changed_takes_songs_and_options_are_measured_again(folder):
    build(folder, "before")
    save_motion(folder / "takes" / "b.bvh", stepping(11 * 30, period_s=0.5, seed=9))
    write_clicks(folder / "takes" / "a.wav", duration_s=10.0, bpm=100)
    changed, known = build(folder, "changed")
    assert known == ["1 of 3"]
    assert changed == build(folder, "fresh", cache_gb=0.0)[0]
    sliding, known = build(folder, "sliding", lock_feet=False)
    assert known == [] and sliding == build(folder, "fresh", lock_feet=False, cache_gb=0.0)[0]


def test_takes_that_are_added_again_are_not_measured_again(folder):
    build(folder, "library")
    outputs = []
    for name in ("one", "two"):
        added = cg.change_takes(folder / "library.h5", add=folder / "more", output=folder / f"{name}.h5")
        outputs.append((added.path.read_bytes(), any("2 of 2 takes are as" in note for note in added.notes)))
    assert [is_kept for _, is_kept in outputs] == [False, True]
    assert outputs[0][0] == outputs[1][0]
