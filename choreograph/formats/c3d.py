"""C3D: plug-in-gait markers of one dancer, and a skeleton that is measured from them and fitted to them.

Markers are placed by hand on the skin, often centimetres away from the place that the manual states. So each
joint centre is first estimated from anatomy and then corrected by the motion. The hip is the centre of the
sphere on which the markers of the thigh move about the pelvis. Knee, ankle and elbow are the points that stay
in place in both adjacent segments.

References
----------
Harrington et al., Prediction of the hip joint centre in adults, J. Biomechanics 40 (2007).
Ehrig et al., A survey of formal methods for determining the centre of rotation, J. Biomechanics 39 (2006):
the symmetrical centre of rotation (SCoRE).
"""

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

from choreograph.core.errors import FormatError, ParameterError
from choreograph.core.files import BUDGETS, check_regular
from choreograph.core.numerics import Floats
from choreograph.formats.axes_and_units import rotation_from_upward
from choreograph.formats.manifest import SkippedFile, each_attempted
from choreograph.motion import rotations as rot
from choreograph.motion.contacts import estimate_floor_m
from choreograph.motion.marker_fitting import (
    fit_error_m,
    fit_positions,
    measure_skeleton,
    resized,
    size_ratio,
)
from choreograph.motion.motion import Credits, Motion, Take, check_length
from choreograph.motion.skeleton import Skeleton

# Joint centres from markers.


MarkerPos = Mapping[str, Floats]  # name -> (T, 3) in metres, Y up
Segment = tuple[Floats, Floats]  # origin (T, 3) and axes (T, 3, 3) in columns

_SIDED = (
    "FHD",
    "BHD",
    "SHO",
    "UPA",
    "ELB",
    "FRM",
    "WRA",
    "WRB",
    "FWT",
    "BWT",
    "THI",
    "KNE",
    "SHN",
    "ANK",
    "HEE",
    "TOE",
)
REQUIRED_MARKERS = ("C7", "T10", "CLAV", "STRN", *(side + name for name in _SIDED for side in "LR"))

# From the marker's centre to the joint's: half the joint's width and the marker's radius.
_KNEE_M, _ANKLE_M, _ELBOW_M = 0.055, 0.042, 0.042
_SHOULDER_DROP_M = 0.055  # from the marker on the acromion, along the trunk
_HEAD_DROP_M = 0.09  # from the head band to the joint at the base of the skull
_HAND_M = 0.085  # from wrist to hand, where fingers have no marker
_TOE_MARKER_M = 0.03  # above the sole
_BALL = 0.8  # of the way from heel to toe marker
_HIP_PRIOR = 0.3  # weight of anatomy, relative to the distance of one sample to the sphere
_CENTRE_PRIOR, _AXIS_PRIOR = 0.1, 2.0  # the same across a hinge's axis, and more along it
_HINGE_PASSES = 4
_STRETCHED_PERCENT = 5.0  # of the frames: in these a knee is straight, if ever
_CALIBRATION_FRAMES = 600
_FLAT_SHARE = 0.1  # of the frames, with the lowest heel: there the foot is flat


def joint_centres(markers: MarkerPos) -> tuple[Floats, tuple[str, ...]]:
    """Positions (T, R, 3) in metres of joints and landmarks, and their R names, for `fit_positions`.

    `markers` are those of one take, since markers are attached again for each take. They are
    `REQUIRED_MARKERS`, and optionally "LMT5", "LFIN", "RMT5" and "RFIN". Raises `ParameterError` if a
    required marker is missing.
    """
    missing = [name for name in REQUIRED_MARKERS if name not in markers]
    if missing:
        raise ParameterError(f"expected plug-in-gait markers, missing {', '.join(missing)}")
    points: dict[str, Floats] = {}
    head = np.mean([markers[name] for name in ("LFHD", "RFHD", "LBHD", "RBHD")], axis=0)
    chest, back = 0.5 * (markers["CLAV"] + markers["C7"]), 0.5 * (markers["STRN"] + markers["T10"])
    down = rot.unit(back - chest)  # (T, 3)
    points["head"] = head + _HEAD_DROP_M * rot.unit(chest - head)
    points["spine1"] = np.mean([markers[name] for name in ("LFWT", "RFWT", "LBWT", "RBWT")], axis=0)
    for side, word in (("L", "left"), ("R", "right")):
        points[f"{word}_temple"] = 0.5 * (markers[f"{side}FHD"] + markers[f"{side}BHD"])
        points |= {f"{word}_{part}": pos for part, pos in _leg(markers, side).items()}
        shoulder = markers[f"{side}SHO"] + _SHOULDER_DROP_M * down
        points |= {f"{word}_{part}": pos for part, pos in _arm(markers, side, shoulder).items()}
    return np.stack(list(points.values()), axis=1), tuple(points)


def _leg(markers: MarkerPos, side: str) -> dict[str, Floats]:
    named = {name: markers[side + name] for name in ("THI", "KNE", "SHN", "ANK", "HEE", "TOE")}
    medial = 1.0 if side == "R" else -1.0  # of the normal of thigh and shank: knees bend backwards
    hip = _hip(markers, side)
    thigh = _segment(hip, named["KNE"], named["THI"])
    shank = _segment(named["KNE"], named["ANK"], named["SHN"])
    foot = _segment(named["HEE"], named["TOE"], markers.get(f"{side}MT5", named["ANK"]))
    foot_middle = 0.5 * (named["HEE"] + named["TOE"])
    ankle = _hinge(named["ANK"], -medial * _ANKLE_M, (named["KNE"], foot_middle), (shank, foot))
    shank = _segment(
        ankle, named["SHN"], named["ANK"]
    )  # without the knee's marker, which moves with the skin
    knee = _hinge(named["KNE"], medial * _KNEE_M, (hip, ankle), (thigh, shank))
    knee = _unstretched(knee, (hip, ankle), thigh)
    heel, toe = _sole(named["HEE"], named["TOE"], foot)
    return {"hip": hip, "knee": knee, "ankle": ankle, "heel": heel, "foot": heel + _BALL * (toe - heel)}


def _arm(markers: MarkerPos, side: str, shoulder: Floats) -> dict[str, Floats]:
    elbow, upper, lower = (markers[side + name] for name in ("ELB", "UPA", "FRM"))
    wrist = 0.5 * (markers[f"{side}WRA"] + markers[f"{side}WRB"])
    medial = 1.0 if side == "L" else -1.0  # elbows bend forwards
    upper_arm = _segment(shoulder, elbow, upper)
    forearm = _segment(wrist, markers[f"{side}WRA"], lower)
    centre = _hinge(elbow, medial * _ELBOW_M, (shoulder, wrist), (upper_arm, forearm))
    centre = _unstretched(centre, (shoulder, wrist), upper_arm)
    hand = markers.get(f"{side}FIN", wrist + _HAND_M * rot.unit(wrist - centre))
    return {"shoulder": shoulder, "elbow": centre, "wrist": wrist, "hand": hand}


def _hip(markers: MarkerPos, side: str) -> Floats:
    """The centre of the hip (T, 3), from the size of the pelvis and the spheres of the thigh's markers."""
    front = 0.5 * (markers["LFWT"] + markers["RFWT"])
    back = 0.5 * (markers["LBWT"] + markers["RBWT"])
    pelvis = _segment(front, markers["LFWT"], back)
    width = float(np.mean(np.linalg.norm(markers["LFWT"] - markers["RFWT"], axis=-1)))
    depth = float(np.mean(np.linalg.norm(front - back, axis=-1)))
    axes = pelvis[1]  # (T, 3, 3), columns: left, backwards
    # Waist markers may be higher in front than at the back. The mean vertical is used as up.
    up = rot.unit(np.einsum("tij,i->tj", axes, [0.0, 1.0, 0.0]).mean(axis=0) * [0.0, 1.0, 1.0])
    left = np.array([1.0, 0.0, 0.0])
    forward = np.cross(left, up)
    sign = 1.0 if side == "L" else -1.0
    guess = (
        sign * (0.33 * width + 0.0073) * left
        - (0.24 * depth + 0.0099) * forward
        - (0.30 * width + 0.0109) * up
    )
    kept = _sample(len(front))
    local = [_into(pelvis, markers[side + name])[kept] for name in ("KNE", "THI")]  # (K, 3) each
    prior = _HIP_PRIOR * np.sqrt(len(kept))

    def residuals(centre: Floats) -> Floats:
        radii = [np.linalg.norm(pos - centre, axis=-1) for pos in local]
        return np.concatenate([*(radius - radius.mean() for radius in radii), prior * (centre - guess)])

    return _out_of(pelvis, scipy.optimize.least_squares(residuals, guess).x)


def _hinge(
    marker: Floats, reach_m: float, ends: tuple[Floats, Floats], segments: tuple[Segment, Segment]
) -> Floats:
    """The centre (T, 3) of a joint `reach_m` beside its marker, along the axis about which it bends.

    `ends` are the joints before and after it, and `segments` the two segments that it joins. The axis is the
    mean normal of the limb in the frames where it is bent most. The first centre, on the skin, tilts the
    axis, so the axis is computed again from the next centre.
    """
    centre = marker
    for _ in range(_HINGE_PASSES):
        normal = np.cross(centre - ends[0], ends[1] - centre)  # (T, 3), longer where the limb is bent more
        normal = normal * np.linalg.norm(normal, axis=-1, keepdims=True)
        axes = [rot.unit(np.einsum("tij,ti->j", axes, normal)) for _, axes in segments]
        beside = marker + reach_m * np.einsum("tij,j->ti", segments[0][1], axes[0])
        centre = _centre(segments, beside, axes)
    return centre


def _unstretched(centre: Floats, ends: tuple[Floats, Floats], segment: Segment) -> Floats:
    """A knee or elbow (T, 3), moved forwards so that a stretched limb is straight and not bent backwards.

    Skin slides over a bending joint, so that its estimated centre lies too far back and straight legs seem to
    be bent backwards.
    """
    normal = np.cross(centre - ends[0], ends[1] - centre)
    normal = normal * np.linalg.norm(normal, axis=-1, keepdims=True)
    axis = np.einsum("tij,j->ti", segment[1], rot.unit(np.einsum("tij,ti->j", segment[1], normal)))
    for _ in range(_HINGE_PASSES):
        upper, lower = centre - ends[0], ends[1] - centre
        lengths = [np.linalg.norm(bone, axis=-1) for bone in (upper, lower)]  # (T,) each
        sine = np.sum(np.cross(upper, lower) * axis, axis=-1) / (lengths[0] * lengths[1])
        bent_back = -float(np.percentile(sine, _STRETCHED_PERCENT))  # radians, since small
        if bent_back <= 0.0:
            break
        forward = rot.unit(np.cross(ends[1] - ends[0], axis))
        centre = centre + bent_back / np.mean(1.0 / lengths[0] + 1.0 / lengths[1]) * forward
    return centre


def _centre(segments: tuple[Segment, Segment], guess: Floats, axes: Sequence[Floats]) -> Floats:
    """The point (T, 3) that moves least in both segments.

    Its place along the axis does not follow from motion, so it is that of `guess`.
    """
    kept = _sample(len(guess))
    guesses = np.concatenate([_into(segment, guess)[kept].mean(axis=0) for segment in segments])  # (6,)
    (origin, basis), (other_origin, other_basis) = segments
    apart = np.concatenate([basis[kept], -other_basis[kept]], axis=2).reshape(-1, 6)  # (3K, 6)
    offset = (other_origin - origin)[kept].ravel()  # (3K,)
    prior = np.sqrt(len(kept)) * scipy.linalg.block_diag(
        *(_CENTRE_PRIOR * np.eye(3) + _AXIS_PRIOR * np.outer(axis, axis) for axis in axes)
    )
    solved, *_ = np.linalg.lstsq(np.concatenate([apart, prior]), np.concatenate([offset, prior @ guesses]))
    return 0.5 * (_out_of(segments[0], solved[:3]) + _out_of(segments[1], solved[3:]))


def _sole(heel: Floats, toe: Floats, foot: Segment) -> tuple[Floats, Floats]:
    """Heel and toe (T, 3) on the sole, below their markers in the frames where the foot stands flat."""
    rise = heel[:, 1] - toe[:, 1]  # (T,)
    flat = np.argsort(rise)[: max(1, round(_FLAT_SHARE * len(rise)))]
    down = rot.unit(-foot[1][flat, 1].mean(axis=0))  # world's down in the foot's axes
    down = np.einsum("tij,j->ti", foot[1], down)
    heel_m = _TOE_MARKER_M + float(np.median(rise[flat]))
    return heel + max(heel_m, 0.0) * down, toe + _TOE_MARKER_M * down


def _segment(origin: Floats, along: Floats, towards: Floats) -> Segment:
    """A rigid segment from three points (T, 3): its origin (T, 3), and axes (T, 3, 3) in columns."""
    first = rot.unit(along - origin)
    second = towards - origin
    second = rot.unit(second - first * np.sum(first * second, axis=-1, keepdims=True))
    return origin, np.stack([first, second, np.cross(first, second)], axis=-1)


def _into(segment: Segment, pos: Floats) -> Floats:
    return np.einsum("tij,ti->tj", segment[1], pos - segment[0])


def _out_of(segment: Segment, local: Floats) -> Floats:
    return segment[0] + np.einsum("tij,j->ti", segment[1], local)


def _sample(n_frames: int) -> NDArray[np.int64]:
    return np.unique(np.linspace(0, n_frames - 1, _CALIBRATION_FRAMES).round().astype(np.int64))


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
        edges = np.flatnonzero(np.diff(missing[:, column], prepend=False, append=False))  # of gaps, in pairs
        gap_s = (edges[1::2] - edges[::2]).max(initial=0) / fps
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
    return scipy.interpolate.PchipInterpolator(known, pos[known])(frames)


def _jumps(pos_m: Floats) -> NDArray[np.bool_]:
    """Samples (T,) at which a marker was confused with another, or a reflection, for one or two frames."""
    usual = scipy.ndimage.median_filter(pos_m, size=(_JUMP_FRAMES, 1), mode="nearest")
    return np.linalg.norm(pos_m - usual, axis=-1) > _JUMP_M


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
