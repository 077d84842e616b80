"""Repertoire files and files of networks, opened with checks and read on demand."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from choreograph.core.errors import FormatError, RepertoireError
from choreograph.core.files import check_regular
from choreograph.core.numerics import AnyInts
from choreograph.library import checks
from choreograph.library.checks import StoredArray
from choreograph.library.rows import MOST_BYTES, KeptBlocks
from choreograph.library.schema import (
    DELTA_RESTART,
    FORMAT,
    NETWORKS_FORMAT,
    OPTIONAL,
    VERSION,
    NetArrays,
    axis_sizes,
    delta_decode,
    layout_of,
    net_names_in,
)

# HDF5 files from untrusted sources are opened and validated before any data is read.
#
# Links to other files are refused. Every error of HDF5 and of `checks` becomes one that names the file.


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
    """Raise the errors of HDF5 and of `checks` as a `RepertoireError` that names the file."""
    try:
        check_regular(path, what)
        yield
    except (RepertoireError, FormatError, *H5PY_ERRORS) as error:
        if isinstance(error, RepertoireError) and str(error).startswith(str(path)):
            raise
        raise RepertoireError(_with_file(error, path, what)) from error


def _with_file(error: Exception, path: Path, what: str) -> str:
    """The message of an error, with the name of the file."""
    if isinstance(error, RepertoireError):
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


def _text_attribute(owner: h5py.Group, name: str) -> str | None:
    value = scalar(owner, name)
    return value.decode(errors="replace") if isinstance(value, bytes) else None


def attribute(owner: h5py.Group, name: str, kind: type) -> Any:
    """An attribute that is one text or whole number. Raises `RepertoireError` for anything else."""
    value = _text_attribute(owner, name) if kind is str else scalar(owner, name)
    if not isinstance(value, str if kind is str else np.integer):
        raise RepertoireError(
            f"the attribute {name}: expected {kind.__name__}, got another type or no such attribute"
        )
    return kind(value)


def from_json(text: str, what: str) -> dict[str, Any]:
    """The JSON object in a text. Raises `RepertoireError`, which names `what`, for anything else."""
    try:
        data = json.loads(text)
    except (TypeError, ValueError, RecursionError) as error:
        raise RepertoireError(f"{what}: expected JSON: a damaged file") from error
    if not isinstance(data, dict):
        raise RepertoireError(f"{what}: expected a JSON object: a damaged file")
    return data


# Repertoire files and files of networks, read on demand. The module `writing` writes them.


_VERIFIED_ROWS = 1 << 16  # at once


def read_networks(path: Path) -> tuple[dict[str, NetArrays], dict[str, Any]]:
    """Networks by name and their provenance, as written by `write_networks`.

    Raises `RepertoireError` for any other file.
    """
    with opened(path, "networks") as file:
        if _text_attribute(file, "format") != NETWORKS_FORMAT:
            raise RepertoireError(f"{path}: expected networks, got another kind of file")
        names = member_names(file, "nets", checks.MAX_NETS)
        nets = {name: _read_net(file, name, path) for name in names}
        return nets, _read_provenance(file, path)


class RepertoireFile:
    """An open repertoire file. Arrays are read on demand. Between reads the file is closed.

    Raises `RepertoireError` if the file is missing, not HDF5, truncated, not a repertoire or of
    another version, or an array is not stored as `checks` expects.
    Opening reads headers only, and takes as long for a million clips as for a thousand. The content of arrays
    is verified when it is read, block by block. `verify` reads everything. Of the rows of each array, at most
    `most_bytes` are kept.
    """

    def __init__(self, path: Path, *, most_bytes: int = MOST_BYTES) -> None:
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
            self._kinds = {name: kind for name, (kind, _) in layout.items()}
            stored = self._check_stored(file, layout)
            self.density: str = attribute(file, "density", str)
            self.provenance = _read_provenance(file, self.path)
            self.net_names = self._find_nets(file)
            self.names = tuple(layout)
            self.shapes = {a.name: a.shape for a in stored if self._kinds[a.name] != "s"}  # of numbers
            self.sizes = axis_sizes(self.shapes)
            self.quantised = frozenset(array.name for array in stored if array.is_quantised)
            self._block_rows = {array.name: _block_rows(array) for array in stored}
            self._kept: dict[str, KeptBlocks] = {}

    def _check_version(self, file: h5py.File) -> None:
        kind = _text_attribute(file, "format")
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

    def _check_stored(self, file: h5py.File, layout: Mapping[str, tuple[str, str]]) -> list[StoredArray]:
        for group in dict.fromkeys(name.split("/")[0] for name in layout if "/" in name):
            check_link(file, group)
        stored = [stored_array(file, name) for name in layout]
        for array, (kind, _) in zip(stored, layout.values(), strict=True):
            checks.check_stored(array, kind)
        checks.check_size(stored, self.path.stat().st_size)
        return stored

    def _find_nets(self, file: h5py.File) -> tuple[str, ...]:
        if "nets" not in file:
            return ()
        check_link(file, "nets")
        return net_names_in(member_names(file, "nets", checks.MAX_NETS))

    def read(self, name: str, part: slice = slice(None)) -> NDArray[Any]:
        """An array of the schema, or a slice of its first axis. Strings become numpy str.

        Raises `RepertoireError` if it cannot be read or a value is not one that `checks` expects.
        """
        with opened(self.path, "a repertoire") as file:
            data = file[name]
            if self._kinds[name] == "s":
                return _read_texts(data)[part]
            return self._numbers(data, name, part)

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
        checks.check_values(name, array, self.sizes)
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
        kept = self._kept.get(name)
        state = status.st_mtime_ns, status.st_size, status.st_ino
        if kept is None or kept.state != state:
            kept = self._kept[name] = KeptBlocks(
                self.shapes[name], self._kinds[name], self._block_rows[name], state, self._most_bytes
            )
        return kept.rows(rows, partial(self._blocks, name))

    def forget_rows(self) -> None:
        """Free the memory of the rows that are kept."""
        self._kept.clear()

    def _blocks(self, name: str, blocks: Sequence[int]) -> Iterator[NDArray[Any]]:
        n_rows = self._block_rows[name]
        with opened(self.path, "a repertoire") as file:
            data = file[name]
            for block in blocks:
                yield self._numbers(data, name, slice(block * n_rows, (block + 1) * n_rows))

    def copy_chunks(self, name: str, target: h5py.Dataset, n_rows: int) -> int:
        """Copy the chunks of the first `n_rows` of an array to a new one, without unpacking them.

        Returns the number of rows that were copied: 0 if the new array is stored in another way. Rows of a
        chunk that has other rows besides are not copied.
        """
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
    names = member_names(file, group, checks.MAX_WEIGHTS)
    stored = [stored_array(file, f"{group}/{weight}") for weight in names]
    for array in stored:
        checks.check_stored(array, checks.WEIGHTS)
    checks.check_size(stored, path.stat().st_size)
    weights = {weight: _to_single(file[f"{group}/{weight}"][()]) for weight in names}
    for weight, values in weights.items():
        checks.check_finite(f"{group}/{weight}", values)
    config = attribute(file[group], "config", str)
    return NetArrays(from_json(config, f"{path}: the config of network {name}"), weights)


def _read_quantised(name: str, data: h5py.Dataset, part: slice) -> NDArray[np.float32]:
    """Rows of a quantised array. Decoding starts at the last row before them where the encoding restarts."""
    checks.check_quantisation(name, {key: scalar(data, key) for key in data.attrs})
    start, stop, _ = part.indices(len(data))
    first = start // DELTA_RESTART * DELTA_RESTART
    integers = delta_decode(data[first:stop])[start - first :]
    result: NDArray[np.float32] = np.multiply(integers, data.attrs["step"]).astype(np.float32)
    return result


def _read_texts(data: h5py.Dataset) -> NDArray[np.str_]:
    """Texts (N,), which are stored as bytes with a zero after each. There is a limit on their total size."""
    content = data[()].tobytes()
    if content and content[-1]:
        raise RepertoireError(f"{data.name}: expected texts with a zero after each, got others")
    try:
        texts = content.decode().split("\0")[:-1]
    except UnicodeDecodeError:
        raise RepertoireError(f"{data.name}: expected texts in UTF-8, got others") from None
    checks.check_text(data.name, texts)
    return np.array(texts, dtype=np.str_)


def _read_provenance(file: h5py.File, path: Path) -> dict[str, Any]:
    checks.check_stored(stored_array(file, "provenance"), "s")
    texts = _read_texts(file["provenance"])
    provenance = from_json(str(texts[0]) if len(texts) == 1 else "", f"{path}: provenance")
    checks.check_provenance(provenance)
    return provenance


def _to_single(weight: NDArray[Any]) -> NDArray[Any]:
    return weight.astype(np.float32) if weight.dtype == np.float16 else weight
