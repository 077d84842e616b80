"""Atomic writing: all or nothing, and what killed writers left goes away."""

import gc
import os
import subprocess
import sys

import pytest

from choreograph.core.errors import ChoreographError, ParameterError
from choreograph.core.files import (
    atomic_path,
    check_apart,
    check_target,
    is_running,
    read_json,
    without_garbage_collection,
)

_KILLED_WHILE_WRITING = """
import os, signal, sys
from choreograph.core.files import atomic_path
with atomic_path(sys.argv[1]) as temporary:
    temporary.write_text("half")
    os.kill(os.getpid(), signal.SIGKILL)
"""


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_what_fails_or_is_killed_leaves_the_old_file(tmp_path):
    target = tmp_path / "a.json"
    target.write_text("old")
    with pytest.raises(UnicodeEncodeError), atomic_path(target) as temporary:
        temporary.write_text("half \udc80", encoding="utf-8")
    assert names(tmp_path) == ["a.json"] and target.read_text() == "old"
    for _ in range(2):
        subprocess.run([sys.executable, "-c", _KILLED_WHILE_WRITING, str(target)], check=False)
        assert target.read_text() == "old"
        assert len(names(tmp_path)) == 2  # the second removed what the first left
    with atomic_path(target) as temporary:
        temporary.write_text("new")
    assert names(tmp_path) == ["a.json"] and target.read_text() == "new"


def test_files_of_living_writers_and_of_other_names_stay(tmp_path):
    others = [".a.notes.json", ".a.json", ".b.0000abcd-999999-0123abcd.json", ".a.0123abcd.json"]
    for name in others:
        (tmp_path / name).write_text("mine")
    with atomic_path(tmp_path / "a.json") as first:
        first.write_text("first")
        with atomic_path(tmp_path / "a.json") as second:
            second.write_text("second")
        assert first.read_text() == "first"
    assert (tmp_path / "a.json").read_text() == "first"
    assert names(tmp_path) == sorted([*others, "a.json"])


def test_leftovers_of_other_files_go_as_well_and_again_in_a_long_process(tmp_path):
    for _ in range(2):
        subprocess.run([sys.executable, "-c", _KILLED_WHILE_WRITING, str(tmp_path / "a.json")], check=False)
        assert len(names(tmp_path)) == 1
        for _ in range(2):  # the folder is listed again after as many writes as it had files
            with atomic_path(tmp_path / "b.txt") as temporary:
                temporary.write_text("new")
        assert names(tmp_path) == ["b.txt"]
        (tmp_path / "b.txt").unlink()


def test_the_time_of_a_write_does_not_grow_with_the_folder(tmp_path, monkeypatch):
    listed, listdir = [], os.listdir
    monkeypatch.setattr(os, "listdir", lambda folder: listed.extend(found := listdir(folder)) or found)
    for index in range(300):
        with atomic_path(tmp_path / f"{index}.txt") as temporary:
            temporary.touch()
    assert len(listed) < 3 * 300  # instead of 300 * 300 / 2
    assert len(names(tmp_path)) == 300


def test_an_os_error_names_the_target(tmp_path):
    target = tmp_path / "a.json"
    with pytest.raises(ChoreographError, match=r"cannot write .*a\.json: No space"), atomic_path(target):
        raise OSError(28, os.strerror(28))
    with pytest.raises(ParameterError, match="no folder"), atomic_path(tmp_path / "none" / "a.json"):
        pass


def test_running_processes_are_known():
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    assert is_running(os.getpid()) and is_running(1)
    assert not is_running(ended.pid) and not is_running(10**30)


@pytest.mark.parametrize("name", ["x" * 255, "x" * 250 + ".json", "a." + "x" * 253, "é" * 127, ".json"])
def test_names_of_any_length_are_written_and_their_leftovers_removed(tmp_path, name):
    target = tmp_path / name
    subprocess.run([sys.executable, "-c", _KILLED_WHILE_WRITING, str(target)], check=False)
    (left,) = names(tmp_path)
    assert left != name and len(os.fsencode(left)) <= 255
    with atomic_path(target) as temporary:
        temporary.write_text("new")
    assert names(tmp_path) == [name]


def test_a_name_that_the_system_does_not_allow_is_refused(tmp_path):
    for name in ("x" * 256, "a\0b"):
        with pytest.raises(ParameterError, match="cannot write"):
            check_target(tmp_path / name)


def test_files_are_compared_as_the_system_has_them(tmp_path):
    (tmp_path / "a").touch()
    os.link(tmp_path / "a", tmp_path / "b")
    (tmp_path / "c").symlink_to("a")
    (tmp_path / "up").symlink_to(".")
    for one in ("b", "c", "up/a", "up/up/b"):
        with pytest.raises(ParameterError, match="input"):
            check_apart([tmp_path / one], [tmp_path / "a"])
        with pytest.raises(ParameterError, match="input"):
            check_apart([tmp_path / one], [tmp_path])  # "up" leads back to the folder, without an end
    with pytest.raises(ParameterError, match="one file"):
        check_apart([tmp_path / "new", tmp_path / "up" / "new"], [])
    check_apart([tmp_path / "new", tmp_path / "a"], [tmp_path / "other"])


def test_in_a_folder_of_takes_results_may_be_replaced(tmp_path):
    (tmp_path / "rep.h5").write_bytes(b"\x89HDF\r\n\x1a\n")
    (tmp_path / "report.html").write_text("<!doctype html>")
    (tmp_path / "e.json").write_text('{\n "format": "choreograph-evaluation"')
    for name in names(tmp_path):
        check_apart([tmp_path / name], [tmp_path])
        with pytest.raises(ParameterError, match="input"):
            check_apart([tmp_path / name], [tmp_path / name])


@pytest.mark.parametrize("collects", [True, False])
def test_json_is_read_without_passes_of_the_garbage_collector(tmp_path, collects):
    """Which is on or off afterwards as it was before, also if the file is damaged."""
    (tmp_path / "lists.json").write_text("[" + "[]," * 100_000 + "[]]")
    (tmp_path / "damaged.json").write_text("[" * 10)
    passes = []
    gc.callbacks.append(lambda phase, info: passes.append(phase))
    try:
        gc.enable() if collects else gc.disable()
        assert len(read_json(tmp_path / "lists.json", "lists")) == 100_001
        assert len(passes) <= 2 and gc.isenabled() == collects  # one afterwards, instead of 140
        with pytest.raises(ChoreographError, match="no valid JSON"):
            read_json(tmp_path / "damaged.json", "lists")
        with without_garbage_collection(), without_garbage_collection():
            assert not gc.isenabled()
        assert gc.isenabled() == collects
    finally:
        gc.enable()
        gc.callbacks.pop()
