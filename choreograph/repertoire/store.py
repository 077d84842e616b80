"""Repertoire files and files of networks, read on demand; `writing` writes them."""

from __future__ import annotations

import mmap
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from choreograph.errors import RepertoireError
from choreograph.repertoire import checks
from choreograph.repertoire.checks import StoredArray
from choreograph.repertoire.hdf5 import (
    attribute,
    check_link,
    damage_named,
    from_json,
    member_names,
    opened,
    scalar,
    stored_array,
)
from choreograph.repertoire.layout import NetArrays, axis_sizes, layout_of
from choreograph.repertoire.schema import (
    COUNTS,
    DATASETS,
    DELTA_RESTART,
    DOUBT,
    FORMAT,
    MOTIFS,
    NETS,
    NETWORKS_FORMAT,
    ROLES,
    VERSION,
    WITH_COUNTS,
)
from choreograph.zigzag import zigzag_decode

_TEXT_BYTES = 1 << 30  # read at once, at most


def read_networks(path: Path) -> tuple[dict[str, NetArrays], dict[str, Any]]:
    """Networks by name and their provenance, of `write_networks`; `RepertoireError` if it is no such file."""
    with opened(path, "networks") as file:
        if attribute(file, "format", str) != NETWORKS_FORMAT:
            raise RepertoireError(f"{path}: expected networks, got another kind of file")
        names = member_names(file, "nets", checks.MAX_NETS)
        nets = {name: _read_net(file, name, path) for name in names}
        provenance = from_json(attribute(file, "provenance", str), f"{path}: provenance")
        checks.check_provenance(provenance)
        return nets, provenance


class RepertoireFile:
    """An open repertoire file; arrays are read on demand.

    Raises `RepertoireError` if the file is missing, not HDF5, truncated, not a repertoire or of
    another version, or an array is not stored as `checks` expects. One that is shipped with the program is
    not searched for damaged heaps of texts, which takes longer than all else.
    """

    def __init__(self, path: Path, *, is_shipped: bool = False) -> None:
        self.path = Path(path)
        if self.path.is_dir():
            raise RepertoireError(f"{path}: expected a repertoire file, got a folder")
        if not self.path.exists():
            raise RepertoireError(
                f"{path}: expected a repertoire, got no such repertoire: make one with `choreograph build-db`"
            )
        if not is_shipped:
            self._check_heaps()
        with opened(self.path, "a repertoire") as file:
            version = self._read_version(file)
            self.has_motifs = "motifs" in file
            self.has_counts = version >= WITH_COUNTS
            self.has_doubt = self.has_counts and all(name in file for name in DOUBT)
            self.has_roles = all(name in file for name in ROLES)
            has = ((MOTIFS, self.has_motifs), (DOUBT, self.has_doubt), (ROLES, self.has_roles))
            optional = [name for names, is_there in has if is_there for name in names]
            stored = self._check_stored(file, layout_of(optional, version))
            self.density = attribute(file, "density", str)
            self.provenance = from_json(attribute(file, "provenance", str), f"{path}: provenance")
            checks.check_provenance(self.provenance)
            self.net_names = self._find_nets(file)
            self.shapes = {array.name: array.shape for array in stored}
            self._sizes = axis_sizes(self.shapes, version)

    def _check_heaps(self) -> None:
        with (
            damage_named(self.path, "a repertoire"),
            open(self.path, "rb") as file,
            mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data,
        ):
            checks.check_text_heaps(data)

    def _read_version(self, file: h5py.File) -> int:
        kind = file.attrs.get("format")
        if not isinstance(kind, str) or kind != FORMAT:
            got = f"{kind!r}"[:40].replace("\n", " ")
            raise RepertoireError(
                f"{self.path}: expected a repertoire, got an HDF5 file of another kind ({got})"
            )
        version = attribute(file, "version", int)
        if version not in range(1, VERSION + 1):
            raise RepertoireError(
                f"{self.path}: expected repertoire version 1 to {VERSION}, got {version}: made by another "
                "version of choreograph, build it again from its takes"
            )
        return version

    def _check_stored(self, file: h5py.File, layout: Mapping[str, tuple[str, str]]) -> list[StoredArray]:
        for group in dict.fromkeys(name.split("/")[0] for name in layout):
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
        return tuple(name for name in NETS if name in file["nets"])

    def read(self, name: str, part: slice = slice(None)) -> NDArray:
        """An array of the schema, or a slice of its first axis; strings as numpy str.

        Raises `RepertoireError` if it cannot be read or a value is not one that `checks` expects.
        """
        with opened(self.path, "a repertoire") as file:
            data = file[name]
            if (DATASETS | COUNTS | DOUBT | MOTIFS | ROLES)[name][0] == "s":
                return _read_text(data, part, self.path.stat().st_size)
            array = _read_quantised(name, data, part) if "step" in data.attrs else data[part]
            checks.check_values(name, array, self._sizes)
            return array

    def read_net(self, name: str) -> NetArrays:
        """A network's config and weights; `RepertoireError` if the file has none of that name."""
        if name not in self.net_names:
            known = ", ".join(self.net_names) or "none"
            raise RepertoireError(f"{self.path}: expected a network {name!r}, got a repertoire with {known}")
        with opened(self.path, "a repertoire") as file:
            return _read_net(file, name, self.path)


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
    # The first 16-bit files have whole integers, the next ones their first differences, and do not say so.
    absent: dict[str, Any] = {"order": np.int64("restart" in data.attrs), "restart": np.int64(DELTA_RESTART)}
    attributes: dict[str, Any] = {
        key: scalar(data, key) if key in data.attrs else absent.get(key)
        for key in ("step", "order", "restart", "folded")
    }
    checks.check_quantisation(name, attributes)
    restart, order = int(attributes["restart"]), int(attributes["order"])
    start, stop, _ = part.indices(len(data))
    first = start // restart * restart
    differences = data[first:stop]
    if attributes["folded"]:
        differences = zigzag_decode(differences)
    for row in range(0, len(differences), restart):
        block = differences[row : row + restart]
        for _ in range(order):
            np.cumsum(block, axis=0, dtype=np.int16, out=block)
    return (differences[start - first :] * attributes["step"]).astype(np.float32)


def _read_text(data: h5py.Dataset, part: slice, n_file_bytes: int) -> NDArray[np.str_]:
    """Rows of text, no more of it than the file holds: many rows may refer to the same long text in it."""
    first, stop, _ = part.indices(len(data))
    n_rows = max(1, _TEXT_BYTES // n_file_bytes)  # at once: none is longer than the file
    texts: list[str] = []
    for row in range(first, stop, n_rows):
        texts.extend(data.asstr()[row : min(row + n_rows, stop)])
        checks.check_text(data.name, texts, n_file_bytes)
    return np.array(texts, dtype=np.str_)


def _to_single(weight: NDArray) -> NDArray:
    return weight.astype(np.float32) if weight.dtype == np.float16 else weight
