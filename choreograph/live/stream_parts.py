"""Parts of a dance to music that is still playing, planned some seconds ahead of it.

A part is planned as a gap of a dance to a short song: the last seconds of the dance so far are kept, and the
graph engine fills the bars after them from the repertoire, by its own costs and by those of the join. The
song is the music so far, continued by a repetition of its latest bars, with the beats that are
predicted.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from choreograph.choreography.constraints import Keep, make_constraints
from choreograph.choreography.genres import likely_genre
from choreograph.choreography.graph.cost import Cost
from choreograph.choreography.graph.layers import Layer
from choreograph.choreography.song_analysis import analyse_song
from choreograph.core.cache import Memory
from choreograph.core.counts import Counts, Figure
from choreograph.core.timebase import NET_FPS, SAMPLE_RATE_HZ, STORE_FPS, seconds_to_frames
from choreograph.formats.register import save_motion
from choreograph.library.repertoire import Repertoire, as_repertoire
from choreograph.library.vocabulary import ALL_GENRES
from choreograph.live.changing import with_feet_locked
from choreograph.live.stream import stay_behind
from choreograph.motion.motion import Motion
from choreograph.music.song import Song
from choreograph.music.song_features import SongFeatures
from choreograph.pipeline.dancing import dance_with
from choreograph.render.dynamics import hold_ends
from choreograph.render.filled_gaps import of_length

KEPT_S = 4.0  # of the dance so far, before a part. Whole seconds, on which the engine compares poses
FPS = STORE_FPS  # of the motion of parts
_MOST_BYTES = 1 << 28  # of the memory of a repertoire
_RECENT = 8  # parts whose material is avoided
_SAME_S = 0.5  # parts of a take that are nearer look the same
_CLICK = 400  # samples
_FREE_M = 0.5  # from the middle of the stage, within which nothing is corrected
_SHARE, _MOST_M = 0.6, 0.6  # of the way back to it that a part goes, and at most
_GENRE_MEMORY = 0.8  # weight of what earlier parts of the music suited
_AVOID = 2.0  # weight, of the other costs of a second


@dataclass(frozen=True, eq=False)
class PartRequest:
    """What a part is planned from. Times are in seconds from the start of its kept motion."""

    samples: NDArray[np.float32]  # (S,) mono at 22.05 kHz, known and then expected
    counts: Counts  # expected
    kept: Motion | None  # of the first `KEPT_S` and on, or None to stand until the first count
    until_s: float  # when the next part is expected to begin
    genre: str | None
    seed: int
    rests: bool = False  # the music has ended: a pose is held from `until_s` on


def expected(
    recent: NDArray[np.float32], recent_s: float, from_s: float, to_s: float, bar_s: float
) -> NDArray[np.float32]:
    """Samples (S,) from one time of a stream to another.

    `recent` (R,) are the latest samples, from `recent_s` on. After them, the latest whole bars are repeated,
    two if there are so many. What is older than they are is silent.
    """
    heard_s = recent_s + len(recent) / SAMPLE_RATE_HZ
    n_bars = min(2, int(len(recent) / SAMPLE_RATE_HZ / bar_s))
    period = round(n_bars * bar_s * SAMPLE_RATE_HZ)
    index = round((from_s - recent_s) * SAMPLE_RATE_HZ) + np.arange(round((to_s - from_s) * SAMPLE_RATE_HZ))
    if period and heard_s < to_s:
        beyond = index >= len(recent)
        index[beyond] = len(recent) - period + (index[beyond] - len(recent)) % period
    samples, known = np.zeros(len(index), np.float32), (index >= 0) & (index < len(recent))
    samples[known] = recent[index[known]]
    return samples


@dataclass(frozen=True, eq=False)
class PlannedPart:
    """The motion of a part, and the figures that are danced in it, in seconds from its first frame."""

    motion: Motion
    figures: tuple[Figure, ...] = ()


class NotAgain(Cost):
    """1 for a node from what the latest parts have danced, in the same take within half a second."""

    name = "not_again"

    def __init__(self, danced: Iterable[Sequence[tuple[str, float, float]]]) -> None:
        self._danced = [span for part in danced for span in part]  # take, from and to in seconds of it

    def node(self, layer: Layer, song_features: SongFeatures) -> NDArray[np.floating]:
        """The cost of every node (N,)."""
        start_s = layer.take_frames[:, 0] / NET_FPS
        same = np.zeros(layer.n_nodes, bool)
        for take, from_s, to_s in self._danced:
            inside = (start_s > from_s - _SAME_S) & (start_s < to_s - _SAME_S)
            same |= (layer.take_names == take) & inside
        return same.astype(np.float64)


class PartPlanner:
    """Plans parts with one repertoire."""

    def __init__(self, repertoire: Repertoire) -> None:
        self._repertoire, self._memory = repertoire, Memory(_MOST_BYTES)
        self._danced: deque[list[tuple[str, float, float]]] = deque(maxlen=_RECENT)
        self._genres: dict[str, float] = {}  # how well each suits the music

    def plan(self, request: PartRequest) -> PlannedPart:
        """A part, `KEPT_S` of kept motion first. Raises as `choreograph.dance`."""
        song, counts = Song(request.samples, "stream"), request.counts
        rows = zip(counts.times_s.tolist(), counts.numbers.tolist(), strict=True)
        with TemporaryDirectory() as folder:
            beats, before = Path(folder) / "beats.txt", Path(folder) / "before.npz"
            beats.write_text("\n".join(f"{time_s:.5f} {number or ''}" for time_s, number in rows))
            if request.kept is not None:
                save_motion(before, of_length(request.kept, seconds_to_frames(song.duration_s, FPS)))
            genre = request.genre or (None if request.rests else self._genre(song, beats))
            made = dance_with(
                self._memory, song, self._repertoire, genre=genre, seed=request.seed, beats=beats,
                existing=before if request.kept is not None else None,
                keep=[Keep(0.0, KEPT_S)] if request.kept is not None else (),
                costs=[NotAgain(self._danced)], weights={NotAgain.name: _AVOID}, cache=False, fps=FPS,
                hold_ends=request.kept is None,
            )  # fmt: skip
        if request.kept is not None:
            danced = [
                (block.planned.take, block.source_start_s, block.source_end_s)
                for block in made.plan.blocks
                if KEPT_S - _SAME_S <= block.start_s < request.until_s
            ]
            self._danced.append(danced)
        first, until = (seconds_to_frames(time_s, FPS) for time_s in (KEPT_S, request.until_s))
        motion = made.motion if request.kept is None else to_middle(made.motion, first, until)
        if request.rests:
            return PlannedPart(hold_ends(motion, 0.0, request.until_s))
        return PlannedPart(motion, made.figures)

    def _genre(self, song: Song, beats: Path) -> str | None:
        """The genre that the music has suited best so far, since a few seconds of it are little evidence."""
        features, _ = analyse_song(song, self._repertoire, beats=beats, memory=self._memory)
        likely = likely_genre(features, self._repertoire, make_constraints())
        for genre in self._genres:
            self._genres[genre] *= _GENRE_MEMORY
        self._genres[likely.genre] = self._genres.get(likely.genre, 0.0) + likely.probability
        best = max(self._genres, key=lambda genre: self._genres[genre])
        return None if best == ALL_GENRES else best


def to_middle(motion: Motion, first: int, until: int) -> Motion:
    """The motion, nearer to the middle of the stage at the frame `until`, and changed from `first` on.

    The body is shifted where it travels, and hardly where it stands.
    """
    at_m = motion.root_pos_m[min(until, motion.n_frames - 1), [0, 2]]
    away_m = float(np.linalg.norm(at_m))
    if away_m <= _FREE_M or until <= first:
        return motion
    shift_m = -at_m / away_m * min(_SHARE * (away_m - _FREE_M), _MOST_M)
    after = motion.sliced(first, motion.n_frames)
    speed = np.linalg.norm(np.diff(after.root_pos_m[:, [0, 2]], axis=0), axis=1)[: until - first]
    share = np.cumsum(speed) / max(float(speed.sum()), 1e-9)
    share = np.concatenate([[0.0], share, np.ones(max(0, after.n_frames - 1 - len(share)))])[: after.n_frames]
    root_pos_m = after.root_pos_m.copy()
    root_pos_m[:, [0, 2]] += share[:, None] * shift_m
    return with_feet_locked(motion, replace(after, root_pos_m=root_pos_m), first)


# In a process of its own, so that planning does not delay the frames that are sent.


_PLANNERS: list[PartPlanner] = []


def open_planner(repertoire: tuple[Path, ...]) -> None:
    """Open a repertoire in this process, for `plan_here`."""
    stay_behind()
    opened = as_repertoire(repertoire)
    stands = PartPlanner(opened).plan(standing(KEPT_S)).motion
    counts = Counts(np.arange(0.0, KEPT_S + 4.0, 0.5), np.arange(int(2 * KEPT_S) + 8) % 4 + 1, 4)
    first = PartRequest(clicks(counts, KEPT_S + 4.0), counts, stands, KEPT_S + 2.0, None, 0)
    PartPlanner(opened).plan(first)  # which loads and compiles what the others use
    _PLANNERS.append(PartPlanner(opened))


def plan_here(request: PartRequest) -> PlannedPart:
    """As `PartPlanner.plan`, by the planner of this process."""
    return _PLANNERS[0].plan(request)


def standing(duration_s: float) -> PartRequest:
    """A request for a body that stands and breathes, from the first pose of a dance to clicks."""
    times_s = np.arange(duration_s, duration_s + 4.0, 0.5)
    counts = Counts(times_s, np.arange(len(times_s)) % 4 + 1, 4)
    return PartRequest(clicks(counts, duration_s + 4.5), counts, None, duration_s, None, 0)


def clicks(counts: Counts, duration_s: float) -> NDArray[np.float32]:
    """Samples (S,) of a click on each count, for a dance whose music is silent."""
    samples = np.zeros(round(duration_s * SAMPLE_RATE_HZ) + _CLICK, np.float32)
    for at in np.rint(counts.times_s * SAMPLE_RATE_HZ).astype(np.int64):
        samples[at : at + _CLICK] = np.hanning(_CLICK)
    return samples[:-_CLICK]
