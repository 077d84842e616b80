"""C3D: plug-in-gait markers of one dancer, and a skeleton that is measured from them and fitted to them."""

from __future__ import annotations

import struct
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import c3d
import numpy as np
import scipy
from numpy.typing import NDArray

from choreograph.core.budgets import BUDGETS
from choreograph.core.errors import FormatError, ParameterError
from choreograph.core.files import check_regular
from choreograph.core.numerics import Floats
from choreograph.formats.axes_and_units import rotation_from_upward
from choreograph.formats.manifest import SkippedFile, each_attempted
from choreograph.motion import rotations as rot
from choreograph.motion.contacts import estimate_floor_m
from choreograph.motion.joint_centres import REQUIRED_MARKERS, joint_centres
from choreograph.motion.marker_fitting import fit_error_m, fit_positions
from choreograph.motion.motion import Credits, Motion, Take, check_length
from choreograph.motion.skeleton import Skeleton
from choreograph.motion.skeleton_calibration import measure_skeleton, resized, size_ratio

# Labelled markers in metres, with Y up and without gaps.


_UNITS_M = {"mm": 0.001, "cm": 0.01, "m": 1.0, "in": 0.0254, "": 0.001}  # most files without a unit are in mm
# Names of the same marker in other versions of the marker set.
_ALIASES = {
    "LASI": "LFWT", "RASI": "RFWT", "LPSI": "LBWT", "RPSI": "RBWT", "LTIB": "LSHN", "RTIB": "RSHN",
}  # fmt: skip
_MAX_BYTES = BUDGETS["c3d"].file_bytes
_ROOM_M = 1000.0
_LONG_GAP_S = 0.25  # longer ones are noted
_JUMP_FRAMES, _JUMP_M = 5, 0.02  # a sample that far from the median of that many frames is an error
_HEAD, _FEET = ("LFHD", "RFHD", "LBHD", "RBHD", "C7"), ("LTOE", "RTOE", "LHEE", "RHEE", "LANK", "RANK")
# Exceptions of the library for files that are cut off, damaged or of another format.
_DAMAGE = (
    AssertionError, AttributeError, EOFError, IndexError, KeyError, MemoryError, NameError, OverflowError,
    TypeError, ValueError, ZeroDivisionError, struct.error,
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Markers:
    """Marker positions over time by label, without the prefix of the subject."""

    pos_m: Mapping[str, Floats]  # label -> (T, 3), Y up
    fps: float
    notes: tuple[str, ...]  # on gaps and on markers that are not read

    @property
    def n_frames(self) -> int:
        """Number of frames T."""
        return len(next(iter(self.pos_m.values())))


def read_markers(path: Path) -> Markers:
    """The markers of a C3D file that have a sample. Gaps are interpolated, and long ones are noted.

    A sample is missing if its residual is negative, or if it is exactly at the origin, outside of any room,
    or far from its neighbours. The prefix `subject:` of labels is removed. Raises `FormatError` if the file
    is damaged, over 256 MiB, has no labelled point, or has several dancers.
    """
    labels, points, fps, unit = _read(path)
    names, notes = _names(path, labels)
    in_room = (np.abs(unit * points[..., :3]) < _ROOM_M).all(axis=-1)  # (T, P), never where it is NaN
    missing = (points[..., 3] < 0) | (points[..., :3] == 0).all(axis=-1) | ~in_room
    pos_m: dict[str, Floats] = {}
    for column, name in names.items():
        if missing[:, column].all():
            continue
        filled = unit * _filled(points[:, column, :3], missing[:, column])
        pos_m[name] = _filled(filled, _jumps(filled))
        gap_s = _longest_run(missing[:, column]) / fps
        if gap_s > _LONG_GAP_S:
            notes.append(f"marker {name} is missing for {gap_s:.2f} s, which was interpolated")
    if not pos_m:
        raise FormatError(f"{path}: expected labelled markers, got none with a valid sample")
    return Markers(_y_up(pos_m), fps, tuple(notes))


def _read(path: Path) -> tuple[list[str], Floats, float, float]:
    """Labels, points (T, P, 5) in the unit of the file with residual and cameras, fps, metres per unit."""
    if check_regular(path, "a C3D file").stat().st_size > _MAX_BYTES:
        raise FormatError(f"{path}: expected at most {_MAX_BYTES >> 20} MiB, got more")
    try:
        with open(path, "rb") as file, warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about properties that are checked below
            reader = c3d.Reader(file)
            labels = [str(label).strip() for label in reader.point_labels]
            unit = reader.get("POINT:UNITS")
            unit_name = "" if unit is None else unit.string_value.strip().lower()
            fps, expected = float(reader.point_rate), int(reader.frame_count)
            frames = [points.astype(np.float64) for _, points, _ in reader.read_frames()]
    except _DAMAGE as error:
        raise FormatError(
            f"{path}: expected a C3D file, got something else ({type(error).__name__}: {error}): damaged?"
        ) from None
    if len(frames) < 2 or len(frames) != expected:
        raise FormatError(f"{path}: expected {expected} frames, at least 2, got {len(frames)}: cut short?")
    if len(labels) > frames[0].shape[0]:
        raise FormatError(
            f"{path}: expected a point for each of {len(labels)} labels, got {len(frames[0])}: damaged?"
        )
    if not (np.isfinite(fps) and fps > 0):
        raise FormatError(f"{path}: expected a frame rate above 0, got {fps}")
    if unit_name not in _UNITS_M:
        raise FormatError(
            f"{path}: expected a unit among {', '.join(filter(None, _UNITS_M))}, got {unit_name!r}"
        )
    return labels, np.stack(frames), fps, _UNITS_M[unit_name]


def _names(path: Path, labels: list[str]) -> tuple[dict[int, str], list[str]]:
    """The names of the labelled points of the dancer by column, and a note on other subjects.

    Points that the software could not name ("*12") are left out. So are those of props, which are subjects
    without the markers of a body.
    """
    subjects = [label.rpartition(":")[0] for label in labels]
    short = [label.rpartition(":")[2].upper() for label in labels]
    names = [_ALIASES.get(name, name) for name in short]
    of: dict[str, set[str]] = {subject: set() for subject in subjects if subject}
    for subject, name in zip(subjects, names, strict=True):
        of.get(subject, set()).add(name)
    bodies = sorted(subject for subject, own in of.items() if own.issuperset(REQUIRED_MARKERS))
    if len(of) > 1 and len(bodies) != 1:
        raise FormatError(f"{path}: expected one dancer, got subjects {', '.join(sorted(of))}")
    others = sorted(set(of) - set(bodies)) if len(of) > 1 else []
    notes = (
        [f"markers of {', '.join(others)} are not read, because they are not those of a body"]
        if others
        else []
    )
    kept = {
        i: name
        for i, name in enumerate(names)
        if name and not name.startswith("*") and subjects[i] not in others
    }
    return kept, notes


def _filled(pos: Floats, missing: NDArray[np.bool_]) -> Floats:
    """Positions (T, 3) with missing samples interpolated, constant before the first and after the last."""
    known = np.flatnonzero(~missing)
    if len(known) == len(pos):
        return pos
    if len(known) == 1:
        return np.repeat(pos[known], len(pos), axis=0)
    frames = np.arange(len(pos)).clip(known[0], known[-1])
    filled: Floats = scipy.interpolate.PchipInterpolator(known, pos[known])(frames)
    return filled


def _jumps(pos_m: Floats) -> NDArray[np.bool_]:
    """Samples (T,) at which a marker was confused with another, or a reflection, for one or two frames."""
    usual = scipy.ndimage.median_filter(pos_m, size=(_JUMP_FRAMES, 1), mode="nearest")
    is_far: NDArray[np.bool_] = np.linalg.norm(pos_m - usual, axis=-1) > _JUMP_M
    return is_far


def _longest_run(flags: NDArray[np.bool_]) -> int:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int)))
    return int((edges[1::2] - edges[::2]).max(initial=0))


def _y_up(pos_m: dict[str, Floats]) -> dict[str, Floats]:
    """The positions with Y up. Up is the axis along which the mean head is above the mean feet."""
    ends = [[pos_m[name].mean(axis=0) for name in group if name in pos_m] for group in (_HEAD, _FEET)]
    if not all(ends):
        return pos_m
    rotation, _ = rotation_from_upward(np.mean(ends[0], axis=0) - np.mean(ends[1], axis=0))
    return {name: rot.rotate(rotation, pos) for name, pos in pos_m.items()}


# Takes.


LAYOUT = "a single NAME.c3d of plug-in-gait markers"
SUFFIXES = (".c3d",)
_SMALLEST_BODY_M, _LARGEST_BODY_M = 0.3, 10.0  # of a child to a giant on stilts
_FOOT_MARKERS = ("left_heel", "right_heel", "left_foot", "right_foot")


def read(path: Path) -> Iterator[Take | SkippedFile]:
    """The file as a take without music, named after it."""
    (found,) = read_c3d_files([path])
    if isinstance(found, SkippedFile):
        yield found
        return
    motion, notes = found
    yield Take(path.stem, motion, Credits(source=path.name), source_paths=(path,), notes=notes)


def read_c3d_files(paths: Sequence[Path]) -> list[tuple[Motion, tuple[str, ...]] | SkippedFile]:
    """The motions of C3D files on one skeleton, the mean of all frames, with notes.

    Recordings are scaled to the size of the skeleton, so that feet of different dancers do not slide. A file
    that is damaged or lacks a marker is skipped.
    """
    recordings = list(each_attempted((_recording, path) for path in paths))
    read = [recording for recording in recordings if not isinstance(recording, SkippedFile)]
    if not read:
        return [recording for recording in recordings if isinstance(recording, SkippedFile)]
    roles = read[0].roles  # the same for all
    skeleton = measure_skeleton(np.concatenate([recording.pos_m for recording in read]), roles)
    fitted = each_attempted(
        (partial(_fitted, skeleton, recording), path)
        for path, recording in zip(paths, recordings, strict=True)
        if not isinstance(recording, SkippedFile)
    )
    return [recording if isinstance(recording, SkippedFile) else next(fitted) for recording in recordings]


@dataclass(frozen=True, eq=False)
class _Recording:
    """Markers, and the joint centres computed from them."""

    markers: Markers
    pos_m: Floats  # (T, R, 3)
    roles: tuple[str, ...]  # R of them


def _recording(path: Path) -> _Recording:
    """Read one file. Raises `FormatError` if it is damaged or lacks a marker."""
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
    except (ValueError, np.linalg.LinAlgError):  # the joints of the body are in one place
        raise FormatError(f"{path}: expected the markers of a body, got all in one place: damaged?") from None


def _on_skeleton(
    skeleton: Skeleton, pos_m: Floats, roles: tuple[str, ...], markers: Markers
) -> tuple[Motion, tuple[str, ...]]:
    ratio = size_ratio(measure_skeleton(pos_m, roles), skeleton)
    floor_m = estimate_floor_m(pos_m[:, [roles.index(role) for role in _FOOT_MARKERS]])
    sized_m = resized(pos_m, np.full(len(pos_m), ratio), floor_m)  # (T, R, 3)
    root_pos_m, local_quat = fit_positions(skeleton, sized_m, roles, fps=markers.fps)
    error_m = fit_error_m(skeleton, root_pos_m, local_quat, sized_m, roles)
    note = f"joints, estimated from markers, are fitted within {100 * error_m.mean():.1f} cm on average"
    return Motion(skeleton, root_pos_m, local_quat, markers.fps), (*markers.notes, note)
