"""Inputs that are sent with their files: paths and messages of the result are those of the sender."""

from __future__ import annotations

import pickle
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from choreograph.core.clusters import on_staged, sent_files, staged
from choreograph.core.errors import FormatError, ParameterError


@dataclass(frozen=True)
class Found:
    """What was read, with paths, numbers and an error that names a file."""

    text: str
    paths: tuple[Path, ...]
    rows: np.ndarray
    error: FormatError


def read(one: tuple[Path, Path, int]) -> Found:
    folder, file, number = one
    beside = sorted(folder.iterdir())
    error = FormatError(f"{file}: expected a take, got {file.read_text()}")
    return Found(file.read_text(), (*beside, Path("relative")), np.arange(number), error)


def sent(one, files):
    """An input as it arrives on another machine."""
    return pickle.loads(pickle.dumps(staged(one, files)))


@pytest.fixture
def folder(tmp_path):
    for name in ("a.bvh", "b.bvh"):
        path = tmp_path / "takes" / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(name)
    return tmp_path / "takes"


def test_a_result_is_that_of_the_sender_although_the_files_are_gone(folder):
    one, files = (folder, folder / "a.bvh", 3), sorted(folder.iterdir())
    here, arriving = read(one), sent(one, files)
    for file in files:
        file.unlink()
    found = pickle.loads(pickle.dumps(on_staged(read, arriving))).received()
    assert (found.text, found.paths, str(found.error)) == (here.text, here.paths, str(here.error))
    np.testing.assert_array_equal(found.rows, here.rows)


def test_files_of_all_inputs_are_sent_beside_and_named_in_texts(folder):
    common = folder / "b.bvh"

    def named(one: tuple[Path, str]) -> tuple[str, str, str]:
        own, text = one
        return own.read_text(), Path(text.partition("=")[2]).read_text(), text

    shared = sent_files([common])
    arriving = sent((folder / "a.bvh", f"style_song={common}"), [folder / "a.bvh"])
    common.unlink()
    found = on_staged(named, arriving, shared).received()
    assert found == ("a.bvh", "b.bvh", f"style_song={common}")


def test_files_are_removed_where_the_work_was_done(folder, tmp_path, monkeypatch):
    (tmp_path / "there").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "there"))
    with pytest.raises(ZeroDivisionError):
        on_staged(lambda one: 1 / 0, sent(folder / "a.bvh", [folder / "a.bvh"]))
    assert not list((tmp_path / "there").iterdir())


def test_files_that_do_not_exist_are_left_out_and_large_ones_refused(folder):
    assert staged(folder / "gone.bvh", [folder / "gone.bvh"]).files == ()
    with open(folder / "a.bvh", "r+b") as file:
        file.truncate((1 << 30) + 1)  # a hole, which takes no room on disk
    with pytest.raises(ParameterError, match=r"a\.bvh: expected a file of at most .* leave out --stage"):
        staged(folder / "a.bvh", [folder / "a.bvh"])
