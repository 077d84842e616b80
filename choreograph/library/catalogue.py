"""Several repertoire files that are read as one, such as those of an archive in a folder.

The folder is the catalogue: its files are the library, in the order of their names. Their networks and
skeleton are the same, and their motifs are of one set. What is relative to all takes of a genre is computed
from all files when it is first needed, so that a dance is the same as with one file of all takes
(`RepertoireShards`). Files are added to a folder, removed from it, or merged into one file.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.core.cache import MOST_ROW_BYTES, digest
from choreograph.core.errors import ParameterError, RepertoireError
from choreograph.core.files import (
    atomic_path,
    check_apart,
    check_target,
    folder_beside,
    locked_folder,
    writing,
)
from choreograph.core.numerics import AnyInts
from choreograph.library.derived import genre_arrays
from choreograph.library.schema import DERIVED, MOTIFS, OPTIONAL, NetArrays, layout_of
from choreograph.library.store import RepertoireFile
from choreograph.library.vocabulary import Motifs, make_vocabulary, motif_arrays
from choreograph.library.writing import Contents, write_repertoire
from choreograph.nets.configs import WORD_DIM

SUFFIX = ".h5"  # of the files in a folder
_OF_ALL = ("J", "E", "1", "J 3", "E 3")  # axes of arrays that are the same in all files
_ROWS = "XMBQNCUFW"  # axes along which files follow each other
# Arrays with indices of rows, and the axis of these rows.
_INDICES = {
    "clips/take": "X", "sources/take": "X", "figures/take": "X", "motifs/word_take": "X",
    **{f"takes/{part}_{end}": axis
       for part, axis in (("motion", "M"), ("body", "B"), ("beat", "Q"), ("count", "U"))
       for end in ("start", "stop")},
}  # fmt: skip
_OF_GENRES = ("clips/step_rank", "clips/liveliness_rank", *(n for n in DERIVED if n.startswith("genres/")))
_LEAST_BYTES = 1 << 22  # of the rows of one array of one file


class RepertoireShards:
    """Repertoire files read as one, with the methods of `RepertoireFile`.

    Takes are those of the first file, then those of the second, and so on.

    Raises `RepertoireError` as `RepertoireFile` does, and if the networks or the skeletons of two
    files differ, their motifs are of different sets, or two files have a take of one name.

    Parameters
    ----------
    paths : of the files, at least one
    path : what the whole is called, such as the folder of the files
    """

    def __init__(self, paths: Sequence[Path], path: Path) -> None:
        self.path, self.paths = path, tuple(paths)
        most_bytes = max(_LEAST_BYTES, MOST_ROW_BYTES // len(paths))
        self._shards = [RepertoireFile(one, most_bytes=most_bytes) for one in paths]
        first = self._shards[0]
        self.density, self.net_names = first.density, first.net_names
        # `notes` and `uncertainty` of any file are read, other optional arrays of all files.
        have = [shard.parts for shard in self._shards]
        of_any = frozenset.union(*have) & {"notes", "uncertainty"}
        self.parts = frozenset.intersection(*have) | of_any
        for other in self._shards[1:]:
            _check_same(first, other)
        self._layout = layout_of({name for part in self.parts for name in OPTIONAL[part]})
        self.names = tuple(self._layout)
        sizes = [shard.sizes for shard in self._shards]
        self._borders = {
            axis: np.cumsum([0, *(of_shard.get(axis, 0) for of_shard in sizes)])
            for axis in {axes.split()[0] for _, axes, *_ in self._layout.values()}
        }
        self.shapes = {
            name: (self._rows_of(name), *first.shapes[name][1:])
            for name, (kind, axes, *_) in self._layout.items()
            if kind != "s" and axes[0] in _ROWS and name in first.shapes
        }
        self._check_names()

    def _rows_of(self, name: str) -> int:
        return int(self._borders[self._layout[name][1].split()[0]][-1])

    def _check_names(self) -> None:
        known: dict[str, Path] = {}
        for shard in self._shards:
            names = shard.read("takes/name").tolist()
            for name in names:
                if name in known:
                    raise RepertoireError(
                        f"{shard.path}: expected takes that {known[name].name} does not have, got {name!r}: "
                        "remove it from one of them"
                    )
            known |= dict.fromkeys(names, shard.path)

    @cached_property
    def provenance(self) -> dict[str, Any]:
        """That of the first file, with the songs that any of them was trained on."""
        trained_on = {song for shard in self._shards for song in shard.provenance.get("trained_on", ())}
        files = [shard.path.name for shard in self._shards]
        return {**self._shards[0].provenance, "trained_on": sorted(trained_on), "files": files}

    def forget_rows(self) -> None:
        """As `RepertoireFile.forget_rows`."""
        for shard in self._shards:
            shard.forget_rows()

    def read(self, name: str, part: slice = slice(None)) -> NDArray[Any]:
        """As `RepertoireFile.read`."""
        if name in _OF_GENRES:
            return self._of_genres[name][part]
        if name in MOTIFS:
            return self._vocabulary[name][part]
        kind, axes, *_ = self._layout[name]
        if axes in _OF_ALL:
            return self._shards[0].read(name, part)
        if kind == "s":
            return np.concatenate([s.read(name) for s in self._shards if name in s.names])[part]
        if part == slice(None):
            return self._whole(name)
        return self.rows(name, np.arange(*part.indices(self._rows_of(name))))

    def _whole(self, name: str) -> NDArray[Any]:
        """All rows of an array of numbers, without keeping them."""
        parts = []
        for index, shard in enumerate(self._shards):
            if name in shard.names:
                parts.append(self._shifted(name, index, shard.read(name)))
            else:  # counts without uncertainty
                axis = self._layout[name][1].split()[0]
                parts.append(np.zeros(shard.sizes[axis], self._layout[name][0]))
        return np.concatenate(parts)

    def _shifted(self, name: str, index: int, rows: NDArray[Any]) -> NDArray[Any]:
        """Rows of a file, whose indices are those among the rows of all files."""
        if name not in _INDICES:
            return rows
        shifted: NDArray[Any] = rows + rows.dtype.type(self._borders[_INDICES[name]][index])
        return shifted

    def read_rows(self, name: str, start: int, stop: int) -> NDArray[Any]:
        """As `RepertoireFile.read_rows`."""
        return self.rows(name, np.arange(start, min(stop, self.shapes[name][0])))

    def rows(self, name: str, rows: AnyInts) -> NDArray[Any]:
        """As `RepertoireFile.rows`."""
        if name in _OF_GENRES or name in MOTIFS:
            of_all: NDArray[Any] = self.read(name)[rows]
            return of_all
        borders = self._borders[self._layout[name][1].split()[0]]
        shard = np.searchsorted(borders, rows, side="right") - 1
        kind = self._layout[name][0]
        found = np.empty((*np.shape(rows), *self.shapes[name][1:]), kind)
        for index in np.unique(shard).tolist():
            here = shard == index
            own = self._shards[index].rows(name, rows[here] - borders[index])
            found[here] = self._shifted(name, index, own)
        return found

    @cached_property
    def _of_genres(self) -> Mapping[str, NDArray[Any]]:
        """The sizes of the seconds of each genre, and the ranks of clips in their genre, among all files."""
        needed = ("takes/body_start", "takes/body_stop", "body/sums", "clips/take", "clips/start_frame",
                  "clips/steps")  # fmt: skip
        return genre_arrays({"takes/genre": self.read("takes/genre")} | {n: self._whole(n) for n in needed})

    @cached_property
    def _vocabulary(self) -> Mapping[str, NDArray[Any]]:
        """The motifs of all files, the most frequent first, and the templates and transitions of the genres.

        Motifs of equal embeddings are one.
        """
        rows = [shard.read("motifs/embeddings") for shard in self._shards]
        numbers: dict[bytes, int] = {}
        own = [np.array([numbers.setdefault(row.tobytes(), len(numbers)) for row in of]) for of in rows]
        counts = np.zeros(len(numbers), np.int64)
        embeddings, medoids = np.zeros((len(numbers), WORD_DIM), np.float32), np.zeros(len(numbers), np.int64)
        words = self._borders["W"]
        for index in reversed(range(len(rows))):  # the medoid is that of the first file that has the motif
            embeddings[own[index]] = rows[index]
            counts[own[index]] += self._shards[index].read("motifs/counts")
            medoids[own[index]] = self._shards[index].read("motifs/words") + words[index]
        order = np.argsort(-counts, kind="stable")
        rank = np.argsort(order)
        found = zip(own, self._shards, strict=True)
        motif = np.concatenate([rank[of[shard.read("motifs/word_motif")]] for of, shard in found])
        motifs = Motifs(embeddings[order], medoids[order], counts[order])
        take, start_s, end_s = (self._whole(f"motifs/word_{of}") for of in ("take", "start_s", "end_s"))
        genres = [str(genre) for genre in self.read("takes/genre")]
        return motif_arrays(make_vocabulary(motifs, motif, take, start_s, end_s, genres))

    def verify(self, report: Callable[[int, int], None] | None = None) -> None:
        """As `RepertoireFile.verify`."""
        for index, shard in enumerate(self._shards):
            shard.verify()
            if report is not None:
                report(index + 1, len(self._shards))

    def read_net(self, name: str) -> NetArrays:
        """As `RepertoireFile.read_net`."""
        return self._shards[0].read_net(name)


AnyFile = RepertoireFile | RepertoireShards


def open_files(paths: Sequence[Path]) -> AnyFile:
    """Open a file, or those of folders and several files as one.

    Raises `RepertoireError` as `RepertoireFile` and `RepertoireShards` do, and for a folder without files.
    """
    if not paths:
        raise RepertoireError("expected repertoire files, got none")
    files = files_of(paths)
    if len(files) == 1:
        return RepertoireFile(files[0])
    return RepertoireShards(files, paths[0] if len(paths) == 1 else Path("+".join(p.name for p in paths)))


def files_of(paths: Sequence[Path]) -> list[Path]:
    """Files, and those of folders by name. Raises `RepertoireError` for a folder without repertoire files."""
    files: list[Path] = []
    for path in paths:
        inside = path.glob(f"*{SUFFIX}") if path.is_dir() else [path]
        found = sorted(file for file in inside if file.is_file() or not path.is_dir())
        if not found:
            raise RepertoireError(f"{path}: expected repertoire files ({SUFFIX}) in this folder, got none")
        files += found
    return files


def _check_same(first: RepertoireFile, other: RepertoireFile) -> None:
    """Raise `RepertoireError` if two files cannot be read as one."""
    again = f"build it again with `--init-from {first.path.name} --keep-networks`"
    retarget = f"`build-db --add TAKES {first.path.name}` retargets takes to it"
    for what, of, cure in (
        ("skeleton", _skeleton, retarget), ("networks", _networks, again),
        ("tempo-density", lambda file: file.density, again), ("motifs", motif_set, again),
    ):  # fmt: skip
        if of(first) != of(other):
            raise RepertoireError(
                f"{other.path}: expected the {what} of {first.path.name}, got another: {cure}"
            )


def _skeleton(file: RepertoireFile) -> bytes:
    names = [name for name in file.names if name.startswith("skeleton/")]
    return digest(names, [file.read(name) for name in names])


def _networks(file: RepertoireFile) -> bytes:
    nets = {name: file.read_net(name) for name in file.net_names}
    return digest(list(nets), [[net.config, net.weights] for net in nets.values()])


def motif_set(file: AnyFile) -> str:
    """A digest of the motifs that were found together, of which a file has those of its own words.

    It is empty without motifs. Files that keep the motifs of another one have its digest.
    """
    if "motifs" not in file.parts:
        return ""
    return str(file.provenance.get("motifs") or digest(file.read("motifs/embeddings")).hex())


# Libraries in a folder: files are added, removed and merged into one.


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
