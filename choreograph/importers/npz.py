"""NPZ motions written by this program, read back exactly."""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from choreograph.errors import FormatError, ParameterError
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import Skeleton
from choreograph.takes import Credits, Take

LAYOUT = "a single NAME.npz written by this program"
_KEYS = ("root_pos_m", "local_quat", "fps", "names", "parents", "offsets_m", "tip_parents", "tips_m")


def detect(path: Path) -> bool:
    """Whether `path` is one NPZ file written by this program."""
    return path.is_file() and path.suffix.lower() == ".npz" and "root_pos_m" in array_names(path)


def read(path: Path) -> Iterator[Take]:
    """The file as a take without music, named after it."""
    yield Take(path.stem, read_npz(path), Credits(source=path.name), source_paths=(path,))


def array_names(path: Path) -> set[str]:
    """Names of the arrays in an NPZ file; empty if it is not one."""
    try:
        with zipfile.ZipFile(path) as archive:
            return {name.removesuffix(".npy") for name in archive.namelist()}
    except (OSError, zipfile.BadZipFile):
        return set()


def load_arrays(path: Path, names: tuple[str, ...]) -> dict[str, np.ndarray]:
    """The named arrays of an NPZ file, without unpickling; `FormatError` if damaged or one is missing."""
    if not path.exists():
        raise ParameterError(f"no file {path}")
    try:
        with np.load(path, allow_pickle=False) as archive:
            return {name: archive[name] for name in names}
    except KeyError as error:
        raise FormatError(f"{path}: expected arrays {', '.join(names)}: {error.args[0]}") from None
    except (
        OSError,
        ValueError,
        TypeError,
        EOFError,
        AttributeError,
        zipfile.BadZipFile,
        zlib.error,
    ) as error:
        raise FormatError(
            f"{path}: not a valid NPZ file ({error}): damaged, cut off, or another format"
        ) from None


def read_npz(path: str | Path) -> Motion:
    """The motion in `path`. `ParameterError` if it does not exist, `FormatError` if it is damaged."""
    path = Path(path)
    arrays = load_arrays(path, _KEYS)
    try:
        names = tuple(map(str, arrays["names"].tolist()))
        skeleton = Skeleton(
            names, *(arrays[key] for key in ("parents", "offsets_m", "tip_parents", "tips_m"))
        )
        return Motion(skeleton, arrays["root_pos_m"], arrays["local_quat"], float(arrays["fps"]))
    except (TypeError, ValueError, IndexError) as error:
        raise FormatError(f"{path}: {error}") from None
