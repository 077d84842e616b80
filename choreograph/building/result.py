"""What a build returns."""

from __future__ import annotations

from html import escape
from pathlib import Path
from typing import NamedTuple

from choreograph.repertoire import Repertoire


class BuildResult(NamedTuple):
    """The repertoire that was built, and notes on what was unusual, one line each."""

    repertoire: Repertoire
    notes: tuple[str, ...]

    @property
    def path(self) -> Path:
        """The file that was written."""
        return self.repertoire.path

    def __repr__(self) -> str:
        takes, clips = len(self.repertoire.takes), self.repertoire.n_clips
        return f"<BuildResult {self.path.name}: {takes} takes, {clips} clips, {len(self.notes)} notes>"

    def _repr_html_(self) -> str:
        notes = "".join(f"<li>{escape(note)}</li>" for note in self.notes)
        return self.repertoire._repr_html_() + (f"<ul>{notes}</ul>" if notes else "")
