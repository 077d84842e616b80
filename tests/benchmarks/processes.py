"""Whole processes of `choreograph dance`: wall time, CPU time and peak memory, from the command to the file.

    python tests/benchmarks/processes.py

Every process has a cache folder of its own run, so that the first one compiles all kernels. For a new song,
the kept analyses are removed before it. Each is started by a small process: the peak memory of a process that
Linux reports includes that of the one that started it.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

from stages import song_of

ENGINES = ("graph", "mixer", "rollout")
SHORT_S, LONG_S = 42.0, 180.0
_REPEATS = 3
_IMPORTS = "import choreograph.pipeline.dancing, choreograph.choreography.engine as it; it.engines()"


@dataclass(frozen=True)
class Spent:
    """What a process needed, with all processes that it started."""

    wall_s: float
    cpu_s: float
    peak_gb: float


def spent(arguments: list[str], cache: Path) -> Spent:
    """What Python with these arguments needs. Raises `RuntimeError` if it fails."""
    environment = {**os.environ, "CHOREOGRAPH_CACHE": str(cache), "OMP_NUM_THREADS": "1"}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    return reported(subprocess.run(started(arguments), env=environment, stdout=subprocess.PIPE).stdout)


_STARTER = """
import json, os, subprocess, sys, time
start = time.perf_counter()
process = subprocess.Popen([sys.executable, *sys.argv[1:]], stdout=subprocess.DEVNULL)
_, status, usage = os.wait4(process.pid, 0)
print(json.dumps([status, time.perf_counter() - start, usage.ru_utime + usage.ru_stime, usage.ru_maxrss]))
"""


def started(arguments: list[str]) -> list[str]:
    """The command that runs Python with these arguments, and prints for `reported` what that needed."""
    return [sys.executable, "-c", _STARTER, *arguments]


def reported(printed: str | bytes) -> Spent:
    """What a command of `started` needed. Raises `RuntimeError` if it failed."""
    status, wall_s, cpu_s, peak_kib = json.loads(printed)
    if status:
        raise RuntimeError(f"expected the process to succeed, got the status {status}")
    return Spent(wall_s, cpu_s, peak_kib / 2**20)


def processes(folder: Path) -> dict[str, Spent]:
    """What each kind of process needs: medians of three, except for the one that compiles."""
    cache = folder / "cache"
    short, long = (str(song_of(seconds, folder)) for seconds in (SHORT_S, LONG_S))

    def dance(song: str, suffix: str, engine: str) -> list[str]:
        output = str(folder / f"dance.{suffix}")
        return ["-m", "choreograph", "dance", song, "-o", output, "--engine", engine, "--quiet"]

    def repeated(arguments: list[str], *, is_new: bool = False) -> Spent:
        runs = []
        for _ in range(_REPEATS):
            if is_new:
                shutil.rmtree(cache / "analyses", ignore_errors=True)
            runs.append(spent(arguments, cache))
        return Spent(*(median(getattr(run, name) for run in runs) for name in ("wall_s", "cpu_s", "peak_gb")))

    measured = {f"graph, {SHORT_S:g} s, nothing compiled": spent(dance(short, "bvh", "graph"), cache)}
    for engine in ENGINES:
        spent(dance(short, "bvh", engine), cache)  # compiles what only this engine needs
        new = repeated(dance(long, "bvh", engine), is_new=True)
        measured[f"{engine}, {LONG_S:g} s, song known"] = repeated(dance(long, "bvh", engine))
        measured[f"{engine}, {LONG_S:g} s, song new"] = new
    spent(dance(short, "bvh", "graph"), cache)  # makes the song known
    measured[f"graph, {SHORT_S:g} s, song known"] = repeated(dance(short, "bvh", "graph"))
    measured[f"the same as a page, {SHORT_S:g} s"] = repeated(dance(short, "html", "graph"))
    measured["imports of a dance"] = repeated(["-c", _IMPORTS])
    return measured


def process_table(measured: dict[str, Spent]) -> list[str]:
    """The lines of a table in Markdown."""
    lines = ["| process | wall, s | CPU, s | peak memory, GB |", "| --- | --- | --- | --- |"]
    for name, one in measured.items():
        lines.append(f"| {name} | {one.wall_s:.2f} | {one.cpu_s:.2f} | {one.peak_gb:.2f} |")
    return lines


if __name__ == "__main__":
    with TemporaryDirectory() as place:
        print("\n".join(process_table(processes(Path(place)))))
