"""The acceptance corpus's own check: it counts refusals, names them and lets other exceptions through."""

from __future__ import annotations

from pathlib import Path

import pytest
from acceptance.corpus import SaneFile, assert_read, refusals

from choreograph.core.errors import FormatError


def _read(path: Path) -> None:
    if "refused" in path.read_text():
        raise FormatError(f"{path.name}: expected a sane file")
    assert "wrong" not in path.read_text()


def _files(*contents: str) -> list[SaneFile]:
    def writer(content: str):
        def write(folder: Path) -> Path:
            (folder / "file.txt").write_text(content)
            return folder / "file.txt"

        return write

    return [SaneFile(f"{number}-{content}", writer(content)) for number, content in enumerate(contents)]


def test_refusals_are_named(tmp_path):
    files = _files("good", "refused", "good")
    assert refusals(files, _read, tmp_path) == {"1-refused": "file.txt: expected a sane file"}


def test_more_than_1_percent_refused_fails(tmp_path, capsys):
    assert_read(_files(*["good"] * 99, "refused"), _read, tmp_path / "1 of 100", n_files=100)
    assert "99-refused: file.txt: expected a sane file" in capsys.readouterr().out
    with pytest.raises(AssertionError, match="98-refused"):
        assert_read(_files(*["good"] * 98, "refused"), _read, tmp_path / "1 of 99", n_files=99)


def test_too_few_files_and_wrong_readings_fail(tmp_path):
    with pytest.raises(AssertionError):
        assert_read(_files("good"), _read, tmp_path / "few", n_files=2)
    with pytest.raises(AssertionError):
        assert_read(_files("wrong"), _read, tmp_path / "wrong", n_files=1)
