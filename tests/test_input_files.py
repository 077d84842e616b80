"""Files from untrusted sources and output files: those that cannot be used raise an error of one line."""

from __future__ import annotations

import json
import os

import pytest

from choreograph.core.errors import FormatError, ParameterError
from choreograph.core.files import check_regular, check_target, read_bytes, read_json, read_text


def test_files_are_read(tmp_path):
    (tmp_path / "a").write_bytes("\ufeffé".encode())
    assert read_bytes(tmp_path / "a", "x") == "\ufeffé".encode()
    for encoding in ("utf-8", "utf-8-sig", "utf-16"):
        (tmp_path / "a").write_text("é", encoding=encoding)
        assert read_text(tmp_path / "a", "x") == "é"
    (tmp_path / "a").write_text("é", encoding="cp1252")
    assert read_text(tmp_path / "a", "x", fallback="cp1252") == "é"
    with pytest.raises(FormatError, match="no text in UTF-8"):
        read_text(tmp_path / "a", "x")
    (tmp_path / "a").write_text(json.dumps([1, {"a": None}]))
    assert read_json(tmp_path / "a", "x") == [1, {"a": None}]


def test_a_file_of_just_the_size_is_read_and_one_byte_more_is_not(tmp_path):
    (tmp_path / "a").write_bytes(bytes(100))
    assert len(read_bytes(tmp_path / "a", "a list", max_bytes=100)) == 100
    with pytest.raises(FormatError, match="a list of up to"):
        read_bytes(tmp_path / "a", "a list", max_bytes=99)


@pytest.mark.parametrize(
    ("kind", "said"), [("pipe", "a pipe"), ("folder", "a folder"), ("device", "a device")]
)
def test_what_is_no_file_is_refused_without_opening_it(tmp_path, kind, said):
    path = tmp_path / "a"
    make = {"pipe": lambda: os.mkfifo(path), "folder": path.mkdir}
    make.get(kind, lambda: path.symlink_to("/dev/zero"))()
    with pytest.raises(FormatError, match=said):
        check_regular(path, "a plan")


@pytest.mark.parametrize("name", ["none", "a\0b", "x" * 5000])
def test_a_name_that_names_nothing_is_refused(tmp_path, name):
    with pytest.raises(FormatError, match="could not find it"):
        check_regular(tmp_path / name, "a plan")


@pytest.mark.parametrize("text", ["", "{", "[" * 100_000, "9" * 5000, "\ud800"])
def test_what_is_no_json_is_refused_in_a_line(tmp_path, text):
    (tmp_path / "a").write_bytes(text.encode("utf-8", "surrogatepass"))
    with pytest.raises(FormatError) as caught:
        read_json(tmp_path / "a", "a plan")
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 400


def test_targets(tmp_path, monkeypatch):
    assert check_target(tmp_path / "new.bvh") == tmp_path / "new.bvh"
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(ParameterError, match="pipe"):
        check_target(tmp_path / "pipe")
    # Who may write anywhere still cannot where a disk is read-only, and os.access says so.
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    with pytest.raises(ParameterError, match="read-only"):
        check_target(tmp_path / "new.bvh")
