"""How the clips of a repertoire move: poses, speeds, densities, liveliness and doubt of counts by frame."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from choreograph.counts import Counts
from choreograph.features.liveliness import Liveliness
from choreograph.features.motion_beats import mean_joint_speed_m_s
from choreograph.motion.pose import to_root_frame
from choreograph.repertoire.clip_ranks import clip_liveliness, clip_steps
from choreograph.repertoire.take_info import TakeInfo
from choreograph.timebase import CLIP_FRAMES, NET_FPS, frame_times_s

Ints = NDArray[np.integer]


class ClipMotion:
    """Frames of clips at 20 fps, read on demand from the flat arrays (B, …) of all takes' frames.

    `read` gives an array of the file by name; `counts` are those of each take; `clip_take` and
    `clip_start_frame` (N,) place the clips.
    """

    def __init__(
        self,
        read: Callable[[str], NDArray],
        takes: Sequence[TakeInfo],
        counts: Sequence[Counts],
        clip_take: Ints,
        clip_start_frame: Ints,
    ) -> None:
        self._read = read
        self._counts = counts
        self._clip_take = clip_take
        self._clip_start_frame = clip_start_frame
        self._genres = [take.credits.genre for take in takes]
        self._take_rows = np.array([take.body for take in takes], np.int64)  # (takes, 2)

    def body_pos_m(self, take: int) -> NDArray[np.float32]:
        """A take's 21 joints at 20 fps, (T, 21, 3)."""
        start, stop = self._take_rows[take]
        return self._body_pos_m[start:stop]

    def density(self, clips: Ints) -> NDArray[np.float32]:
        """Tempo-densities of clips (K,), (K, 160)."""
        return self._density[self._clip_rows[clips][:, None] + np.arange(CLIP_FRAMES)]

    def speed(self, clips: Ints) -> NDArray[np.float32]:
        """Mean joint speeds of clips (K,) in m/s, (K, 160)."""
        return self._speed[self._clip_rows[clips][:, None] + np.arange(CLIP_FRAMES)]

    def poses_m(
        self, clip: Ints, frames: NDArray[np.floating]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Poses (N, 21, 3) and joint velocities (N, 21, 3) in m/s, both in the root frame.

        `clip` (N,) and fractional clip frames (N,); beyond the clip the take goes on, and beyond the take
        its first or last pose holds.
        """
        poses, velocities = self._root_frame_poses
        first, stop = self._take_rows[self._clip_take[clip]].T
        rows = np.clip(self._clip_rows[clip] + frames, first, stop - 1)
        row = np.minimum(np.floor(rows).astype(np.int64), stop - 2)
        weight = (rows - row).astype(np.float32)[:, None, None]
        pose = poses[row] + weight * (poses[row + 1] - poses[row])
        return pose, velocities[row] + weight * (velocities[row + 1] - velocities[row])

    def liveliness(
        self, clip: Ints, start: NDArray[np.floating], stop: NDArray[np.floating]
    ) -> NDArray[np.float32]:
        """Rank (N,), 0 … 1, in its genre of each clip played from frame `start` to `stop` within a second."""
        offset = self._clip_start_frame[clip]
        return self._liveliness.ranks(self._clip_take[clip], offset + start, offset + stop)

    def count_doubt(
        self, clip: Ints, start: NDArray[np.floating], stop: NDArray[np.floating]
    ) -> NDArray[np.float32]:
        """Doubt (N,), 0 … 1, of the counts half way between two frames of each clip: see `Counts`."""
        middle = np.round(0.5 * (start + stop)).astype(np.int64)
        return self._doubt[self._clip_rows[clip] + middle]

    @cached_property
    def liveliness_ranks(self) -> NDArray[np.float32]:
        """Rank (N,), 0 … 1, in its genre of how lively the middle 4 s of each clip are."""
        return clip_liveliness(self._liveliness, self._clip_take, self._clip_start_frame)

    @cached_property
    def step_ranks(self) -> NDArray[np.float32]:
        """Rank (N,), 0 … 1, in its genre of how many steps the middle 4 s of each clip have."""
        return clip_steps(self.body_pos_m, self._clip_take, self._clip_start_frame, np.array(self._genres))

    @cached_property
    def _clip_rows(self) -> NDArray[np.int64]:
        """First row of each clip in the flat arrays, (N,)."""
        return self._take_rows[self._clip_take, 0] + self._clip_start_frame

    @cached_property
    def _body_pos_m(self) -> NDArray[np.float32]:
        return self._read("body/pos_m")

    @cached_property
    def _density(self) -> NDArray[np.float32]:
        return self._read("body/density")

    @cached_property
    def _speed(self) -> NDArray[np.float32]:
        """Mean joint speed, (B,)."""
        speeds = [
            mean_joint_speed_m_s(self.body_pos_m(take), NET_FPS) for take in range(len(self._take_rows))
        ]
        return np.concatenate(speeds).astype(np.float32)

    @cached_property
    def _doubt(self) -> NDArray[np.float32]:
        """Doubt of the counts, (B,); 0 where a take has none."""
        doubt = np.zeros(len(self._body_pos_m), np.float32)
        for (start, stop), counts in zip(self._take_rows, self._counts, strict=True):
            if len(counts.doubt):
                times_s = frame_times_s(stop - start, NET_FPS)
                doubt[start:stop] = np.interp(times_s, counts.times_s, counts.doubt)
        return doubt

    @cached_property
    def _liveliness(self) -> Liveliness:
        return Liveliness([self.body_pos_m(take) for take in range(len(self._take_rows))], self._genres)

    @cached_property
    def _root_frame_poses(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Every frame and its velocities in its root frame, (B, 21, 3) each."""
        pos = self._body_pos_m.astype(np.float64)
        velocity = np.zeros_like(pos)
        for start, stop in self._take_rows:
            if stop - start > 1:
                velocity[start:stop] = np.gradient(pos[start:stop], axis=0) * NET_FPS
        return to_root_frame(pos).astype(np.float32), to_root_frame(pos, velocity).astype(np.float32)
