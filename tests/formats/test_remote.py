"""Takes at addresses are read like those in a folder, and what cannot be read is said in a line."""

from __future__ import annotations

import sys
from importlib.util import find_spec

import pytest
from command_line import assert_one_line, run
from synthetic_motions import stepping

from choreograph.core.errors import ParameterError
from choreograph.formats.register import save_motion
from choreograph.formats.remote import is_address, local_sources

fsspec = pytest.importorskip("fsspec")


@pytest.fixture
def address(tmp_path):
    """A folder in memory with a take in it and a file below it, and the same in a folder here."""
    folder = tmp_path / "takes"
    save_motion_to = folder / "walk.bvh"
    folder.mkdir()
    save_motion(save_motion_to, stepping(30 * 9, seed=1))
    (folder / "notes").mkdir()
    (folder / "notes" / "read me.txt").write_text("hello")
    memory = fsspec.filesystem("memory")
    memory.put(f"{folder}/", "/bucket/takes/", recursive=True)
    yield "memory://bucket/takes"
    memory.rm("/bucket", recursive=True)


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("s3://bucket/takes", True), ("memory://x", True), ("takes", False), ("C:/takes", False),
        ("://", False), ("../a://b", False),
    ],
)  # fmt: skip
def test_addresses_have_a_protocol(source, expected):
    assert is_address(source) == expected


def test_a_folder_is_copied_with_its_name_and_removed(address, tmp_path):
    with local_sources([tmp_path / "takes", address, f"{address}/walk.bvh"], tmp_path / "work") as paths:
        here, folder, file = paths
        assert here == tmp_path / "takes" and (folder.name, file.name) == ("takes", "walk.bvh")
        for inside in ("walk.bvh", "notes/read me.txt"):
            assert (folder / inside).read_bytes() == (here / inside).read_bytes()
        assert file.read_bytes() == (here / "walk.bvh").read_bytes()
    assert not (tmp_path / "work" / "fetched").exists()


@pytest.mark.parametrize(
    ("source", "says"),
    [
        ("memory://nothing/here", "expected takes at memory://nothing/here, got nothing"),
        ("nosuch://bucket", "nosuch://bucket: expected takes, could not read them: Protocol not known"),
        pytest.param(
            "s3://bucket/takes",
            "s3://bucket/takes: expected takes, could not read them: Install s3fs",
            marks=pytest.mark.skipif(find_spec("s3fs") is not None, reason="s3fs is installed"),
        ),
    ],
)
def test_what_cannot_be_read_is_said_in_a_line(tmp_path, source, says):
    assert_one_line(run("build-db", source, "-o", tmp_path / "rep.h5"), says=says)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "source",
    [
        "reference://x", "data://x", "data://,x", "data://text/plain;base64,AAAA", "dir://x", "generic://x",
        "github://x", "dask://x", "filecache://x", "zip://x", "memory://\0", "http://[bad/", "file://\0",
        "http://127.0.0.1:99999/takes",
    ],
)  # fmt: skip
def test_no_protocol_raises_an_error_of_its_own(tmp_path, source):
    with (
        pytest.raises(ParameterError, match=r"expected takes") as raised,
        local_sources([source], tmp_path / "work"),
    ):
        pass
    assert "\n" not in str(raised.value) and not (tmp_path / "work" / "fetched").exists()


def test_a_name_that_leads_out_of_the_folder_is_replaced(tmp_path):
    memory = fsspec.filesystem("memory")
    memory.pipe("/bucket/..", b"x")
    try:
        with local_sources(["memory://bucket/.."], tmp_path / "work") as (path,):
            assert path == tmp_path / "work" / "fetched" / "0" / "takes" and path.read_bytes() == b"x"
    finally:
        memory.rm("/bucket", recursive=True)


def test_without_the_package_addresses_are_refused(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "fsspec.core", None)
    refused = pytest.raises(ParameterError, match=r"expected the package fsspec .*choreograph\[remote\]")
    with refused, local_sources(["memory://a"], tmp_path):
        pass


def test_files_outside_of_the_address_are_refused(address, tmp_path, monkeypatch):
    found = fsspec.implementations.memory.MemoryFileSystem.find
    monkeypatch.setattr(
        "fsspec.implementations.memory.MemoryFileSystem.find",
        lambda *given, **options: [*found(*given, **options), "/bucket/takes/../../evil.bvh"],
    )
    with pytest.raises(ParameterError, match="expected files below it"), local_sources([address], tmp_path):
        pass


def test_check_shows_takes_at_an_address(address):
    shown = run("build-db", address, "--check")
    assert shown.exit_code == 0, shown.output
    assert "read as walk" in shown.stdout
