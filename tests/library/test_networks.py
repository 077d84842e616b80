"""Checksums of what networks learn from."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic_motions import stepping
from synthetic_repertoire import write_clicks

from choreograph.core.counts import ANNOTATED, make_counts
from choreograph.formats.register import import_takes, save_motion
from choreograph.library.building.build import build_repertoire
from choreograph.library.building.networks import checksum_of
from choreograph.library.building.options import BuildOptions
from choreograph.library.builtin import STARTER_PATH
from choreograph.library.store import RepertoireFile
from content.motion_counting import CountedMotion

# Checksums of what networks learn from.


COUNTS = make_counts(np.arange(4.0), np.arange(1, 5), 4, source=ANNOTATED)
TAKE = CountedMotion("a", "waltz", np.zeros((80, 21, 3)), COUNTS)


def test_takes_have_the_same_checksum_only_if_their_content_is_the_same():
    moved = TAKE.body_pos_m.copy()
    moved[79, 20, 2] = 1e-9
    later = make_counts(np.arange(4.0) + 1e-9, np.arange(1, 5), 4, source=ANNOTATED)
    others = [
        replace(TAKE, name="b"),
        replace(TAKE, is_built_in=True),
        replace(TAKE, body_pos_m=moved),
        replace(TAKE, body_pos_m=TAKE.body_pos_m.astype(np.float32)),
        replace(TAKE, body_pos_m=TAKE.body_pos_m[:40]),
        replace(TAKE, counts=later),
    ]
    checksums = [checksum_of(takes) for takes in ([TAKE], [], [TAKE, TAKE], *([other] for other in others))]
    assert len(set(checksums)) == len(checksums)
    assert checksum_of([replace(TAKE, body_pos_m=TAKE.body_pos_m.copy())]) == checksums[0]


# What a repertoire says of its sources: nothing of the machine, nor of how they were typed.


_QUICK = BuildOptions(preset="tiny", words=False, pretrained="nothing", allow_outside=True)


@pytest.fixture(scope="module")
def takes(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("library") / "takes"
    folder.mkdir()
    save_motion(folder / "walk.bvh", stepping(300, seed=1))
    (folder / "walk.counts.csv").write_text("time_s,number\n1,1\n1.5,2\n2,3\n2.5,4\n")
    write_clicks(folder.parent / "clicks.wav", duration_s=10.0)
    (folder / "manifest.csv").write_text("name,song\nwalk,../clicks.wav\n")
    return folder


def test_the_bytes_do_not_depend_on_how_a_source_was_typed(takes, tmp_path, monkeypatch):
    (tmp_path / "link").symlink_to(takes)
    above = f"../{takes.parent.name}/takes"
    spellings = ["takes/", "./takes", str(takes), f"{takes}/", above, str(tmp_path / "link"), "."]
    contents = []
    for number, typed in enumerate(spellings):
        monkeypatch.chdir(takes if typed == "." else takes.parent)
        built, _ = build_repertoire([typed], tmp_path / f"{number}.h5", _QUICK)
        contents.append(built.path.read_bytes())
    assert len(set(contents)) == 1
    assert os.fsencode(tmp_path.parent) not in contents[0]
    paths = RepertoireFile(tmp_path / "0.h5").read("sources/path").tolist()
    assert paths == ["walk.bvh", "clicks.wav", "walk.counts.csv"]


def test_folders_of_the_same_data_give_the_same_credits(tmp_path, monkeypatch):
    """AMASS names performer and data set by folders, which "." and relative paths do not end in."""
    folder = tmp_path / "CMU" / "01"
    folder.mkdir(parents=True)
    np.savez(folder / "a_poses.npz", poses=np.zeros((60, 156)), trans=np.zeros((60, 3)), mocap_framerate=60.0)
    credits = []
    for base, typed in (
        (tmp_path, "CMU/01"),
        (tmp_path / "CMU", "01"),
        (folder, "."),
        (tmp_path, str(folder)),
    ):
        monkeypatch.chdir(base)
        credits += [take.credits for take in import_takes(typed)]
    assert {(c.performer, c.source) for c in credits} == {("01", "AMASS CMU")} and len(credits) == 4


def test_the_shipped_repertoire_says_nothing_of_a_machine():
    paths = RepertoireFile(STARTER_PATH).read("sources/path").tolist()
    assert paths and all("/" not in path for path in paths)
    assert b"/takes/" not in STARTER_PATH.read_bytes()
