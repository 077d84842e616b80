"""NPY and NPZ: plain arrays without pickles. NPZ holds motions, which are written and read back exactly.

The header of an NPY is Python code, which NumPy evaluates. The headers that it and other programs write have
one form, and no other is read. An array has the bytes that its header states, and its values are numbers or
short texts.
"""

from __future__ import annotations

import math
import re
import struct
import zipfile
import zlib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from choreograph.core.errors import FormatError, ParameterError
from choreograph.core.files import BUDGETS, check_regular
from choreograph.core.pickles import array_of_bytes, number_kind
from choreograph.formats.writer import DANCE_GENERATOR, GENERATOR, Writer
from choreograph.motion import rotations as rot
from choreograph.motion.motion import FARTHEST_M, Credits, Motion, Take, check_length
from choreograph.motion.skeleton import CANONICAL_JOINTS, Skeleton, roles_of

# NPY: one array of numbers, or a pickle, which is not read here.


MAGIC = b"\x93NUMPY"
_SIZES = {1: "<H", 2: "<I", 3: "<I"}  # of the length of the header, by the version of the format
_MAX_HEADER_BYTES = 1 << 12
_HEADER = re.compile(
    rb"\{\s*'descr':\s*'([^'\\]{1,20})',\s*'fortran_order':\s*(True|False),\s*"
    rb"'shape':\s*\(([\dL, ]*)\),?\s*\}\s*"
)
_NUMBER = re.compile(rb"\d+")


class Header(NamedTuple):
    """What an NPY file states before its values."""

    kind: np.dtype[Any] | None  # None for objects, which are pickled
    is_fortran: bool
    shape: tuple[int, ...]
    n_bytes: int  # before the values


def header_of(data: bytes) -> Header:
    """The header of a file. Raises `FormatError` if it is damaged, or its values are not numbers or texts."""
    size = _SIZES.get(data[6]) if data.startswith(MAGIC) and len(data) > len(MAGIC) else None
    if size is None or len(data) < 8 + struct.calcsize(size):
        raise FormatError("expected an array (.npy), got no header of one: damaged, or another format")
    start = 8 + struct.calcsize(size)
    n_bytes = start + int(struct.unpack_from(size, data, 8)[0])
    found = _HEADER.fullmatch(data[start : min(n_bytes, start + _MAX_HEADER_BYTES)])
    if found is None or n_bytes > len(data):
        raise FormatError("expected an array of numbers (.npy), got another header: damaged?")
    descr, order, shape = found.groups()
    try:
        kind = number_kind(descr.decode("ascii"))
    except ValueError as error:
        raise FormatError(f"expected an array of numbers, got {error}") from None
    return Header(kind, order == b"True", tuple(map(int, _NUMBER.findall(shape))), n_bytes)


def array_of(data: bytes, header: Header | None = None) -> NDArray[Any]:
    """The array of a file. Raises `FormatError` if it is damaged or cut off, or has objects."""
    header = header or header_of(data)
    if header.kind is None:
        raise FormatError("expected an array of numbers, got one of objects, which is not read from here")
    n_bytes = math.prod(header.shape) * header.kind.itemsize
    content = memoryview(data)[header.n_bytes : header.n_bytes + n_bytes]
    try:
        return array_of_bytes(content, header.kind, header.shape, "F" if header.is_fortran else "C")
    except ValueError as error:
        raise FormatError(f"expected an array of numbers, got {error}: cut off?") from None


# NPZ: arrays by name.


LAYOUT = "a single NAME.npz written by this program"
SUFFIXES = (".npz",)
_NUMBERS = ("root_pos_m", "local_quat", "fps", "parents", "offsets_m", "tip_parents", "tips_m")
_OPTIONAL = frozenset(("roles",))
_FREE_BYTES, _UNPACKED_RATIO = 1 << 27, 16  # unpacked size by compression, which is low for motion
_ROUNDED = 1e-6  # of a unit quaternion's length from 1
_SHORTEST = 1e-3  # quaternion that has a direction


def detect(path: Path) -> bool:
    """Whether `path` is one NPZ file written by this program."""
    return path.is_file() and path.suffix.lower() == ".npz" and "root_pos_m" in array_names(path)


def read(path: Path) -> Iterator[Take]:
    """The file as a take without music, named after it."""
    yield Take(path.stem, read_npz(path), Credits(source=path.name), source_paths=(path,))


def array_names(path: Path) -> set[str]:
    """Names of the arrays in an NPZ file, empty if it is not one."""
    try:
        with zipfile.ZipFile(path) as archive:
            return {name.removesuffix(".npy") for name in archive.namelist()}
    except (OSError, ValueError, NotImplementedError, zipfile.BadZipFile):
        return set()


def load_arrays(path: Path, names: tuple[str, ...]) -> dict[str, np.ndarray]:
    """The named arrays of an NPZ file, without unpickling.

    Raises `FormatError` if the file is damaged, an array is missing, or the arrays are over 1 GiB when
    unpacked, or far larger than the file.
    """
    if not path.exists():
        raise ParameterError(f"expected an NPZ file at {path}, got nothing: there is no such file")
    check_regular(path, "an NPZ file")
    try:
        with zipfile.ZipFile(path) as archive:
            entries = {entry.filename.removesuffix(".npy"): entry for entry in archive.infolist()}
            missing = [name for name in names if name not in entries]
            if missing:
                raise FormatError(f"{path}: expected arrays {', '.join(names)}, got no {', '.join(missing)}")
            limit = min(BUDGETS["npz"].unpacked_bytes, _FREE_BYTES + _UNPACKED_RATIO * path.stat().st_size)
            if sum(entries[name].file_size for name in names) > limit:
                raise FormatError(f"{path}: expected at most {limit >> 20} MiB of arrays, got more")
            return {name: _array(archive, entries[name], path) for name in names}
    except FormatError:
        raise
    except (
        OSError, ValueError, EOFError, MemoryError, NotImplementedError, zipfile.BadZipFile, zlib.error,
        RuntimeError,  # an entry is encrypted
    ) as error:  # fmt: skip
        raise FormatError(
            f"{path}: expected an NPZ file, got no valid one ({str(error)[:200]}): damaged, cut off, or "
            "another format"
        ) from None


def _array(archive: zipfile.ZipFile, entry: zipfile.ZipInfo, path: Path) -> np.ndarray:
    if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise FormatError(f"{path}: expected arrays that are stored or deflated, got another compression")
    try:
        with archive.open(entry) as file:
            return array_of(
                file.read(entry.file_size)
            )  # without a size, all that it unpacks to is read first
    except FormatError as error:
        raise FormatError(f"{path}: {entry.filename[:40]}: {error}") from None


def read_npz(path: str | Path) -> Motion:
    """The motion in a file. Raises `ParameterError` if it does not exist, `FormatError` if it is damaged."""
    path = Path(path)
    numbers = (*_NUMBERS, *_OPTIONAL.intersection(array_names(path)))
    arrays = load_arrays(path, ("names", *numbers))
    for key in numbers:
        if arrays[key].dtype.kind not in "iuf" or not (np.abs(arrays[key]) < FARTHEST_M).all():
            raise FormatError(f"{path}: expected numbers below {FARTHEST_M:g} in {key}, got something else")
    try:
        fps = float(arrays["fps"])
        if not fps > 0:
            raise ValueError(f"expected a frame rate above 0, got {fps}")
        check_length(len(arrays["root_pos_m"]), len(arrays["names"]), fps)
        names = tuple(map(str, arrays["names"].tolist()))
        skeleton = Skeleton(
            names, *(arrays[key] for key in ("parents", "offsets_m", "tip_parents", "tips_m"))
        )
        if "roles" in arrays:
            skeleton = replace(skeleton, roles=roles_of(arrays["roles"]))
        return Motion(skeleton, arrays["root_pos_m"], _unit(arrays["local_quat"]), fps)
    except (TypeError, ValueError, IndexError, ParameterError) as error:
        raise FormatError(f"{path}: {error}") from None


def _unit(quat: np.ndarray) -> np.ndarray:
    """Quaternions (..., 4) of length 1. They are not changed if that is their length already."""
    length = np.linalg.norm(np.asarray(quat, np.float64), axis=-1, keepdims=True)
    if (length < _SHORTEST).any():
        raise FormatError("expected rotations as quaternions of length 1, got some of length 0: damaged?")
    return quat if (np.abs(length - 1.0) <= _ROUNDED).all() else quat / length


# The earliest date of a zip entry, so that the same motion gives the same bytes.
_EPOCH = (1980, 1, 1, 0, 0, 0)


class NpzWriter(Writer):
    """Writes arrays that `formats.npz.read_npz` reads back bit for bit.

    The arrays are root_pos_m (T, 3), local_quat (T, J, 4) wxyz, fps, names (J,), parents (J,), offsets_m (J,
    3), tip_parents (E,) and tips_m (E, 3). Motions of the canonical joints also have `poses` (T, 72) of SMPL,
    in axis-angle, and `trans` (T, 3), the position of the pelvis. In files of SMPL, the pelvis is at a
    constant distance from `trans`.
    """

    format = "npz"

    def write(self, motion: Motion, path: Path) -> None:
        """Write `motion`."""
        skeleton = motion.skeleton
        arrays = {
            "root_pos_m": motion.root_pos_m,
            "local_quat": motion.local_quat,
            "fps": np.array(motion.fps),
            "names": np.array(skeleton.names),
            "parents": skeleton.parents,
            "offsets_m": skeleton.offsets_m,
            "tip_parents": skeleton.tip_parents,
            "tips_m": skeleton.tips_m,
        }
        if skeleton.roles is not None:
            arrays["roles"] = skeleton.role_numbers()
        if skeleton.names == CANONICAL_JOINTS:
            arrays["poses"] = rot.to_rotvec(motion.local_quat).reshape(motion.n_frames, -1)  # (T, 72)
            arrays["trans"] = motion.root_pos_m
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, array in arrays.items():
                with archive.open(zipfile.ZipInfo(f"{name}.npy", _EPOCH), "w", force_zip64=True) as file:
                    np.lib.format.write_array(file, array, allow_pickle=False)
            archive.comment = (DANCE_GENERATOR if self.is_dance else GENERATOR).encode()


WRITERS = (NpzWriter,)
