"""Reading and writing repertoire files; the only module that uses h5py."""

from __future__ import annotations

import json
from collections.abc import Container, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from choreograph.errors import RepertoireError
from choreograph.files import atomic_path
from choreograph.repertoire.schema import (
    ATTRIBUTES,
    COUNTS,
    DATASETS,
    DELTA_ORDER,
    DELTA_RESTART,
    DOUBT,
    FORMAT,
    HALF_PRECISION,
    MOTIFS,
    NETS,
    NETWORKS_FORMAT,
    QUANTISATION_STEPS,
    VERSION,
    WITH_COUNTS,
)
from choreograph.zigzag import zigzag_decode, zigzag_encode

_MIN_GZIP_SIZE = 4096  # values: compressing fewer saves nothing


@dataclass(frozen=True, eq=False)
class NetArrays:
    """One network as plain data: its config and weights."""

    config: dict[str, Any]
    weights: dict[str, NDArray]


@dataclass(frozen=True, eq=False)
class Contents:
    """Everything in a repertoire file."""

    # By path: all of `schema.DATASETS` and `COUNTS`, all or none of `MOTIFS` and of `DOUBT`.
    arrays: Mapping[str, NDArray]
    density: str  # which tempo-density `body/density` holds: "analytic" or "learned"
    provenance: dict[str, Any]  # program version, seed, preset, losses, training and held-out songs
    nets: Mapping[str, NetArrays] = field(default_factory=dict)


def write_repertoire(path: Path, contents: Contents, *, compress: bool = False) -> None:
    """Write all of `contents` to `path`, or nothing.

    `compress` quantises motion and networks to 16 bits (`schema.QUANTISATION_STEPS`): a quarter of the
    size. The bytes depend on the arguments alone. Raises `RepertoireError` if an array is missing or does
    not match the schema, `ParameterError` if the folder does not exist.
    """
    _check(contents)
    with atomic_path(path) as temporary, h5py.File(temporary, "w", track_order=False) as file:
        file.attrs["format"] = FORMAT
        file.attrs["version"] = VERSION
        file.attrs["density"] = contents.density
        file.attrs["provenance"] = json.dumps(contents.provenance, sort_keys=True)
        for name, (kind, _) in _layout(contents.arrays).items():
            array = np.asarray(contents.arrays[name])
            if kind == "s":
                array = np.array([str(text) for text in array], dtype=object)
                file.create_dataset(name, data=array, dtype=h5py.string_dtype(), track_times=False)
                continue
            kind = "f2" if compress and name in HALF_PRECISION else kind
            step = QUANTISATION_STEPS.get(name) if compress else None
            _write_numbers(file, name, array.astype(kind), step)
        _write_nets(file, contents.nets, compress=compress)


def write_networks(path: Path, nets: Mapping[str, NetArrays], provenance: Mapping[str, Any]) -> None:
    """Write networks alone to `path`, in half precision: what the package ships as pretrained.

    The bytes depend on the arguments alone. Raises `ParameterError` if the folder does not exist.
    """
    with atomic_path(path) as temporary, h5py.File(temporary, "w", track_order=False) as file:
        file.attrs["format"] = NETWORKS_FORMAT
        file.attrs["provenance"] = json.dumps(provenance, sort_keys=True)
        _write_nets(file, nets, compress=True)


def read_networks(path: Path) -> tuple[dict[str, NetArrays], dict[str, Any]]:
    """Networks by name and their provenance, of `write_networks`; `RepertoireError` if it is no such file."""
    try:
        with h5py.File(path, "r") as file:
            if file.attrs.get("format") != NETWORKS_FORMAT:
                raise RepertoireError(f"{path}: expected networks, got another kind of file")
            nets = {name: _read_net(file, name, path) for name in file["nets"]}
            return nets, _from_json(file.attrs["provenance"], f"{path}: provenance")
    except (OSError, KeyError) as error:
        raise RepertoireError(f"{path}: expected networks (HDF5), could not read them: damaged") from error


def _write_nets(file: h5py.File, nets: Mapping[str, NetArrays], *, compress: bool) -> None:
    for name, net in sorted(nets.items()):
        group = file.create_group(f"nets/{name}")
        group.attrs["config"] = json.dumps(net.config, sort_keys=True)
        for weight, array in sorted(net.weights.items()):
            array = np.asarray(array, np.float16) if compress else np.asarray(array)
            options = _gzip(9) if compress and array.size > _MIN_GZIP_SIZE else {}
            group.create_dataset(weight, data=array, track_times=False, **options)


def _read_net(file: h5py.File, name: str, path: Path) -> NetArrays:
    group = file[f"nets/{name}"]
    weights = {weight: _to_single(group[weight][()]) for weight in group}
    return NetArrays(_from_json(group.attrs["config"], f"{path}: the config of network {name}"), weights)


def _gzip(level: int) -> dict[str, Any]:
    return {"compression": "gzip", "compression_opts": level, "shuffle": True}


def _write_numbers(file: h5py.File, name: str, array: NDArray, step: float | None) -> None:
    """Write an array, quantised to multiples of `step` if it is given and 16 bits hold all values."""
    options = _gzip(1) if array.size > _MIN_GZIP_SIZE else {}
    if step is None or np.abs(array).max(initial=0.0) > np.iinfo(np.int16).max * step:
        file.create_dataset(name, data=array, track_times=False, **options)
        return
    if options:
        # One column per chunk: values are similar in time, but not between joints.
        chunk = (min(len(array), DELTA_RESTART), *(1,) * (array.ndim - 1))
        options = {**_gzip(9), "chunks": chunk}
    integers = np.rint(array / step).astype(np.int16)
    differences = integers
    for _ in range(DELTA_ORDER):
        deltas = np.diff(differences, axis=0, prepend=np.zeros_like(differences[:1]))
        deltas[::DELTA_RESTART] = differences[::DELTA_RESTART]
        differences = deltas
    data = file.create_dataset(name, data=zigzag_encode(differences), track_times=False, **options)
    data.attrs.update(step=step, order=DELTA_ORDER, restart=DELTA_RESTART, folded=True)


def _read_quantised(data: h5py.Dataset, part: slice) -> NDArray[np.float32]:
    # The first 16-bit files have whole integers, the next ones their first differences, and do not say so.
    restart = int(data.attrs.get("restart", DELTA_RESTART))
    order = int(data.attrs.get("order", 1 if "restart" in data.attrs else 0))
    start, stop, _ = part.indices(len(data))
    first = start // restart * restart
    differences = data[first:stop]
    if data.attrs.get("folded", False):
        differences = zigzag_decode(differences)
    for row in range(0, len(differences), restart):
        block = differences[row : row + restart]
        for _ in range(order):
            np.cumsum(block, axis=0, dtype=np.int16, out=block)
    return (differences[start - first :] * data.attrs["step"]).astype(np.float32)


def _layout(names: Container[str], version: int = VERSION) -> dict[str, tuple[str, str]]:
    """The datasets of a file with these names: all of `schema.MOTIFS` or `DOUBT` if it has any of them."""
    layout = DATASETS | (COUNTS if version >= WITH_COUNTS else {})
    for optional in (DOUBT, MOTIFS):
        if any(name in names for name in optional):
            layout |= optional
    return layout


def _check(contents: Contents) -> None:
    layout = _layout(contents.arrays)
    missing = [name for name in layout if name not in contents.arrays]
    if missing:
        raise RepertoireError(f"expected all arrays of a repertoire, got no {', '.join(missing)}")
    mismatch = _shape_mismatch({name: np.shape(contents.arrays[name]) for name in layout})
    if mismatch:
        raise RepertoireError(mismatch)
    unknown = set(contents.nets) - set(NETS)
    if unknown:
        raise RepertoireError(f"expected networks among {', '.join(NETS)}, got {', '.join(sorted(unknown))}")


def _shape_mismatch(shapes: Mapping[str, tuple[int, ...]], version: int = VERSION) -> str:
    """A message on the first shape that contradicts the schema or the arrays before it; empty if none."""
    sizes: dict[str, int] = {}
    for name, (_, axes) in _layout(shapes, version).items():
        letters, shape = axes.split(), shapes[name]
        sizes |= {letter: int(letter) for letter in letters if letter.isdigit()}
        if len(shape) != len(letters) or any(
            sizes.setdefault(letter, n) != n for letter, n in zip(letters, shape, strict=True)
        ):
            known = ", ".join(f"{letter} = {sizes[letter]}" for letter in letters if letter in sizes)
            return f"{name}: expected ({axes}) with {known}, got {shape}"
    return ""


class RepertoireFile:
    """An open repertoire file; arrays are read on demand.

    Raises `RepertoireError` if the file is missing, not HDF5, truncated, not a repertoire or of
    another version.
    """

    def __init__(self, path: Path) -> None:
        self.path = Path(path)
        if self.path.is_dir():
            raise RepertoireError(f"{path}: expected a repertoire file, got a folder")
        if not self.path.exists():
            raise RepertoireError(f"{path}: no such repertoire: make one with `choreograph build-db`")
        with self._opened() as file:
            kind, version = file.attrs.get("format"), file.attrs.get("version")
            if kind != FORMAT:
                raise RepertoireError(
                    f"{path}: expected a repertoire, got an HDF5 file of another kind ({kind!r})"
                )
            if version not in range(1, VERSION + 1):
                raise RepertoireError(
                    f"{path}: expected repertoire version 1 to {VERSION}, got {version}: made by another "
                    "version of choreograph, build it again from its takes"
                )
            self.has_motifs = "motifs" in file
            self.has_counts = version >= WITH_COUNTS
            self.has_doubt = self.has_counts and all(name in file for name in DOUBT)
            optional = [*(MOTIFS if self.has_motifs else ()), *(DOUBT if self.has_doubt else ())]
            layout = _layout(optional, version)
            missing = [name for name in layout if not isinstance(file.get(name), h5py.Dataset)]
            missing += [name for name in ATTRIBUTES if name not in file.attrs]
            if missing:
                raise RepertoireError(f"{path}: the repertoire has no {', '.join(missing)}: a damaged file")
            self.density = str(file.attrs["density"])
            self.provenance = _from_json(file.attrs["provenance"], f"{path}: provenance")
            self.net_names = tuple(file["nets"]) if "nets" in file else ()
            self.shapes: dict[str, tuple[int, ...]] = {name: file[name].shape for name in layout}
        mismatch = _shape_mismatch(self.shapes, version)
        if mismatch:
            raise RepertoireError(f"{path}: {mismatch}: a damaged file")

    @contextmanager
    def _opened(self):
        try:
            with h5py.File(self.path, "r") as file:
                yield file
        except (OSError, KeyError, RuntimeError) as error:
            reason = str(error).splitlines()[0][:120]
            raise RepertoireError(
                f"{self.path}: expected a repertoire (HDF5), could not read it ({reason}): truncated or "
                "not made by choreograph"
            ) from error

    def read(self, name: str, part: slice = slice(None)) -> NDArray:
        """An array of the schema, or a slice of its first axis; strings as numpy str."""
        with self._opened() as file:
            data = file[name]
            if (DATASETS | COUNTS | DOUBT | MOTIFS)[name][0] == "s":
                return np.array(data.asstr()[part], dtype=np.str_)
            return _read_quantised(data, part) if "step" in data.attrs else data[part]

    def read_net(self, name: str) -> NetArrays:
        """A network's config and weights; `RepertoireError` if the file has none of that name."""
        if name not in self.net_names:
            known = ", ".join(self.net_names) or "none"
            raise RepertoireError(f"{self.path}: expected a network {name!r}, got a repertoire with {known}")
        with self._opened() as file:
            return _read_net(file, name, self.path)


def _to_single(weight: NDArray) -> NDArray:
    return weight.astype(np.float32) if weight.dtype == np.float16 else weight


def _from_json(text: str, what: str) -> dict[str, Any]:
    try:
        data = json.loads(text)
    except (TypeError, ValueError) as error:
        raise RepertoireError(f"{what}: expected JSON: a damaged file") from error
    if not isinstance(data, dict):
        raise RepertoireError(f"{what}: expected a JSON object: a damaged file")
    return data
