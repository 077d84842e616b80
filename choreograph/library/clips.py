"""Takes and clips of a repertoire: names, counts, and features by frame."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.core.counts import Counts, Figure
from choreograph.core.numerics import AnyInts, mean_ranks
from choreograph.core.timebase import (
    CLIP_FRAMES,
    NET_FPS,
    SEGMENT_FRAMES,
    SEGMENT_S,
    frame_times_s,
    times_to_frames,
)
from choreograph.library.checks import check_counts, check_parts
from choreograph.library.store import RepertoireFile
from choreograph.library.writing import middle_starts
from choreograph.motion import rotations as rot
from choreograph.motion.body import front_rad, ground_pos_m, heading_rad, to_root_frame
from choreograph.motion.contacts import step_counts
from choreograph.motion.motion import Credits
from choreograph.motion.motion_beats import Liveliness, mean_joint_speed_m_s

# The takes of a repertoire file: names, credits, ranges in the arrays, counts and figures.


_TEXT = ("name", "song_name", "genre", "performer", "licence", "source", "notes")
_PARTS = {"motion": ("motion/root_pos_m", 1), "body": ("body/pos_m", 1), "beat": ("beats/motion_s", 0)}
_RANGES = tuple(f"{part}_{end}" for part in _PARTS for end in ("start", "stop"))


@dataclass(frozen=True)
class TakeInfo:
    """A take of a repertoire. Ranges are indices of the file's flat arrays."""

    name: str  # unique in the file
    song_name: str  # the same for all takes of a song, or empty without music
    credits: Credits
    fps: float  # rate of the stored motion
    motion: tuple[int, int]  # rows of the stored motion, the first and the one after the last
    body: tuple[int, int]  # rows of the body positions at 20 fps
    beats: tuple[int, int]  # rows of the motion beats
    notes: str  # on what was unusual in its files

    @property
    def duration_s(self) -> float:
        """Length of the take's motion in seconds."""
        return (self.motion[1] - self.motion[0]) / self.fps


def takes_from(file: RepertoireFile) -> tuple[TakeInfo, ...]:
    """All takes in the order of the file. Raises `RepertoireError` if there is none or their rows overlap."""
    columns = {name: file.read(f"takes/{name}") for name in (*_TEXT, "fps", *_RANGES)}
    for part, (array, shortest) in _PARTS.items():
        start, stop = columns[f"{part}_start"], columns[f"{part}_stop"]
        check_parts(part, start, stop, file.shapes[array][0], shortest=shortest)
    return tuple(
        TakeInfo(
            name=str(columns["name"][i]),
            song_name=str(columns["song_name"][i]),
            credits=Credits(*(str(columns[c][i]) for c in ("genre", "performer", "licence", "source"))),
            fps=float(columns["fps"][i]),
            motion=(int(columns["motion_start"][i]), int(columns["motion_stop"][i])),
            body=(int(columns["body_start"][i]), int(columns["body_stop"][i])),
            beats=(int(columns["beat_start"][i]), int(columns["beat_stop"][i])),
            notes=str(columns["notes"][i]),
        )
        for i in range(len(columns["name"]))
    )


def counts_from(file: RepertoireFile, takes: Sequence[TakeInfo]) -> tuple[Counts, ...]:
    """Each take's counts. Raises `RepertoireError` if they are not in order."""
    columns = ("count_start", "count_stop", "metre", "counts_source", "counts_confidence")
    times_s, numbers = file.read("counts/time_s"), file.read("counts/number")
    uncertainty = file.read("counts/doubt").astype(np.float64) if "uncertainty" in file.parts else np.zeros(0)
    start, stop, *about = (file.read(f"takes/{column}") for column in columns)
    check_parts("count", start, stop, len(times_s), shortest=0)
    counts = tuple(
        Counts(times_s[i:j], numbers[i:j], int(metre), str(source), float(confidence), uncertainty[i:j])
        for i, j, metre, source, confidence in zip(start, stop, *about, strict=True)
    )
    for take, own in zip(takes, counts, strict=True):
        check_counts(take.name, own.times_s, own.numbers, own.metre)
    return counts


def figures_from(read: Callable[[str], NDArray[Any]]) -> dict[int, tuple[Figure, ...]]:
    """The figures of each take, in order. Takes without figures are left out."""
    names = ("take", "name", "start_s", "end_s", "n_counts")
    figures: dict[int, list[Figure]] = {}
    for take, name, start_s, end_s, n_counts in zip(*(read(f"figures/{c}") for c in names), strict=True):
        figure = Figure(str(name), float(start_s), float(end_s), int(n_counts))
        figures.setdefault(int(take), []).append(figure)
    return {take: tuple(own) for take, own in figures.items()}


# Liveliness and numbers of steps of clips, as ranks in their genre.


def clip_liveliness(liveliness: Liveliness, take: AnyInts, start_frame: AnyInts) -> NDArray[np.float32]:
    """Mean rank (N,), 0 … 1, of the seconds of each clip's middle 4 s.

    A clip is given by its take (N,) and its first frame (N,).
    """
    start = middle_starts(start_frame).astype(np.float64)  # (N,) in their takes
    seconds = (start + second * NET_FPS for second in range(SEGMENT_S))
    result: NDArray[np.float32] = np.mean(
        [liveliness.ranks(take, at, at + NET_FPS) for at in seconds], axis=0, dtype=np.float32
    )
    return result


def clip_steps(
    body_pos_m: Callable[[int], NDArray[np.floating]],
    take: AnyInts,
    start_frame: AnyInts,
    genres: NDArray[np.str_],
) -> NDArray[np.float32]:
    """Rank (N,), 0 … 1, of the steps in each clip's middle 4 s among the clips of its genre.

    `body_pos_m` returns the positions (T, 21, 3) of a take at 20 fps. `genres` (takes,) are the genres of the
    takes. Equal clips have their mean rank.
    """
    steps = np.zeros(len(take))
    for index in np.unique(take):
        clips = np.flatnonzero(take == index)
        starts = middle_starts(start_frame[clips])
        steps[clips] = step_counts(body_pos_m(int(index)), NET_FPS, starts, SEGMENT_FRAMES)
    ranks = np.empty(len(take), np.float32)
    for name in np.unique(genres[take]):
        inside = genres[take] == name
        ranks[inside] = (mean_ranks(steps[inside]) - 0.5) / inside.sum()
    return ranks


# Poses, speeds, densities, liveliness and uncertainty of counts of clips, by frame.


# At which the expected share of wrong counts is that of the take. Counts that were estimated without the song
# are wrong in 0.00 below 0.1, 0.05 from 0.1 to 0.2, 0.11 from 0.2 to 0.3, at a confidence of 0.87.
_MEAN_UNCERTAINTY = 0.25


class ClipMotion:
    """Frames of clips at 20 fps, read on demand from the flat arrays (B, …) of all takes' frames.

    `read` returns an array of the file by name. `counts` are the counts of each take. `clip_take` and
    `clip_start_frame` (N,) say where the clips are.
    """

    def __init__(
        self,
        read: Callable[[str], NDArray[Any]],
        takes: Sequence[TakeInfo],
        counts: Sequence[Counts],
        clip_take: AnyInts,
        clip_start_frame: AnyInts,
    ) -> None:
        self._read = read
        self._takes = takes
        self._counts = counts
        self._clip_take = clip_take
        self._clip_start_frame = clip_start_frame
        self._genres = [take.credits.genre for take in takes]
        self._take_rows = np.array([take.body for take in takes], np.int64)  # (takes, 2)

    def of_takes(self) -> ClipMotion:
        """The same features by take: take i is clip i, and its frames are those of the take."""
        n_takes = len(self._take_rows)
        return ClipMotion(
            self._read, self._takes, self._counts, np.arange(n_takes), np.zeros(n_takes, np.int64)
        )

    def body_pos_m(self, take: int) -> NDArray[np.float32]:
        """A take's 21 joints at 20 fps, (T, 21, 3)."""
        start, stop = self._take_rows[take]
        return self._body_pos_m[start:stop]

    def poses_at(self, take: AnyInts, times_s: NDArray[np.floating]) -> NDArray[np.float64]:
        """Poses (N, ..., 21, 3) of takes (N,) at times (N, ...), linear between frames, constant outside."""
        shape = (-1, *[1] * (times_s.ndim - 1))
        first, stop = (rows.reshape(shape) for rows in self._take_rows[take].T)
        last = stop - first - 1
        frames = np.clip(times_to_frames(times_s, NET_FPS), 0.0, last)
        low = np.minimum(frames.astype(np.int64), np.maximum(last - 1, 0))
        weight = (frames - low)[..., None, None]
        before = self._body_pos_m[first + low].astype(np.float64)
        after = self._body_pos_m[first + np.minimum(low + 1, last)].astype(np.float64)
        poses: NDArray[np.float64] = before * (1 - weight) + after * weight
        return poses

    def clip_pos_m(self, clips: AnyInts) -> NDArray[np.float32]:
        """Body positions of clips (K,) in metres, (K, 160, 21, 3)."""
        result: NDArray[np.float32] = self._body_pos_m[
            self._clip_rows[clips][:, None] + np.arange(CLIP_FRAMES)
        ]
        return result

    def density(self, clips: AnyInts) -> NDArray[np.float32]:
        """Tempo-densities of clips (K,), (K, 160)."""
        result: NDArray[np.float32] = self._density[self._clip_rows[clips][:, None] + np.arange(CLIP_FRAMES)]
        return result

    def speed(self, clips: AnyInts) -> NDArray[np.float32]:
        """Mean joint speeds of clips (K,) in m/s, (K, 160)."""
        result: NDArray[np.float32] = self._speed[self._clip_rows[clips][:, None] + np.arange(CLIP_FRAMES)]
        return result

    def poses_m(
        self, clip: AnyInts, frames: NDArray[np.floating]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Poses (N, 21, 3) and joint velocities (N, 21, 3) in m/s, both in the root frame.

        The arguments are clips (N,) and fractional clip frames (N,). Beyond the clip, the take continues.
        Beyond the take, its first or last pose is held.
        """
        poses, velocities = self._root_frame_poses
        first, stop = self._take_rows[self._clip_take[clip]].T
        rows = np.clip(self._clip_rows[clip] + frames, first, stop - 1)
        row = np.minimum(np.floor(rows).astype(np.int64), stop - 2)
        weight = (rows - row).astype(np.float32)[:, None, None]
        pose = poses[row] + weight * (poses[row + 1] - poses[row])
        return pose, velocities[row] + weight * (velocities[row + 1] - velocities[row])

    def liveliness(
        self, clip: AnyInts, start: NDArray[np.floating], stop: NDArray[np.floating]
    ) -> NDArray[np.float32]:
        """Rank (N,), 0 … 1, in its genre of each clip played from frame `start` to `stop` in one second."""
        offset = self._clip_start_frame[clip]
        return self._liveliness.ranks(self._clip_take[clip], offset + start, offset + stop)

    def count_uncertainty(
        self, clip: AnyInts, start: NDArray[np.floating], stop: NDArray[np.floating]
    ) -> NDArray[np.float32]:
        """Expected share (N,) of wrong counts halfway between two frames of each clip.

        It is 0 for counts that were not estimated from the motion. The share that is expected in the take
        follows from the confidence of its counts, and is distributed by their uncertainty.
        """
        middle = np.round(0.5 * (start + stop)).astype(np.int64)
        result: NDArray[np.float32] = self._uncertainty[self._clip_rows[clip] + middle]
        return result

    def headings_rad(self, clip: AnyInts, frames: NDArray[np.floating]) -> NDArray[np.float32]:
        """Headings (N, M) of clips (N,) at fractional clip frames (N, M), from the front of their take.

        They are continuous along a take: a full turn adds 2π.
        """
        return self._between_frames(self._headings_rad, clip, frames)

    def places_m(self, clip: AnyInts, frames: NDArray[np.floating]) -> NDArray[np.float32]:
        """Places of the pelvis on the floor (N, M, 2), x and z, at fractional clip frames (N, M).

        They are measured from the mean place of the take, with its front at +Z.
        """
        return self._between_frames(self._places_m, clip, frames)

    def _between_frames(
        self, values: NDArray[np.float32], clip: AnyInts, frames: NDArray[np.floating]
    ) -> NDArray[np.float32]:
        """Values (B, …) of all frames, interpolated at fractional clip frames (N, M)."""
        first, stop = self._take_rows[self._clip_take[clip]].T
        rows = np.clip(self._clip_rows[clip][:, None] + frames, first[:, None], stop[:, None] - 1)
        row = np.minimum(np.floor(rows).astype(np.int64), np.maximum(stop - 2, first)[:, None])
        beyond = np.minimum(row + 1, len(values) - 1)
        weight = (rows - row).astype(np.float32).reshape(*rows.shape, *(1,) * (values.ndim - 1))
        result: NDArray[np.float32] = values[row] + weight * (values[beyond] - values[row])
        return result

    @cached_property
    def liveliness_ranks(self) -> NDArray[np.float32]:
        """Rank (N,), 0 … 1, of the liveliness of the middle 4 s of each clip in its genre."""
        return clip_liveliness(self._liveliness, self._clip_take, self._clip_start_frame)

    @cached_property
    def step_ranks(self) -> NDArray[np.float32]:
        """Rank (N,), 0 … 1, of the number of steps in the middle 4 s of each clip in its genre."""
        return clip_steps(self.body_pos_m, self._clip_take, self._clip_start_frame, np.array(self._genres))

    @cached_property
    def _clip_rows(self) -> NDArray[np.int64]:
        """First row of each clip in the flat arrays, (N,)."""
        result: NDArray[np.int64] = self._take_rows[self._clip_take, 0] + self._clip_start_frame
        return result

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
    def _uncertainty(self) -> NDArray[np.float32]:
        """Expected share of wrong counts at each frame, (B,), or 0 where counts are certain."""
        uncertainty = np.zeros(len(self._body_pos_m), np.float32)
        for (start, stop), counts in zip(self._take_rows, self._counts, strict=True):
            if len(counts.uncertainty):
                times_s = frame_times_s(stop - start, NET_FPS)
                relative = np.interp(times_s, counts.times_s, counts.uncertainty) / _MEAN_UNCERTAINTY
                uncertainty[start:stop] = np.minimum((1.0 - counts.confidence) * relative, 1.0)
        return uncertainty

    @cached_property
    def _liveliness(self) -> Liveliness:
        return Liveliness([self.body_pos_m(take) for take in range(len(self._take_rows))], self._genres)

    @cached_property
    def fronts_rad(self) -> NDArray[np.float64]:
        """The direction that each take (takes,) faces most: its front."""
        return np.array(
            [
                front_rad(heading_rad(self.body_pos_m(t).astype(np.float64)))
                for t in range(len(self._take_rows))
            ]
        )

    @cached_property
    def _headings_rad(self) -> NDArray[np.float32]:
        headings = np.zeros(len(self._body_pos_m), np.float32)
        for take, (start, stop) in enumerate(self._take_rows):
            raw = heading_rad(self._body_pos_m[start:stop].astype(np.float64)) - self.fronts_rad[take]
            unwrapped = np.unwrap(raw)
            headings[start:stop] = unwrapped - 2 * np.pi * np.round(unwrapped.mean() / (2 * np.pi))
        return headings

    @cached_property
    def _places_m(self) -> NDArray[np.float32]:
        places = np.zeros((len(self._body_pos_m), 2), np.float32)
        for (start, stop), own_front_rad in zip(self._take_rows, self.fronts_rad, strict=True):
            ground_m = ground_pos_m(self._body_pos_m[start:stop].astype(np.float64))  # (T, 3)
            turned_m = rot.rotate(rot.about_y(-own_front_rad), ground_m - ground_m.mean(axis=0))
            places[start:stop] = turned_m[:, [0, 2]]
        return places

    @cached_property
    def _root_frame_poses(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Every frame and its velocities in its root frame, (B, 21, 3) each."""
        pos = self._body_pos_m.astype(np.float64)
        velocity = np.zeros_like(pos)
        for start, stop in self._take_rows:
            if stop - start > 1:
                velocity[start:stop] = np.gradient(pos[start:stop], axis=0) * NET_FPS
        return to_root_frame(pos).astype(np.float32), to_root_frame(pos, velocity).astype(np.float32)
