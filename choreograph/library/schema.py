"""The layout of a repertoire file, version 1, as `data_schema/repertoire.json` documents it, and its checks.

Takes are concatenated along the first axis of each array. The table of takes holds their first and last
rows. Clips are pairs of take and start frame, not copies.

Files may come from untrusted sources. How arrays are stored is checked before any of them is read. Values are
checked when they are read, and then the relations between arrays. Messages do not contain the name of the
file, which `store` adds.
"""

from __future__ import annotations

import math
import re
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from choreograph.core.errors import RepertoireError
from choreograph.core.timebase import CLIP_FRAMES

FORMAT = "choreograph-repertoire"
NETWORKS_FORMAT = "choreograph-networks"  # a file with networks of `NETS` and `provenance` alone
VERSION = 1

ATTRIBUTES = ("format", "version", "density")  # of the file itself
_FAR_M = 1e6
_LONG_S = 1e7
_COUNTED = 1 << 31


class Dataset(NamedTuple):
    """How an array is stored, and the range of its values. No value is NaN or infinite."""

    kind: str  # s (UTF-8 texts), f4, f8, i4 or i8, as in h5py
    axes: str  # letters and lengths of its axes
    low: float = -np.inf
    high: float | str = np.inf  # a letter is the length of that axis, and "<" with a letter its last index


# By path. The axes are J joint, E end site, X take, M stored motion frame, B 20 fps frame, Q motion beat,
# N clip, C checksum, U count, F figure, H genre, Z second of a genre.
#
# Texts are stored as bytes, each text ended by a zero. HDF5's own texts of any length lie in heaps without
# checksums. Every array of numbers and of texts has Fletcher's checksums, which HDF5 verifies as it reads.
DERIVED: dict[str, Dataset] = {  # from the other arrays, see `library.derived`
    "takes/front_rad": Dataset("f8", "X", -4, 4),
    "takes/centre_m": Dataset("f8", "X 3", -_FAR_M, _FAR_M),
    "takes/tempo_bpm": Dataset("f8", "X", 0, _FAR_M * 100),
    "body/speed_m_s": Dataset("f4", "B", 0, _FAR_M * 100),
    "body/heading_rad": Dataset("f4", "B", -_FAR_M, _FAR_M),
    "body/sums": Dataset("f8", "B 2", 0, _FAR_M * _FAR_M),
    "clips/steps": Dataset("i4", "N", 0, _FAR_M),
    "clips/step_rank": Dataset("f4", "N", 0, 1),
    "clips/liveliness_rank": Dataset("f4", "N", 0, 1),
    "genres/name": Dataset("s", "H"),
    "genres/scale": Dataset("f8", "H 2", 0, _FAR_M),
    "genres/size_start": Dataset("i8", "H", 0, "Z"),
    "genres/size_stop": Dataset("i8", "H", 0, "Z"),
    "genres/sizes": Dataset("f8", "Z", 0, _FAR_M * _FAR_M),
}
DATASETS: dict[str, Dataset] = {
    "skeleton/names": Dataset("s", "J"),
    "skeleton/parents": Dataset("i8", "J", -1, "<J"),
    "skeleton/offsets_m": Dataset("f8", "J 3", -_FAR_M, _FAR_M),
    "skeleton/tip_parents": Dataset("i8", "E", 0, "<J"),
    "skeleton/tips_m": Dataset("f8", "E 3", -_FAR_M, _FAR_M),
    "takes/name": Dataset("s", "X"),
    "takes/song_name": Dataset("s", "X"),
    "takes/genre": Dataset("s", "X"),
    "takes/performer": Dataset("s", "X"),
    "takes/licence": Dataset("s", "X"),
    "takes/source": Dataset("s", "X"),
    "takes/notes": Dataset("s", "X"),
    "takes/fps": Dataset("f8", "X", 1e-3, 1000),
    "takes/motion_start": Dataset("i8", "X", 0, "M"),
    "takes/motion_stop": Dataset("i8", "X", 0, "M"),
    "takes/body_start": Dataset("i8", "X", 0, "B"),
    "takes/body_stop": Dataset("i8", "X", 0, "B"),
    "takes/beat_start": Dataset("i8", "X", 0, "Q"),
    "takes/beat_stop": Dataset("i8", "X", 0, "Q"),
    "motion/root_pos_m": Dataset("f4", "M 3", -_FAR_M, _FAR_M),
    "motion/local_quat": Dataset("f4", "M J 4", -12, 12),
    "body/pos_m": Dataset("f4", "B 21 3", -_FAR_M, _FAR_M),
    "body/density": Dataset("f4", "B", -_FAR_M, _FAR_M),
    "beats/motion_s": Dataset("f8", "Q", 0, _LONG_S),
    "clips/take": Dataset("i4", "N", 0, "<X"),
    "clips/start_frame": Dataset("i8", "N", 0, "B"),
    "clips/style": Dataset("f4", "N 32", -_FAR_M, _FAR_M),
    "clips/beat_count": Dataset("f4", "N", 0, _FAR_M),
    "sources/path": Dataset("s", "C"),
    "sources/sha256": Dataset("s", "C"),
    "sources/take": Dataset("i4", "C", 0, "<X"),
    # The counts of the dancers and their figures. A take without counts has `count_start` = `count_stop`.
    "takes/count_start": Dataset("i8", "X", 0, "U"),
    "takes/count_stop": Dataset("i8", "X", 0, "U"),
    "takes/metre": Dataset("i8", "X", 0, 12),
    "takes/counts_source": Dataset("s", "X"),
    "takes/counts_confidence": Dataset("f8", "X", 0, 1),
    "counts/time_s": Dataset("f8", "U", 0, _LONG_S),
    "counts/number": Dataset("i8", "U", 0, 12),
    "figures/take": Dataset("i4", "F", 0, "<X"),
    "figures/name": Dataset("s", "F"),
    "figures/start_s": Dataset("f8", "F", -_LONG_S, _LONG_S),
    "figures/end_s": Dataset("f8", "F", -_LONG_S, _LONG_S),
    "figures/n_counts": Dataset("i8", "F", 0, _COUNTED),
    **DERIVED,
    "provenance": Dataset("s", "1"),  # JSON
}

# The uncertainty of each count, if a network estimated counts from motion. Without it, all are certain.
UNCERTAINTY: dict[str, Dataset] = {"counts/doubt": Dataset("f4", "U", 0, 1)}

# Poses and velocities in the root frame, if the file is not compressed. Those of one are made when read.
POSES: dict[str, Dataset] = {"body/root_frame": Dataset("f4", "B 2 21 3", -_FAR_M * 100, _FAR_M * 100)}

# The part of the body of each joint, for rigs with unknown joint names.
ROLES: dict[str, Dataset] = {"skeleton/roles": Dataset("i8", "J", -1, 23)}

# Motion words and motifs. A file has all of these or none. K motif, W word, G genre. They need the network
# `words`.
MOTIFS: dict[str, Dataset] = {
    "motifs/embeddings": Dataset("f4", "K 184", -_FAR_M, _FAR_M),
    "motifs/words": Dataset("i8", "K", 0, "<W"),
    "motifs/counts": Dataset("i8", "K", 1, "W"),
    "motifs/word_take": Dataset("i4", "W", 0, "<X"),
    "motifs/word_start_s": Dataset("f8", "W", 0, _LONG_S),
    "motifs/word_end_s": Dataset("f8", "W", 0, _LONG_S),
    "motifs/word_motif": Dataset("i4", "W", 0, "<K"),
    "motifs/genres": Dataset("s", "G"),
    "motifs/signatures": Dataset("f8", "G K", 0, 1.001),
    "motifs/transitions": Dataset("f8", "G K K", 0, 1.001),
}

# Notes of the build, if there are any. O note.
NOTES: dict[str, Dataset] = {
    "notes/kind": Dataset("s", "O"),
    "notes/subject": Dataset("s", "O"),
    "notes/values": Dataset("s", "O"),  # JSON
}

# Groups of datasets of which a file has all or none.
OPTIONAL = {"uncertainty": UNCERTAINTY, "motifs": MOTIFS, "roles": ROLES, "notes": NOTES, "poses": POSES}
_ALL = DATASETS | UNCERTAINTY | MOTIFS | ROLES | NOTES | POSES

# A compressed file leaves these out. They are made from its motion when they are read (`body_positions`).
MADE_WHEN_READ = ("body/pos_m",)
MADE_ROWS = 2048  # at once, of arrays that are made when they are read: 100 s

# A compressed file stores these quantised to 16-bit integers: value = integer × step. The integers are
# delta-coded `DELTA_ORDER` times from row to row (modulo 2^16), restarted every `DELTA_RESTART` rows, and
# stored as u2 in zigzag encoding. The attributes `step`, `order`, `restart` and `folded` state the encoding.
# Joint rotations are exact to 0.03 degrees.
QUANTISATION_STEPS = {"motion/root_pos_m": 0.00025, "motion/local_quat": 0.00035}
QUANTISED = (*QUANTISATION_STEPS, *MADE_WHEN_READ)  # that are read: files of before November 2026 have all
DELTA_ORDER, DELTA_RESTART = 2, 8192
HALF_PRECISION = ("motifs/embeddings",)  # f2 in a compressed file, as are the networks' weights


def quantised(array: NDArray[Any], step: float) -> NDArray[np.int16] | None:
    """The multiples of `step` nearest to the values of an array, or None if 16 bits do not hold them."""
    if np.abs(array).max(initial=0.0) > np.iinfo(np.int16).max * step:
        return None
    return np.rint(array / step).astype(np.int16)


def dequantised(integers: NDArray[np.int16], step: float) -> NDArray[np.float32]:
    """The values of the integers of `quantised`."""
    values: NDArray[np.float32] = np.multiply(integers, step).astype(np.float32)
    return values


def delta_encode(integers: NDArray[np.int16]) -> NDArray[np.uint16]:
    """Quantised integers (N, ...) as a compressed file stores them."""
    encoded = integers
    for _ in range(DELTA_ORDER):
        deltas = np.diff(encoded, axis=0, prepend=np.zeros_like(encoded[:1]))
        deltas[::DELTA_RESTART] = encoded[::DELTA_RESTART]
        encoded = deltas
    return zigzag_encode(encoded)


def delta_decode(encoded: NDArray[np.uint16]) -> NDArray[np.int16]:
    """The inverse of `delta_encode`, for rows that begin where the encoding restarts."""
    integers = zigzag_decode(encoded)
    for row in range(0, len(integers), DELTA_RESTART):
        block = integers[row : row + DELTA_RESTART]
        for _ in range(DELTA_ORDER):
            np.cumsum(block, axis=0, dtype=np.int16, out=block)
    return integers


# nets/<name>: a group with the attribute `config` (JSON) and one dataset per weight, of any shape. Where each
# genre has its own rollout network, these are `rollout_0`, `rollout_1` and so on.
NETS = ("style", "motion_density", "music_density", "words", "rollout")
_ROLLOUT_OF_GENRE = re.compile(r"rollout_[0-9]{1,2}", re.ASCII)  # where each genre has its own network


def net_names_in(names: Iterable[str]) -> tuple[str, ...]:
    """The names of networks among these, in the order of `NETS`, and last the rollout networks of genres."""
    found = set(names)
    of_genres = sorted(name for name in found if _ROLLOUT_OF_GENRE.fullmatch(name))
    return (*(name for name in NETS if name in found), *of_genres)


def rollout_names(names: Iterable[str]) -> tuple[str, ...]:
    """Those of the one rollout network, or of the networks of each genre."""
    return tuple(name for name in net_names_in(names) if name.split("_")[0] == "rollout")


@dataclass(frozen=True, eq=False)
class NetArrays:
    """One network as plain data: its config and weights."""

    config: dict[str, Any]
    weights: dict[str, NDArray[Any]]


def layout_of(names: Container[str]) -> dict[str, Dataset]:
    """The datasets of a file with these names: `DATASETS`, and those groups of `OPTIONAL` that it has."""
    layout = dict(DATASETS)
    for group in OPTIONAL.values():
        if any(name in names for name in group):
            layout |= group
    return layout


def shape_of(name: str, sizes: Mapping[str, int]) -> tuple[int, ...]:
    """The shape of an array with axes of these lengths."""
    return tuple(sizes[letter] if letter in sizes else int(letter) for letter in DATASETS[name].axes.split())


def axis_sizes(shapes: Mapping[str, tuple[int, ...]]) -> dict[str, int]:
    """The lengths of the axes. Raises `RepertoireError` if a shape contradicts the schema or another one.

    `shapes` are those of arrays of numbers, and may be those of texts in memory. In a file, the number of
    texts is known when they are read.
    """
    sizes: dict[str, int] = {}
    for name, shape in shapes.items():
        axes = _ALL[name].axes
        letters = axes.split()
        sizes |= {letter: int(letter) for letter in letters if letter.isdigit()}
        if len(shape) != len(letters) or any(
            sizes.setdefault(letter, n) != n for letter, n in zip(letters, shape, strict=True)
        ):
            known = ", ".join(f"{letter} = {sizes[letter]}" for letter in letters if letter in sizes)
            raise RepertoireError(f"{name}: expected ({axes}) with {known}, got {shape}")
    return sizes


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
SUM_TOLERANCE = 1e-6
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
        return math.prod(self.shape) * self.dtype.itemsize


def check_stored(array: StoredArray, kind: str) -> None:
    """Raise `RepertoireError` unless an array is complete and of a kind of the schema, or `WEIGHTS`."""
    if kind == WEIGHTS:
        dtypes = _WEIGHT_DTYPES
    elif kind == "s":
        dtypes = (np.dtype("u1"),)
    elif array.is_quantised and array.name in QUANTISED:
        dtypes = (np.dtype("i2"), np.dtype("u2"))
    else:
        dtypes = tuple(map(np.dtype, (kind, "f2") if array.name in HALF_PRECISION else (kind,)))
    expected = " or ".join(str(dtype) for dtype in dtypes)
    expect(array.dtype in dtypes, f"{array.name}: expected {expected}, got {array.dtype}")
    expect(kind != "s" or len(array.shape) == 1, f"{array.name}: expected bytes of texts, got {array.shape}")
    expect(not array.is_elsewhere, f"{array.name}: expected it in this file, got a part of another place")
    unknown = set(array.filters) - set(FILTERS)
    expect(not unknown, f"{array.name}: expected no compression or deflate, got HDF5 filters {array.filters}")
    n_chunk_bytes = math.prod(array.chunk) * array.dtype.itemsize
    expect(
        n_chunk_bytes <= MAX_CHUNK_BYTES,
        f"{array.name}: expected chunks of at most {MAX_CHUNK_BYTES:,} bytes, got {n_chunk_bytes:,}",
    )
    packed = DEFLATE_RATIO if array.filters else 1
    expect(
        array.n_bytes <= packed * array.n_stored_bytes,
        f"{array.name}: expected all of {array.shape}, got {array.n_stored_bytes:,} bytes of it",
    )


def check_size(arrays: Iterable[StoredArray], n_file_bytes: int) -> None:
    """Raise `RepertoireError` if the arrays are larger than compression can explain for the file size."""
    n_bytes, limit = sum(array.n_bytes for array in arrays), FREE_BYTES + UNPACKED_RATIO * n_file_bytes
    expect(n_bytes <= limit, f"expected at most {limit:,} bytes unpacked, got {n_bytes:,}")


def check_text(name: str, texts: Sequence[str]) -> None:
    """Raise `RepertoireError` if rows of text are too long for an array, in which each is as long."""
    longest = max(map(len, texts), default=0)
    expect(
        4 * longest * len(texts) <= FREE_BYTES + UNPACKED_RATIO * sum(map(len, texts)),
        f"{name}: expected names and notes, got {len(texts)} texts of up to {longest:,} characters",
    )


def check_finite(name: str, array: NDArray[Any]) -> None:
    """Raise `RepertoireError` if an array has NaN or infinity."""
    expect(bool(np.isfinite(array).all()), f"{name}: expected finite numbers, got NaN or infinity")


def check_values(name: str, array: NDArray[Any], sizes: Mapping[str, int]) -> None:
    """Raise `RepertoireError` if a number of an array is outside its range, or shares do not sum to 1.

    `sizes` are those of the axes.
    """
    if array.size == 0:
        return
    _, _, low, high = _ALL[name]
    highest = sizes[high.lstrip("<")] - high.startswith("<") if isinstance(high, str) else high
    least, most = float(array.min()), float(array.max())  # NaN if there is one
    expect(
        least >= low and most <= highest,
        f"{name}: expected values from {low:g} to {highest:g}, got {least:g} to {most:g}",
    )
    if name in _SHARES:
        is_one = np.abs(array.sum(axis=-1) - 1.0) <= SUM_TOLERANCE
        expect(bool(is_one.all()), f"{name}: expected shares that sum to 1, got others")


def check_quantisation(name: str, attributes: Mapping[str, Any]) -> None:
    """Raise `RepertoireError` if the step of an array is not valid, or its encoding is not `ENCODING`."""
    (low, high), step = _STEPS, attributes.get("step")
    expect(
        isinstance(step, np.floating) and bool(low <= step <= high),
        f"{name}: expected step from {low:g} to {high:g}, got {_short(step)}",
    )
    for key, expected in ENCODING.items():
        value = attributes.get(key)
        expect(
            isinstance(value, np.integer | np.bool_) and bool(value == expected),
            f"{name}: expected {key} {expected}, got {_short(value)}",
        )


def check_parts(name: str, start: NDArray[Any], stop: NDArray[Any], length: int, *, shortest: int) -> None:
    """Raise `RepertoireError` unless the parts [start, stop) of takes cover an array in order."""
    ends = np.concatenate([[0], stop])
    expect(
        len(stop) > 0
        and bool((start == ends[:-1]).all() and ends[-1] == length and (stop - start >= shortest).all()),
        f"takes/{name}_start and _stop: expected the {length} rows take by take, {shortest} or more each, "
        "got gaps or overlaps",
    )


def check_provenance(provenance: Mapping[str, Any]) -> None:
    """Raise `RepertoireError` unless the entries of a file's provenance that are used have their types."""
    songs, weight = provenance.get("trained_on", []), provenance.get("selection_beat_weight", 0.0)
    expect(
        isinstance(songs, list) and all(isinstance(song, str) for song in songs),
        f"provenance: expected a list of songs in trained_on, got {_short(songs)}",
    )
    expect(
        isinstance(weight, int | float) and 0 <= weight <= _FAR_M,
        f"provenance: expected a selection_beat_weight of 0 or more, got {_short(weight)}",
    )


def check_clips(take: NDArray[Any], start_frame: NDArray[Any], n_frames: NDArray[Any]) -> None:
    """Raise `RepertoireError` unless clips (N,) lie inside their takes, of `n_frames` (X,) at 20 fps."""
    expect(
        bool((start_frame + CLIP_FRAMES <= n_frames[take]).all()),
        f"clips: expected {CLIP_FRAMES} frames of a take each, got clips beyond the ends of takes",
    )


def check_counts(name: str, times_s: NDArray[Any], numbers: NDArray[Any], metre: int) -> None:
    """Raise `RepertoireError` unless counts (Q,) of a take increase and are numbered in bars of the metre."""
    lowest = 1 if metre else 0
    expect(
        bool((np.diff(times_s) > 0).all() and ((numbers >= lowest) & (numbers <= metre)).all()),
        f"counts of {name!r}: expected increasing times, and numbers from {lowest} to {metre}, got others",
    )


def _short(value: Any) -> str:
    return repr(value).replace("\n", " ")[:60]


def expect(condition: bool, message: str) -> None:
    """Raise `RepertoireError` with a message unless a condition holds."""
    if not condition:
        raise RepertoireError(message)


# Zigzag encoding of signed 16-bit integers as unsigned ones: 0, -1, 1, -2 become 0, 1, 2, 3.
#
# The high byte of a small number is 0 for both signs, so that differences compress well.


def zigzag_encode(integers: NDArray[np.int16]) -> NDArray[np.uint16]:
    """Signed integers (...) int16 as unsigned ones (...) uint16."""
    return ((integers << 1) ^ (integers >> 15)).view(np.uint16)


def zigzag_decode(encoded: NDArray[np.uint16]) -> NDArray[np.int16]:
    """The integers (...) int16 that `zigzag_encode` has encoded."""
    return ((encoded >> 1) ^ -(encoded & 1)).view(np.int16)
