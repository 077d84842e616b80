"""A camera that follows a dancer: from the front, 28° to the side, on a smoothed path."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from choreograph.errors import ParameterError
from choreograph.mannequin.skinned_mesh import Floats, SkinnedMesh, build_mannequin
from choreograph.motion.body import body_pos_m
from choreograph.motion.kinematics import forward
from choreograph.motion.motion import Motion
from choreograph.motion.pose import ground_pos_m, heading_rad
from choreograph.preview.renderer import Camera, Pixels, render_pose

_FOV_RAD = float(np.radians(28.0))
_SIDE_RAD = float(np.radians(28.0))  # of the camera, from straight ahead of the dancer
_EYE_OF_HEIGHT = 0.78  # a little below the dancer's eyes
_HIGH_OF_HEIGHT = 1.36  # what has to fit: the body with raised arms,
_WIDE_OF_HEIGHT = 1.05  # and with arms to the sides, both with a margin
_MIDDLE_OF_HEIGHT = 0.54


@dataclass(frozen=True, eq=False)
class Shots:
    """A motion's poses with a camera for each, ready to be rendered."""

    mesh: SkinnedMesh
    pos_m: Floats  # (T, J, 3) of the world
    global_quat: Floats  # (T, J, 4)
    targets_m: Floats  # (T, 3) what the cameras look at
    towards_eye_m: Floats  # (3,) from the target to the camera

    def render(self, frame: int, size: tuple[int, int]) -> Pixels:
        """Frame `frame` as an image (H, W, 3)."""
        camera = Camera(self.targets_m[frame] + self.towards_eye_m, self.targets_m[frame], _FOV_RAD)
        return render_pose(self.mesh, self.pos_m[frame], self.global_quat[frame], camera, size=size)


def follow_camera(
    motion: Motion, times_s: Sequence[float] | Floats, *, aspect: float, smoothing_s: float = 0.0
) -> Shots:
    """The poses at `times_s` (T,) and cameras for pictures `aspect` times as wide as high.

    All cameras have the same direction: 28° to the side of the dancer's mean heading between the first and
    the last time, so that turns stay visible. They follow the dancer's ground position, smoothed over
    about `smoothing_s`. Raises `ParameterError` if a time lies
    outside the motion.
    """
    times = np.asarray(times_s, dtype=np.float64)
    if times.ndim != 1 or len(times) == 0 or not np.isfinite(times).all():
        raise ParameterError("expected at least one time to show, each a finite number of seconds")
    if times.min() < 0 or times.max() > motion.duration_s:
        raise ParameterError(
            f"expected times within the motion's 0 to {motion.duration_s:.2f} s, "
            f"got {times.min():.2f} to {times.max():.2f} s"
        )
    mesh = build_mannequin(motion.skeleton, motion)
    ground, headings = _whereabouts(motion)
    frames = times * motion.fps
    shown_headings = headings[int(frames.min()) : int(frames.max()) + 2]
    heading = np.arctan2(np.sin(shown_headings).mean(), np.cos(shown_headings).mean())
    if smoothing_s > 0:
        ground = gaussian_filter1d(ground, smoothing_s * motion.fps, axis=0, mode="nearest")
    shown = motion.sampled(frames)
    pos_m, quat = forward(motion.skeleton, shown.root_pos_m, shown.local_quat)
    height = float(np.ptp(mesh.vertices_m[:, 1]))
    grid = np.arange(motion.n_frames)
    targets = np.stack([np.interp(frames, grid, ground[:, axis]) for axis in range(3)], axis=1)  # (T, 3)
    targets[:, 1] = _MIDDLE_OF_HEIGHT * height
    distance = max(_HIGH_OF_HEIGHT, _WIDE_OF_HEIGHT / aspect) * height / (2 * np.tan(_FOV_RAD / 2))
    level = np.array([np.sin(heading + _SIDE_RAD), 0.0, np.cos(heading + _SIDE_RAD)])
    rise = np.array([0.0, (_EYE_OF_HEIGHT - _MIDDLE_OF_HEIGHT) * height, 0.0])
    return Shots(mesh, pos_m, quat, targets, distance * level + rise)


def _whereabouts(motion: Motion) -> tuple[Floats, Floats]:
    """Ground position (T, 3) and heading (T,); of an unknown rig, the root's position and 0."""
    try:
        body = body_pos_m(motion)
    except ParameterError:
        return motion.root_pos_m * [1.0, 0.0, 1.0], np.zeros(motion.n_frames)
    return ground_pos_m(body), heading_rad(body)
