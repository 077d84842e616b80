"""The layout of a repertoire file, documented in `data_schema/repertoire.json`, and its plain data."""

from __future__ import annotations

import re
from collections.abc import Container, Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from choreograph.core.errors import RepertoireError
from choreograph.core.numerics import zigzag_decode, zigzag_encode

if TYPE_CHECKING:
    from choreograph.library.joined_rows import Rows

# The layout of a repertoire file, version 1. `data_schema/repertoire.json` documents it for other programs.
#
# Takes are concatenated along the first axis of each array. The table of takes holds their first and last
# rows. Clips are pairs of take and start frame, not copies.


FORMAT = "choreograph-repertoire"
NETWORKS_FORMAT = "choreograph-networks"  # a file with networks of `NETS` and `provenance` alone
VERSION = 1

# path -> (kind, shape). The kinds are s (UTF-8 texts), f4, f8, i4 and i8, as in h5py. Letters are axes:
# J joint, E end site, X take, M stored motion frame, B 20 fps frame, Q motion beat, N clip, C checksum,
# U count, F figure, H genre, Z second of a genre.
#
# Texts are stored as bytes, each text ended by a zero. HDF5's own texts of any length lie in heaps without
# checksums. Every array of numbers and of texts has Fletcher's checksums, which HDF5 verifies as it reads.
DERIVED: dict[str, tuple[str, str]] = {  # from the other arrays, see `library.derived`
    "takes/front_rad": ("f8", "X"),
    "takes/centre_m": ("f8", "X 3"),
    "takes/tempo_bpm": ("f8", "X"),
    "body/speed_m_s": ("f4", "B"),
    "body/heading_rad": ("f4", "B"),
    "body/sums": ("f8", "B 2"),
    "clips/steps": ("i4", "N"),
    "clips/step_rank": ("f4", "N"),
    "clips/liveliness_rank": ("f4", "N"),
    "genres/name": ("s", "H"),
    "genres/scale": ("f8", "H 2"),
    "genres/size_start": ("i8", "H"),
    "genres/size_stop": ("i8", "H"),
    "genres/sizes": ("f8", "Z"),
}
DATASETS: dict[str, tuple[str, str]] = {
    "skeleton/names": ("s", "J"),
    "skeleton/parents": ("i8", "J"),
    "skeleton/offsets_m": ("f8", "J 3"),
    "skeleton/tip_parents": ("i8", "E"),
    "skeleton/tips_m": ("f8", "E 3"),
    "takes/name": ("s", "X"),
    "takes/song_name": ("s", "X"),
    "takes/genre": ("s", "X"),
    "takes/performer": ("s", "X"),
    "takes/licence": ("s", "X"),
    "takes/source": ("s", "X"),
    "takes/notes": ("s", "X"),
    "takes/fps": ("f8", "X"),
    "takes/motion_start": ("i8", "X"),
    "takes/motion_stop": ("i8", "X"),
    "takes/body_start": ("i8", "X"),
    "takes/body_stop": ("i8", "X"),
    "takes/beat_start": ("i8", "X"),
    "takes/beat_stop": ("i8", "X"),
    "motion/root_pos_m": ("f4", "M 3"),
    "motion/local_quat": ("f4", "M J 4"),
    "body/pos_m": ("f4", "B 21 3"),
    "body/density": ("f4", "B"),
    "beats/motion_s": ("f8", "Q"),
    "clips/take": ("i4", "N"),
    "clips/start_frame": ("i8", "N"),
    "clips/style": ("f4", "N 32"),
    "clips/beat_count": ("f4", "N"),
    "sources/path": ("s", "C"),
    "sources/sha256": ("s", "C"),
    "sources/take": ("i4", "C"),
    # The counts of the dancers and their figures. A take without counts has `count_start` = `count_stop`.
    "takes/count_start": ("i8", "X"),
    "takes/count_stop": ("i8", "X"),
    "takes/metre": ("i8", "X"),
    "takes/counts_source": ("s", "X"),
    "takes/counts_confidence": ("f8", "X"),
    "counts/time_s": ("f8", "U"),
    "counts/number": ("i8", "U"),
    "figures/take": ("i4", "F"),
    "figures/name": ("s", "F"),
    "figures/start_s": ("f8", "F"),
    "figures/end_s": ("f8", "F"),
    "figures/n_counts": ("i8", "F"),
    **DERIVED,
    "provenance": ("s", "1"),  # JSON
}

# The uncertainty of each count, if a network estimated counts from motion. Without it, all are certain.
UNCERTAINTY: dict[str, tuple[str, str]] = {"counts/doubt": ("f4", "U")}

# Poses and velocities in the root frame, if the file is not compressed. Those of one are made when read.
POSES: dict[str, tuple[str, str]] = {"body/root_frame": ("f4", "B 2 21 3")}

# The part of the body of each joint, for rigs with unknown joint names.
ROLES: dict[str, tuple[str, str]] = {"skeleton/roles": ("i8", "J")}

# Motion words and motifs. A file has all of these or none. K motif, W word, G genre. They need the network
# `words`.
MOTIFS: dict[str, tuple[str, str]] = {
    "motifs/embeddings": ("f4", "K 184"),
    "motifs/words": ("i8", "K"),
    "motifs/counts": ("i8", "K"),
    "motifs/word_take": ("i4", "W"),
    "motifs/word_start_s": ("f8", "W"),
    "motifs/word_end_s": ("f8", "W"),
    "motifs/word_motif": ("i4", "W"),
    "motifs/genres": ("s", "G"),
    "motifs/signatures": ("f8", "G K"),
    "motifs/transitions": ("f8", "G K K"),
}

# Notes of the build, if there are any. O note.
NOTES: dict[str, tuple[str, str]] = {
    "notes/kind": ("s", "O"),
    "notes/subject": ("s", "O"),
    "notes/values": ("s", "O"),  # JSON
}

# Groups of datasets of which a file has all or none.
OPTIONAL = {"uncertainty": UNCERTAINTY, "motifs": MOTIFS, "roles": ROLES, "notes": NOTES, "poses": POSES}

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


# Attributes of the file itself.
ATTRIBUTES = ("format", "version", "density")


# The content of a repertoire file as plain data.


@dataclass(frozen=True, eq=False)
class NetArrays:
    """One network as plain data: its config and weights."""

    config: dict[str, Any]
    weights: dict[str, NDArray[Any]]


@dataclass(frozen=True, eq=False)
class Contents:
    """Everything in a repertoire file."""

    # By path: `DATASETS` without the provenance, and all or none of each group of `OPTIONAL`. Those of
    # `DERIVED` are computed when they are written, if they are not given.
    arrays: Mapping[str, Rows]
    density: str  # which tempo-density `body/density` holds: "analytic" or "learned"
    provenance: dict[str, Any]  # program version, seed, preset, losses, training and held-out songs
    nets: Mapping[str, NetArrays] = field(default_factory=dict)


def layout_of(names: Container[str]) -> dict[str, tuple[str, str]]:
    """The datasets of a file with these names: `DATASETS`, and those groups of `OPTIONAL` that it has."""
    layout = dict(DATASETS)
    for group in OPTIONAL.values():
        if any(name in names for name in group):
            layout |= group
    return layout


def shape_of(name: str, sizes: Mapping[str, int]) -> tuple[int, ...]:
    """The shape of an array with axes of these lengths."""
    return tuple(sizes[letter] if letter in sizes else int(letter) for letter in DATASETS[name][1].split())


def axis_sizes(shapes: Mapping[str, tuple[int, ...]]) -> dict[str, int]:
    """The lengths of the axes. Raises `RepertoireError` if a shape contradicts the schema or another one.

    `shapes` are those of arrays of numbers, and may be those of texts in memory. In a file, the number of
    texts is known when they are read.
    """
    sizes: dict[str, int] = {}
    for name, (_, axes) in layout_of(shapes).items():
        if name not in shapes:
            continue
        letters, shape = axes.split(), shapes[name]
        sizes |= {letter: int(letter) for letter in letters if letter.isdigit()}
        if len(shape) != len(letters) or any(
            sizes.setdefault(letter, n) != n for letter, n in zip(letters, shape, strict=True)
        ):
            known = ", ".join(f"{letter} = {sizes[letter]}" for letter in letters if letter in sizes)
            raise RepertoireError(f"{name}: expected ({axes}) with {known}, got {shape}")
    return sizes
