"""Repertoire files and files of networks, written: all of one, or nothing."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from choreograph.errors import RepertoireError
from choreograph.files import atomic_path
from choreograph.repertoire.layout import Contents, NetArrays, axis_sizes, layout_of
from choreograph.repertoire.schema import (
    DELTA_ORDER,
    DELTA_RESTART,
    FORMAT,
    HALF_PRECISION,
    NETS,
    NETWORKS_FORMAT,
    QUANTISATION_STEPS,
    VERSION,
)
from choreograph.zigzag import zigzag_encode

_MIN_GZIP_SIZE = 4096  # values: compressing fewer saves nothing


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
        for name, (kind, _) in layout_of(contents.arrays).items():
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


def _check(contents: Contents) -> None:
    expected = layout_of(contents.arrays)
    missing = [name for name in expected if name not in contents.arrays]
    if missing:
        raise RepertoireError(f"expected all arrays of a repertoire, got no {', '.join(missing)}")
    axis_sizes({name: np.shape(contents.arrays[name]) for name in expected})
    unknown = set(contents.nets) - set(NETS)
    if unknown:
        raise RepertoireError(f"expected networks among {', '.join(NETS)}, got {', '.join(sorted(unknown))}")


def _write_nets(file: h5py.File, nets: Mapping[str, NetArrays], *, compress: bool) -> None:
    for name, net in sorted(nets.items()):
        group = file.create_group(f"nets/{name}")
        group.attrs["config"] = json.dumps(net.config, sort_keys=True)
        for weight, array in sorted(net.weights.items()):
            array = np.asarray(array, np.float16) if compress else np.asarray(array)
            options = _gzip(9) if compress and array.size > _MIN_GZIP_SIZE else {}
            group.create_dataset(weight, data=array, track_times=False, **options)


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
