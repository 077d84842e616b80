"""A dance to music that is still playing: the sound, the parts of the dance, and the body that is sent.

A part is planned some seconds ahead of the music, as a gap of a dance to a short song: the last seconds of
the dance so far are kept, and the graph engine fills the bars after them from the repertoire, by its own
costs and by those of the join. The song is the music so far, continued by a repetition of its latest bars,
with the beats that are predicted.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from itertools import chain, repeat
from multiprocessing import get_context
from pathlib import Path
from queue import SimpleQueue
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
from choreograph.core.errors import ChoreographError
from choreograph.core.numerics import Floats
from choreograph.core.timebase import NET_FPS, SAMPLE_RATE_HZ, STORE_FPS, seconds_to_frames
from choreograph.formats.register import save_motion
from choreograph.library.repertoire import Repertoire, as_repertoire
from choreograph.library.vocabulary import ALL_GENRES
from choreograph.live.changing import with_feet_locked
from choreograph.live.online_beats import HOP_S, WINDOW_S, BeatClock, hear_here, open_listener
from choreograph.live.requests import Request
from choreograph.live.sound import BLOCK_S
from choreograph.live.stream import stay_behind
from choreograph.live.vmc import VmcBody
from choreograph.motion.motion import Motion
from choreograph.music.song import Song
from choreograph.music.song_features import SongFeatures
from choreograph.pipeline.dancing import dance_with
from choreograph.render.dynamics import hold_ends
from choreograph.render.filled_gaps import of_length

# Parts, planned from what was played.


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


# The dance.


AHEAD_S = 2.0  # from a plan to the first count that is danced by it
_SPARE_S = 0.05  # before that count, for the exchange of the part
_PART_S = 4.0  # of a part, about, in whole bars
_TAIL_S = 2.5  # planned beyond a part, danced only if the next part is late or its count 1 moves
_BAR_BEATS = 4  # of music without bars
_ON_S = 1.0  # by which the dance so far goes on, into the join with a part
_TO_REST_S = 2.0  # at least, until the last count of a dance that ends
_REST_S = 4.0  # at least, of the rest after it
_ENDING_S = 8.0  # after the music: until no beats are known, until the dance rests, and some of the rest
_STAND_S = 6.0
_STILL_S = 3.0  # at the end of a part, which go back and forth when nothing else is planned
_DRIFT = 5e-4  # of the clocks of two machines
_STALLED_S = 0.2
_TOLD_CHANGE = 0.04  # of the tempo, after which it is told again


@dataclass(frozen=True, eq=False)
class Part:
    """A part of the dance. Its motion belongs to the beats of its clock, or to times without one."""

    motion: Motion
    body: VmcBody  # of the same frames
    from_s: float  # time in the stream of the first frame, by the clock of its plan
    clock: BeatClock | None
    next_beat: float = 0.0  # position at which the next part is expected to begin
    rests: bool = False  # it comes to rest
    figures: tuple[Figure, ...] = ()  # that are danced, in seconds from its first frame

    def frames_at(self, clock: BeatClock | None, times_s: Floats) -> Floats:
        """The fractional frames at times (T,) of the stream, by the latest clock."""
        if self.clock is not None and clock is not None:
            times_s = self.clock.time_at(clock.beat_at(times_s))
        frames = np.maximum((times_s - self.from_s) * FPS, 0.0)
        last = self.motion.n_frames - 1
        still = min(last, round(_STILL_S * FPS))
        back = np.abs((frames - last + still) % (2 * still) - still)  # from 0 to `still` and back
        return np.where(frames <= last, frames, last - back)


class StreamBody:
    """The body that is sent. Its parts and its clock are exchanged while it is sent."""

    def __init__(self, first: Part) -> None:
        self._now: tuple[Part, BeatClock | None] = (first, first.clock)

    @property
    def part(self) -> Part:
        """The part that is danced."""
        return self._now[0]

    def take(self, part: Part, clock: BeatClock | None) -> None:
        """Dance a part, by its clock or a later one of its generation."""
        self._now = (part, clock)

    def follow(self, clock: BeatClock) -> None:
        """Dance by a later clock, if it is of the generation of the part."""
        part = self.part
        if part.clock is not None and part.clock.generation == clock.generation:
            self._now = (part, clock)

    def frames_at(self, times_s: Floats) -> tuple[Part, Floats]:
        """The part and its fractional frames (T,) at times of the stream."""
        part, clock = self._now
        return part, part.frames_at(clock, np.asarray(times_s, np.float64))

    def at(self, time_s: float) -> VmcBody:
        """One frame of the body, at a time of the stream."""
        part, frames = self.frames_at(np.array([time_s]))
        return part.body.between(float(frames[0]))

    def motion(self, from_s: float, n_frames: int) -> Motion:
        """The motion from a time of the stream on, as it would be danced by the latest part and clock."""
        part, frames = self.frames_at(from_s + np.arange(n_frames) / FPS)
        return part.motion.sampled(frames, fps=FPS)


class StreamTime:
    """The time in a stream of samples: that of the wall, without the gaps in which no samples come."""

    def __init__(self, wall_s: Callable[[], float] = time.perf_counter) -> None:
        self._wall_s, self._began_s = wall_s, wall_s()
        self._arrived_s = 0.0

    def __call__(self) -> float:
        return self._wall_s() - self._began_s

    def arrived(self, end_s: float, sleep: Callable[[float], None] = time.sleep) -> None:
        """Samples up to a time of the stream have come. Waits for that time if they came early.

        So a file is read no faster than it sounds. The clock of another machine is followed slowly.
        """
        late_s = self() - end_s
        most_s = _DRIFT * (end_s - self._arrived_s)
        if late_s > _STALLED_S or self._arrived_s == 0.0:
            self._began_s += late_s
        else:
            self._began_s += min(max(late_s, -most_s), 0.1 * most_s)
        self._arrived_s = end_s
        if (wait_s := end_s - self()) > 0:
            sleep(wait_s)


@dataclass(eq=False)
class StreamDance:
    """Takes blocks of samples, and plans the dance ahead of them.

    `listen` starts the analysis of a block, and `plan` that of a part. Both return a future.
    """

    listen: Callable[[NDArray[np.float32]], Future[BeatClock | None]]
    plan: Callable[[PartRequest], Future[PlannedPart]]
    body: StreamBody
    note: Callable[[str], None]
    genre: str | None = None
    seed: int = 0
    heard_s: float = 0.0
    n_parts: int = 0
    n_late: int = 0  # parts that came after their first count
    clock: BeatClock | None = None  # the latest
    requests: SimpleQueue[Request] = field(default_factory=SimpleQueue)
    _recent: NDArray[np.float32] = field(default_factory=lambda: np.zeros(0, np.float32))
    _unheard: NDArray[np.float32] = field(default_factory=lambda: np.zeros(0, np.float32))
    _heard: Future[BeatClock | None] | None = None
    _told: BeatClock | None = None  # of the latest note
    _planned: tuple[Future[PlannedPart], Part, float] | None = (
        None  # with all but its motion, and its first time
    )

    def hear(self, block: NDArray[np.float32]) -> None:
        """Take the next samples, what was found since the last ones, and plan if it is time."""
        self.heard_s += len(block) / SAMPLE_RATE_HZ
        self._recent = np.concatenate([self._recent, block])[-round(WINDOW_S * SAMPLE_RATE_HZ) :]
        self._unheard = np.concatenate([self._unheard, block])
        if self._heard is not None and self._heard.done():
            self._take_clock(self._heard.result())
            self._heard = None
        if self._heard is None and len(self._unheard) >= HOP_S * SAMPLE_RATE_HZ:
            self._heard, self._unheard = self.listen(self._unheard), np.zeros(0, np.float32)
        self._take_part()
        self._take_requests()
        if self._planned is None:
            self._plan_next()

    def _take_clock(self, clock: BeatClock | None) -> None:
        if clock is not None and not self._is_told(clock):
            bars = f", {clock.metre} in a bar" if clock.metre else ""
            self.note(f"{self.heard_s:.1f} s: {60 / clock.period_s:.0f} beats a minute{bars}")
            self._told = clock
        if clock is None and self.clock is not None:
            self.note(f"{self.heard_s:.1f} s: no beats")
        self.clock = clock
        if clock is not None:
            self.body.follow(clock)

    def _is_told(self, clock: BeatClock) -> bool:
        """Whether the tempo and the metre are those of the latest note."""
        told = self._told if self.clock is not None else None
        if told is None or told.metre != clock.metre:
            return False
        return bool(abs(np.log(clock.period_s / told.period_s)) < _TOLD_CHANGE)

    def _take_requests(self) -> None:
        while not self.requests.empty():
            request = self.requests.get()
            if request.kind == "genre":
                self.genre = str(request.value) or None
            elif request.kind == "seed":
                self.seed = int(request.value)
            else:
                self.note(f"{request}: expected genre or seed with --input, which has no phrases ahead")
                continue
            self.note(f"{request}: from the next part on")

    def _take_part(self) -> None:
        """Dance the part that was planned, unless it comes too late."""
        if self._planned is None or not self._planned[0].done():
            return
        future, part, first_s = self._planned
        self._planned = None
        try:
            planned = future.result()
        except ChoreographError as error:
            self.genre = None
            self.note(f"a part could not be planned: {error}")
            return
        if self.heard_s > first_s - _SPARE_S:
            self.n_late += 1
            return
        clock = self.clock
        if clock is None or part.clock is None or clock.generation != part.clock.generation:
            clock = part.clock
        figures = (*self._figures_before(part.from_s), *planned.figures)
        body = VmcBody.of(planned.motion, figures)
        made = replace(part, motion=planned.motion, body=body, figures=figures)
        self.body.take(made, clock)
        self.n_parts += 1

    def _figures_before(self, from_s: float) -> Iterator[Figure]:
        """The figures of the dance so far in the kept motion of a part that begins at a time."""
        before = self.body.part
        for figure in before.figures:
            start_s, end_s = (before.from_s + time_s - from_s for time_s in (figure.start_s, figure.end_s))
            if start_s < KEPT_S and end_s > 0.0:
                yield replace(figure, start_s=max(start_s, 0.0), end_s=min(end_s, KEPT_S))

    def _plan_next(self) -> None:
        part, clock = self.body.part, self.clock
        soonest_s = self.heard_s + AHEAD_S
        if clock is None:
            if not part.rests:
                self._plan_rest(soonest_s)
            return
        beat = float(clock.beat_at(soonest_s))
        same = part.clock is not None and part.clock.generation == clock.generation and not part.rests
        if same and beat < part.next_beat - 1.01:
            return
        metre = clock.metre or _BAR_BEATS
        first = int(np.ceil(max(beat, part.next_beat - 1.01) if same else beat))
        while clock.metre and clock.number_of(first) != 1:
            first += 1
        next_beat = first + metre * max(1, round(_PART_S / (metre * clock.period_s)))
        first_s, next_s = float(clock.time_at(first)), float(clock.time_at(next_beat))
        self._request(clock, first_s, next_s, next_s + _TAIL_S, float(next_beat), rests=False)

    def _plan_rest(self, soonest_s: float) -> None:
        """Come to rest on a count soon."""
        clock = self.body.part.clock
        assert clock is not None  # of a part that does not rest
        last_s = float(clock.time_at(np.ceil(clock.beat_at(soonest_s + _TO_REST_S))))
        self._request(clock, soonest_s, last_s, last_s + _REST_S, 0.0, rests=True)

    def _request(
        self, clock: BeatClock, first_s: float, next_s: float, to_s: float, next_beat: float, *, rests: bool
    ) -> None:
        from_s = first_s - KEPT_S
        recent_s = self.heard_s - len(self._recent) / SAMPLE_RATE_HZ
        bar_s = clock.period_s * (clock.metre or _BAR_BEATS)
        samples = expected(self._recent, recent_s, from_s, to_s, bar_s)
        counts = clock.counts(from_s, to_s)
        if rests:
            samples = clicks(counts, to_s - from_s)
        kept = self.body.motion(from_s, round((KEPT_S + _ON_S) * FPS))
        seed = self.seed + self.n_parts
        request = PartRequest(samples, counts, kept, next_s - from_s, self.genre, seed, rests)
        part = Part(self.body.part.motion, self.body.part.body, from_s, clock, next_beat, rests)
        self._planned = (self.plan(request), part, first_s)


@contextmanager
def stream_dance(
    repertoire: tuple[Path, ...], note: Callable[[str], None], *, genre: str | None, seed: int
) -> Iterator[StreamDance]:
    """A dance whose music is analysed in one process and whose parts are planned in another one."""
    spawn = get_context("spawn")
    with (
        ProcessPoolExecutor(1, spawn, open_listener) as listener,
        ProcessPoolExecutor(1, spawn, open_planner, (repertoire,)) as planner,
    ):
        listener.submit(len, ())
        stands = planner.submit(plan_here, standing(_STAND_S)).result().motion
        motion = stands.sliced(0, round(_STAND_S * FPS) - FPS)
        first = Part(motion, VmcBody.of(motion), 0.0, None, rests=True)
        body = StreamBody(first)

        def listen(block: NDArray[np.float32]) -> Future[BeatClock | None]:
            return listener.submit(hear_here, block)

        def plan(request: PartRequest) -> Future[PlannedPart]:
            return planner.submit(plan_here, request)

        yield StreamDance(listen, plan, body, note, genre, seed)


def hear_all(dance: StreamDance, blocks: Iterable[NDArray[np.float32]], stream_s: StreamTime) -> None:
    """Take a stream until it ends, in its own time, and then silence in which the dance comes to rest."""
    silence = np.zeros(round(BLOCK_S * SAMPLE_RATE_HZ), np.float32)
    for block in chain(blocks, repeat(silence, round(_ENDING_S / BLOCK_S))):
        stream_s.arrived(dance.heard_s + len(block) / SAMPLE_RATE_HZ)
        dance.hear(block)
