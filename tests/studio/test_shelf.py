"""Repertoires by name: that of the command line, the built-in one, and those of the folder, nothing else."""

from __future__ import annotations

import pytest

from choreograph.core.errors import RepertoireError
from choreograph.studio.refusals import NotFoundError
from choreograph.studio.shelf import Shelf


def test_repertoires_are_found_by_name(repertoire, tmp_path):
    (tmp_path / "mine.h5").write_bytes(repertoire.path.read_bytes())
    shelf = Shelf(repertoire)
    assert shelf.names(tmp_path) == [repertoire.path.name, "starter.h5", "mine.h5"]
    assert shelf.open("", tmp_path) is repertoire is shelf.open(repertoire.path.name, tmp_path)
    assert shelf.open("mine.h5", tmp_path) is shelf.open("mine.h5", tmp_path)
    assert len(shelf.open("starter.h5", tmp_path).takes) > 100


@pytest.mark.parametrize("name", ["other.h5", "../mine.h5", "/etc/passwd", "mine.json", "a/mine.h5"])
def test_other_names_are_refused(name, repertoire, tmp_path):
    with pytest.raises(NotFoundError, match="--db"):
        Shelf(repertoire).open(name, tmp_path)


def test_a_damaged_one_is_refused(repertoire, tmp_path):
    (tmp_path / "mine.h5").write_bytes(b"no repertoire")
    with pytest.raises(RepertoireError):
        Shelf(repertoire).open("mine.h5", tmp_path)
