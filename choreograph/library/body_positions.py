"""Body positions that a compressed file leaves out: made from its motion when they are read."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.core.errors import RepertoireError
from choreograph.core.timebase import NET_FPS, frame_times_s, seconds_to_frames
from choreograph.library.checks import check_parts
from choreograph.motion import rotations as rot
from choreograph.motion.body import BODY_JOINTS, body_pos_m
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import Skeleton, roles_of

ReadArray = Callable[[str], NDArray[Any]]
ReadRows = Callable[[str, int, int], NDArray[Any]]


def stored_skeleton(read: ReadArray, *, has_roles: bool) -> Skeleton:
    """The skeleton of all motion in a file. Raises `ParameterError` if it is not valid."""
    parts = (read(f"skeleton/{name}") for name in ("parents", "offsets_m", "tip_parents", "tips_m"))
    skeleton = Skeleton(tuple(str(name) for name in read("skeleton/names")), *parts)
    return replace(skeleton, roles=roles_of(read("skeleton/roles"))) if has_roles else skeleton


def stored_motion(
    skeleton: Skeleton, root_pos_m: NDArray[np.floating], local_quat: NDArray[np.floating], fps: float
) -> Motion:
    """Rows of a file as motion."""
    quat = rot.normalize(local_quat.astype(np.float64))
    return Motion(skeleton, root_pos_m.astype(np.float64), quat, fps)


@dataclass(frozen=True, eq=False)
class BodyPositions:
    """Makes the rows of `body/pos_m` from those of `motion/`.

    They are those of the motion resampled to 20 fps (`Motion.resampled`), as where takes are measured.
    """

    skeleton: Skeleton
    fps: NDArray[np.float64]  # (X,) of the motion of each take
    motion: NDArray[np.int64]  # (X, 2) first row of each take in `motion/`, and the one after its last
    body: NDArray[np.int64]  # (X, 2) the same in `body/`

    @classmethod
    def of(cls, read: ReadArray, skeleton: Skeleton, n_motion: int, n_body: int) -> BodyPositions:
        """Those of a file. `n_motion` and `n_body` are the numbers of its rows.

        Raises `RepertoireError` if a take's rows are not as many as its motion gives.
        """
        spans = {}
        for part, n_rows in (("motion", n_motion), ("body", n_body)):
            start, stop = (np.asarray(read(f"takes/{part}_{end}"), np.int64) for end in ("start", "stop"))
            check_parts(part, start, stop, n_rows, shortest=1)
            spans[part] = np.stack([start, stop], axis=1)
        made = cls(skeleton, np.asarray(read("takes/fps"), np.float64), spans["motion"], spans["body"])
        lengths = zip(np.diff(made.motion)[:, 0], made.fps, strict=True)
        expected = [max(1, seconds_to_frames(int(n) / float(fps), NET_FPS)) for n, fps in lengths]
        if expected != np.diff(made.body)[:, 0].tolist():
            raise RepertoireError("takes/body_stop: expected as many rows as the motion gives, got others")
        return made

    def rows(self, read_rows: ReadRows, start: int, stop: int) -> NDArray[np.float32]:
        """Rows `start` to `stop`, (N, 21, 3). `read_rows` reads rows of `motion/`."""
        pos_m = np.empty((max(stop - start, 0), len(BODY_JOINTS), 3), np.float32)
        begins_before, ends_after = self.body[:, 0] < stop, self.body[:, 1] > start
        for take in np.flatnonzero(begins_before & ends_after & (start < stop)).tolist():
            first, end = self.body[take].tolist()
            low, high = max(start, first), min(stop, end)
            pos_m[low - start : high - start] = self._of_take(read_rows, take, low - first, high - first)
        return pos_m

    def _of_take(self, read_rows: ReadRows, take: int, start: int, stop: int) -> NDArray[np.float64]:
        """Body frames `start` to `stop` of a take. A frame depends on the two around it alone."""
        first_row, stop_row = self.motion[take].tolist()
        fps = float(self.fps[take])
        frames = frame_times_s(stop, NET_FPS)[start:] * fps
        first = min(int(frames[0]), stop_row - first_row - 1)
        rows = first_row + first, min(first_row + int(frames[-1]) + 2, stop_row)
        root_pos_m, local_quat = (read_rows(f"motion/{name}", *rows) for name in ("root_pos_m", "local_quat"))
        motion = stored_motion(self.skeleton, root_pos_m, local_quat, fps)
        return body_pos_m(motion.sampled(frames - first, fps=NET_FPS))
