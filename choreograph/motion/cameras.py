"""Cameras for dances: one fixed from the audience, one that follows, or shots that are cut on phrases.

A shot has a fixed direction. Its camera stands still (wide) or moves with the dancers. It stands where all
that it must show is in the picture at every frame of the shot, and no nearer. Two shots in a row differ by at
least 30 degrees in direction and by a quarter in size, so that a cut does not look like a jump. Cameras stay
on the side of the audience, +Z, and above the floor.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import scipy
from numpy.typing import ArrayLike

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats
from choreograph.motion.bone_map import joint_roles
from choreograph.motion.motion import Motion

CameraMode = Literal["front", "follow", "cuts"]
CAMERA_MODES: tuple[CameraMode, ...] = ("front", "follow", "cuts")
FOV_RAD = float(np.radians(28.0))  # vertical
ASPECT = 16 / 9  # width over height of the picture
LEAST_TURN_RAD = float(np.radians(30.0))  # between two shots in a row
LEAST_SIZE_RATIO = 1.25  # of the heights that two shots in a row show
LOWEST_M = 0.25  # height of a camera over the floor
_SAMPLE_FPS = 30.0  # of the positions that must be in the picture
_KEY_S = 0.1  # between keys of a camera that moves
_CUT_S = 1e-3  # before a cut, the last key of a shot
_SMOOTHING_S = 0.7  # cameras do not follow faster movements
_SHORTEST_S = 2.5  # of a shot
_BODY_M = 0.2  # of a body around its joints
_FREE_M = 0.5  # between the sight of a close camera and other dancers
_PITCHES_RAD = np.radians([14.0, 10.0, 6.0, 3.0, 0.0, -3.0, -6.0])  # of low shots, from the steepest
_UPPER_BODY = (
    "spine1", "spine2", "spine3", "neck", "head", "left_shoulder", "right_shoulder", "left_elbow",
    "right_elbow",
)  # fmt: skip


@dataclass(frozen=True)
class _Kind:
    """What a kind of shot shows."""

    yaw_rad: (
        float  # of the camera around the dancers, from the audience. Others than wide stand on both sides
    )
    pitch_rad: float  # of the sight, above the horizontal
    share: float  # of the picture that is used, at most
    moves: bool = True  # with the dancers


_KINDS = {
    "wide": _Kind(np.radians(5.0), np.radians(-4.0), 0.8, moves=False),
    "follow": _Kind(np.radians(42.0), np.radians(-4.0), 0.9),
    "close": _Kind(np.radians(42.0), np.radians(-3.0), 0.95),
    "low": _Kind(np.radians(42.0), _PITCHES_RAD[0], 0.94),
}


@dataclass(frozen=True, eq=False)
class Shot:
    """A part of a dance that one camera shows, without roll. Between keys, it moves in straight lines."""

    name: str  # "wide", "follow", "close" or "low"
    start_s: float
    end_s: float
    times_s: Floats  # (K,) of the keys, from the start to a millisecond before the end
    eye_m: Floats  # (K, 3)
    target_m: Floats  # (K, 3) a point in the middle of the picture, among the dancers

    @property
    def shown_m(self) -> float:
        """The height that the picture shows at the dancers."""
        return 2 * float(np.tan(FOV_RAD / 2) * np.linalg.norm(self.target_m[0] - self.eye_m[0]))


@dataclass(frozen=True, eq=False)
class CameraPath:
    """The shots of a dance, in order and without gaps, in metres with Y up."""

    shots: tuple[Shot, ...]

    def at(self, times_s: ArrayLike) -> tuple[Floats, Floats]:
        """The camera and its target, (T, 3) each, at times (T,) in seconds of the dance."""
        times = np.asarray(times_s, np.float64)
        number = np.searchsorted([shot.start_s for shot in self.shots[1:]], times, side="right")
        eye, target = np.empty((len(times), 3)), np.empty((len(times), 3))
        for index, shot in enumerate(self.shots):
            here = number == index
            for out, keys in ((eye, shot.eye_m), (target, shot.target_m)):
                for axis in range(3):
                    out[here, axis] = np.interp(times[here], shot.times_s, keys[:, axis])
        return eye, target

    @property
    def cuts_s(self) -> list[float]:
        """The times of the cuts."""
        return [shot.start_s for shot in self.shots[1:]]

    @property
    def keys(self) -> tuple[Floats, Floats, Floats]:
        """The keys of all shots: times (K,), cameras (K, 3) and targets (K, 3)."""
        return (
            np.concatenate([shot.times_s for shot in self.shots]),
            np.concatenate([shot.eye_m for shot in self.shots]),
            np.concatenate([shot.target_m for shot in self.shots]),
        )


def plan_cameras(motions: Sequence[Motion], mode: CameraMode, borders_s: Sequence[float] = ()) -> CameraPath:
    """The cameras of a dance of one or several dancers, in a picture of 16 to 9.

    Parameters
    ----------
    motions : one of each dancer, of about the same length, with the floor at Y = 0 and the audience at +Z
    mode : "front" is one fixed camera, "follow" one that moves with the dancers, "cuts" changes on borders
    borders_s : increasing times of phrase borders in seconds of the dance, for "cuts"

    Raises `ParameterError` without a motion, for another mode, or for borders that do not increase.
    """
    if not motions:
        raise ParameterError("expected the motion of at least one dancer for a camera, got none")
    if mode not in CAMERA_MODES:
        raise ParameterError(f"expected a camera among {', '.join(CAMERA_MODES)}, got {mode!r}")
    borders = np.asarray(borders_s, np.float64)
    if borders.ndim != 1 or not np.isfinite(borders).all() or (np.diff(borders) <= 0).any():
        raise ParameterError("expected increasing times of phrase borders in seconds, got others")
    dancers = _Dancers.of(motions)
    if mode == "front":
        return CameraPath((dancers.shot("wide", 0.0, dancers.end_s, _KINDS["wide"].yaw_rad),))
    if mode == "follow":
        return CameraPath((dancers.shot("follow", 0.0, dancers.end_s, _KINDS["wide"].yaw_rad),))
    edges_s = [0.0]
    for border in borders.tolist():
        if edges_s[-1] + _SHORTEST_S <= border <= dancers.end_s - _SHORTEST_S:
            edges_s.append(border)
    return CameraPath(_cut(dancers, [*edges_s, dancers.end_s]))


def _cut(dancers: _Dancers, edges_s: list[float]) -> tuple[Shot, ...]:
    """A shot between each two edges. The first one is wide, and so is the last one of three or more."""
    shots: list[Shot] = []
    n_shots, order = len(edges_s) - 1, list(_KINDS)
    for index in range(n_shots):
        name = order[index % len(order)]
        if index == n_shots - 1 and n_shots != 2:
            name = "wide"
        elif index == n_shots - 2 and index and name == "wide":
            name = "close"  # after low, and before the last wide one
        before = shots[-1] if shots else None
        shots.append(dancers.best_shot(name, edges_s[index], edges_s[index + 1], before))
    return _of_other_sizes(shots)


def _of_other_sizes(shots: list[Shot]) -> tuple[Shot, ...]:
    """The shots, with wide ones moved back until they differ in size from those beside them."""
    for index, shot in enumerate(shots):
        beside = [shots[other].shown_m for other in (index - 1, index + 1) if 0 <= other < len(shots)]
        least_m = LEAST_SIZE_RATIO * max(beside, default=0.0)
        if shot.name == "wide" and shot.shown_m < least_m:
            away = (shot.eye_m - shot.target_m) * (least_m / shot.shown_m)
            shots[index] = replace(shot, eye_m=shot.target_m + away)
    return tuple(shots)


@dataclass(frozen=True, eq=False)
class _Dancers:
    """The positions of all dancers at `_SAMPLE_FPS`, and the smoothed places that cameras follow."""

    pos_m: tuple[Floats, ...]  # of each, (T, J, 3)
    upper: tuple[list[int], ...]  # joints of the upper body of each
    middle_m: Floats  # (T, 3) of all of them on the floor, smoothed
    own_m: tuple[Floats, ...]  # of each, (T, 3)
    end_s: float

    @classmethod
    def of(cls, motions: Sequence[Motion]) -> _Dancers:
        """The dancers of motions, as long as the shortest."""
        sampled = [motion.resampled(_SAMPLE_FPS) for motion in motions]
        n_frames = min(motion.n_frames for motion in sampled)
        roots_m = np.stack([motion.root_pos_m[:n_frames] for motion in sampled]) * [
            1.0,
            0.0,
            1.0,
        ]  # (D, T, 3)
        sigma = _SMOOTHING_S * _SAMPLE_FPS
        smooth_m = scipy.ndimage.gaussian_filter1d(roots_m, sigma, axis=1, mode="nearest")
        return cls(
            tuple(motion.joint_pos_m()[:n_frames] for motion in sampled),
            tuple(map(_upper_body, sampled)),
            (smooth_m.min(axis=0) + smooth_m.max(axis=0)) / 2,
            tuple(smooth_m),
            min(motion.duration_s for motion in motions),
        )

    def best_shot(self, name: str, start_s: float, end_s: float, before: Shot | None) -> Shot:
        """The shot of a kind whose direction differs enough from the one before, and whose sight is free."""
        yaw = _KINDS[name].yaw_rad
        sides = (yaw,) if name == "wide" else (yaw, -yaw)
        chosen = range(len(self.pos_m)) if name == "close" else (None,)
        found: list[tuple[float, Shot]] = []
        for dancer in chosen:
            for side in sides:
                shot = self.shot(name, start_s, end_s, side, dancer)
                if before is None or _turn_rad(before, shot) >= LEAST_TURN_RAD:
                    free_m = min(self._free_m(shot, dancer), _FREE_M)  # more is no better
                    found.append((free_m, shot))
        return max(found, key=lambda each: each[0])[1]  # the first of equal ones

    def shot(
        self, name: str, start_s: float, end_s: float, yaw_rad: float, dancer: int | None = None
    ) -> Shot:
        """A shot of all dancers, or of the upper body of one."""
        kind, frames = _KINDS[name], self._frames(start_s, end_s)
        middle_m = self.middle_m if dancer is None else self.own_m[dancer]
        middle_m = middle_m[frames] if kind.moves else np.zeros_like(middle_m[frames])
        whole = self.pos_m if dancer is None else (self.pos_m[dancer][:, self.upper[dancer]],)
        points_m = np.concatenate([(pos[frames] - middle_m[:, None]).reshape(-1, 3) for pos in whole])
        for pitch in _PITCHES_RAD if name == "low" else (kind.pitch_rad,):
            axes = _axes(yaw_rad, pitch)
            eye_m = _eye_m(points_m, axes, kind.share)
            if eye_m[1] >= LOWEST_M:
                break
        eye_m[1] = max(eye_m[1], LOWEST_M)
        depth_m = float(((points_m - eye_m) @ axes[2]).mean())
        last = end_s if end_s >= self.end_s else end_s - _CUT_S
        n_keys = max(2, round((last - start_s) / _KEY_S) + 1) if kind.moves else 2
        times_s = np.linspace(start_s, last, n_keys)
        grid_s = np.arange(frames.start, frames.stop) / _SAMPLE_FPS
        moved_m = np.stack([np.interp(times_s, grid_s, middle_m[:, axis]) for axis in range(3)], axis=1)
        eyes_m = moved_m + eye_m
        return Shot(name, start_s, end_s, times_s, eyes_m, eyes_m + depth_m * axes[2])

    def _frames(self, start_s: float, end_s: float) -> slice:
        n_frames = len(self.middle_m)
        start = min(int(start_s * _SAMPLE_FPS), n_frames - 1)
        return slice(start, max(start + 1, min(int(np.ceil(end_s * _SAMPLE_FPS)) + 1, n_frames)))

    def _free_m(self, shot: Shot, dancer: int | None) -> float:
        """The least distance of other dancers from the line of sight of a close shot."""
        others = [pos for index, pos in enumerate(self.pos_m) if index != dancer]
        if dancer is None or not others:
            return np.inf
        frames = self._frames(shot.start_s, shot.end_s)
        times_s = np.arange(frames.start, frames.stop) / _SAMPLE_FPS
        eye, target = CameraPath((shot,)).at(times_s)
        sight = (target - eye)[:, None]  # (T, 1, 3)
        points = np.concatenate([pos[frames] for pos in others], axis=1) - eye[:, None]  # (T, N, 3)
        along = np.clip((points * sight).sum(axis=-1) / (sight**2).sum(axis=-1), 0.0, 1.0)
        return float(np.linalg.norm(points - along[..., None] * sight, axis=-1).min())


def _upper_body(motion: Motion) -> list[int]:
    """The joints of the upper body, or all of an unknown rig."""
    try:
        roles = joint_roles(motion.skeleton)
    except ParameterError:
        return list(range(motion.skeleton.n_joints))
    return [roles[name] for name in _UPPER_BODY if name in roles]


def _axes(yaw_rad: float, pitch_rad: float) -> Floats:
    """Unit directions to the right, up and into the picture, rows of (3, 3), of a camera around +Z."""
    back = np.array([np.sin(yaw_rad), 0.0, np.cos(yaw_rad)])
    ahead = -np.cos(pitch_rad) * back + np.array([0.0, np.sin(pitch_rad), 0.0])
    right = np.cross(ahead, [0.0, 1.0, 0.0])
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(right, ahead), ahead])


def _eye_m(points_m: Floats, axes: Floats, share: float) -> Floats:
    """The nearest camera (3,) that has bodies around all points (N, 3) in the share of its picture.

    On each axis of the picture, the two outermost planes through the points meet at the nearest camera.
    """
    across, up, ahead = (points_m @ axes.T).T
    high = float(np.tan(FOV_RAD / 2)) * share
    place, nearest = [0.0, 0.0], np.inf
    for axis, (values, slope) in enumerate(((across, high * ASPECT), (up, high))):
        around = _BODY_M * np.sqrt(1 + slope**2)
        most = float((values - slope * ahead).max()) + around
        least = float((-values - slope * ahead).max()) + around
        place[axis] = (most - least) / 2
        nearest = min(nearest, -(most + least) / (2 * slope))
    return np.array([*place, nearest]) @ axes


def _turn_rad(before: Shot, after: Shot) -> float:
    """The angle between the directions of two shots."""
    one, other = (shot.target_m[0] - shot.eye_m[0] for shot in (before, after))
    cosine = one @ other / (np.linalg.norm(one) * np.linalg.norm(other))
    return float(np.arccos(np.clip(cosine, -1.0, 1.0)))
