"""The dance-with-melody dataset: folders `DANCE_<G>_<n>` of audio, config and markers.

Tang, Jia, Mao: Dance with Melody (ACM Multimedia 2018). Three properties are undocumented. Most takes are
spliced from several bodies: thighs change from 44 to 55 cm within a second. The floor under the feet drifts
by up to half a metre within a take. Figures were joined by moving every marker along a straight line for five
frames, which makes corners that no body can dance. No dancer is named. We therefore cluster frames by bone
lengths into three bodies, scale the frames of each body to the size of one skeleton, the mean of all frames,
fit that skeleton, track the floor over time, and bridge the fitted rotations at the joins.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from choreograph.core.errors import FormatError
from choreograph.core.files import read_json
from choreograph.core.numerics import Floats
from choreograph.formats.manifest import SkippedFile, each_attempted
from choreograph.motion.cleaning import Span, bridged, bridged_rotations
from choreograph.motion.contacts import estimate_floor_m, sole_pos_m, track_floor_m
from choreograph.motion.marker_fitting import (
    BodyClusters,
    cluster_bodies,
    fit_error_m,
    fit_positions,
    measure_skeleton,
    resized,
    size_ratio,
)
from choreograph.motion.motion import Credits, Motion, Take
from choreograph.motion.skeleton import Skeleton

LAYOUT = "dance-with-melody: a folder of DANCE_<G>_<n> with skeletons.json, or one of them"
_FOLDER = re.compile(r"DANCE_([A-Z])_(\d+)")
_GENRES = {"C": "cha-cha", "R": "rumba", "T": "tango", "W": "waltz"}
_SOURCE = "Tang, Jia, Mao 2018, Dance with Melody"
_LICENCE = "none stated"
_CONFIG_FPS = 25.0  # of start_position and end_position
_POINTS = 23
_FAR_CM = 1e5
N_BODIES = 3
_SPIKE_M = 0.1  # from the mean of the frames before and after
_STRAIGHT_M = 7e-4  # from a straight line, by rounding alone
_JOIN_FRAMES = range(3, 11)  # shorter spans are chance, in longer ones a dancer holds still
# The points that are joints or landmarks. Points 21 and 22 are on the wrists, next to 14 and 6.
_ROLES = {
    "right_temple": 0, "left_temple": 1, "spine1": 2, "right_shoulder": 3, "right_elbow": 4, "right_wrist": 5,
    "right_hand": 6, "right_hip": 7, "right_knee": 8, "right_ankle": 9, "right_heel": 10, "right_foot": 11,
    "left_shoulder": 12, "left_elbow": 13, "left_wrist": 14, "left_hand": 15, "left_hip": 16, "left_knee": 17,
    "left_ankle": 18, "left_heel": 19, "left_foot": 20,
}  # fmt: skip
ROLES = (*_ROLES, "head")  # the head joint: the mean of the temples
_FEET = [ROLES.index(f"{side}_foot") for side in ("left", "right")]


def detect(path: Path) -> bool:
    """Whether `path` is a folder of such takes, or one of them."""
    return bool(_folders(path))


def read(path: Path) -> Iterator[Take | SkippedFile]:
    """All takes in `path`, on one skeleton, with the feet at y = 0. Folders of songs alone are not takes."""
    folders = _folders(path)
    found = dict(zip(folders, each_attempted((_points_of, folder) for folder in folders), strict=True))
    points = {folder: pos_m for folder, pos_m in found.items() if not isinstance(pos_m, SkippedFile)}
    yield from (unread for unread in found.values() if isinstance(unread, SkippedFile))
    if not points:
        return
    joins = {folder: straight_spans(pos_m) for folder, pos_m in points.items()}
    points = {folder: without_spikes(pos_m) for folder, pos_m in points.items()}
    all_points = np.concatenate(list(points.values()))  # (sum of T, 22, 3)
    bodies = cluster_bodies(all_points, ROLES, min(N_BODIES, len(all_points)))
    skeleton = measure_skeleton(all_points, ROLES)
    yield from each_attempted(
        (partial(_take, pos_m=pos_m, joins=joins[folder], skeleton=skeleton, bodies=bodies), folder)
        for folder, pos_m in points.items()
    )


def _points_of(folder: Path) -> Floats:
    return read_points_m(folder / "skeletons.json")


def read_points_m(path: Path) -> Floats:
    """Positions (T, 22, 3) in metres of `ROLES` from a skeletons.json, floor height unchanged.

    Raises `FormatError`.
    """
    data = _read_json(path)
    try:
        center = np.asarray(data["center"], np.float64)  # (T, 3)
        around = np.asarray(data["skeletons"], np.float64)  # (T, 23, 3)
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise FormatError(f"{path}: expected numbers under 'center' and 'skeletons', got {error}") from error
    n_frames = len(center) if center.ndim else 0
    if n_frames < 2 or center.shape != (n_frames, 3) or around.shape != (n_frames, _POINTS, 3):
        raise FormatError(
            f"{path}: expected center (n, 3) and skeletons (n, {_POINTS}, 3) of 2 frames or more, "
            f"got {center.shape} and {around.shape}"
        )
    if data.get("length", n_frames) != n_frames:
        raise FormatError(
            f"{path}: expected {data['length']} frames as stated in 'length', got {n_frames}: file cut short?"
        )
    if not ((np.abs(center) < _FAR_CM).all() and (np.abs(around) < _FAR_CM).all()):
        raise FormatError(f"{path}: expected finite positions within a kilometre, got others")
    pos_cm = (around + center[:, None])[:, list(_ROLES.values())]  # (T, 21, 3)
    head = pos_cm[:, :2].mean(axis=1, keepdims=True)
    return np.concatenate([pos_cm, head], axis=1) / 100.0


def without_spikes(pos_m: Floats) -> Floats:
    """Positions (T, R, 3) with one-frame spikes of markers replaced by the mean of their neighbours."""
    between = 0.5 * (pos_m[:-2] + pos_m[2:])
    far = np.linalg.norm(pos_m[1:-1] - between, axis=-1, keepdims=True) > _SPIKE_M
    return np.concatenate([pos_m[:1], np.where(far, between, pos_m[1:-1]), pos_m[-1:]])


def straight_spans(pos_m: Floats) -> list[Span]:
    """Spans of frames in which all positions (T, R, 3) move along straight lines at constant speed."""
    off_m = np.linalg.norm(np.diff(pos_m, n=2, axis=0), axis=-1).max(axis=1)  # (T - 2,)
    straight = np.concatenate([[False], off_m < _STRAIGHT_M, [False]])  # (T,)
    edges = np.flatnonzero(np.diff(straight.astype(np.int8))).reshape(-1, 2) + 1
    return [(int(start), int(stop)) for start, stop in edges if stop - start in _JOIN_FRAMES]


def _folders(path: Path) -> list[Path]:
    if not path.is_dir():
        return []
    named = [folder for folder in (path, *path.iterdir()) if _FOLDER.fullmatch(folder.name)]
    found = [folder for folder in named if (folder / "skeletons.json").is_file()]
    return sorted(found, key=lambda folder: folder.name)


def _read_json(path: Path) -> dict[str, Any]:
    data = read_json(path, "JSON beside the other files of the take")
    if not isinstance(data, dict):
        raise FormatError(f"{path}: expected a JSON object, got {type(data).__name__}")
    return data


def _span_s(path: Path) -> tuple[float, float]:
    """Start and end in seconds of the danced part of the audio."""
    data = _read_json(path)
    frames = [data.get("start_position"), data.get("end_position")]
    numbers = [f for f in frames if isinstance(f, int | float) and not isinstance(f, bool)]
    if len(numbers) < 2:
        raise FormatError(f"{path}: expected start_position and end_position in frames, got {frames}")
    start, end = numbers
    if not 0 <= start < end:
        raise FormatError(f"{path}: expected 0 <= start_position < end_position, got {start} and {end}")
    return start / _CONFIG_FPS, end / _CONFIG_FPS


def _take(folder: Path, pos_m: Floats, joins: list[Span], skeleton: Skeleton, bodies: BodyClusters) -> Take:
    start_s, end_s = _span_s(folder / "config.json")
    fps = len(pos_m) / (end_s - start_s)
    root_pos_m, local_quat, error_m = fit_bodies(skeleton, bodies, pos_m, fps)
    root_pos_m, local_quat = bridged(root_pos_m, joins), bridged_rotations(local_quat, joins)
    motion, drift_m = _on_floor(Motion(skeleton, root_pos_m, local_quat, fps))
    song = folder / "audio.mp3"
    letter = _FOLDER.fullmatch(folder.name)[1]  # type: ignore[index]  # `_folders` matched it
    notes = [f"markers, scaled to the skeleton, are fitted within {100 * error_m.mean():.1f} cm on average"]
    if drift_m > 0.05:
        notes.append(f"the floor drifted by {100 * drift_m:.0f} cm, which was removed")
    if joins:
        notes.append(f"{len(joins)} joins of figures by straight lines were bridged smoothly")
    return Take(
        name=folder.name,
        motion=motion,
        credits=Credits(genre=_GENRES.get(letter, letter), licence=_LICENCE, source=_SOURCE),
        song_path=song if song.is_file() else None,
        song_start_s=start_s,
        song_name=folder.name,
        source_paths=tuple(
            p for p in (folder / "skeletons.json", folder / "config.json", song) if p.is_file()
        ),
        notes=tuple(notes),
    )


def fit_bodies(
    skeleton: Skeleton, bodies: BodyClusters, pos_m: Floats, fps: float
) -> tuple[Floats, Floats, Floats]:
    """Root positions (T, 3), local rotations (T, 24, 4) and joint errors (T, R') in metres, on `skeleton`.

    The markers (T, R, 3) are first scaled to its size, each frame by the size of its body. Otherwise a
    dancer 10 % taller would be centimetres off, and would slide because the steps are too long.
    """
    size = bodies.membership(pos_m, ROLES, fps) @ [size_ratio(body, skeleton) for body in bodies.skeletons]
    floor_m = estimate_floor_m(pos_m[:, _FEET])
    sized_m = resized(pos_m, size, floor_m)
    root_pos_m, local_quat = fit_positions(skeleton, sized_m, ROLES, fps=fps)
    return root_pos_m, local_quat, fit_error_m(skeleton, root_pos_m, local_quat, sized_m, ROLES)


def _on_floor(motion: Motion) -> tuple[Motion, float]:
    """The motion with its feet on y = 0, and the range of the floor drift in metres."""
    floor_m = track_floor_m(sole_pos_m(motion), motion.fps)  # (T,)
    root_pos_m = motion.root_pos_m - floor_m[:, None] * [0.0, 1.0, 0.0]
    return replace(motion, root_pos_m=root_pos_m), float(np.ptp(floor_m))
