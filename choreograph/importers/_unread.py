"""Files in a folder of takes that look like motion or music and were not read: which, and why."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterator
from pathlib import Path

from choreograph.foreign_formats import foreign_format

_NAMED = 6  # files in a note; the others are counted


def unread_notes(
    folder: Path, read: Collection[Path], motion_suffixes: Collection[str], why: Callable[[Path], str]
) -> tuple[str, ...]:
    """A note for each reason for which files of a folder were not read.

    `read` are those that were. `why` says it of a file directly in the folder, "" for one that is no loss;
    of files in folders below, those with `motion_suffixes` or a foreign format are named.
    """
    by_reason: dict[str, list[str]] = {}
    for file in _files(folder):
        foreign = foreign_format(file)
        if file in read:
            continue
        if file.parent != folder:
            is_motion = foreign is not None or file.suffix.lower() in motion_suffixes
            reason = (
                "in folders below, which are not looked into: give them by themselves" if is_motion else ""
            )
        else:
            reason = why(file) if foreign is None else f"{foreign.what}: {foreign.motion}"
        if reason:
            by_reason.setdefault(reason, []).append(file.relative_to(folder).as_posix())
    return tuple(_note(reason, names) for reason, names in by_reason.items())


def _files(folder: Path) -> Iterator[Path]:
    """All files in a folder and those below it, but for hidden folders, in order."""
    for parent, folders, names in os.walk(folder):
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        yield from (Path(parent) / name for name in sorted(names))


def _note(reason: str, names: list[str]) -> str:
    number = "1 file" if len(names) == 1 else f"{len(names)} files"
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return f"skipped {number}: {', '.join(names[:_NAMED])}{more} ({reason})"
