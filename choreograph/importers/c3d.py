"""C3D: plug-in-gait markers of one dancer, fitted with a skeleton measured from them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from choreograph.errors import FormatError, ParameterError
from choreograph.importers._c3d_markers import Markers, read_markers
from choreograph.importers._unread import Unread, attempted
from choreograph.motion.floor import estimate_floor_m
from choreograph.motion.joint_centres import joint_centres
from choreograph.motion.marker_fitting import fit_error_m, fit_positions
from choreograph.motion.motion import Motion, check_length
from choreograph.motion.skeleton import Skeleton
from choreograph.motion.skeleton_calibration import measure_skeleton, resized, size_ratio
from choreograph.takes import Credits, Take

Floats = NDArray[np.float64]

LAYOUT = "a single NAME.c3d of plug-in-gait markers"
_SMALLEST_BODY_M, _LARGEST_BODY_M = 0.3, 10.0  # of a child to a giant on stilts
_FEET = ("left_heel", "right_heel", "left_foot", "right_foot")


def detect(path: Path) -> bool:
    """Whether `path` is one C3D file."""
    return path.is_file() and is_c3d(path)


def is_c3d(path: Path) -> bool:
    """Whether the name is that of a C3D file."""
    # Hidden files come from other programs, such as macOS's "._NAME.c3d".
    return path.suffix.lower() == ".c3d" and not path.name.startswith(".")


def read(path: Path) -> Iterator[Take | Unread]:
    """The file as a take without music, named after it."""
    (found,) = read_c3d_files([path])
    if isinstance(found, Unread):
        yield found
        return
    motion, notes = found
    yield Take(path.stem, motion, Credits(source=path.name), source_paths=(path,), notes=notes)


def read_c3d_files(paths: Sequence[Path]) -> list[tuple[Motion, tuple[str, ...]] | Unread]:
    """The motions of C3D files and notes on each, all on one skeleton, the mean of all frames.

    Recordings are scaled to its size first: of one dancer that changes little, of several it keeps their
    feet from sliding. A file that is damaged or lacks a marker is unread.
    """
    recordings = [attempted(_recording, path) for path in paths]
    read = [recording for recording in recordings if not isinstance(recording, Unread)]
    if not read:
        return [recording for recording in recordings if isinstance(recording, Unread)]
    roles = read[0].roles  # the same for all
    skeleton = measure_skeleton(np.concatenate([recording.pos_m for recording in read]), roles)
    return [
        recording if isinstance(recording, Unread) else attempted(partial(_fitted, skeleton, recording), path)
        for path, recording in zip(paths, recordings, strict=True)
    ]


@dataclass(frozen=True, eq=False)
class _Recording:
    """Markers, and the joints between them."""

    markers: Markers
    pos_m: Floats  # (T, R, 3)
    roles: tuple[str, ...]  # R of them


def _recording(path: Path) -> _Recording:
    """One file; `FormatError` if it is damaged or lacks a marker."""
    markers = read_markers(path)
    try:
        check_length(markers.n_frames, len(markers.pos_m), markers.fps)
        pos_m, roles = joint_centres(markers.pos_m)
    except (ParameterError, np.linalg.LinAlgError) as error:
        raise FormatError(f"{path}: {error}") from None
    height_m = float(np.ptp(measure_skeleton(pos_m, roles).rest_pos_m()[:, 1]))
    if not _SMALLEST_BODY_M < height_m < _LARGEST_BODY_M:
        raise FormatError(
            f"{path}: expected markers of a body, got one {height_m:.3g} m tall: is the unit right?"
        )
    return _Recording(markers, pos_m, roles)


def _fitted(skeleton: Skeleton, recording: _Recording, path: Path) -> tuple[Motion, tuple[str, ...]]:
    try:
        return _on_skeleton(skeleton, recording.pos_m, recording.roles, recording.markers)
    except (ValueError, np.linalg.LinAlgError):  # axes of a body whose joints are in one place
        raise FormatError(f"{path}: expected markers on a body, got some in one place: damaged?") from None


def _on_skeleton(
    skeleton: Skeleton, pos_m: Floats, roles: tuple[str, ...], markers: Markers
) -> tuple[Motion, tuple[str, ...]]:
    ratio = size_ratio(measure_skeleton(pos_m, roles), skeleton)
    floor_m = estimate_floor_m(pos_m[:, [roles.index(role) for role in _FEET]])
    sized_m = resized(pos_m, np.full(len(pos_m), ratio), floor_m)  # (T, R, 3)
    root_pos_m, local_quat = fit_positions(skeleton, sized_m, roles, fps=markers.fps)
    error_m = fit_error_m(skeleton, root_pos_m, local_quat, sized_m, roles)
    note = f"joints, estimated from markers, are fitted within {100 * error_m.mean():.1f} cm on average"
    return Motion(skeleton, root_pos_m, local_quat, markers.fps), (*markers.notes, note)
