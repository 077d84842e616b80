"""A dance to music that is still playing: the sound, the parts of the dance, and the body that is sent."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from itertools import chain, repeat
from multiprocessing import get_context
from pathlib import Path
from queue import SimpleQueue

import numpy as np
from numpy.typing import NDArray

from choreograph.core.counts import Figure
from choreograph.core.errors import ChoreographError
from choreograph.core.numerics import Floats
from choreograph.core.timebase import SAMPLE_RATE_HZ
from choreograph.live.beat_clock import BeatClock
from choreograph.live.online_beats import HOP_S, WINDOW_S, hear_here, open_listener
from choreograph.live.pcm import BLOCK_S
from choreograph.live.requests import Request
from choreograph.live.stream_parts import (
    FPS,
    KEPT_S,
    PartRequest,
    PlannedPart,
    clicks,
    expected,
    open_planner,
    plan_here,
    standing,
)
from choreograph.live.vmc import VmcBody
from choreograph.motion.motion import Motion

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
        danced: Floats = np.where(frames <= last, frames, last - back)
        return danced


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
