"""Several repertoire files that are read as one, such as those of an archive in a folder.

Their networks and skeleton are the same, and their motifs are of one set. What is relative to all takes of a
genre is computed from all files when it is first needed, so that a dance is the same as with one file of all
takes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.core.cache import MOST_ROW_BYTES, digest
from choreograph.core.errors import RepertoireError
from choreograph.core.numerics import AnyInts
from choreograph.library.derived import genre_arrays
from choreograph.library.motifs import Motifs
from choreograph.library.schema import DERIVED, MOTIFS, OPTIONAL, NetArrays, layout_of
from choreograph.library.store import RepertoireFile
from choreograph.library.vocabulary import make_vocabulary, motif_arrays
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
        self.parts = self._common_parts()
        for other in self._shards[1:]:
            _check_same(first, other)
        self._layout = layout_of({name for part in self.parts for name in OPTIONAL[part]})
        self.names = tuple(self._layout)
        sizes = [shard.sizes for shard in self._shards]
        self._borders = {
            axis: np.cumsum([0, *(of_shard.get(axis, 0) for of_shard in sizes)])
            for axis in {axes.split()[0] for _, axes in self._layout.values()}
        }
        self.shapes = {
            name: (self._rows_of(name), *first.shapes[name][1:])
            for name, (kind, axes) in self._layout.items()
            if kind != "s" and axes[0] in _ROWS and name in first.shapes
        }
        self._check_names()

    def _common_parts(self) -> frozenset[str]:
        """The optional arrays that are read: `notes` and `uncertainty` of any file, others of all files."""
        have = [shard.parts for shard in self._shards]
        return frozenset.intersection(*have) | (frozenset.union(*have) & {"notes", "uncertainty"})

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
        kind, axes = self._layout[name]
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
    """Files, and those of folders. Raises `RepertoireError` for a folder without repertoire files."""
    return [file for path in paths for file in (_files_in(path) if path.is_dir() else [path])]


def _files_in(folder: Path) -> list[Path]:
    """The repertoire files in a folder, by name."""
    found = sorted(path for path in folder.glob(f"*{SUFFIX}") if path.is_file())
    if not found:
        raise RepertoireError(f"{folder}: expected repertoire files ({SUFFIX}) in this folder, got none")
    return found


def _check_same(first: RepertoireFile, other: RepertoireFile) -> None:
    """Raise `RepertoireError` if two files cannot be read as one."""
    for what, of in (
        ("skeleton", _skeleton), ("networks", _networks), ("tempo-density", lambda file: file.density),
        ("motifs", motif_set),
    ):  # fmt: skip
        if of(first) != of(other):
            raise RepertoireError(_differs(what, first, other))


def _differs(what: str, first: RepertoireFile, other: RepertoireFile) -> str:
    cure = f"build it again with `--init-from {first.path.name} --keep-networks`"
    if what == "skeleton":
        cure = f"`build-db --add TAKES {first.path.name}` retargets takes to it"
    return f"{other.path}: expected the {what} of {first.path.name}, got another: {cure}"


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
