"""A dance that is changed while it runs: what is requested is danced from the next phrase on."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path
from queue import SimpleQueue
from threading import Thread
from typing import Any

import numpy as np

from choreograph.choreography.constraints import Keep
from choreograph.choreography.song_analysis import analyse_song
from choreograph.core.errors import ChoreographError
from choreograph.core.timebase import seconds_to_frames
from choreograph.live.requests import Request
from choreograph.live.stream import stay_behind
from choreograph.live.vmc import VmcBody
from choreograph.motion import rotations as rot
from choreograph.motion.contacts import lock_feet
from choreograph.motion.motion import Motion
from choreograph.music.song_features import Places
from choreograph.pipeline.dancing import Dance
from choreograph.pipeline.session import Session
from choreograph.render.dynamics import with_amplitudes

_AHEAD_S = 2.5  # from a request to the phrase in which it is danced, in which the dance is planned again
_SPARE_S = 0.1  # before a phrase, for the exchange of the dance
_LEAST_S = 2.0  # of a dance that is planned again
_EASE_S = 3.0  # after the start of a phrase until the size changes, which is smooth in time


class ChangingBody:
    """The body that is sent. Its frames from a phrase on are replaced while it is sent."""

    def __init__(self, body: VmcBody) -> None:
        self._body = body

    def __len__(self) -> int:
        return len(self._body)

    def packet(self, frame: int, time_s: float) -> bytes:
        """As `VmcBody.packet`."""
        return self._body.packet(frame, time_s)

    def pose(self, frame: int, time_s: float) -> dict[str, Any]:
        """As `VmcBody.pose`."""
        return self._body.pose(frame, time_s)

    def replace(self, body: VmcBody, first: int) -> None:
        """Send the frames of another body of the same length from the frame `first` on."""
        self._body = self._body.joined(body, first)


@dataclass(frozen=True)
class Wanted:
    """All that is requested of the rest of a dance."""

    arguments: dict[str, Any]  # keywords of `Session.dance`
    sizes: tuple[tuple[float, float], ...] = ()  # of the dance from times in seconds on

    def changed(self, request: Request, from_s: float, to_s: float) -> Wanted:
        """With a request for the phrase between two times, and the rest as before."""
        arguments = {name: value for name, value in self.arguments.items() if name != "pins"}
        if request.kind == "energy":
            return Wanted(arguments, (*self.sizes, (from_s, float(request.value))))
        if request.kind == "pin":
            return Wanted({**arguments, "pins": [request.pin(from_s, to_s)]}, self.sizes)
        value = request.value if request.kind == "seed" else request.value or None
        return Wanted({**arguments, request.kind: value}, self.sizes)


def sized(motion: Motion, sizes: Sequence[tuple[float, float]]) -> Motion:
    """The motion in the sizes from times on. It changes in some seconds, and not before the first time."""
    if not sizes:
        return motion
    first = seconds_to_frames(sizes[0][0], motion.fps)
    before = Motion(motion.skeleton, motion.root_pos_m[first:], motion.local_quat[first:], motion.fps)
    amplitudes = np.ones(max(1, int(np.ceil(before.duration_s))))
    for from_s, size in sizes:
        amplitudes[int(np.ceil(from_s - sizes[0][0] + _EASE_S)) :] = size
    return with_feet_locked(motion, with_amplitudes(before, amplitudes.tolist()), first)


def with_feet_locked(motion: Motion, after: Motion, first: int) -> Motion:
    """The motion with its frames from `first` on replaced by changed ones, whose feet are locked anew.

    The change begins there in no pose, and the other rotations of locked legs come within a second.
    """
    before = motion.sliced(first, motion.n_frames)
    after = lock_feet(after)
    share = np.minimum(np.arange(before.n_frames) / motion.fps, 1.0)[:, None]  # of the feet locked anew
    root_pos_m = before.root_pos_m + share * (after.root_pos_m - before.root_pos_m)
    local_quat = rot.slerp(before.local_quat, after.local_quat, share)
    return replace(
        motion,
        root_pos_m=np.concatenate([motion.root_pos_m[:first], root_pos_m]),
        local_quat=rot.make_continuous(np.concatenate([motion.local_quat[:first], local_quat])),
    )


# In a process of its own, so that planning does not delay the frames that are sent.


_SESSIONS: list[Session] = []
_DANCES: dict[int, Dance] = {}


def _open(song: Path, repertoire: tuple[Path, ...], dance: Dance) -> None:
    stay_behind()
    _SESSIONS.append(Session(song, repertoire))  # type: ignore[arg-type]
    _DANCES[0] = dance


def _changed(
    before: int, number: int, until_s: float, wanted: Wanted, fps: float
) -> tuple[VmcBody, tuple[str, ...]]:
    """The body of the dance `before` until a time, and then as wanted, and what is not met."""
    known = _DANCES[before]
    made = _SESSIONS[0].dance(existing=known, keep=[Keep(0.0, until_s)], **wanted.arguments)
    for unused in [other for other in _DANCES if other != before]:
        del _DANCES[unused]
    _DANCES[number] = made
    return VmcBody.of(sized(made.motion, wanted.sizes).resampled(fps), made.figures), made.unmet


def phrases_s(song: Path, repertoire: tuple[Path, ...], duration_s: float) -> list[float]:
    """The times at which the phrases of a song begin, or its bars if it has no phrases."""
    session = Session(song, repertoire)  # type: ignore[arg-type]
    features, _ = analyse_song(session.song, session.repertoire, keep=True)
    spans = Places.of_song(features).spans_s
    starts = [start_s for start_s, _ in (spans["phrase"] or spans["bar"])]
    return [start_s for start_s in starts if start_s < duration_s - _LEAST_S]


@dataclass(frozen=True)
class Change:
    """A change that will be danced."""

    request: Request
    from_s: float
    unmet: tuple[str, ...]


class Changes:
    """Takes requests, and replaces the rest of the body that is sent.

    A dance is planned in another process, and its body is exchanged before its phrase begins. If it comes too
    late for that, it is planned for the next phrase.
    """

    def __init__(
        self,
        body: ChangingBody,
        starts_s: Sequence[float],
        fps: float,
        wanted: Wanted,
        plan: Callable[[int, int, float, Wanted, float], tuple[VmcBody, tuple[str, ...]]],
        *,
        song_s: Callable[[], float],
        note: Callable[[str], None],
    ) -> None:
        self._body, self._starts_s, self._fps, self._wanted = body, list(starts_s), fps, wanted
        self._plan, self._song_s, self._note = plan, song_s, note
        self._number, self._last = 0, 0
        self._requests: SimpleQueue[Request | None] = SimpleQueue()

    def request(self, request: Request) -> None:
        """Take a request. It is handled by `run`, in another thread."""
        self._requests.put(request)

    def end(self) -> None:
        """End `run`."""
        self._requests.put(None)

    def run(self) -> None:
        """Handle requests one after the other until `end`."""
        while (request := self._requests.get()) is not None:
            try:
                change = self.handle(request)
            except ChoreographError as error:
                self._note(f"{request}: {error}")
                continue
            if change is None:
                self._note(f"{request}: the song has no other phrase for it")
                continue
            self._note(f"{request}: from {change.from_s:.1f} s on")
            for line in change.unmet:
                self._note(line)

    def handle(self, request: Request) -> Change | None:
        """Dance a request from the next phrase on, or return None if there is none.

        Raises what the planning of a dance raises. The dance then goes on as it was.
        """
        while True:
            coming = [start_s for start_s in self._starts_s if start_s >= self._song_s() + _AHEAD_S]
            if not coming:
                return None
            end_s = coming[1] if len(coming) > 1 else len(self._body) / self._fps
            wanted = self._wanted.changed(request, coming[0], end_s)
            self._last += 1
            body, unmet = self._plan(self._number, self._last, coming[0], wanted, self._fps)
            if self._song_s() < coming[0] - _SPARE_S:
                break
        self._body.replace(body, seconds_to_frames(coming[0], self._fps))
        self._number, self._wanted = self._last, wanted
        return Change(request, coming[0], unmet)


@contextmanager
def changing(
    song: Path,
    repertoire: tuple[Path, ...],
    dance: Dance,
    body: ChangingBody,
    fps: float,
    arguments: dict[str, Any],
    *,
    song_s: Callable[[], float],
    note: Callable[[str], None],
) -> Iterator[Changes]:
    """Requests for a dance that is sent, handled until the block ends. `arguments` are those of the dance."""
    starts_s = phrases_s(song, repertoire, dance.motion.duration_s)
    with ProcessPoolExecutor(1, get_context("spawn"), _open, (song, repertoire, dance)) as pool:
        pool.submit(len, ()).result()  # the process has started before the song does

        def plan(*given: Any) -> tuple[VmcBody, tuple[str, ...]]:
            try:
                return pool.submit(_changed, *given).result()
            except BrokenProcessPool:
                raise ChoreographError(
                    "expected another process to plan the dance again, it has ended: start again for changes"
                ) from None

        changes = Changes(body, starts_s, fps, Wanted(arguments), plan, song_s=song_s, note=note)
        thread = Thread(target=changes.run, daemon=True)
        thread.start()
        try:
            yield changes
        finally:
            changes.end()
            thread.join()
