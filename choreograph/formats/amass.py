"""AMASS: NPZ files of SMPL-H or SMPL-X poses in folders of data set and performer, with Z up.

Other data sets have the same keys with Y up, which is detected from the pose of the body.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from choreograph.core.errors import FormatError, ParameterError
from choreograph.core.numerics import Floats
from choreograph.formats.axes_and_units import UP_AXIS_MARGIN, Z_UP_TO_Y_UP, known_roles, upward
from choreograph.formats.manifest import SkippedFile, each_attempted
from choreograph.formats.npz import array_names, load_arrays
from choreograph.motion import rotations as rot
from choreograph.motion.motion import FARTHEST_M, Credits, Motion, Take, check_length
from choreograph.motion.skeleton import CANONICAL_JOINTS, canonical_skeleton

LARGEST_NUMBER = FARTHEST_M * 1e3  # of poses and positions in any unit down to millimetres
_BODY = 22  # joints of SMPL, SMPL-H and SMPL-X, before hands, jaw and eyes


def numbers_of(value: Any) -> Floats:
    """An array or number of a file as floats. Raises `FormatError` if it is neither, such as a text."""
    kind = type(value).__name__ if isinstance(value, str) else np.asarray(value).dtype
    if isinstance(kind, str) or kind.kind not in "biuf":
        raise FormatError(f"expected an array of numbers, got one of {kind}")
    return np.asarray(value, np.float64)


def smpl_motion(poses: Any, trans: Any, fps: float) -> Motion:
    """The motion of axis-angle `poses`, (T, 66 or more) or (T, J, 3), and root positions `trans` (T, 3) in m.

    The body joints come first and in canonical order. The two hand joints of SMPL (72 values) are kept,
    fingers are not. In SMPL the pelvis is at a constant distance from `trans`. The estimate of the floor
    corrects its height. Raises `FormatError` if shapes or values are wrong.
    """
    poses, trans = numbers_of(poses), numbers_of(trans)
    if poses.ndim == 3 and poses.shape[2] == 3:
        poses = poses.reshape(len(poses), 3 * poses.shape[1])
    if poses.ndim != 2 or poses.shape[1] < 3 * _BODY or poses.shape[1] % 3 or trans.shape != (len(poses), 3):
        raise FormatError(
            f"expected poses (T, 66 or more) and translations (T, 3), got {poses.shape}, {trans.shape}"
        )
    if len(poses) == 0:
        raise FormatError("expected poses of a frame or more, got no frame")
    try:
        check_length(len(poses), len(CANONICAL_JOINTS), fps)
    except ParameterError as error:
        raise FormatError(str(error)) from None
    if not all((np.abs(values) < LARGEST_NUMBER).all() for values in (poses, trans)):
        raise FormatError(
            f"expected finite poses and translations below {LARGEST_NUMBER:g}, got others: damaged data?"
        )
    n_joints = len(CANONICAL_JOINTS)
    kept = n_joints if poses.shape[1] == 3 * n_joints else _BODY
    rotvec = np.zeros((len(poses), n_joints, 3))
    rotvec[:, :kept] = poses[:, : 3 * kept].reshape(len(poses), kept, 3)
    return Motion(canonical_skeleton(), trans, rot.make_continuous(rot.from_rotvec(rotvec)), fps)


def rotated_world(motion: Motion, rotation: np.ndarray) -> Motion:
    """The motion with root positions and root rotations rotated by `rotation` (4,)."""
    quat = np.array(motion.local_quat)
    quat[:, 0] = rot.multiply(rotation, quat[:, 0])
    root_pos_m = rot.rotate(rotation, motion.root_pos_m)
    return Motion(motion.skeleton, root_pos_m, rot.make_continuous(quat), motion.fps)


LAYOUT = "AMASS: NAME_poses.npz files in a folder tree, or one of them"
_RATE_KEYS = ("mocap_framerate", "mocap_frame_rate", "fps")  # of SMPL-H, SMPL-X and others


def detect(path: Path) -> bool:
    """Whether `path` is an AMASS file or a folder tree with one."""
    if path.is_file():
        return path.suffix.lower() == ".npz" and _is_motion(path)
    return any(_is_motion(file) for file in _files(path))


def read(path: Path) -> Iterator[Take | SkippedFile]:
    """Takes without music, by path. Files without poses, such as body shapes, are not read.

    The folder of a file is the performer, the folder above it is the data set, which is the source.
    """
    files = [path] if path.is_file() else _files(path)
    motions = [file for file in files if _is_motion(file)]
    read = each_attempted((partial(_take, path), file) for file in motions)
    for file in files:
        if file in motions:
            yield next(read)
        elif not array_names(file):
            error = FormatError(f"{file}: not a valid NPZ file: damaged, cut off, or another format")
            yield SkippedFile.damaged(file, error)


def _files(folder: Path) -> list[Path]:
    # Hidden files come from other programs, such as "._NAME.npz" of macOS.
    return sorted(folder.rglob("[!.]*.npz"))


def _is_motion(file: Path) -> bool:
    names = array_names(file)
    is_ours = "root_pos_m" in names  # this program writes these arrays as well
    return {"poses", "trans"} <= names and not names.isdisjoint(_RATE_KEYS) and not is_ours


def _take(source: Path, file: Path) -> Take:
    names = array_names(file)
    rate_key = next(key for key in _RATE_KEYS if key in names)
    arrays = load_arrays(file, ("poses", "trans", rate_key))
    try:
        rate = numbers_of(arrays[rate_key])
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
    """The motion with Y up, and a note."""
    x, y, z = upward(known_roles(motion.skeleton), motion.joint_pos_m())
    if y > UP_AXIS_MARGIN * max(abs(x), abs(z)):
        return motion, "read as Y up, because the body stands along Y, and not as Z up as in AMASS"
    return rotated_world(motion, Z_UP_TO_Y_UP), "rotated from Z up, as in AMASS, to Y up"
