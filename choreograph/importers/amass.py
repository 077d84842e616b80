"""AMASS: NPZ files of SMPL-H or SMPL-X poses, Z up, in folders of data set and performer.

Other data sets use the same keys with Y up, which shows in where the body stands.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np

from choreograph.errors import FormatError
from choreograph.importers._axes_and_units import UP_AXIS_MARGIN, Z_UP_TO_Y_UP, known_roles, upward
from choreograph.importers._smpl import rotated_world, smpl_motion
from choreograph.importers._unread import Unread, attempted
from choreograph.importers.npz import array_names, load_arrays
from choreograph.motion.motion import Motion
from choreograph.takes import Credits, Take

LAYOUT = "AMASS: NAME_poses.npz files in a folder tree, or one of them"
_RATE_KEYS = ("mocap_framerate", "mocap_frame_rate", "fps")  # SMPL-H's, SMPL-X's, others'


def detect(path: Path) -> bool:
    """Whether `path` is an AMASS file or a folder tree with one."""
    if path.is_file():
        return path.suffix.lower() == ".npz" and _is_motion(path)
    return any(_is_motion(file) for file in _files(path))


def read(path: Path) -> Iterator[Take | Unread]:
    """Takes without music, by path; files without poses, such as body shapes, are not read.

    A file's folder is the performer; the folder above it is the data set, the source.
    """
    for file in [path] if path.is_file() else _files(path):
        if _is_motion(file):
            yield attempted(partial(_take, path), file)
        elif not array_names(file):
            error = FormatError(f"{file}: not a valid NPZ file: damaged, cut off, or another format")
            yield Unread.damaged(file, error)


def _files(folder: Path) -> list[Path]:
    # Hidden files come from other programs, such as macOS's "._NAME.npz".
    return sorted(folder.rglob("[!.]*.npz"))


def _is_motion(file: Path) -> bool:
    names = array_names(file)
    is_ours = "root_pos_m" in names  # this program writes the same arrays beside its own
    return {"poses", "trans"} <= names and not names.isdisjoint(_RATE_KEYS) and not is_ours


def _take(source: Path, file: Path) -> Take:
    names = array_names(file)
    rate_key = next(key for key in _RATE_KEYS if key in names)
    arrays = load_arrays(file, ("poses", "trans", rate_key))
    try:
        rate = np.asarray(arrays[rate_key], np.float64)
        fps = rate.item() if rate.size == 1 else np.nan
        if not 1.0 <= fps <= 1000.0:
            raise FormatError(f"expected a frame rate in {rate_key}, got {fps}")
        motion, up = _y_up(smpl_motion(arrays["poses"], arrays["trans"], fps))
    except (FormatError, TypeError, ValueError) as error:
        raise FormatError(f"{file}: {' '.join(str(error).split())}") from None
    name = file.stem if source.is_file() else file.relative_to(source).with_suffix("").as_posix()
    folder = file.parent.resolve()
    return Take(
        name=name,
        motion=motion,
        credits=Credits(performer=folder.name, source=f"AMASS {folder.parent.name}".strip()),
        source_paths=(file,),
        notes=(f"{up}; body shape and fingers are left out",),
    )


def _y_up(motion: Motion) -> tuple[Motion, str]:
    """The motion with Y up, and what was done."""
    x, y, z = upward(known_roles(motion.skeleton), motion.joint_pos_m())
    if y > UP_AXIS_MARGIN * max(abs(x), abs(z)):
        return motion, "read as Y up, along which the body stands, not as Z up, as AMASS is"
    return rotated_world(motion, Z_UP_TO_Y_UP), "rotated from Z up, as AMASS is, to Y up"
