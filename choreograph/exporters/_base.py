"""Base class of the writers, and what the files of dances say of themselves."""

from __future__ import annotations

from abc import ABC, abstractmethod
from pathlib import Path
from typing import ClassVar

from choreograph._version import __version__
from choreograph.motion.motion import Motion

GENERATOR = f"choreograph {__version__}"
DANCE_GENERATOR = f"{GENERATOR}: a dance"  # by which files are known that may be replaced by a new dance


class Writer(ABC):
    """Writes motions in one format; the same motion gives the same bytes."""

    format: ClassVar[str]  # also the file's suffix, without the dot
    is_dance: bool = False  # whether the file says that it is a dance, where the format has a place for it

    @abstractmethod
    def write(self, motion: Motion, path: Path) -> None:
        """Write `motion` to the new file `path`; the caller translates an `OSError`."""
