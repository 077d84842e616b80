"""Libraries in a folder: repertoire files that are read as one are added, removed and merged into one file.

The folder is the catalogue: its files are the library, in the order of their names (`library.shards`).
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from choreograph.core.errors import ParameterError
from choreograph.core.files import (
    atomic_path,
    check_apart,
    check_target,
    folder_beside,
    locked_folder,
    writing,
)
from choreograph.library.schema import Contents
from choreograph.library.shards import SUFFIX, AnyFile, RepertoireShards, files_of, motif_set, open_files
from choreograph.library.store import RepertoireFile
from choreograph.library.writing import write_repertoire


def create_library(folder: Path, files: Sequence[Path]) -> AnyFile:
    """Copy repertoire files to a new folder, and open it.

    Raises `ParameterError` if the folder has repertoire files, and as `add_files`.
    """
    if folder.is_dir() and any(folder.glob(f"*{SUFFIX}")):
        raise ParameterError(
            f"expected a new folder, got {folder}, which is a library: `choreograph library add` adds to it"
        )
    with writing(folder):
        folder.mkdir(exist_ok=True)
    return add_files(folder, files)


def add_files(folder: Path, files: Sequence[Path]) -> AnyFile:
    """Copy repertoire files to the folder of a library, and open it.

    All are checked before anything is copied. Raises `ParameterError` if there are no files, or the folder
    has one of their names, and `RepertoireError` if they cannot be read as one with those of the folder.
    """
    new = files_of(files)
    if not new:
        raise ParameterError("expected repertoire files, got none")
    with _changing(folder):
        targets = [check_target(folder / file.with_suffix(SUFFIX).name) for file in new]
        check_apart(targets, new)
        if there := next((target for target in targets if target.exists()), None):
            raise ParameterError(f"expected files with new names, but there is {there}: rename the new one")
        open_files([*sorted(folder.glob(f"*{SUFFIX}")), *new])
        for file, target in zip(new, targets, strict=True):
            with atomic_path(target) as temporary:
                shutil.copyfile(file, temporary)
        return open_files([folder])


def remove_files(folder: Path, names: Sequence[str]) -> AnyFile:
    """Delete files of a library by their names, with or without suffix, and open what is left.

    Raises `ParameterError` for a name that the folder does not have, or if no file would be left.
    """
    with _changing(folder):
        by_stem = {path.stem: path for path in files_of([folder])}
        stems = {name.removesuffix(SUFFIX) for name in names}
        if absent := sorted(stems - set(by_stem)):
            raise ParameterError(f"expected files of {folder}, got {absent[0]!r}: it has {_listed(by_stem)}")
        if stems == set(by_stem):
            raise ParameterError(f"expected a file that is left in {folder}, got all of them to remove")
        for stem in sorted(stems):
            with writing(by_stem[stem]):
                by_stem[stem].unlink()
        return open_files([folder])


def merge_library(paths: Sequence[Path], output: Path) -> RepertoireFile:
    """Write the takes of all files to one file, and open it. It needs the memory of all motion.

    Files are compressed alike: the result is if all of them are. Raises `RepertoireError` if they cannot be
    read as one, and `ParameterError` if the output is one of them.
    """
    files = files_of(paths)
    check_apart([check_target(output)], files)
    whole = open_files(paths)
    shards = [RepertoireFile(file) for file in files]
    arrays = {name: whole.read(name) for name in whole.names if name != "provenance"}
    provenance = {name: value for name, value in whole.provenance.items() if name != "files"}
    if isinstance(whole, RepertoireShards):
        provenance["motifs"] = motif_set(whole)
    contents = Contents(
        arrays, whole.density, provenance, {name: whole.read_net(name) for name in whole.net_names}
    )
    write_repertoire(output, contents, compress=not any("poses" in shard.parts for shard in shards))
    return RepertoireFile(output)


@contextmanager
def _changing(folder: Path) -> Iterator[None]:
    """While a library is changed, no other process changes it. Raises `ParameterError` if it is no folder."""
    if not folder.is_dir():
        raise ParameterError(f"expected the folder of a library, got {folder}: create it first")
    with locked_folder(folder_beside(folder, ".change"), doing=f"changes {folder.name}"):
        yield


def _listed(names: Sequence[str] | dict[str, Path]) -> str:
    known = sorted(names)
    return ", ".join(known[:5]) + (f" and {len(known) - 5} more" if len(known) > 5 else "")
