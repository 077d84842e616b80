"""Converts takes and their features to the arrays of a repertoire file, and writes files."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from choreograph.core.errors import RepertoireError
from choreograph.core.files import atomic_path
from choreograph.core.timebase import CLIP_FRAMES, NET_FPS, SEGMENT_FRAMES, frames_to_seconds
from choreograph.library.derived import middle_starts, with_derived
from choreograph.library.schema import (
    DELTA_ORDER,
    DELTA_RESTART,
    DERIVED,
    FORMAT,
    HALF_PRECISION,
    MADE_WHEN_READ,
    NETS,
    NETWORKS_FORMAT,
    QUANTISATION_STEPS,
    VERSION,
    NetArrays,
    axis_sizes,
    delta_encode,
    layout_of,
    net_names_in,
    quantised,
)
from choreograph.library.store import JoinedRows, Rows
from choreograph.motion.motion import Take
from choreograph.nets.configs import STYLE_DIM


@dataclass(frozen=True, eq=False)
class Contents:
    """Everything in a repertoire file."""

    # By path: `DATASETS` without the provenance, and all or none of each group of `OPTIONAL`. Those of
    # `DERIVED` are computed when they are written, if they are not given.
    arrays: Mapping[str, Rows]
    density: str  # which tempo-density `body/density` holds: "analytic" or "learned"
    provenance: dict[str, Any]  # program version, seed, preset, losses, training and held-out songs
    nets: Mapping[str, NetArrays] = field(default_factory=dict)


# Takes and their features as arrays.


@dataclass(frozen=True, eq=False)
class MeasuredTake:
    """A take with its features. All arrays begin at the first frame."""

    take: Take  # on the repertoire's skeleton
    body_pos_m: NDArray[np.float32]  # (T, 21, 3) at 20 fps
    motion_beats_s: NDArray[np.float64]  # (Q,)


# Maps body positions (T, 21, 3) and first frames (N,) of segments to style vectors (N, 32).
EmbedMotion = Callable[[NDArray[np.float32], NDArray[np.int64]], NDArray[np.float32]]
# Maps a take to its tempo-density (T,) at 20 fps.
ClipDensity = Callable[[MeasuredTake], NDArray[np.float32]]


def clip_starts(n_frames: int) -> NDArray[np.int64]:
    """First frames of a take's clips at 20 fps, one every second, as long as 8 s remain."""
    return np.arange(0, max(0, n_frames - CLIP_FRAMES + 1), NET_FPS, dtype=np.int64)


def to_arrays(
    takes: Sequence[MeasuredTake],
    *,
    embed_motion: EmbedMotion | None,
    density: ClipDensity,
    checksums: Sequence[tuple[str, str, int]],
) -> dict[str, NDArray[Any]]:
    """All arrays of a repertoire file by path.

    Without `embed_motion`, style vectors are zeros. `checksums` are (path, sha256, index of the take).
    """
    skeleton = takes[0].take.motion.skeleton
    motions = [measured.take.motion for measured in takes]
    columns: dict[str, NDArray[Any]] = {
        "skeleton/names": np.array(skeleton.names),
        "skeleton/parents": skeleton.parents,
        "skeleton/offsets_m": skeleton.offsets_m,
        "skeleton/tip_parents": skeleton.tip_parents,
        "skeleton/tips_m": skeleton.tips_m,
        **({} if skeleton.roles is None else {"skeleton/roles": skeleton.role_numbers()}),
        "takes/name": np.array([m.take.name for m in takes]),
        "takes/song_name": np.array([m.take.song_name for m in takes]),
        "takes/notes": np.array(["; ".join(m.take.notes) for m in takes]),
        "takes/fps": np.array([motion.fps for motion in motions]),
        "motion/root_pos_m": np.concatenate([motion.root_pos_m for motion in motions]),
        "motion/local_quat": np.concatenate([motion.local_quat for motion in motions]),
        "body/pos_m": np.concatenate([m.body_pos_m for m in takes]),
        "body/density": np.concatenate([density(m) for m in takes]),
        "beats/motion_s": np.concatenate([m.motion_beats_s for m in takes]),
        "sources/path": np.array([path for path, _, _ in checksums], np.str_),
        "sources/sha256": np.array([digest for _, digest, _ in checksums], np.str_),
        "sources/take": np.array([take for _, _, take in checksums], np.int64),
    }
    for credit in ("genre", "performer", "licence", "source"):
        columns[f"takes/{credit}"] = np.array([getattr(m.take.credits, credit) for m in takes])
    lengths = {
        "motion": [motion.n_frames for motion in motions],
        "body": [len(m.body_pos_m) for m in takes],
        "beat": [len(m.motion_beats_s) for m in takes],
    }
    for name, counts in lengths.items():
        stops = np.cumsum(counts)
        columns[f"takes/{name}_start"] = stops - counts
        columns[f"takes/{name}_stop"] = stops
    return columns | _count_arrays([m.take for m in takes]) | _clip_arrays(takes, embed_motion)


def _count_arrays(takes: Sequence[Take]) -> dict[str, NDArray[Any]]:
    stops = np.cumsum([len(take.counts) for take in takes])
    figures = [(index, figure) for index, take in enumerate(takes) for figure in take.figures]
    uncertainty = [take.counts.uncertainty for take in takes]
    if any(len(of_take) for of_take in uncertainty):  # counts that no network estimated are certain
        known = [d if len(d) else np.zeros(len(t.counts)) for d, t in zip(uncertainty, takes, strict=True)]
        uncertainties = {"counts/doubt": np.concatenate(known)}
    else:
        uncertainties = {}
    return uncertainties | {
        "takes/count_start": stops - [len(take.counts) for take in takes],
        "takes/count_stop": stops,
        "takes/metre": np.array([take.counts.metre for take in takes]),
        "takes/counts_source": np.array([take.counts.source for take in takes]),
        "takes/counts_confidence": np.array([take.counts.confidence for take in takes]),
        "counts/time_s": np.concatenate([take.counts.times_s for take in takes]),
        "counts/number": np.concatenate([take.counts.numbers for take in takes]),
        "figures/take": np.array([index for index, _ in figures], np.int64),
        "figures/name": np.array([figure.name for _, figure in figures], np.str_),
        "figures/start_s": np.array([figure.start_s for _, figure in figures]),
        "figures/end_s": np.array([figure.end_s for _, figure in figures]),
        "figures/n_counts": np.array([figure.n_counts for _, figure in figures], np.int64),
    }


def _clip_arrays(takes: Sequence[MeasuredTake], embed_motion: EmbedMotion | None) -> dict[str, NDArray[Any]]:
    starts = [clip_starts(len(m.body_pos_m)) for m in takes]
    styles, counts = [], []
    for measured, first in zip(takes, starts, strict=True):
        middle = middle_starts(first)
        if embed_motion is None:
            styles.append(np.zeros((len(first), STYLE_DIM), np.float32))
        else:
            styles.append(embed_motion(measured.body_pos_m, middle))
        borders_s = frames_to_seconds([middle, middle + SEGMENT_FRAMES], NET_FPS)  # (2, n)
        counts.append(np.diff(np.searchsorted(measured.motion_beats_s, borders_s), axis=0)[0])
    return {
        "clips/take": np.repeat(np.arange(len(takes)), [len(s) for s in starts]),
        "clips/start_frame": np.concatenate(starts),
        "clips/style": np.concatenate(styles),
        "clips/beat_count": np.concatenate(counts).astype(np.float32),
    }


# Writing of repertoire files and of files of networks.


# Of HDF5's layouts. From this one on, headers and indices have checksums, too, and take less room.
_LIBVER = ("v110", "v110")
_MIN_GZIP_SIZE = 4096  # values. Compressing fewer saves nothing
_CHUNK_BYTES = 1 << 18  # of arrays that are read in long parts: 11 s of a body at 60 fps, unpacked in 2 ms
# Arrays of which a dance reads some rows here and there. They are not compressed, and HDF5 reads, and checks,
# as many bytes at once.
_BY_ROWS = {"body/pos_m": 1 << 15, "body/root_frame": 1 << 15, "body/sums": 1 << 13}
_BY_ROWS |= dict.fromkeys(("body/density", "body/speed_m_s", "body/heading_rad"), 1 << 12)


def write_repertoire(path: Path, contents: Contents, *, compress: bool = False) -> None:
    """Write all of `contents` to `path`, or nothing.

    Chunks of `JoinedRows` are copied as they are stored where they would be stored so again.
    `compress` quantises motion and networks to 16 bits (`schema.QUANTISATION_STEPS`) and leaves out body
    positions (`schema.MADE_WHEN_READ`), which reduces the file to about a ninth of the size.
    The bytes depend on the arguments alone. Raises `RepertoireError` if an array is missing or does not match
    the schema, and `ParameterError` if the folder does not exist.
    """
    _check(contents)
    arrays = with_derived(contents.arrays, compress=compress)
    with atomic_path(path) as temporary, h5py.File(temporary, "w", libver=_LIBVER, track_order=False) as file:
        file.attrs["format"] = np.bytes_(FORMAT)
        file.attrs["version"] = VERSION
        file.attrs["density"] = np.bytes_(contents.density)
        arrays["provenance"] = np.array([json.dumps(contents.provenance, sort_keys=True)])
        for name, (kind, *_) in layout_of(arrays).items():
            if compress and name in MADE_WHEN_READ:
                continue
            array = arrays[name]
            if kind == "s":
                write_texts(file, name, np.asarray(array))
                continue
            kind = "f2" if compress and name in HALF_PRECISION else kind
            step = QUANTISATION_STEPS.get(name) if compress else None
            if not isinstance(array, JoinedRows) or array.size <= _MIN_GZIP_SIZE:
                array = np.asarray(array).astype(kind)
            _write_numbers(file, name, array, step, compress=compress)
        _write_nets(file, contents.nets, compress=compress)


def write_networks(path: Path, nets: Mapping[str, NetArrays], provenance: Mapping[str, Any]) -> None:
    """Write networks alone to `path`, in half precision, as in the package's pretrained sets.

    The bytes depend on the arguments alone. Raises `ParameterError` if the folder does not exist.
    """
    with atomic_path(path) as temporary, h5py.File(temporary, "w", libver=_LIBVER, track_order=False) as file:
        file.attrs["format"] = np.bytes_(NETWORKS_FORMAT)
        write_texts(file, "provenance", np.array([json.dumps(provenance, sort_keys=True)]))
        _write_nets(file, nets, compress=True)


def write_texts(file: h5py.Group, name: str, texts: NDArray[Any]) -> None:
    """Write texts as bytes, each ended by a zero. Zeros inside of texts are left out."""
    content = "".join(f"{str(text).replace(chr(0), '')}\0" for text in texts).encode()
    stored = np.frombuffer(content, np.uint8)
    options = _gzip(9) if stored.size > _MIN_GZIP_SIZE else {}
    _create(file, name, stored, **options)


def _check(contents: Contents) -> None:
    expected = [name for name in layout_of(contents.arrays) if name not in (*DERIVED, "provenance")]
    missing = [name for name in expected if name not in contents.arrays]
    if missing:
        raise RepertoireError(f"expected all arrays of a repertoire, got no {', '.join(missing)}")
    axis_sizes({name: np.shape(contents.arrays[name]) for name in expected})
    unknown = set(contents.nets) - set(net_names_in(contents.nets))
    if unknown:
        raise RepertoireError(f"expected networks among {', '.join(NETS)}, got {', '.join(sorted(unknown))}")


def _write_nets(file: h5py.File, nets: Mapping[str, NetArrays], *, compress: bool) -> None:
    for name, net in sorted(nets.items()):
        group = file.create_group(f"nets/{name}")
        group.attrs["config"] = np.bytes_(json.dumps(net.config, sort_keys=True))
        for weight, array in sorted(net.weights.items()):
            array = np.asarray(array, np.float16) if compress else np.asarray(array)
            options = _gzip(9) if compress and array.size > _MIN_GZIP_SIZE else {}
            _create(group, weight, array, **options)


def _gzip(level: int) -> dict[str, Any]:
    return {"compression": "gzip", "compression_opts": level, "shuffle": True}


def _create(
    file: h5py.Group,
    name: str,
    array: Rows,
    encode: Callable[[NDArray[Any]], NDArray[Any]] = lambda rows: rows,
    **options: Any,
) -> h5py.Dataset:
    """Write an encoded array with a checksum for each chunk, which HDF5 verifies when it reads it."""
    if array.size == 0 or array.shape == ():  # there is no chunk
        return file.create_dataset(name, data=encode(np.asarray(array)), track_times=False)
    if "chunks" not in options and "compression" not in options:
        options["chunks"] = _chunk(array, _CHUNK_BYTES)
    options |= {"track_times": False, "fletcher32": True}
    if not isinstance(array, JoinedRows):
        return file.create_dataset(name, data=encode(array), **options)
    dtype = encode(np.zeros((1, *array.shape[1:]), array.dtype)).dtype
    data = file.create_dataset(name, array.shape, dtype, **options)
    copied = array.file.copy_chunks(array.name, data, array.n_kept)
    for start, rows in array.blocks(copied, data.chunks[0]):
        data[start : start + len(rows)] = encode(rows)
    return data


def _chunk(array: Rows, n_bytes: int) -> tuple[int, ...]:
    """The shape of chunks of whole rows with at most this size, if a row is not larger."""
    n_rows = max(1, n_bytes * len(array) // array.nbytes)
    return (min(len(array), n_rows), *array.shape[1:])


def _fits(array: Rows, step: float) -> bool:
    """Whether 16 bits hold all multiples of `step`, which they do for rows that are stored so already."""
    if not isinstance(array, JoinedRows):
        return quantised(array, step) is not None
    if array.name in array.file.quantised:
        return all(quantised(part, step) is not None for part in array.new_parts)
    return all(quantised(rows, step) is not None for _, rows in array.blocks(0, 1))


def _quantised_rows(rows: NDArray[Any], step: float) -> NDArray[np.uint16]:
    """Rows, the first of which is one where the encoding restarts, as a compressed file stores them."""
    integers = quantised(rows, step)
    assert integers is not None
    return delta_encode(integers)


def _write_numbers(file: h5py.File, name: str, array: Rows, step: float | None, *, compress: bool) -> None:
    """Write an array, quantised to multiples of `step` if it is given and 16 bits hold all values."""
    if step is not None and _fits(array, step):
        # One column per chunk: values are similar in time, but not between joints, and the file is a fifth
        # smaller. All columns of 8,192 frames are read together (`RepertoireFile.rows`), in 10 ms.
        chunk = (min(len(array), DELTA_RESTART), *(1,) * (len(array.shape) - 1))
        options = {**_gzip(9), "chunks": chunk} if array.size > _MIN_GZIP_SIZE else {}
        data = _create(file, name, array, partial(_quantised_rows, step=step), **options)
        data.flush()  # chunks before attributes, as where they are copied
        data.attrs.update(step=step, order=DELTA_ORDER, restart=DELTA_RESTART, folded=True)
        return
    if array.size <= _MIN_GZIP_SIZE:
        options = {}
    elif name in _BY_ROWS and not compress:
        options = {"chunks": _chunk(array, _BY_ROWS[name])}
    else:
        options = {**_gzip(9 if compress else 1), "chunks": _chunk(array, _CHUNK_BYTES)}
    _create(file, name, array, **options)
