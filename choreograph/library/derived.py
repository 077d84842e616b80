"""The arrays of a repertoire that follow from its takes.

`with_derived` computes them when a file is written: fronts, speeds, headings and steps of single takes, and
ranks among all takes of a genre. A compressed file leaves out the body positions. `BodyPositions` makes them
from its motion when they are read.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from choreograph.core.errors import RepertoireError
from choreograph.core.numerics import AnyFloats, AnyInts, frame_blocks
from choreograph.core.timebase import (
    CLIP_FRAMES,
    NET_FPS,
    SEGMENT_FRAMES,
    SEGMENT_S,
    frame_times_s,
    seconds_to_frames,
)
from choreograph.library.schema import DERIVED, QUANTISATION_STEPS, check_parts, dequantised, quantised
from choreograph.motion import rotations as rot
from choreograph.motion.body import (
    BODY_JOINTS,
    body_pos_m,
    front_rad,
    ground_pos_m,
    heading_rad,
    to_root_frame,
)
from choreograph.motion.contacts import step_counts
from choreograph.motion.motion import Motion
from choreograph.motion.motion_beats import (
    genre_sizes,
    liveliness_ranks,
    mean_joint_speed_m_s,
    travel_and_width,
    travel_and_width_sums,
)
from choreograph.motion.skeleton import Skeleton, roles_of

# Body positions that a compressed file leaves out.


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


# What is computed when a file is written.


Arrays = dict[str, NDArray[Any]]  # by path
ALWAYS_MADE = (
    "takes/tempo_bpm",
    "clips/step_rank",
    "clips/liveliness_rank",
    *(name for name in DERIVED if "genres/" in name),
)
_OF_TAKES = tuple(name for name in DERIVED if name not in ALWAYS_MADE)


def middle_starts(starts: NDArray[np.integer]) -> NDArray[np.int64]:
    """First frames of the clips' middle 4 s, the part that style vectors describe."""
    return np.asarray(starts, np.int64) + (CLIP_FRAMES - SEGMENT_FRAMES) // 2


def with_derived(arrays: Mapping[str, Any], *, compress: bool) -> dict[str, Any]:
    """The arrays with all of `DERIVED`. Those of single takes are kept if they are given.

    Arrays are in memory, or `store.JoinedRows`, which are read here only where they are needed.

    With `compress`, they are computed from the positions as they will be made from the motion of the file.
    """
    made = dict(arrays)
    if any(name not in made for name in _OF_TAKES):
        body_pos_m = _pos_m_from_motion(made) if compress else np.asarray(made["body/pos_m"], np.float32)
        made |= take_arrays(body_pos_m, made)
    if compress:
        made.pop("body/root_frame", None)
    elif "body/root_frame" not in made:
        body_pos_m = np.asarray(made["body/pos_m"], np.float32)
        take_rows = np.stack([np.asarray(made[f"takes/body_{end}"]) for end in ("start", "stop")], axis=1)
        parts = [
            root_frame_rows(lambda rows: body_pos_m[rows], np.arange(len(body_pos_m))[part], take_rows)
            for part in frame_blocks(len(body_pos_m))
        ]
        made["body/root_frame"] = np.concatenate(parts)
    return made | {"takes/tempo_bpm": take_tempi_bpm(made)} | genre_arrays(made)


def _pos_m_from_motion(arrays: Mapping[str, Any]) -> NDArray[np.float32]:
    """Body positions (B, 21, 3), made from motion as a compressed file holds it."""
    motion = {}
    for name, step in QUANTISATION_STEPS.items():
        values = np.asarray(arrays[name])
        integers = quantised(values, step)
        motion[name] = values if integers is None else dequantised(integers, step)

    def read(name: str) -> NDArray[Any]:
        return np.asarray(arrays[name])

    skeleton = stored_skeleton(read, has_roles="skeleton/roles" in arrays)
    n_motion, n_body = (len(arrays[name]) for name in ("motion/root_pos_m", "body/pos_m"))
    positions = BodyPositions.of(read, skeleton, n_motion, n_body)
    return positions.rows(lambda name, start, stop: motion[name][start:stop], 0, n_body)


def take_arrays(body_pos_m: NDArray[np.float32], arrays: Mapping[str, Any]) -> Arrays:
    """What follows from single takes, from the body positions (B, 21, 3) of all of them."""
    starts, stops = np.asarray(arrays["takes/body_start"]), np.asarray(arrays["takes/body_stop"])
    n_takes, n_frames = len(starts), len(body_pos_m)
    clip_take, clip_start = np.asarray(arrays["clips/take"]), np.asarray(arrays["clips/start_frame"])
    clip_borders = np.searchsorted(clip_take, np.arange(n_takes + 1))
    made: Arrays = {
        "takes/front_rad": np.zeros(n_takes),
        "takes/centre_m": np.zeros((n_takes, 3)),
        "body/speed_m_s": np.zeros(n_frames, np.float32),
        "body/heading_rad": np.zeros(n_frames, np.float32),
        "body/sums": np.zeros((n_frames, 2)),
        "clips/steps": np.zeros(len(clip_take), np.int32),
    }
    for take, (start, stop) in enumerate(zip(starts, stops, strict=True)):
        pos = body_pos_m[start:stop].astype(np.float64)
        raw = heading_rad(pos)
        front = made["takes/front_rad"][take] = front_rad(raw)
        unwrapped = np.unwrap(raw - front)
        made["body/heading_rad"][start:stop] = unwrapped - 2 * np.pi * np.round(
            unwrapped.mean() / (2 * np.pi)
        )
        made["takes/centre_m"][take] = ground_pos_m(pos).mean(axis=0)
        made["body/speed_m_s"][start:stop] = mean_joint_speed_m_s(pos, NET_FPS)
        made["body/sums"][start:stop] = travel_and_width_sums(pos)
        clips = slice(*clip_borders[take : take + 2])
        if clips.stop > clips.start:
            middles = middle_starts(clip_start[clips])
            made["clips/steps"][clips] = step_counts(body_pos_m[start:stop], NET_FPS, middles, SEGMENT_FRAMES)
    return made


def root_frame_rows(
    read_pos_m: Callable[[AnyInts], AnyFloats], rows: AnyInts, take_rows: AnyInts
) -> NDArray[np.float32]:
    """Poses and velocities in m/s (N, 2, 21, 3) in the root frame of rows (N,) of the flat arrays.

    `read_pos_m` returns body positions by row. `take_rows` (takes, 2) are the first and last rows of takes.
    """
    take = np.searchsorted(take_rows[:, 0], rows, side="right") - 1
    before, after = np.maximum(rows - 1, take_rows[take, 0]), np.minimum(rows + 1, take_rows[take, 1] - 1)
    pos, pos_before, pos_after = (read_pos_m(r).astype(np.float64) for r in (rows, before, after))
    n_apart = np.maximum(after - before, 1)[:, None, None]
    velocity = (pos_after - pos_before) / n_apart * NET_FPS
    return np.stack([to_root_frame(pos), to_root_frame(pos, velocity)], axis=1).astype(np.float32)


def take_tempi_bpm(arrays: Mapping[str, Any]) -> NDArray[np.float64]:
    """Median tempo of each take (X,), 0 for a take with fewer than two counts."""
    times_s = np.asarray(arrays["counts/time_s"])
    starts, stops = np.asarray(arrays["takes/count_start"]), np.asarray(arrays["takes/count_stop"])
    return np.array(
        [
            60.0 / np.median(np.diff(times_s[start:stop])) if stop - start > 1 else 0.0
            for start, stop in zip(starts.tolist(), stops.tolist(), strict=True)
        ]
    )


# Ranks among all takes of a genre.


def genre_arrays(arrays: Mapping[str, Any]) -> Arrays:
    """The sizes of the seconds of each genre, and the ranks of clips in their genre."""
    genre = np.asarray(arrays["takes/genre"])
    starts, stops = np.asarray(arrays["takes/body_start"]), np.asarray(arrays["takes/body_stop"])
    sums = np.asarray(arrays["body/sums"])
    names = np.unique(genre)
    of_genre = [genre_sizes([sums[starts[i] : stops[i]] for i in np.flatnonzero(genre == g)]) for g in names]
    ends = np.cumsum([len(one.sizes) for one in of_genre])
    take, start_frame = np.asarray(arrays["clips/take"]), np.asarray(arrays["clips/start_frame"])
    genre_of_clip = np.searchsorted(names, genre)[take]
    # The rank of the seconds of each clip's middle 4 s in its genre, and their mean.
    middle = middle_starts(start_frame).astype(np.float64)  # (N,) in their takes
    rows = starts[take], stops[take] - 1
    ranks = []
    for at in (middle + second * NET_FPS for second in range(SEGMENT_S)):
        measured = travel_and_width(lambda of: sums[of], *rows, at, at + NET_FPS)
        ranks.append(liveliness_ranks(measured, genre_of_clip, of_genre))
    return {
        "genres/name": names,
        "genres/scale": np.stack([one.scale for one in of_genre]),
        "genres/size_start": ends - [len(one.sizes) for one in of_genre],
        "genres/size_stop": ends,
        "genres/sizes": np.concatenate([one.sizes for one in of_genre]),
        "clips/step_rank": _step_ranks(np.asarray(arrays["clips/steps"]), genre_of_clip),
        "clips/liveliness_rank": np.asarray(np.mean(ranks, axis=0, dtype=np.float32)),
    }


def _step_ranks(steps: AnyInts, genre_of_clip: AnyInts) -> NDArray[np.float32]:
    """Rank (N,), 0 … 1, of the steps in each clip's middle 4 s among the clips of its genre.

    Equal clips have their mean rank.
    """
    ranks = np.empty(len(steps), np.float32)
    for genre in np.unique(genre_of_clip):
        inside = genre_of_clip == genre
        ranks[inside] = (scipy.stats.rankdata(steps[inside]) - 0.5) / inside.sum()
    return ranks
