"""AMASS: NPZ files of SMPL-H or SMPL-X poses, Z up, in folders of data set and performer."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from choreograph.errors import FormatError
from choreograph.importers._axes_and_units import Z_UP_TO_Y_UP
from choreograph.importers._smpl import rotated_world, smpl_motion
from choreograph.importers.npz import array_names, load_arrays
from choreograph.takes import Credits, Take

LAYOUT = "AMASS: NAME_poses.npz files in a folder tree, or one of them"
_RATE_KEYS = ("mocap_framerate", "mocap_frame_rate")  # SMPL-H's, SMPL-X's


def detect(path: Path) -> bool:
    """Whether `path` is an AMASS file or a folder tree with one."""
    if path.is_file():
        return path.suffix.lower() == ".npz" and _is_motion(path)
    return any(_is_motion(file) for file in path.rglob("*.npz"))


def read(path: Path) -> Iterator[Take]:
    """Takes without music, by path; files without poses, such as body shapes, are skipped.

    A file's folder is the performer; the folder above it is the data set, the source.
    """
    files = [path] if path.is_file() else sorted(path.rglob("*.npz"))
    for file in files:
        if _is_motion(file):
            yield _take(file, path)
        elif not array_names(file):
            raise FormatError(f"{file}: not a valid NPZ file: damaged, cut off, or another format")


def _is_motion(file: Path) -> bool:
    names = array_names(file)
    return {"poses", "trans"} <= names and not names.isdisjoint(_RATE_KEYS)


def _take(file: Path, source: Path) -> Take:
    names = array_names(file)
    rate_key = next(key for key in _RATE_KEYS if key in names)
    arrays = load_arrays(file, ("poses", "trans", rate_key))
    try:
        fps = float(arrays[rate_key])
        if not 1.0 <= fps <= 1000.0:
            raise FormatError(f"expected a frame rate in {rate_key}, got {fps}")
        motion = rotated_world(smpl_motion(arrays["poses"], arrays["trans"], fps), Z_UP_TO_Y_UP)
    except (FormatError, TypeError, ValueError) as error:
        raise FormatError(f"{file}: {' '.join(str(error).split())}") from None
    name = file.stem if source.is_file() else file.relative_to(source).with_suffix("").as_posix()
    folder = file.parent.resolve()
    return Take(
        name=name,
        motion=motion,
        credits=Credits(performer=folder.name, source=f"AMASS {folder.parent.name}".strip()),
        source_paths=(file,),
        notes=("rotated from Z up, as AMASS is, to Y up; body shape and fingers are left out",),
    )
