"""The built-in repertoire and its songs, so that dancing needs no data set."""

from __future__ import annotations

from pathlib import Path

from choreograph.repertoire import Repertoire

STARTER_PATH = Path(__file__).with_name("starter.h5")
SONGS_PATH = Path(__file__).with_name("songs")


def starter_repertoire() -> Repertoire:
    """The repertoire that comes with the package; `RepertoireError` if the installation lacks it."""
    return Repertoire.open(STARTER_PATH)


def example_songs() -> dict[str, Path]:
    """Name -> file of the songs that come with the package."""
    return {path.stem: path for path in sorted(SONGS_PATH.glob("*.ogg"))}
