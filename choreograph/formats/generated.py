"""Dances as other systems write them: pickles and arrays (.npy) of SMPL poses or of joint positions.

The layouts follow the public code of the systems, and were tested on files made after it:

- EDGE, POPDG, LODGE: a pickle of `smpl_poses` (T, 72 or more) and `smpl_trans` (T, 3), at 30 fps
- LODGE: an array (T, 139) of 4 contacts, root position and 22 rotations in 6D, (T, 135) without the contacts,
  and (T, 319) or (T, 315) with fingers, at 30 fps
- FACT: an array (T, 225) of 6 zeros, root position and 24 rotation matrices, at 60 fps
- Bailando: `pred_position` in a pickled array, or an array of joint positions (T, 72) or (T, 24, 3), at
  60 fps
- arrays of the first 22 joints of SMPL, (T, 66) or (T, 22, 3), at 30 fps

None of the files states its rate. A note says which one was assumed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from choreograph.core.errors import FormatError, ParameterError
from choreograph.core.files import BUDGETS, read_bytes
from choreograph.core.numerics import Floats
from choreograph.formats.aist import arrays_of, has_scaling
from choreograph.formats.amass import LARGEST_NUMBER, numbers_of, rotated_world, smpl_motion
from choreograph.formats.axes_and_units import rotation_to_y_up, unit_m
from choreograph.formats.manifest import SkippedFile, each_attempted
from choreograph.formats.npz import MAGIC, array_of, header_of
from choreograph.motion import rotations as rot
from choreograph.motion.marker_fitting import fit_positions
from choreograph.motion.motion import Credits, Motion, Take, check_length
from choreograph.motion.skeleton import CANONICAL_JOINTS, Skeleton, canonical_skeleton

LAYOUT = "a dance of EDGE, LODGE, FACT or Bailando: a pickle or .npy of SMPL poses or joint positions"
_PICKLE_FPS = 30.0
_LONGEST_NAME = 40
_BODY = 22  # joints before the hands
_CONTACTS, _ZEROS = 4, 6  # columns before those of the motion


def detect(path: Path) -> bool:
    """Whether `path` is a pickle without the scaling of AIST++, or an array."""
    return path.is_file() and (
        path.suffix.lower() == ".npy" or (path.suffix.lower() == ".pkl" and not has_scaling(path))
    )


def read(path: Path) -> Iterator[Take | SkippedFile]:
    """The file as a take without music, named after it."""
    yield from each_attempted([(_take, path)])


def _take(path: Path) -> Take:
    try:
        motion, notes = _motion_of(_content(path))
    except (FormatError, ParameterError) as error:
        raise FormatError(f"{path}: {error}") from None
    rotation, note = rotation_to_y_up(motion.skeleton, motion.joint_pos_m())
    if note:
        motion, notes = rotated_world(motion, rotation), (*notes, note)
    name = path.name.removesuffix(path.suffix).removesuffix(".pkl")  # Bailando writes NAME.pkl.npy
    return Take(name, motion, Credits(source=path.name), source_paths=(path,), notes=notes)


def _content(path: Path) -> Any:
    """The dictionary of a pickle, or the array or pickled dictionary of an .npy file. Runs no code of it."""
    data = read_bytes(
        path, "a dance", max_bytes=BUDGETS["pkl" if path.suffix.lower() == ".pkl" else "npy"].file_bytes
    )
    if not data.startswith(MAGIC):
        return arrays_of(data)
    header = header_of(data)
    return arrays_of(data[header.n_bytes :]) if header.kind is None else array_of(data, header)


def _motion_of(content: Any) -> tuple[Motion, tuple[str, ...]]:
    """The motion of a dictionary or an array, with notes."""
    if not isinstance(content, Mapping):
        return _from_array(content)
    if "smpl_poses" in content and "smpl_trans" in content:
        motion = smpl_motion(content["smpl_poses"], content["smpl_trans"], _PICKLE_FPS)
        return motion, (_rate_note(_PICKLE_FPS),)
    for name in ("pred_position", "full_pose"):
        if name in content:
            return _from_array(content[name])
    names = ", ".join(ascii(name[:_LONGEST_NAME])[1:-1] for name in sorted(content)[:4])
    raise FormatError(
        f"expected smpl_poses and smpl_trans, pred_position or full_pose, got {names or 'nothing'}"
    )


def _from_array(array: Any) -> tuple[Motion, tuple[str, ...]]:
    rows = numbers_of(array)
    shape = rows.shape
    if rows.ndim == 4 and rows.shape[0] == 1:  # a batch of one dance
        rows = rows[0]
    if rows.ndim == 3:  # joints of a frame, or parts of a dance one after another
        n_columns = 3 * rows.shape[1] if rows.shape[2] == 3 else rows.shape[2]
        rows = rows.reshape(-1, n_columns)
    layout = _LAYOUTS.get(rows.shape[1]) if rows.ndim == 2 else None
    if layout is None or len(rows) == 0:
        known = ", ".join(map(str, _LAYOUTS))
        raise FormatError(f"expected an array (T, N) with N among {known}, got {shape}")
    if not (np.abs(rows) < LARGEST_NUMBER).all():
        raise FormatError(f"expected finite numbers below {LARGEST_NUMBER:g}, got others: damaged data?")
    make, fps = layout
    check_length(len(rows), len(CANONICAL_JOINTS), fps)
    return make(rows, fps), (_rate_note(fps),)


def _rate_note(fps: float) -> str:
    return f"the file does not state its rate: read at {fps:g} fps"


def _from_6d(rows: Floats, fps: float) -> Motion:
    """Root position and rotations (T, 3 + 6 J), of which the 22 of the body are used."""
    matrix = _orthogonal(rows[:, 3 : 3 + 6 * _BODY].reshape(len(rows), _BODY, 2, 3))
    return _posed(rows[:, :3], rot.from_matrix(matrix), fps)


def _orthogonal(six: Floats) -> Floats:
    """Rotation matrices (..., 3, 3) of their first two rows (..., 2, 3), which need not be orthogonal."""
    x, y = _unit(six[..., 0, :]), _unit(six[..., 1, :])
    y = _unit(y - (x * y).sum(axis=-1, keepdims=True) * x)
    return np.stack([x, y, np.cross(x, y)], axis=-2)


def _unit(vectors: Floats) -> Floats:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    if not (length > 1e-6).all():
        raise FormatError("expected rotations, got some without a direction: another layout?")
    return np.asarray(vectors / length, np.float64)


def _from_matrices(rows: Floats, fps: float) -> Motion:
    """6 zeros, root position and 24 matrices (T, 225), each replaced by the nearest rotation."""
    given = rows[:, _ZEROS + 3 :].reshape(len(rows), len(CANONICAL_JOINTS), 3, 3)
    u, _, vh = np.linalg.svd(given)
    u[..., 2] *= np.sign(np.linalg.det(u @ vh))[..., None]
    return _posed(rows[:, _ZEROS : _ZEROS + 3], rot.from_matrix(u @ vh), fps)


def _posed(root_pos_m: Floats, quat: Floats, fps: float) -> Motion:
    """The motion of the canonical body with rotations (T, J, 4) of its first J joints."""
    local_quat = np.tile(rot.IDENTITY, (len(quat), len(CANONICAL_JOINTS), 1))
    local_quat[:, : quat.shape[1]] = quat
    return Motion(canonical_skeleton(), root_pos_m, rot.make_continuous(local_quat), fps)


def _from_positions(rows: Floats, fps: float) -> Motion:
    """Joint positions (T, 3 J) in any unit, fitted by a body of the same bone lengths."""
    if len(rows) < 2:
        raise FormatError("expected joint positions of two frames or more, got one frame")
    pos = rows.reshape(len(rows), -1, 3)
    roles, body = CANONICAL_JOINTS[: pos.shape[1]], canonical_skeleton()
    rotation, _ = rotation_to_y_up(body, pos)
    pos_m = rot.rotate(rotation, pos * unit_m(body, pos)[0])
    skeleton = _with_lengths_of(pos_m)
    try:
        return Motion(skeleton, *fit_positions(skeleton, pos_m, roles, fps=fps), fps)
    except ParameterError:
        raise
    except ValueError:  # of a frame whose joints are in one place, or of a body without a size
        raise FormatError("expected joint positions of a body, got others: another layout?") from None


def _with_lengths_of(pos_m: Floats) -> Skeleton:
    """The canonical body with the mean lengths of the bones between joints (T, J, 3)."""
    body = canonical_skeleton()
    offsets_m, parents = body.offsets_m.copy(), body.parents
    for joint in range(1, pos_m.shape[1]):
        length_m = np.linalg.norm(pos_m[:, joint] - pos_m[:, parents[joint]], axis=-1).mean()
        offsets_m[joint] *= length_m / np.linalg.norm(offsets_m[joint])
    return replace(body, offsets_m=offsets_m)


# By the number of columns: how it is read, and at what rate.
_Maker = Callable[[Floats, float], Motion]
_LAYOUTS: dict[int, tuple[_Maker, float]] = {
    66: (_from_positions, 30.0),
    72: (_from_positions, 60.0),
    135: (_from_6d, 30.0),
    139: (lambda rows, fps: _from_6d(rows[:, _CONTACTS:], fps), 30.0),
    225: (_from_matrices, 60.0),
    315: (_from_6d, 30.0),
    319: (lambda rows, fps: _from_6d(rows[:, _CONTACTS:], fps), 30.0),
}
