"""Inputs tried in child processes, which may neither crash, hang nor take memory without bound.

A child works through the inputs of one target for a while and tells its parent of each, so that the parent
knows which one a child that died or hung was at. Inputs follow from the seed and their number.
"""

from __future__ import annotations

import faulthandler
import json
import os
import resource
import select
import signal
import sys
import time
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from fuzz.mutations import mutated

from choreograph.errors import ChoreographError

BEYOND_BYTES = 2 << 30  # of address space, over what the program takes before the first input
CPU_S = 10.0  # an input takes at most that long
WALL_S = 60.0  # and is ended after that, on a machine that may be busy
SLICE_S = 5.0  # of one target before it is the next one's turn


@dataclass(frozen=True)
class Target:
    """A reader of files, and good files to begin with."""

    name: str
    file_name: str  # that a file to be read has in its folder
    kind: str  # of changes: see `mutations`
    seeds: Sequence[bytes]
    read: Callable[[Path], object]  # may raise `ChoreographError`
    folder: Path  # where files beside it lie


@dataclass
class Tally:
    """What came of a target's inputs."""

    tried: int = 0
    was_read: int = 0
    failures: dict[str, tuple[int, str]] = field(default_factory=dict)  # by place: first input, what happened
    slowest: tuple[float, int] = (0.0, -1)  # CPU seconds, input
    hungriest: tuple[float, int] = (0.0, -1)  # MB of memory that it took, input

    def add(self, number: int, outcome: dict) -> None:
        """Count one input."""
        self.tried += 1
        self.was_read += outcome.get("read", False)
        self.slowest = max(self.slowest, (outcome.get("cpu_s", 0.0), number))
        self.hungriest = max(self.hungriest, (outcome.get("mb", 0.0), number))
        failure = outcome.get("failure")
        if failure is None and outcome.get("cpu_s", 0.0) > CPU_S:
            failure = f"slow: {outcome['cpu_s']:.1f} s"
        if failure:
            self.failures.setdefault(failure.splitlines()[-1][:200], (number, failure))


def input_of(target: Target, seed: int, number: int) -> bytes:
    """The input of that number."""
    key = [seed, int.from_bytes(target.name.encode(), "little"), number]
    return mutated(target.kind, target.seeds, np.random.default_rng(key))


def fuzz(
    targets: Sequence[Target], *, seed: int, seconds: float | None = None, n_inputs: int | None = None
) -> dict[str, Tally]:
    """Try inputs of all targets in turn, for `seconds` or `n_inputs` of each."""
    tallies = {target.name: Tally() for target in targets}
    end = time.monotonic() + (seconds or 0.0)
    while True:
        for target in targets:
            tally = tallies[target.name]
            last = sys.maxsize if n_inputs is None else n_inputs
            slice_s = SLICE_S if n_inputs is None else np.inf
            if tally.tried < last and (n_inputs is not None or time.monotonic() < end):
                _in_child(target, tally, lambda n, t=target: input_of(t, seed, n), last, slice_s)
        if time.monotonic() >= end and all(tally.tried >= (n_inputs or 0) for tally in tallies.values()):
            return tallies


def replay(target: Target, inputs: Sequence[bytes]) -> Tally:
    """Try given inputs."""
    tally = Tally()
    while tally.tried < len(inputs):
        _in_child(target, tally, lambda number: inputs[number], len(inputs), np.inf)
    return tally


def _in_child(target: Target, tally: Tally, make: Callable[[int], bytes], last: int, slice_s: float) -> None:
    """Try inputs from `tally.tried` on: to the last, for `slice_s`, or until one ends the child."""
    from_child, to_parent = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            _try_inputs(target, make, range(tally.tried, last), slice_s, to_parent)
        finally:  # without what the parent does at its end, such as to remove its files
            os._exit(1)
    os.close(to_parent)
    hung = False
    with os.fdopen(from_child, "rb", buffering=0) as lines:  # `select` knows nothing of a buffer
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
    target: Target, make: Callable[[int], bytes], numbers: range, slice_s: float, pipe: int
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
    path, end = target.folder / target.file_name, time.monotonic() + slice_s
    for number in numbers:
        path.write_bytes(make(number))
        Path("/proc/self/clear_refs").write_text("5")  # the peak of memory begins anew
        before, began = _peak_bytes(), time.process_time()
        outcome = _outcome(target, path)
        outcome["cpu_s"] = time.process_time() - began
        outcome["mb"] = (_peak_bytes() - before) / 1e6
        os.write(pipe, (json.dumps(outcome) + "\n").encode())
        if time.monotonic() > end:
            break
    os._exit(0)


def _outcome(target: Target, path: Path) -> dict:
    try:
        target.read(path)
    except ChoreographError:
        return {}
    except Exception as error:  # noqa: BLE001  # whatever is raised instead is what we are after
        frames = traceback.extract_tb(error.__traceback__)
        place = next((f for f in reversed(frames) if "choreograph/" in f.filename), frames[-1])
        text = " ".join(str(error).split())[:100]
        return {"failure": f"{text}\n{type(error).__name__} in {Path(place.filename).name}:{place.lineno}"}
    return {"read": True}


def _peak_bytes() -> int:
    status = Path("/proc/self/status").read_text()
    return int(status.split("VmHWM:")[1].split()[0]) * 1024
