"""Repertoire files and files of networks, read on demand. The module `writing` writes them."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from choreograph.core.cache import MOST_ROW_BYTES, CachedRows
from choreograph.core.errors import RepertoireError
from choreograph.core.numerics import AnyInts
from choreograph.library import checks
from choreograph.library.body_positions import BodyPositions, stored_skeleton
from choreograph.library.checks import StoredArray
from choreograph.library.hdf5 import (
    attribute,
    check_link,
    file_named,
    member_names,
    opened,
    scalar,
    stored_array,
    text_attribute,
)
from choreograph.library.schema import (
    DELTA_RESTART,
    FORMAT,
    MADE_ROWS,
    MADE_WHEN_READ,
    NETWORKS_FORMAT,
    OPTIONAL,
    VERSION,
    NetArrays,
    axis_sizes,
    delta_decode,
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
        if text_attribute(file, "format") != NETWORKS_FORMAT:
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
            self._kinds = {name: kind for name, (kind, _) in layout.items()}
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
            checks.check_stored(array, self._kinds[array.name])
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
        checks.check_values("body/pos_m", pos_m, self.sizes)
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
    names = member_names(file, group, checks.MAX_WEIGHTS)
    stored = [stored_array(file, f"{group}/{weight}") for weight in names]
    for array in stored:
        checks.check_stored(array, checks.WEIGHTS)
    checks.check_size(stored, path.stat().st_size)
    weights = {weight: _to_single(file[f"{group}/{weight}"][()]) for weight in names}
    for weight, values in weights.items():
        checks.check_finite(f"{group}/{weight}", values)
    config = attribute(file[group], "config", str)
    return NetArrays(_from_json(config, f"{path}: the config of network {name}"), weights)


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
    provenance = _from_json(str(texts[0]) if len(texts) == 1 else "", f"{path}: provenance")
    checks.check_provenance(provenance)
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


def _to_single(weight: NDArray[Any]) -> NDArray[Any]:
    return weight.astype(np.float32) if weight.dtype == np.float16 else weight
