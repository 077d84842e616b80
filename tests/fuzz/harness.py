"""Inputs tried in child processes, which may neither crash, hang nor take memory without bound.

Other failures are CPU time that grows faster than the input, sane files that are refused, and files that are
no longer the same when they are written and read again.

A child works through the inputs of one target for a while and tells its parent of each, so that the parent
has the input at which a child died or hung. Inputs follow from the seed and their number.
"""

from __future__ import annotations

import faulthandler
import gc
import json
import os
import re
import resource
import select
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from acceptance.corpus import MAX_REFUSED_SHARE, SaneFile
from fuzz.mutations import Rng, mutated
from fuzz.repeats import REPEATS, Repeated, repeated

from choreograph.core.errors import ChoreographError

BEYOND_BYTES = 2 << 30  # of address space, over what the program takes before the first input
CPU_S = 10.0  # an input takes at most that long
REPEATED_CPU_S = 30.0  # one in which a part is repeated: it may hold thousands of takes
WALL_S = 120.0  # and is ended after that, on a machine that may be busy
SLICE_S = 5.0  # of one target before it is the next one's turn
REPEATED_SHARE = 0.1  # of the inputs: with one part many times
# CPU time grows at most as this power of the number of repeats. A reader that is linear on an idle machine
# was measured at 1.3 on a busy one, and a quadratic one is at 2. `test_reading_time` expects at most 1.2.
MAX_SLOPE = 1.5
SLOPE_CPU_S = (
    0.3,
    4.0,
)  # of an input whose slope is measured: above noise, and all measurements within WALL_S
N_TRIALS = 3  # of a slope that is too steep at first
ROUND_TRIP_BYTES = 1 << 18  # of the largest input that is written and read again


@dataclass(frozen=True)
class Target:
    """A reader of files, and good files to begin with."""

    name: str
    file_name: str  # that a file to be read has in its folder
    kind: str  # of changes: see `mutations`
    seeds: Sequence[bytes]
    read: Callable[[Path], Any]  # may raise `ChoreographError`
    folder: Path  # where files beside it lie
    # Writes what was read into a folder and reads it again; raises `AssertionError` unless it is the same.
    round_trip: Callable[[Any, Path], None] | None = None
    sane: Sequence[SaneFile] = ()  # of which at most 1 % may be refused
    make: Callable[[Rng], bytes] | None = None  # all inputs, instead of changes of the seeds


@dataclass(frozen=True)
class Input:
    """A file to be read."""

    data: bytes
    repeated: Repeated | None = None  # how it is made, if a part is repeated
    is_seed: bool = False  # must be read
    sane: SaneFile | None = None  # written instead of the data


@dataclass
class Tally:
    """What came of a target's inputs."""

    tried: int = 0
    was_read: int = 0
    failures: dict[str, tuple[int, str]] = field(default_factory=dict)  # by place: first input, what happened
    slowest: tuple[float, int] = (0.0, -1)  # CPU seconds, input
    hungriest: tuple[float, int] = (0.0, -1)  # MB of memory that it took, input
    refused_sane: dict[str, str] = field(default_factory=dict)  # name of the file: error

    def add(self, number: int, outcome: dict) -> None:
        """Count one input."""
        self.tried += 1
        self.was_read += outcome.get("read", False)
        self.slowest = max(self.slowest, (outcome.get("cpu_s", 0.0), number))
        self.hungriest = max(self.hungriest, (outcome.get("mb", 0.0), number))
        self.refused_sane |= outcome.get("refused_sane", {})
        failure = outcome.get("failure")
        longest_s = REPEATED_CPU_S if outcome.get("is_repeated") else CPU_S
        if failure is None and outcome.get("cpu_s", 0.0) > longest_s:
            failure = f"slow: {outcome['cpu_s']:.1f} s"
        if failure:
            self.failures.setdefault(failure.splitlines()[-1][:200], (number, failure))


def input_of(target: Target, seed: int, number: int) -> Input:
    """The input of that number."""
    key = [seed, int.from_bytes(target.name.encode(), "little"), number]
    rng = np.random.default_rng(key)
    if target.make is not None:
        return Input(target.make(rng))
    if rng.random() < REPEATED_SHARE:
        made = repeated(target.kind, target.seeds, rng)
        return Input(made.make(made.times), made)
    return Input(mutated(target.kind, target.seeds, rng))


def fuzz(
    targets: Sequence[Target], *, seed: int, seconds: float | None = None, n_inputs: int | None = None
) -> dict[str, Tally]:
    """Try inputs of all targets in turn: `n_inputs` of each, or for `seconds`, of which all get their share.

    A target whose turn comes too late, since one before it took long, still gets one input.
    """
    tallies = {target.name: Tally() for target in targets}
    end = time.monotonic() + (seconds or 0.0)
    last = sys.maxsize if n_inputs is None else n_inputs
    while seconds != 0.0:
        for turn, target in enumerate(targets):
            tally, left_s = tallies[target.name], end - time.monotonic()
            slice_s = min(SLICE_S, left_s / (len(targets) - turn)) if n_inputs is None else np.inf
            if tally.tried < last and (n_inputs is not None or left_s > 0.0 or tally.tried == 0):
                _in_child(target, tally, lambda n, t=target: input_of(t, seed, n), last, slice_s)
        if time.monotonic() >= end and all(tally.tried >= (n_inputs or 0) for tally in tallies.values()):
            break
    return tallies


def n_good(target: Target) -> int:
    """How many files a target has that must be read."""
    return len(target.seeds) + len(target.sane)


def in_jobs(
    work: Callable[[Sequence[Target]], dict[str, Tally]],
    targets: Sequence[Target],
    n_jobs: int,
    cost: Callable[[Target], int] = lambda target: 1,
) -> dict[str, Tally]:
    """Do the work in several processes at once, each for some of the targets. The inputs stay the same.

    The targets are dealt so that the sums of their `cost` are about equal.
    """
    hands: list[list[Target]] = [[] for _ in range(min(n_jobs, len(targets)))]
    for target in sorted(targets, key=cost, reverse=True):
        min(hands, key=lambda hand: sum(map(cost, hand))).append(target)
    context = get_context("fork")
    started = []
    for hand in hands:
        receive, send = context.Pipe(duplex=False)
        process = context.Process(target=lambda of, to: to.send(work(of)), args=(hand, send))
        process.start()
        send.close()
        started.append((process, receive))
    tallies: dict[str, Tally] = {}
    for process, receive in started:
        tallies |= receive.recv()
        process.join()
    return {target.name: tallies[target.name] for target in targets}


def accepted(target: Target) -> Tally:
    """Try the untouched seeds, which must be read, and the sane files."""
    tally = replay(
        target,
        [
            *(Input(data, is_seed=True) for data in target.seeds),
            *(Input(b"", sane=file) for file in target.sane),
        ],
    )
    if len(tally.refused_sane) > MAX_REFUSED_SHARE * len(target.sane):
        tally.failures |= {
            f"refused, though sane: {name}": (-1, line) for name, line in tally.refused_sane.items()
        }
    return tally


def replay(target: Target, inputs: Sequence[Input]) -> Tally:
    """Try given inputs."""
    tally = Tally()
    while tally.tried < len(inputs):
        _in_child(target, tally, lambda number: inputs[number], len(inputs), np.inf)
    return tally


def _in_child(target: Target, tally: Tally, make: Callable[[int], Input], last: int, slice_s: float) -> None:
    """Try inputs from `tally.tried` on: to the last, for `slice_s`, or until one ends the child."""
    from_child, to_parent = os.pipe()
    gc.freeze()  # a child that frees FFmpeg's objects of the parent waits for their threads for ever
    child = os.fork()
    if child == 0:
        try:
            _try_inputs(target, make, range(tally.tried, last), slice_s, to_parent)
        finally:  # without what the parent does at its end, such as to remove its files
            os._exit(1)
    gc.unfreeze()
    os.close(to_parent)
    hung = False
    with os.fdopen(from_child, "rb", buffering=0) as lines:  # `select` ignores a buffer
        while not hung:
            ready, _, _ = select.select([lines], [], [], WALL_S)
            hung = not ready
            if hung:
                os.kill(child, signal.SIGKILL)
            elif line := lines.readline():
                tally.add(tally.tried, json.loads(line))
            else:
                break
    _, status = os.waitpid(child, 0)
    if hung or status:
        ended = "hangs" if hung else f"ended by {os.waitstatus_to_exitcode(status)}"
        tally.add(tally.tried, {"failure": f"{target.name}: {ended}"})


def _try_inputs(
    target: Target, make: Callable[[int], Input], numbers: range, slice_s: float, pipe: int
) -> None:
    """In the child: a line of JSON for each input; never returns."""
    faulthandler.disable()  # a crash is reported as its signal, not as pages of a traceback
    quiet = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(quiet, stream)
    page = resource.getpagesize()
    n_virtual_bytes = int(Path("/proc/self/statm").read_text().split()[0]) * page
    resource.setrlimit(resource.RLIMIT_AS, (n_virtual_bytes + BEYOND_BYTES,) * 2)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    end = time.monotonic() + slice_s
    for number in numbers:
        outcome = _tried(target, make(number))
        os.write(pipe, (json.dumps(outcome) + "\n").encode())
        if time.monotonic() > end:
            break
    os._exit(0)


def _tried(target: Target, given: Input) -> dict:
    """What comes of an input; whether it was read, and why not otherwise."""
    if given.sane is None:
        path = target.folder / target.file_name
        path.write_bytes(given.data)
    else:
        own = target.folder / "sane" / given.sane.name
        own.mkdir(parents=True)
        path = given.sane.write(own)
    Path("/proc/self/clear_refs").write_text("5")  # the peak of memory begins anew
    before = _peak_bytes()
    outcome, read = _outcome(target, path)
    outcome["mb"] = (_peak_bytes() - before) / 1e6
    if "failure" in outcome:
        return outcome
    if "refusal" in outcome and given.is_seed:
        outcome["failure"] = f"{outcome['refusal']}\nan untouched seed is refused"
    elif "refusal" in outcome and given.sane is not None:
        outcome["refused_sane"] = {given.sane.name: outcome["refusal"]}
    elif "read" in outcome and target.round_trip is not None and len(given.data) <= ROUND_TRIP_BYTES:
        outcome |= _lost(target.round_trip, read, target.folder)
    if given.repeated is not None:
        outcome["is_repeated"] = True
        outcome |= _steep(target, path, given.repeated, outcome)
    return outcome


def _outcome(target: Target, path: Path) -> tuple[dict, Any]:
    """How the file was read, in how much CPU time, and what was read."""
    read = None
    began = time.process_time()
    try:
        read = target.read(path)
        outcome: dict[str, Any] = {"read": True}
    except ChoreographError as error:
        outcome = {"refusal": str(error)}
    except Exception as error:  # noqa: BLE001  # whatever is raised instead is what we are after
        outcome = {"failure": _described(error)}
    outcome["cpu_s"] = time.process_time() - began
    return outcome, read


def _described(error: Exception) -> str:
    """The error's text, and in a second line its kind and place."""
    frames = traceback.extract_tb(error.__traceback__)
    place = next((f for f in reversed(frames) if "choreograph/" in f.filename), frames[-1])
    text = " ".join(str(error).split())[:100]
    return f"{text}\n{type(error).__name__} in {Path(place.filename).name}:{place.lineno}"


def _lost(round_trip: Callable[[Any, Path], None], read: Any, folder: Path) -> dict:
    """A failure if what was read is not the same after it is written and read again."""
    with tempfile.TemporaryDirectory(dir=folder) as own:
        try:
            round_trip(read, Path(own))
        except Exception as error:  # noqa: BLE001  # whatever keeps it from being written and read
            return {"failure": f"lost round trip: {_described(error)}"}
    return {}


def _steep(target: Target, path: Path, made: Repeated, outcome: dict) -> dict:
    """A failure if CPU time grows too fast with the repeats, from a quarter to half of them to all.

    From one to the other, a reader may also begin to do more or less with the file: both steps must be steep,
    and what comes of the file must be the same.
    """
    if not SLOPE_CPU_S[0] <= outcome["cpu_s"] <= SLOPE_CPU_S[1] or made.times < 4 * REPEATS[0]:
        return {}
    slope = 0.0
    for n_trials in (1, N_TRIALS):
        cpu_s = []
        for n in (made.times // 4, made.times // 2, made.times):
            path.write_bytes(made.make(n))
            tried = [_outcome(target, path)[0] for _ in range(n_trials)]
            if any(_kind(other) != _kind(outcome) for other in tried):
                return {}
            cpu_s.append(min(other["cpu_s"] for other in tried))
        slope = float(np.diff(np.log2(cpu_s)).min())
        if slope <= MAX_SLOPE:
            return {}
    what = f"{made.times} repeats took {cpu_s[-1]:.1f} s"
    return {"failure": f"{what}\n{target.name}: CPU time grows as n^{slope:.1f}"}


def _kind(outcome: dict) -> str:
    """What came of a file, but for its numbers."""
    return re.sub(r"[\d.]+", "", outcome.get("refusal", "read"))


def _peak_bytes() -> int:
    status = Path("/proc/self/status").read_text()
    return int(status.split("VmHWM:")[1].split()[0]) * 1024
