"""`Motion`, the root positions and local rotations of a skeleton, and `Take`, a recorded performance."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import scipy
from numpy.typing import NDArray

from choreograph.core.arguments import (
    as_floats,
    as_list,
    as_number,
    as_texts,
    check_kind,
    check_text,
    is_whole,
    unexpected,
)
from choreograph.core.counts import NO_COUNTS, Counts, Figure
from choreograph.core.errors import ParameterError
from choreograph.core.files import as_path
from choreograph.core.numerics import Floats, frame_blocks, frame_weights, interpolate_frames
from choreograph.core.progress import counted, one_line
from choreograph.core.timebase import STORE_FPS, frame_times_s, seconds_to_frames
from choreograph.motion import rotations as rot
from choreograph.motion.kinematics import forward
from choreograph.motion.skeleton import Skeleton

# `Motion`: root positions and local rotations at one rate, on a skeleton.


LONGEST_S = 3600.0  # duration of a recording
FARTHEST_M = 1e6  # from the origin, of a body in a file. Beyond, the precision of files is too low
_SPLINE_FRAME_JOINTS = 1 << 17  # frames × joints interpolated at once: 90 s of a body at 60 fps
MAX_FRAME_JOINTS = 1 << 24  # frames × joints of a recording: an hour at 60 fps of a body with fingers
MAX_SAMPLED_FRAME_JOINTS = 1 << 26  # of a motion at another rate: 2 GB


def check_length(n_frames: int, n_joints: int, fps: float) -> None:
    """Raise `ParameterError` if a recording is too long to be read.

    Frames at a low rate count as many as after resampling to the rate of the program.
    """
    duration_s = n_frames / fps
    if duration_s > LONGEST_S:
        raise ParameterError(f"expected a motion of up to an hour, got {duration_s:.0f} s: cut it in parts")
    if duration_s * max(fps, STORE_FPS) * n_joints > MAX_FRAME_JOINTS:
        raise ParameterError(
            f"expected a motion of at most {MAX_FRAME_JOINTS} frames × joints, got {n_frames} frames of "
            f"{n_joints} joints: cut it in parts, or leave out joints"
        )


@dataclass(frozen=True, eq=False)
class Motion:
    """Root positions and local rotations of a skeleton at one frame rate.

    Positions are in metres, Y up, right-handed, facing +Z at heading 0. Rotations are quaternions `wxyz`,
    sign-continuous.

    Raises `ParameterError` if a field is of another type, shapes disagree, there is no frame, or a value is
    not finite.

    Examples
    --------
    >>> skeleton = cg.Skeleton(("hips", "head"), [-1, 0], [[0, 1, 0], [0, 0.6, 0]])
    >>> motion = cg.Motion(skeleton, np.zeros((60, 3)), np.tile([1.0, 0, 0, 0], (60, 2, 1)), 30)
    >>> motion.duration_s, motion.joint_pos_m().shape
    (2.0, (60, 2, 3))
    >>> motion.resampled(60).n_frames
    120
    """

    skeleton: Skeleton
    """The body that moves, with J joints."""

    root_pos_m: Floats
    """(T, 3) position of the root joint in each frame, in metres."""

    local_quat: Floats
    """(T, J, 4) rotation of each joint in its parent's frame, and of the root in the world. Unit quaternions
    `wxyz`."""

    fps: float
    """Frames per second."""

    def __post_init__(self) -> None:
        check_kind("the skeleton of a motion", self.skeleton, Skeleton)
        as_number("a frame rate above 0", self.fps, above=0.0)
        object.__setattr__(self, "root_pos_m", as_floats("root positions", self.root_pos_m))
        object.__setattr__(self, "local_quat", as_floats("rotations", self.local_quat))
        shapes = self.root_pos_m.shape, self.local_quat.shape
        n_frames, n_joints = self.root_pos_m.size // 3, self.skeleton.n_joints
        if n_frames == 0 or shapes != ((n_frames, 3), (n_frames, n_joints, 4)):
            raise ParameterError(
                f"expected root positions (T, 3) and rotations (T, {n_joints}, 4) of one frame or more, got "
                f"{shapes[0]} and {shapes[1]}"
            )
        for what, values in (("root positions", self.root_pos_m), ("rotations", self.local_quat)):
            if not all(np.isfinite(values[block]).all() for block in frame_blocks(n_frames)):
                place = tuple(np.argwhere(~np.isfinite(values))[0].tolist())
                raise ParameterError(
                    f"expected finite {what}, got {values[place]} in frame {place[0]}: damaged data?"
                )

    def __repr__(self) -> str:
        frames, joints = counted(self.n_frames, "frame"), counted(self.skeleton.n_joints, "joint")
        return f"<Motion: {frames} at {self.fps:g} fps ({self.duration_s:.1f} s), {joints}>"

    @property
    def n_frames(self) -> int:
        """Number of frames T."""
        return len(self.root_pos_m)

    @property
    def duration_s(self) -> float:
        """Length in seconds: frames over rate."""
        return self.n_frames / self.fps

    def joint_pos_m(self) -> Floats:
        """World positions of all joints, (T, J, 3) in metres."""
        return forward(self.skeleton, self.root_pos_m, self.local_quat)[0]

    def sliced(self, start: int, stop: int) -> Motion:
        """Frames start … stop - 1 as a motion, as in a Python slice. Raises `ParameterError` if empty."""
        if not (is_whole(start) and is_whole(stop)):
            raise unexpected("the first frame and the one after the last as whole numbers", (start, stop))
        if not range(self.n_frames)[start:stop]:
            raise unexpected(f"a frame or more of {self.n_frames} from start to stop", (start, stop))
        return replace(self, root_pos_m=self.root_pos_m[start:stop], local_quat=self.local_quat[start:stop])

    def sampled(self, frames: Floats, *, fps: float | None = None) -> Motion:
        """The poses at fractional `frames` (T',), rotations by slerp, clamped to the first and last frame.

        Raises `ParameterError` unless there is a frame or more, all are finite, and the rate is above 0.
        """
        frames, fps = _as_frames(frames), self.fps if fps is None else fps
        quat = np.empty((len(frames), *self.local_quat.shape[1:]))  # (T', J, 4)
        for block in frame_blocks(len(frames)):  # since a slerp has several times its frames
            low, high, weight = frame_weights(frames[block], self.n_frames)  # (T_b,) each
            quat[block] = rot.slerp(self.local_quat[low], self.local_quat[high], weight[:, None])
        root = interpolate_frames(self.root_pos_m, frames)
        return Motion(self.skeleton, root, rot.make_continuous(quat, out=quat), fps)

    def sampled_smooth(self, frames: Floats, *, fps: float | None = None) -> Motion:
        """The poses at fractional `frames` (T',) by cubic splines, clamped to the first and last frame.

        Slerp (`sampled`) has corners at the source frames, which are visible as jerk when motion at 25 fps is
        resampled to 60 fps. Raises as `sampled` does.
        """
        frames, fps = _as_frames(frames), self.fps if fps is None else fps
        if self.n_frames < 4:
            return self.sampled(frames, fps=fps)
        spline = scipy.interpolate.make_interp_spline  # faster than `CubicSpline`
        frames = np.clip(frames, 0, self.n_frames - 1)
        quat = np.empty((len(frames), *self.local_quat.shape[1:]))  # (T', J, 4)
        at_once = max(1, _SPLINE_FRAME_JOINTS // self.n_frames)  # a spline has several times its frames
        for joints in frame_blocks(self.skeleton.n_joints, at_once):
            continuous = rot.make_continuous(self.local_quat[:, joints])
            quat[:, joints] = rot.normalize(spline(np.arange(self.n_frames), continuous)(frames))
        root_pos_m = spline(np.arange(self.n_frames), self.root_pos_m)(frames)
        return replace(self, root_pos_m=root_pos_m, local_quat=quat, fps=fps)

    def resampled(self, fps: float) -> Motion:
        """The same motion at another rate, with the same first frame.

        Raises `ParameterError` unless the rate is above 0 and gives no more than `MAX_SAMPLED_FRAME_JOINTS`.
        """
        as_number("a frame rate above 0", fps, above=0.0)
        if fps == self.fps:
            return self
        if self.duration_s * fps * self.skeleton.n_joints > MAX_SAMPLED_FRAME_JOINTS:
            raise unexpected(
                f"a frame rate that gives at most {MAX_SAMPLED_FRAME_JOINTS} frames × joints", fps
            )
        n_frames = max(1, seconds_to_frames(self.duration_s, fps))
        return self.sampled(frame_times_s(n_frames, fps) * self.fps, fps=fps)

    def moved(self, *, yaw_rad: float = 0.0, shift_m: NDArray[np.floating] | None = None) -> Motion:
        """Rotated about the world's vertical axis, then shifted by (3,) metres.

        Raises `ParameterError` unless angle and shift are finite numbers.
        """
        rotation = rot.about_y(as_number("yaw_rad as a number", yaw_rad))
        shift_m = np.zeros(3) if shift_m is None else as_floats("shift_m", shift_m)
        if shift_m.shape != (3,) or not np.isfinite(shift_m).all():
            raise unexpected("shift_m as three finite numbers", shift_m)
        root = rot.rotate(rotation, self.root_pos_m) + shift_m
        quat = np.array(self.local_quat)
        quat[:, 0] = rot.multiply(rotation, quat[:, 0])
        return replace(self, root_pos_m=root, local_quat=rot.make_continuous(quat))


def _as_frames(frames: object) -> Floats:
    """Fractional frames (T',) to sample. Raises `ParameterError` if there is none or one is not finite."""
    array = as_floats("frames", frames)
    if array.ndim != 1 or not array.size or not np.isfinite(array).all():
        raise unexpected("one finite frame or more (T',)", frames)
    return array


# `Take` is a recorded performance with its music. It is the unit of import and of train/test splits.


@dataclass(frozen=True)
class Credits:
    """Performer, licence and source of a take, or empty where the source does not state them.

    Raises `ParameterError` unless all are text.

    Examples
    --------
    >>> cg.Credits(genre="waltz", performer="Ana", licence="CC BY 4.0").genre
    'waltz'
    """

    genre: str = ""
    """The genre that is danced, such as "waltz"."""

    performer: str = ""
    """Name of the dancer."""

    licence: str = ""
    """Licence of the motion, such as "CC BY 4.0"."""

    source: str = ""
    """Data set or studio that it comes from."""

    __repr__ = one_line

    def __post_init__(self) -> None:
        check_text("credits", self.genre, self.performer, self.licence, self.source)


@dataclass(frozen=True, eq=False)
class Take:
    """One performance: its motion, its song file and its credits.

    Raises `ParameterError` if a field is of another type.

    Examples
    --------
    >>> skeleton = cg.Skeleton(("hips", "head"), [-1, 0], [[0, 1, 0], [0, 0.6, 0]])
    >>> motion = cg.Motion(skeleton, np.zeros((60, 3)), np.tile([1.0, 0, 0, 0], (60, 2, 1)), 30)
    >>> take = cg.Take("first waltz", motion, cg.Credits(genre="waltz"))
    >>> take.credits.genre, take.song_path is None
    ('waltz', True)
    """

    name: str
    """Its name, unique in a repertoire."""

    motion: Motion
    """What was recorded, on any skeleton."""

    credits: Credits
    """Genre, performer, licence and source."""

    song_path: Path | None = None
    """File of its music, or None without music."""

    song_start_s: float = 0.0
    """Time of the first frame in the song file, in seconds."""

    song_name: str = ""
    """Name of the song, the same for all takes of one song, which are never split between training and
    test."""

    source_paths: tuple[Path, ...] = ()
    """All files that the take was read from, for checksums."""

    notes: tuple[str, ...] = ()
    """What was unusual in the files and how it was handled, one line each."""

    counts: Counts = NO_COUNTS
    """Its counts in seconds from the first frame, if they are known."""

    figures: tuple[Figure, ...] = ()
    """Its named figures in order of time, if the data names them."""

    __repr__ = one_line

    def __post_init__(self) -> None:
        check_text("the names of a take and its song", self.name, self.song_name)
        check_kind("the motion of a take", self.motion, Motion)
        check_kind("the credits of a take", self.credits, Credits)
        if self.song_path is not None:
            object.__setattr__(self, "song_path", as_path("the song of a take", self.song_path))
        as_number("song_start_s of a take in seconds", self.song_start_s)
        sources = as_list("the source_paths of a take", self.source_paths, "paths", str | Path)
        object.__setattr__(self, "source_paths", tuple(map(Path, sources)))
        object.__setattr__(self, "notes", as_texts("notes on a take", self.notes))
        check_kind("the counts of a take", self.counts, Counts)
        figures = as_list("the figures of a take", self.figures, "Figure", Figure)
        object.__setattr__(self, "figures", figures)
