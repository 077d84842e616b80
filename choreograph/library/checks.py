"""Checks of repertoire files, which may come from untrusted sources.

How arrays are stored is checked before any of them is read. Values are checked when they are read, and then
the relations between arrays. Messages do not contain the name of the file, which `store` adds.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.core.errors import RepertoireError
from choreograph.core.timebase import CLIP_FRAMES
from choreograph.library.schema import DELTA_ORDER, DELTA_RESTART, HALF_PRECISION, QUANTISED
from choreograph.library.words import SUM_TOLERANCE

# Limits of stored arrays. Files of this program are 4 times as large when they are unpacked, and a dance
# holds several copies of some arrays.
FILTERS = (1, 2, 3)  # HDF5's numbers of deflate, shuffle and Fletcher's checksum
FREE_BYTES = 1 << 26  # that may be unpacked from a file of any size
UNPACKED_RATIO = 16  # largest ratio of all arrays to the file beyond that
DEFLATE_RATIO = 1032  # the highest that deflate reaches. A file that claims more is damaged
MAX_CHUNK_BYTES = 1 << 24
MAX_WEIGHTS = 4096  # arrays of a network
MAX_NETS = 64
WEIGHTS = "weights"  # the kind of a network's arrays: see `StoredArray`
_WEIGHT_DTYPES = tuple(np.dtype(kind) for kind in ("f2", "f4", "f8", "i8"))
_QUANTISED = (np.dtype("i2"), np.dtype("u2"))

_FAR_M = 1e6
_LONG_S = 1e7
_COUNTED = 1 << 31
# Lowest and highest value in an array. A letter stands for the length of that axis, or for its last index
# after "<". No value is NaN or infinite.
VALUES: dict[str, tuple[float, float | str]] = {
    "skeleton/parents": (-1, "<J"),
    "skeleton/offsets_m": (-_FAR_M, _FAR_M),
    "skeleton/tip_parents": (0, "<J"),
    "skeleton/tips_m": (-_FAR_M, _FAR_M),
    "skeleton/roles": (-1, 23),
    "takes/fps": (1e-3, 1000),
    "takes/motion_start": (0, "M"),
    "takes/motion_stop": (0, "M"),
    "takes/body_start": (0, "B"),
    "takes/body_stop": (0, "B"),
    "takes/beat_start": (0, "Q"),
    "takes/beat_stop": (0, "Q"),
    "takes/count_start": (0, "U"),
    "takes/count_stop": (0, "U"),
    "takes/metre": (0, 12),
    "takes/counts_confidence": (0, 1),
    "motion/root_pos_m": (-_FAR_M, _FAR_M),
    "motion/local_quat": (-12, 12),
    "body/pos_m": (-_FAR_M, _FAR_M),
    "body/density": (-_FAR_M, _FAR_M),
    "body/root_frame": (-_FAR_M * 100, _FAR_M * 100),
    "body/speed_m_s": (0, _FAR_M * 100),
    "body/heading_rad": (-_FAR_M, _FAR_M),
    "body/sums": (0, _FAR_M * _FAR_M),
    "takes/front_rad": (-4, 4),
    "takes/centre_m": (-_FAR_M, _FAR_M),
    "takes/tempo_bpm": (0, _FAR_M * 100),
    "clips/steps": (0, _FAR_M),
    "clips/step_rank": (0, 1),
    "clips/liveliness_rank": (0, 1),
    "genres/scale": (0, _FAR_M),
    "genres/size_start": (0, "Z"),
    "genres/size_stop": (0, "Z"),
    "genres/sizes": (0, _FAR_M * _FAR_M),
    "beats/motion_s": (0, _LONG_S),
    "clips/take": (0, "<X"),
    "clips/start_frame": (0, "B"),
    "clips/style": (-_FAR_M, _FAR_M),
    "clips/beat_count": (0, _FAR_M),
    "sources/take": (0, "<X"),
    "counts/time_s": (0, _LONG_S),
    "counts/number": (0, 12),
    "counts/doubt": (0, 1),
    "figures/take": (0, "<X"),
    "figures/start_s": (-_LONG_S, _LONG_S),
    "figures/end_s": (-_LONG_S, _LONG_S),
    "figures/n_counts": (0, _COUNTED),
    "motifs/embeddings": (-_FAR_M, _FAR_M),
    "motifs/words": (0, "<W"),
    "motifs/counts": (1, "W"),
    "motifs/word_take": (0, "<X"),
    "motifs/word_start_s": (0, _LONG_S),
    "motifs/word_end_s": (0, _LONG_S),
    "motifs/word_motif": (0, "<K"),
    "motifs/signatures": (0, 1.001),
    "motifs/transitions": (0, 1.001),
}
_SHARES = ("motifs/signatures", "motifs/transitions")  # whose rows sum to 1

_STEPS = (1e-9, 1.0)  # of a quantised array, lowest and highest
# Its other attributes, which name the one encoding.
ENCODING = {"order": DELTA_ORDER, "restart": DELTA_RESTART, "folded": True}


@dataclass(frozen=True)
class StoredArray:
    """How an array is stored in a file, according to its header."""

    name: str
    dtype: np.dtype
    is_quantised: bool
    shape: tuple[int, ...]
    chunk: tuple[int, ...]  # () if it is stored in one piece
    filters: tuple[int, ...]
    n_stored_bytes: int
    is_elsewhere: bool  # in another file, or composed of other arrays

    @property
    def n_bytes(self) -> int:
        """Size when unpacked."""
        return _size(self.shape) * self.dtype.itemsize


def check_stored(array: StoredArray, kind: str) -> None:
    """Raise `RepertoireError` unless an array is complete and of a kind of the schema, or `WEIGHTS`."""
    dtypes = _stored_dtypes(array, kind)
    expected = " or ".join(str(dtype) for dtype in dtypes)
    _expect(array.dtype in dtypes, f"{array.name}: expected {expected}, got {array.dtype}")
    _expect(kind != "s" or len(array.shape) == 1, f"{array.name}: expected bytes of texts, got {array.shape}")
    _expect(not array.is_elsewhere, f"{array.name}: expected it in this file, got a part of another place")
    unknown = set(array.filters) - set(FILTERS)
    _expect(
        not unknown, f"{array.name}: expected no compression or deflate, got HDF5 filters {array.filters}"
    )
    n_chunk_bytes = _size(array.chunk) * array.dtype.itemsize
    _expect(
        n_chunk_bytes <= MAX_CHUNK_BYTES,
        f"{array.name}: expected chunks of at most {MAX_CHUNK_BYTES:,} bytes, got {n_chunk_bytes:,}",
    )
    packed = DEFLATE_RATIO if array.filters else 1
    _expect(
        array.n_bytes <= packed * array.n_stored_bytes,
        f"{array.name}: expected all of {array.shape}, got {array.n_stored_bytes:,} bytes of it",
    )


def check_size(arrays: Iterable[StoredArray], n_file_bytes: int) -> None:
    """Raise `RepertoireError` if the arrays are larger than compression can explain for the file size."""
    n_bytes, limit = sum(array.n_bytes for array in arrays), FREE_BYTES + UNPACKED_RATIO * n_file_bytes
    _expect(n_bytes <= limit, f"expected at most {limit:,} bytes unpacked, got {n_bytes:,}")


def _stored_dtypes(array: StoredArray, kind: str) -> tuple[np.dtype, ...]:
    """The dtypes that an array may be stored in."""
    if kind == WEIGHTS:
        return _WEIGHT_DTYPES
    if kind == "s":
        return (np.dtype("u1"),)
    if array.is_quantised and array.name in QUANTISED:
        return _QUANTISED
    return (np.dtype(kind), *((np.dtype("f2"),) if array.name in HALF_PRECISION else ()))


def check_text(name: str, texts: Sequence[str]) -> None:
    """Raise `RepertoireError` if rows of text are too long for an array, in which each is as long."""
    longest = max(map(len, texts), default=0)
    _expect(
        4 * longest * len(texts) <= FREE_BYTES + UNPACKED_RATIO * sum(map(len, texts)),
        f"{name}: expected names and notes, got {len(texts)} texts of up to {longest:,} characters",
    )


def check_finite(name: str, array: NDArray[Any]) -> None:
    """Raise `RepertoireError` if an array has NaN or infinity."""
    _expect(bool(np.isfinite(array).all()), f"{name}: expected finite numbers, got NaN or infinity")


def check_values(name: str, array: NDArray[Any], sizes: Mapping[str, int]) -> None:
    """Raise `RepertoireError` if a number of an array is outside `VALUES`, or shares do not sum to 1.

    `sizes` are those of the axes.
    """
    if name not in VALUES or array.size == 0:
        return
    low, high = VALUES[name]
    highest = sizes[high.lstrip("<")] - high.startswith("<") if isinstance(high, str) else high
    least, most = float(array.min()), float(array.max())  # NaN if there is one
    _expect(
        least >= low and most <= highest,
        f"{name}: expected values from {low:g} to {highest:g}, got {least:g} to {most:g}",
    )
    if name in _SHARES:
        is_one = np.abs(array.sum(axis=-1) - 1.0) <= SUM_TOLERANCE
        _expect(bool(is_one.all()), f"{name}: expected shares that sum to 1, got others")


def check_quantisation(name: str, attributes: Mapping[str, Any]) -> None:
    """Raise `RepertoireError` if the step of an array is not valid, or its encoding is not `ENCODING`."""
    (low, high), step = _STEPS, attributes.get("step")
    _expect(
        isinstance(step, np.floating) and bool(low <= step <= high),
        f"{name}: expected step from {low:g} to {high:g}, got {_short(step)}",
    )
    for key, expected in ENCODING.items():
        value = attributes.get(key)
        _expect(
            isinstance(value, np.integer | np.bool_) and bool(value == expected),
            f"{name}: expected {key} {expected}, got {_short(value)}",
        )


def check_parts(name: str, start: NDArray[Any], stop: NDArray[Any], length: int, *, shortest: int) -> None:
    """Raise `RepertoireError` unless the parts [start, stop) of takes cover an array in order."""
    ends = np.concatenate([[0], stop])
    _expect(
        len(stop) > 0
        and bool((start == ends[:-1]).all() and ends[-1] == length and (stop - start >= shortest).all()),
        f"takes/{name}_start and _stop: expected the {length} rows take by take, {shortest} or more each, "
        "got gaps or overlaps",
    )


def check_provenance(provenance: Mapping[str, Any]) -> None:
    """Raise `RepertoireError` unless the entries of a file's provenance that are used have their types."""
    songs, weight = provenance.get("trained_on", []), provenance.get("selection_beat_weight", 0.0)
    _expect(
        isinstance(songs, list) and all(isinstance(song, str) for song in songs),
        f"provenance: expected a list of songs in trained_on, got {_short(songs)}",
    )
    _expect(
        isinstance(weight, int | float) and 0 <= weight <= _FAR_M,
        f"provenance: expected a selection_beat_weight of 0 or more, got {_short(weight)}",
    )


def check_clips(take: NDArray[Any], start_frame: NDArray[Any], n_frames: NDArray[Any]) -> None:
    """Raise `RepertoireError` unless clips (N,) lie inside their takes, of `n_frames` (X,) at 20 fps."""
    _expect(
        bool((start_frame + CLIP_FRAMES <= n_frames[take]).all()),
        f"clips: expected {CLIP_FRAMES} frames of a take each, got clips beyond the ends of takes",
    )


def check_counts(name: str, times_s: NDArray[Any], numbers: NDArray[Any], metre: int) -> None:
    """Raise `RepertoireError` unless counts (Q,) of a take increase and are numbered in bars of the metre."""
    lowest = 1 if metre else 0
    _expect(
        bool((np.diff(times_s) > 0).all() and ((numbers >= lowest) & (numbers <= metre)).all()),
        f"counts of {name!r}: expected increasing times, and numbers from {lowest} to {metre}, got others",
    )


def _size(shape: tuple[int, ...]) -> int:
    """Number of elements. Python's integers do not overflow for any shape in a header."""
    size = 1
    for length in shape:
        size *= length
    return size


def _short(value: Any) -> str:
    return repr(value).replace("\n", " ")[:60]


def _expect(condition: bool, message: str) -> None:
    if not condition:
        raise RepertoireError(message)
