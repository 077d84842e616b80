"""Base class of the writers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from pathlib import Path
from typing import ClassVar

from choreograph.motion.motion import Motion


class Writer(ABC):
    """Writes motions in one format; the same motion gives the same bytes."""

    format: ClassVar[str]  # also the file's suffix, without the dot

    @abstractmethod
    def write(self, motion: Motion, path: Path) -> None:
        """Write `motion` to the new file `path`; the caller translates an `OSError`."""
