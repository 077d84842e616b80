"""Loader of the built-in repertoire and songs, with which dancing needs no data set."""

from __future__ import annotations

from pathlib import Path

from choreograph.repertoire import Repertoire
from choreograph.repertoire.store import RepertoireFile

STARTER_PATH = Path(__file__).with_name("starter.h5")
SONGS_PATH = Path(__file__).with_name("songs")


def starter_repertoire() -> Repertoire:
    """Open the built-in repertoire; `RepertoireError` if the installation lacks it."""
    return Repertoire(RepertoireFile(STARTER_PATH, is_shipped=True))


def example_songs() -> dict[str, Path]:
    """Names and files of the built-in songs."""
    return {path.stem: path for path in sorted(SONGS_PATH.glob("*.ogg"))}
