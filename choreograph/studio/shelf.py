"""The repertoires that a studio can dance with, by the names of their files."""

from __future__ import annotations

from pathlib import Path

from choreograph.core.errors import ChoreographError
from choreograph.library.builtin import STARTER_PATH, starter_repertoire
from choreograph.library.repertoire import Repertoire
from choreograph.studio.project_file import checked_name
from choreograph.studio.refusals import NotFoundError

SUFFIX = ".h5"


class Shelf:
    """The repertoire of the command line, the built-in one, and those in the folder of the project."""

    def __init__(self, given: Repertoire) -> None:
        self.given = given.path.name
        self._opened = {self.given: given}

    def names(self, folder: Path) -> list[str]:
        """The names of all repertoires, the one of the command line first."""
        beside = sorted(path.name for path in folder.glob(f"*{SUFFIX}") if path.is_file())
        return list(dict.fromkeys([self.given, STARTER_PATH.name, *beside]))

    def open(self, name: str, folder: Path) -> Repertoire:
        """A repertoire by its name, or that of the command line without one.

        Raises `NotFoundError` if there is none of this name, and `RepertoireError` if it is damaged.
        """
        name = name or self.given
        if name not in self._opened:
            self._opened[name] = _opened(name, folder)
        return self._opened[name]


def _opened(name: str, folder: Path) -> Repertoire:
    if name == STARTER_PATH.name:
        return starter_repertoire()
    try:
        path = folder / checked_name(name, [SUFFIX])
    except ChoreographError:
        path = folder
    if not path.is_file():
        raise NotFoundError(
            f"expected the repertoire {name[:80]} in the folder of the project, got no such file: open the "
            "studio with --db"
        )
    return Repertoire.open(path)
