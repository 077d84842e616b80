"""Takes and clips of a repertoire, read from its file: `TakeInfo`, `ClipMotion` and `TakeCounts`.

`TakeInfo` has the names and credits of a take and its rows in the arrays of the file. `ClipMotion` has
features of clips by frame, such as poses and speeds. `TakeCounts` has the counts of takes.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, fields
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from choreograph.core.cache import CachedRows
from choreograph.core.counts import FROM_MOTION, NO_COUNTS, Counts, Figure
from choreograph.core.errors import RepertoireError
from choreograph.core.numerics import AnyInts
from choreograph.core.timebase import CLIP_FRAMES, NET_FPS, frames_to_seconds, times_to_frames
from choreograph.library.builtin import (
    CHOICES,
    MotionCounter,
    are_likely_right,
    load_motion_counter,
    pretrained_set,
)
from choreograph.library.catalogue import AnyFile
from choreograph.library.derived import root_frame_rows
from choreograph.library.schema import MADE_ROWS, check_counts, check_parts
from choreograph.motion import rotations as rot
from choreograph.motion.body import BODY_JOINTS, ground_pos_m
from choreograph.motion.motion import Credits
from choreograph.motion.motion_beats import GenreSizes, liveliness_ranks, travel_and_width
from choreograph.music.bars import tempo_bpm

if TYPE_CHECKING:
    from choreograph.library.builtin import MotionCounter

# The takes of a repertoire file: names, credits, ranges in the arrays, counts and figures.


_TEXT = ("name", "song_name", "genre", "performer", "licence", "source", "notes")
_PARTS = {"motion": ("motion/root_pos_m", 1), "body": ("body/pos_m", 1), "beat": ("beats/motion_s", 0)}
_RANGES = tuple(f"{part}_{end}" for part in _PARTS for end in ("start", "stop"))


@dataclass(frozen=True)
class TakeInfo:
    """A take of a repertoire. Ranges are indices of the file's flat arrays."""

    name: str
    """Its name, unique in the file."""

    song_name: str
    """Name of the song, the same for all takes of a song, or empty without music."""

    credits: Credits
    """Genre, performer, licence and source."""

    fps: float
    """Frames per second of the stored motion."""

    motion: tuple[int, int]
    """Rows of the stored motion: the first one, and the one after the last."""

    body: tuple[int, int]
    """Rows of the body positions at 20 fps: the first one, and the one after the last."""

    beats: tuple[int, int]
    """Rows of the motion beats: the first one, and the one after the last."""

    notes: str
    """What was unusual in its files."""

    @property
    def duration_s(self) -> float:
        """Length of the take's motion in seconds."""
        return (self.motion[1] - self.motion[0]) / self.fps


def takes_from(file: AnyFile) -> tuple[TakeInfo, ...]:
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


def figures_from(read: Callable[[str], NDArray[Any]]) -> dict[int, tuple[Figure, ...]]:
    """The figures of each take, in order. Takes without figures are left out."""
    names = ("take", "name", "start_s", "end_s", "n_counts")
    figures: dict[int, list[Figure]] = {}
    for take, name, start_s, end_s, n_counts in zip(*(read(f"figures/{c}") for c in names), strict=True):
        figure = Figure(str(name), float(start_s), float(end_s), int(n_counts))
        figures.setdefault(int(take), []).append(figure)
    return {take: tuple(own) for take, own in figures.items()}


# Poses, speeds, densities, liveliness and uncertainty of counts of clips, by frame.


# At which the expected share of wrong counts is that of the take. Counts that were estimated without the song
# are wrong in 0.00 below 0.1, 0.05 from 0.1 to 0.2, 0.11 from 0.2 to 0.3, at a confidence of 0.87.
_MEAN_UNCERTAINTY = 0.25


class ClipMotion:
    """Frames of clips at 20 fps, of which the rows that are needed are read from the file.

    `counts` returns the counts of a take. `clip_take` and `clip_start_frame` (N,) say where the clips are.
    """

    def __init__(
        self,
        file: AnyFile,
        takes: Sequence[TakeInfo],
        counts: Callable[[int], Counts],
        clip_take: AnyInts,
        clip_start_frame: AnyInts,
    ) -> None:
        self._file = file
        self._takes = takes
        self._counts = counts
        self._clip_take = clip_take
        self._clip_start_frame = clip_start_frame
        self._take_rows = np.array([take.body for take in takes], np.int64)  # (takes, 2)

    def of_takes(self) -> ClipMotion:
        """The same features by take: take i is clip i, and its frames are those of the take."""
        n_takes = len(self._take_rows)
        return ClipMotion(
            self._file, self._takes, self._counts, np.arange(n_takes), np.zeros(n_takes, np.int64)
        )

    def body_pos_m(self, take: int) -> NDArray[np.float32]:
        """A take's 21 joints at 20 fps, (T, 21, 3)."""
        return self._file.read_rows("body/pos_m", *self._take_rows[take])

    def poses_at(self, take: AnyInts, times_s: NDArray[np.floating]) -> NDArray[np.float64]:
        """Poses (N, ..., 21, 3) of takes (N,) at times (N, ...), linear between frames, constant outside."""
        shape = (-1, *[1] * (times_s.ndim - 1))
        first, stop = (rows.reshape(shape) for rows in self._take_rows[take].T)
        last = stop - first - 1
        frames = np.clip(times_to_frames(times_s, NET_FPS), 0.0, last)
        low = np.minimum(frames.astype(np.int64), np.maximum(last - 1, 0))
        weight = (frames - low)[..., None, None]
        rows = np.stack([first + low, first + np.minimum(low + 1, last)])
        before, after = self._file.rows("body/pos_m", rows).astype(np.float64)
        poses: NDArray[np.float64] = before * (1 - weight) + after * weight
        return poses

    def clip_pos_m(self, clips: AnyInts) -> NDArray[np.float32]:
        """Body positions of clips (K,) in metres, (K, 160, 21, 3)."""
        return self._frames("body/pos_m", clips)

    def density(self, clips: AnyInts) -> NDArray[np.float32]:
        """Tempo-densities of clips (K,), (K, 160)."""
        return self._frames("body/density", clips)

    def speed(self, clips: AnyInts) -> NDArray[np.float32]:
        """Mean joint speeds of clips (K,) in m/s, (K, 160)."""
        return self._frames("body/speed_m_s", clips)

    def _frames(self, name: str, clips: AnyInts) -> NDArray[np.float32]:
        return self._file.rows(name, self._first_rows(clips)[:, None] + np.arange(CLIP_FRAMES))

    def _first_rows(self, clips: AnyInts) -> NDArray[np.int64]:
        """First row of clips (K,) in the flat arrays, (K,)."""
        rows: NDArray[np.int64] = self._take_rows[self._clip_take[clips], 0] + self._clip_start_frame[clips]
        return rows

    def poses_m(
        self, clip: AnyInts, frames: NDArray[np.floating]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Poses (N, 21, 3) and joint velocities (N, 21, 3) in m/s, both in the root frame.

        The arguments are clips (N,) and fractional clip frames (N,). Beyond the clip, the take continues.
        Beyond the take, its first or last pose is held.
        """
        first, stop = self._take_rows[self._clip_take[clip]].T
        rows = np.clip(self._first_rows(clip) + frames, first, stop - 1)
        row = np.minimum(np.floor(rows).astype(np.int64), stop - 2)
        weight = (rows - row).astype(np.float32)[:, None, None, None]
        before, both = self._root_frame(np.stack([row, row + 1]))  # copies, (N, 2, 21, 3) each
        both -= before
        both *= weight
        both += before
        return both[:, 0], both[:, 1]

    def _root_frame(self, rows: AnyInts) -> NDArray[np.float32]:
        """Poses and velocities (..., 2, 21, 3) in the root frame of rows (...) of the flat arrays."""
        if "poses" in self._file.parts:
            return self._file.rows("body/root_frame", rows)
        return self._made_poses.rows(rows, self._make_poses)

    @cached_property
    def _made_poses(self) -> CachedRows:
        n_frames = self._file.shapes["body/pos_m"][0]
        return CachedRows((n_frames, 2, len(BODY_JOINTS), 3), "f4", MADE_ROWS)

    def _make_poses(self, blocks: Sequence[int]) -> Iterator[NDArray[np.float32]]:
        """Blocks of `_root_frame` of a compressed file."""
        n_frames = self._file.shapes["body/pos_m"][0]
        for block in blocks:
            rows = np.arange(block * MADE_ROWS, min((block + 1) * MADE_ROWS, n_frames))
            yield root_frame_rows(partial(self._file.rows, "body/pos_m"), rows, self._take_rows)

    def liveliness(
        self, clip: AnyInts, start: NDArray[np.floating], stop: NDArray[np.floating]
    ) -> NDArray[np.float32]:
        """Rank (N,), 0 … 1, in its genre of each clip played from frame `start` to `stop` in one second."""
        offset, take = self._clip_start_frame[clip], self._clip_take[clip]
        first, stops = self._take_rows[take].T
        measured = travel_and_width(
            partial(self._file.rows, "body/sums"), first, stops - 1, offset + start, offset + stop
        )
        return liveliness_ranks(measured, self._take_genre[take], self._genre_sizes)

    @cached_property
    def _take_genre(self) -> NDArray[np.int64]:
        """The genre of each take as an index of those of the file, (takes,)."""
        names = self._file.read("genres/name")
        genres = np.array([take.credits.genre for take in self._takes])
        index = np.minimum(np.searchsorted(names, genres), len(names) - 1)
        if not np.array_equal(names[index], genres):
            raise RepertoireError("genres: expected those of the takes in alphabetical order, got others")
        return index

    @cached_property
    def _genre_sizes(self) -> list[GenreSizes]:
        starts, stops = self._file.read("genres/size_start"), self._file.read("genres/size_stop")
        scale, sizes = self._file.read("genres/scale"), self._file.read("genres/sizes")
        return [
            GenreSizes(of_genre, sizes[start:stop])
            for of_genre, start, stop in zip(scale, starts, stops, strict=True)
        ]

    def count_uncertainty(
        self, clip: AnyInts, start: NDArray[np.floating], stop: NDArray[np.floating]
    ) -> NDArray[np.float32]:
        """Expected share (N,) of wrong counts halfway between two frames of each clip.

        It is 0 for counts that were not estimated from the motion. The share that is expected in the take
        follows from the confidence of its counts, and is distributed by their uncertainty.
        """
        frame = self._clip_start_frame[clip] + np.round(0.5 * (start + stop)).astype(np.int64)
        uncertainty, takes = np.zeros(len(frame), np.float32), self._clip_take[clip]
        for take in np.unique(takes).tolist():
            counts = self._counts(take)
            if len(counts.uncertainty):
                here = takes == take
                times_s = frames_to_seconds(frame[here], NET_FPS)
                relative = np.interp(times_s, counts.times_s, counts.uncertainty) / _MEAN_UNCERTAINTY
                uncertainty[here] = np.minimum((1.0 - counts.confidence) * relative, 1.0)
        return uncertainty

    def headings_rad(self, clip: AnyInts, frames: NDArray[np.floating]) -> NDArray[np.float32]:
        """Headings (N, M) of clips (N,) at fractional clip frames (N, M), from the front of their take.

        They are continuous along a take: a full turn adds 2π.
        """
        rows, row, beyond = self._rows_around(clip, frames)
        before, after = self._file.rows("body/heading_rad", np.stack([row, beyond]))
        headings_rad: NDArray[np.float32] = before + (rows - row).astype(np.float32) * (after - before)
        return headings_rad

    def places_m(self, clip: AnyInts, frames: NDArray[np.floating]) -> NDArray[np.float32]:
        """Places of the pelvis on the floor (N, M, 2), x and z, at fractional clip frames (N, M).

        They are measured from the mean place of the take, with its front at +Z.
        """
        rows, row, beyond = self._rows_around(clip, frames)
        take = self._clip_take[clip][:, None]
        ground_m = ground_pos_m(
            self._file.rows("body/pos_m", np.stack([row, beyond])).astype(np.float64)
        )  # (2, N, M, 3)
        turned_m = rot.rotate(rot.about_y(-self.fronts_rad[take]), ground_m - self._centres_m[take])
        before, after = turned_m[..., [0, 2]].astype(np.float32)
        places_m: NDArray[np.float32] = before + (rows - row).astype(np.float32)[..., None] * (after - before)
        return places_m

    def _rows_around(
        self, clip: AnyInts, frames: NDArray[np.floating]
    ) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
        """Fractional rows (N, M) of fractional clip frames (N, M), and the rows before and after them."""
        first, stop = self._take_rows[self._clip_take[clip]].T
        rows = np.clip(self._first_rows(clip)[:, None] + frames, first[:, None], stop[:, None] - 1)
        row = np.minimum(np.floor(rows).astype(np.int64), np.maximum(stop - 2, first)[:, None])
        return rows, row, np.minimum(row + 1, stop[:, None] - 1)

    @cached_property
    def liveliness_ranks(self) -> NDArray[np.float32]:
        """Rank (N,), 0 … 1, of the liveliness of the middle 4 s of each clip in its genre."""
        return self._file.read("clips/liveliness_rank")

    @cached_property
    def step_ranks(self) -> NDArray[np.float32]:
        """Rank (N,), 0 … 1, of the number of steps in the middle 4 s of each clip in its genre."""
        return self._file.read("clips/step_rank")

    @cached_property
    def fronts_rad(self) -> NDArray[np.float64]:
        """The direction that each take (takes,) faces most: its front."""
        return self._file.read("takes/front_rad")

    @cached_property
    def _centres_m(self) -> NDArray[np.float64]:
        """The mean place of the pelvis of each take on the floor, (takes, 3)."""
        return self._file.read("takes/centre_m")


# The counts of takes: those of the file, and estimates where it has none.


@dataclass(frozen=True, eq=False)
class TakeTempi:
    """What most decisions read of the counts of all takes."""

    metre: NDArray[np.int64]  # (takes,) 0 where bars are not known
    bpm: NDArray[np.float64]  # (takes,) the median tempo, 0 for fewer than two counts
    n_counts: NDArray[np.int64]  # (takes,)
    counted_s: NDArray[np.float64]  # (takes,) from the first count to the last
    is_estimated: NDArray[np.bool_]  # (takes,) from the motion

    def of(self, takes: NDArray[Any]) -> TakeTempi:
        """The same of some takes, by their numbers or a mask."""
        return TakeTempi(*(getattr(self, field.name)[takes] for field in fields(self)))


class TakeCounts:
    """The counts of the takes of a file, of these names.

    Where the file has none, they are estimated from the motion by the network of the set that the file was
    built with, if they are more likely right than wrong. Those of takes that the build `refused` are not.

    Raises `RepertoireError`, without the name of the file, if counts are not in order.
    """

    def __init__(self, file: AnyFile, names: Sequence[str], refused: Collection[str]) -> None:
        self._file, self._names, self._refused = file, names, refused
        self._start, self._stop = file.read("takes/count_start"), file.read("takes/count_stop")
        check_parts("count", self._start, self._stop, file.shapes["counts/time_s"][0], shortest=0)
        self._metres, self._sources = file.read("takes/metre"), file.read("takes/counts_source")
        self._confidence = file.read("takes/counts_confidence")
        self._times_s, self._numbers = file.read("counts/time_s"), file.read("counts/number")
        self._uncertainty = np.zeros(0)
        if "uncertainty" in file.parts:
            self._uncertainty = file.read("counts/doubt").astype(np.float64)
        self._made: dict[int, Counts] = {}

    def of_take(self, take: int) -> Counts:
        """The counts of a take, or `NO_COUNTS`."""
        if take not in self._made:
            self._made[take] = self._counts(take)
        return self._made[take]

    def _counts(self, take: int) -> Counts:
        own = slice(self._start[take], self._stop[take])
        if own.start == own.stop:
            return self._estimated(take)
        source, confidence = str(self._sources[take]), float(self._confidence[take])
        times_s, numbers, metre = self._times_s[own], self._numbers[own], int(self._metres[take])
        check_counts(self._names[take], times_s, numbers, metre)
        return Counts(times_s, numbers, metre, source, confidence, self._uncertainty[own])

    @cached_property
    def tempi(self) -> TakeTempi:
        """What most decisions read of the counts of all takes."""
        n_counts = self._stop - self._start
        counted_s = np.zeros(len(n_counts))
        counted = n_counts > 0
        ends_s = self._times_s[np.stack([self._start, self._stop - 1])[:, counted]]
        counted_s[counted] = ends_s[1] - ends_s[0]
        bpm, is_estimated = self._file.read("takes/tempo_bpm"), self._sources == FROM_MOTION
        metre = self._metres.copy()
        refused = [name in self._refused for name in self._names]
        missing = np.flatnonzero(~counted & ~np.array(refused, bool))
        if len(missing) and self._count_motion is not None:
            for take in missing.tolist():
                counts = self.of_take(take)
                metre[take], n_counts[take] = counts.metre, len(counts)
                bpm[take] = tempo_bpm(counts) if len(counts) > 1 else 0.0
                counted_s[take] = np.ptp(counts.times_s) if len(counts) else 0.0
                is_estimated[take] = counts.source == FROM_MOTION
        return TakeTempi(metre, bpm, n_counts, counted_s, is_estimated)

    def _estimated(self, take: int) -> Counts:
        """The counts of a take that a network estimates from its motion, or none if they are likely wrong."""
        if self._count_motion is None or self._names[take] in self._refused:
            return NO_COUNTS
        rows = (self._file.read(f"takes/body_{end}", slice(take, take + 1))[0] for end in ("start", "stop"))
        counts = self._count_motion(self._file.read_rows("body/pos_m", *rows))
        return counts if are_likely_right(counts) else NO_COUNTS

    @cached_property
    def _count_motion(self) -> MotionCounter | None:
        networks = self._file.provenance.get("pretrained")
        return load_motion_counter(pretrained_set(networks)) if networks in CHOICES else None
