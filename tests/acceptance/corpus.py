"""The acceptance corpus: sane files, as other programs write them, of which at most 1 % may be refused.

A test lists its files and gives their reader:

    def test_songs_are_read(tmp_path):
        assert_read(SONGS, load_song, tmp_path, n_files=60)

The reader may check what it reads: an assertion that fails, or any exception that is not a refusal, fails
the test.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from choreograph.core.errors import ChoreographError

MAX_REFUSED_SHARE = 0.01


@dataclass(frozen=True)
class SaneFile:
    """A file that a reader must accept."""

    name: str  # what is special about it; also the name of its folder
    write: Callable[
        [Path], Path
    ]  # writes the file, and what belongs beside it, into a folder; returns what to read


def refusals(files: Sequence[SaneFile], read: Callable[[Path], object], folder: Path) -> dict[str, str]:
    """Write each file into a folder of its own below `folder` and read it: error lines of the refused."""
    refused = {}
    for file in files:
        own = folder / file.name
        own.mkdir(parents=True)  # fails where two files have the same name
        path = file.write(own)
        try:
            read(path)
        except ChoreographError as error:
            refused[file.name] = str(error)
    return refused


def assert_read(
    files: Sequence[SaneFile], read: Callable[[Path], object], folder: Path, *, n_files: int
) -> None:
    """Assert that there are at least `n_files` files, of which at most 1 % are refused; print those."""
    refused = refusals(files, read, folder)
    lines = [f"{name}: {line}" for name, line in refused.items()]
    print(f"{len(refused)} of {len(files)} sane files refused", *lines, sep="\n")
    assert len(files) >= n_files
    assert len(refused) <= MAX_REFUSED_SHARE * len(files), "\n".join(lines)
