"""Repertoire files and files of networks, read on demand. The module `writing` writes them.

`RepertoireFile` reads the arrays of a file, whole or by rows. Rows that were read lately are kept in blocks
(`core.cache.CachedRows`). `JoinedRows` are rows of a file and new ones as one array, which is read when it
is written.

Files may come from untrusted sources. They are opened and validated before any data is read, and links to
other files are refused. Every error of HDF5 and of `schema` becomes one that names the file.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from itertools import pairwise, product
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import DTypeLike, NDArray

from choreograph.core.cache import MOST_ROW_BYTES, CachedRows
from choreograph.core.errors import FormatError, ParameterError, RepertoireError
from choreograph.core.files import check_regular
from choreograph.core.numerics import AnyInts
from choreograph.library.derived import BodyPositions, stored_skeleton
from choreograph.library.schema import (
    DELTA_RESTART,
    FORMAT,
    MADE_ROWS,
    MADE_WHEN_READ,
    MAX_NETS,
    MAX_WEIGHTS,
    NETWORKS_FORMAT,
    OPTIONAL,
    VERSION,
    WEIGHTS,
    NetArrays,
    StoredArray,
    axis_sizes,
    check_finite,
    check_provenance,
    check_quantisation,
    check_size,
    check_stored,
    check_text,
    check_values,
    delta_decode,
    dequantised,
    expect,
    layout_of,
    net_names_in,
    shape_of,
)

_VERIFIED_ROWS = 1 << 16  # at once


def read_networks(path: Path) -> tuple[dict[str, NetArrays], dict[str, Any]]:
    """Networks by name and their provenance, as written by `write_networks`.

    Raises `RepertoireError` for any other file.
    """
    with opened(path, "networks") as file:
        expect(
            text_attribute(file, "format") == NETWORKS_FORMAT,
            f"{path}: expected networks, got another kind of file",
        )
        names = member_names(file, "nets", MAX_NETS)
        nets = {name: _read_net(file, name, path) for name in names}
        return nets, _read_provenance(file, path)


class RepertoireFile:
    """An open repertoire file. Arrays are read on demand. Between reads the file is closed.

    Raises `RepertoireError` if the file is missing, not HDF5, truncated, not a repertoire or of
    another version, or an array is not stored as the schema expects.
    Opening reads headers only, and takes as long for a million clips as for a thousand. The content of arrays
    is verified when it is read, block by block. `verify` reads everything. Of the rows of each array, at most
    `most_bytes` are kept.
    """

    def __init__(self, path: Path, *, most_bytes: int = MOST_ROW_BYTES) -> None:
        self.path, self._most_bytes = Path(path), most_bytes
        self.paths = (self.path,)
        if self.path.is_dir():
            raise RepertoireError(f"{path}: expected a repertoire file, got a folder")
        if not self.path.exists():
            raise RepertoireError(
                f"{path}: expected a repertoire, got no such repertoire: make one with `choreograph build-db`"
            )
        with opened(self.path, "a repertoire") as file:
            self._check_version(file)
            layout = layout_of(file)
            self.parts = frozenset(part for part, names in OPTIONAL.items() if names.keys() <= layout.keys())
            self._kinds = {name: dataset.kind for name, dataset in layout.items()}
            self._left_out = frozenset(name for name in MADE_WHEN_READ if name not in file)
            stored = self._check_stored(file, [name for name in layout if name not in self._left_out])
            self.density: str = attribute(file, "density", str)
            self.provenance = _read_provenance(file, self.path)
            self.net_names = self._find_nets(file)
            self.names = tuple(layout)
            self.shapes = {a.name: a.shape for a in stored if self._kinds[a.name] != "s"}  # of numbers
            self.sizes = axis_sizes(self.shapes)
            self.shapes |= {name: shape_of(name, self.sizes) for name in self._left_out}
            self.quantised = frozenset(array.name for array in stored if array.is_quantised)
            self._block_rows = {array.name: _block_rows(array) for array in stored}
            self._block_rows |= dict.fromkeys(self._left_out, MADE_ROWS)
            self._rows: dict[str, tuple[object, CachedRows]] = {}  # with the state of the file
            self._positions: BodyPositions | None = None  # of the file that `_rows` were read from

    def _check_version(self, file: h5py.File) -> None:
        kind = text_attribute(file, "format")
        if kind != FORMAT:
            got = "none" if kind is None else f"{kind!r}"[:40]
            raise RepertoireError(
                f"{self.path}: expected a repertoire, got an HDF5 file of another kind ({got})"
            )
        version = attribute(file, "version", int)
        if version != VERSION:
            raise RepertoireError(
                f"{self.path}: expected repertoire version {VERSION}, got {version}: made by another version "
                f"of choreograph, build it again with `choreograph build-db TAKES -o {self.path.name}`"
            )

    def _check_stored(self, file: h5py.File, names: Sequence[str]) -> list[StoredArray]:
        for group in dict.fromkeys(name.split("/")[0] for name in names if "/" in name):
            check_link(file, group)
        stored = [stored_array(file, name) for name in names]
        for array in stored:
            check_stored(array, self._kinds[array.name])
        check_size(stored, self.path.stat().st_size)
        return stored

    def _find_nets(self, file: h5py.File) -> tuple[str, ...]:
        if "nets" not in file:
            return ()
        check_link(file, "nets")
        return net_names_in(member_names(file, "nets", MAX_NETS))

    def read(self, name: str, part: slice = slice(None)) -> NDArray[Any]:
        """An array of the schema, or a slice of its first axis. Strings become numpy str.

        Raises `RepertoireError` if it cannot be read or a value is not one that the schema expects.
        """
        if name in self._left_out:
            start, stop, step = part.indices(self.shapes[name][0])
            with file_named(self.path, "a repertoire"):
                return self._made(self._body_positions(), start, stop)[::step]
        with opened(self.path, "a repertoire") as file:
            return self._read_from(file, name, part)

    def _read_from(self, file: h5py.File, name: str, part: slice = slice(None)) -> NDArray[Any]:
        if self._kinds[name] == "s":
            return _read_texts(file[name])[part]
        return self._numbers(file[name], name, part)

    def _body_positions(self) -> BodyPositions:
        with opened(self.path, "a repertoire") as file:
            read = partial(self._read_from, file)
            skeleton = stored_skeleton(read, has_roles="roles" in self.parts)
            return BodyPositions.of(read, skeleton, self.sizes["M"], self.sizes["B"])

    def _made(self, positions: BodyPositions, start: int, stop: int) -> NDArray[np.float32]:
        pos_m = positions.rows(self.read_rows, start, stop)
        check_values("body/pos_m", pos_m, self.sizes)
        return pos_m

    def arrays(self) -> dict[str, NDArray[Any]]:
        """All arrays by path, as `schema.Contents` holds them."""
        return {name: self.read(name) for name in self.names if name != "provenance"}

    def _numbers(self, data: h5py.Dataset, name: str, part: slice) -> NDArray[Any]:
        if data.shape != self.shapes[name]:
            raise RepertoireError(
                f"{self.path}: expected the repertoire that was opened, got another one in its place: takes "
                "were added or removed since, open it again"
            )
        array = _read_quantised(name, data, part) if "step" in data.attrs else data[part]
        check_values(name, array, self.sizes)
        return array

    def read_rows(self, name: str, start: int, stop: int) -> NDArray[Any]:
        """Rows `start` to `stop` of an array of numbers, as `rows` reads them."""
        return self.rows(name, np.arange(start, min(stop, self.shapes[name][0])))

    def rows(self, name: str, rows: AnyInts) -> NDArray[Any]:
        """Rows (...) of an array of numbers by index. Blocks that were read lately are kept.

        Raises as `read` does. A file that was replaced is read again, if it has as many rows.
        """
        with file_named(self.path, "a repertoire"):
            status = self.path.stat()
        state = status.st_mtime_ns, status.st_size, status.st_ino
        before, kept = self._rows.get(name, (None, None))
        if kept is None or before != state:
            of = self.shapes[name], self._kinds[name], self._block_rows[name]
            kept = CachedRows(*of, self._most_bytes)
            self._rows[name] = state, kept
            if name in self._left_out:
                self._positions = None
        return kept.rows(rows, partial(self._blocks, name))

    def forget_rows(self) -> None:
        """Free the memory of the rows that are kept."""
        self._rows.clear()

    def _blocks(self, name: str, blocks: Sequence[int]) -> Iterator[NDArray[Any]]:
        n_rows, n_all = self._block_rows[name], self.shapes[name][0]
        if name in self._left_out:
            positions = self._positions = self._positions or self._body_positions()
            for block in blocks:
                yield self._made(positions, block * n_rows, min((block + 1) * n_rows, n_all))
            return
        with opened(self.path, "a repertoire") as file:
            data = file[name]
            for block in blocks:
                yield self._numbers(data, name, slice(block * n_rows, (block + 1) * n_rows))

    def copy_chunks(self, name: str, target: h5py.Dataset, n_rows: int) -> int:
        """Copy the chunks of the first `n_rows` of an array to a new one, without unpacking them.

        Returns the number of rows that were copied: 0 if the new array is stored in another way. Rows of a
        chunk that has other rows besides are not copied.
        """
        if name in self._left_out:
            return 0
        with opened(self.path, "a repertoire") as file:
            source = file[name]
            if _storage(source) != _storage(target):
                return 0
            is_same = n_rows == len(source) == len(target)
            n_copied = n_rows if is_same else n_rows // source.chunks[0] * source.chunks[0]
            lengths = (n_copied, *source.shape[1:])
            steps = [range(0, end, step) for end, step in zip(lengths, source.chunks, strict=True)]
            for offset in product(*steps):
                mask, packed = source.id.read_direct_chunk(offset)
                target.id.write_direct_chunk(offset, packed, mask)
        return n_copied

    def verify(self, report: Callable[[int, int], None] | None = None) -> None:
        """Read all arrays and networks. Raises `RepertoireError` if one is damaged."""
        for index, name in enumerate(self.names):
            if name not in self.shapes:
                self.read(name)
            else:
                for start in range(0, self.shapes[name][0], _VERIFIED_ROWS):
                    self.read(name, slice(start, start + _VERIFIED_ROWS))
            if report is not None:
                report(index + 1, len(self.names))
        for name in self.net_names:
            self.read_net(name)

    def read_net(self, name: str) -> NetArrays:
        """A network's config and weights. Raises `RepertoireError` if the file has none of that name."""
        if name not in self.net_names:
            known = ", ".join(self.net_names) or "none"
            raise RepertoireError(f"{self.path}: expected a network {name!r}, got a repertoire with {known}")
        with opened(self.path, "a repertoire") as file:
            return _read_net(file, name, self.path)


def _storage(data: h5py.Dataset) -> tuple[object, ...]:
    """Arrays with equal values of this have equal chunks for equal rows."""
    plan = data.id.get_create_plist()
    filters = [plan.get_filter(i)[:3] for i in range(plan.get_nfilters())]
    return data.dtype, data.shape[1:], data.chunks, filters


def _block_rows(array: StoredArray) -> int:
    """The rows of an array that are read at once: those of a chunk, which has one checksum."""
    if array.is_quantised:
        return DELTA_RESTART
    return array.chunk[0] if array.chunk else max(1, array.shape[0] if array.shape else 1)


def _read_net(file: h5py.File, name: str, path: Path) -> NetArrays:
    group = f"nets/{name}"
    check_link(file, group)
    names = member_names(file, group, MAX_WEIGHTS)
    stored = [stored_array(file, f"{group}/{weight}") for weight in names]
    for array in stored:
        check_stored(array, WEIGHTS)
    check_size(stored, path.stat().st_size)
    weights = {}
    for weight in names:
        values = file[f"{group}/{weight}"][()]
        check_finite(f"{group}/{weight}", values)
        weights[weight] = values.astype(np.float32) if values.dtype == np.float16 else values
    config = attribute(file[group], "config", str)
    return NetArrays(_from_json(config, f"{path}: the config of network {name}"), weights)


def _read_quantised(name: str, data: h5py.Dataset, part: slice) -> NDArray[np.float32]:
    """Rows of a quantised array. Decoding starts at the last row before them where the encoding restarts."""
    check_quantisation(name, {key: scalar(data, key) for key in data.attrs})
    start, stop, _ = part.indices(len(data))
    first = start // DELTA_RESTART * DELTA_RESTART
    integers = delta_decode(data[first:stop])[start - first :]
    return dequantised(integers, data.attrs["step"])


def _read_texts(data: h5py.Dataset) -> NDArray[np.str_]:
    """Texts (N,), which are stored as bytes with a zero after each. There is a limit on their total size."""
    content = data[()].tobytes()
    if content and content[-1]:
        raise RepertoireError(f"{data.name}: expected texts with a zero after each, got others")
    try:
        texts = content.decode().split("\0")[:-1]
    except UnicodeDecodeError:
        raise RepertoireError(f"{data.name}: expected texts in UTF-8, got others") from None
    check_text(data.name, texts)
    return np.array(texts, dtype=np.str_)


def _read_provenance(file: h5py.File, path: Path) -> dict[str, Any]:
    check_stored(stored_array(file, "provenance"), "s")
    texts = _read_texts(file["provenance"])
    provenance = _from_json(str(texts[0]) if len(texts) == 1 else "", f"{path}: provenance")
    check_provenance(provenance)
    return provenance


def _from_json(text: str, what: str) -> dict[str, Any]:
    """The JSON object in a text. Raises `RepertoireError`, which names `what`, for anything else."""
    try:
        data = json.loads(text)
    except (TypeError, ValueError, RecursionError) as error:
        raise RepertoireError(f"{what}: expected JSON: a damaged file") from error
    if not isinstance(data, dict):
        raise RepertoireError(f"{what}: expected a JSON object: a damaged file")
    return data


# Rows that are written again.


BLOCK_ROWS = 1 << 16  # that are read at once


class JoinedRows:
    """An array of rows (N, ...) in several parts: rows of an array of a file, or arrays in memory.

    It has the shape and the dtype of the array, and `np.asarray` returns all of it.

    Parameters
    ----------
    file : the repertoire that some of the rows are in
    name : the array there
    parts : ranges (start, stop) of rows of the file, and arrays, in the order of the result
    dtype : of the result
    """

    def __init__(
        self,
        file: RepertoireFile,
        name: str,
        parts: Sequence[tuple[int, int] | NDArray[Any]],
        dtype: DTypeLike,
    ) -> None:
        self.file, self.name = file, name
        self.dtype = np.dtype(dtype)
        self._parts = [part for part in parts if _length(part) > 0]
        self._ends = np.cumsum([0, *map(_length, self._parts)])  # where each part ends
        self.shape = (int(self._ends[-1]), *file.shapes[name][1:])

    def __len__(self) -> int:
        return self.shape[0]

    @property
    def size(self) -> int:
        """The number of values."""
        return int(np.prod(self.shape, dtype=np.int64))

    @property
    def nbytes(self) -> int:
        """The number of bytes of the whole array."""
        return self.size * self.dtype.itemsize

    @property
    def new_parts(self) -> list[NDArray[Any]]:
        """The arrays in memory."""
        return [part for part in self._parts if not isinstance(part, tuple)]

    @property
    def n_kept(self) -> int:
        """How many rows at the beginning are the first rows of the file."""
        kept = 0
        for part in self._parts:
            if not isinstance(part, tuple) or part[0] != kept:
                return kept
            kept = part[1]
        return kept

    def rows(self, start: int, stop: int) -> NDArray[Any]:
        """Rows `start` to `stop`. Raises `RepertoireError` if a block of the file is damaged."""
        found = []
        for part, (first, end) in zip(self._parts, pairwise(self._ends.tolist()), strict=True):
            low, high = max(start, first) - first, min(stop, end) - first
            if low < high and isinstance(part, tuple):
                found.append(self.file.read(self.name, slice(part[0] + low, part[0] + high)))
            elif low < high and not isinstance(part, tuple):
                found.append(part[low:high])
        if not found:
            return np.zeros((0, *self.shape[1:]), self.dtype)
        return np.concatenate(found, dtype=self.dtype, casting="unsafe")

    def blocks(self, start: int, n_rows: int) -> Iterator[tuple[int, NDArray[Any]]]:
        """First row and rows of blocks from row `start` on, of multiples of `n_rows` that fit in memory."""
        n_rows *= max(1, BLOCK_ROWS // n_rows)
        for first in range(start, len(self), n_rows):
            yield first, self.rows(first, min(first + n_rows, len(self)))

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray[Any]:
        return self.rows(0, len(self)).astype(self.dtype if dtype is None else dtype, copy=False)


Rows = NDArray[Any] | JoinedRows


def _length(part: tuple[int, int] | NDArray[Any]) -> int:
    return part[1] - part[0] if isinstance(part, tuple) else len(part)


# HDF5 files from untrusted sources.


# The errors of h5py for a file that it cannot read. It depends on the damaged bytes which is raised.
H5PY_ERRORS = (
    OSError, KeyError, RuntimeError, ValueError, TypeError, AttributeError, OverflowError, MemoryError,
    NotImplementedError,
)  # fmt: skip


@contextmanager
def opened(path: Path, what: str) -> Iterator[h5py.File]:
    """Open a file of a kind, such as "a repertoire". Raises `RepertoireError` if it is not valid."""
    with file_named(path, what), h5py.File(path, "r") as file:
        yield file


@contextmanager
def file_named(path: Path, what: str) -> Iterator[None]:
    """Raise the errors of HDF5 and of `schema` as a `RepertoireError` that names the file."""
    try:
        check_regular(path, what)
        yield
    except (RepertoireError, FormatError, *H5PY_ERRORS) as error:
        if isinstance(error, RepertoireError) and str(error).startswith(str(path)):
            raise
        raise RepertoireError(_with_file(error, path, what)) from error


def _with_file(error: Exception, path: Path, what: str) -> str:
    """The message of an error, with the name of the file."""
    if isinstance(error, RepertoireError | ParameterError):
        return f"{path}: {error}: a damaged file"
    if isinstance(error, FormatError):  # there is no such file, and the message names it
        return str(error)
    reason = " ".join(str(error).split())[:120]
    return (
        f"{path}: expected {what} (HDF5), could not read it ({reason}): truncated or not made by choreograph"
    )


def check_link(file: h5py.File, name: str) -> None:
    """Raise `RepertoireError` if an object does not exist or is a link to another place."""
    try:
        link = file.id.links.get_info(name.encode())
    except (KeyError, RuntimeError):
        raise RepertoireError(f"the repertoire has no {name}") from None
    if link.type != h5py.h5l.TYPE_HARD:
        raise RepertoireError(f"{name}: expected it in this file, got a link to another place")


def stored_array(file: h5py.File, name: str) -> StoredArray:
    """How an array is stored. Calls are low-level, since opening a repertoire checks every array."""
    check_link(file, name)
    data = h5py.h5o.open(file.id, name.encode())
    if not isinstance(data, h5py.h5d.DatasetID):
        raise RepertoireError(f"the repertoire has no {name}")
    plan = data.get_create_plist()
    layout = plan.get_layout()
    return StoredArray(
        name,
        data.dtype,
        is_quantised=h5py.h5a.exists(data, b"step"),
        shape=data.shape or (),
        chunk=plan.get_chunk() if layout == h5py.h5d.CHUNKED else (),
        filters=tuple(plan.get_filter(i)[0] for i in range(plan.get_nfilters())),
        n_stored_bytes=data.get_storage_size(),
        is_elsewhere=layout == h5py.h5d.VIRTUAL or plan.get_external_count() > 0,
    )


def member_names(file: h5py.File, group: str, most: int) -> list[str]:
    """The sorted names in a group. Raises `RepertoireError` if it is no group, or has more than `most`."""
    check_link(file, group)
    members = file[group]
    if not isinstance(members, h5py.Group) or len(members) > most:
        raise RepertoireError(
            f"{group}: expected a group of up to {most} members, got another object or a larger group"
        )
    return sorted(members)


def scalar(owner: h5py.Group | h5py.Dataset, name: str) -> Any:
    """An attribute that is a single number or text of fixed length, or None for anything else.

    Texts of any length are in heaps, on which HDF5 2.0 loops endlessly if they are damaged.
    """
    if name not in owner.attrs:
        return None
    header = owner.attrs.get_id(name)
    return owner.attrs[name] if header.shape == () and header.dtype.kind in "iufbS" else None


def text_attribute(owner: h5py.Group, name: str) -> str | None:
    """An attribute that is one text, or None for anything else."""
    value = scalar(owner, name)
    return value.decode(errors="replace") if isinstance(value, bytes) else None


def attribute(owner: h5py.Group, name: str, kind: type) -> Any:
    """An attribute that is one text or whole number. Raises `RepertoireError` for anything else."""
    value = text_attribute(owner, name) if kind is str else scalar(owner, name)
    if not isinstance(value, str if kind is str else np.integer):
        raise RepertoireError(
            f"the attribute {name}: expected {kind.__name__}, got another type or no such attribute"
        )
    return kind(value)
