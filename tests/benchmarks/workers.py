"""Takes read, measured and counted in one process, in a pool of two, and by two workers of Dask.

    OMP_NUM_THREADS=1 python tests/benchmarks/workers.py TAKES

Each runs in a process of its own. CPU seconds are of all processes, those of Dask without their start. The
least time on two free cores is half of them, if nothing waits.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))  # of the schedulers of the tests

N_WORKERS = 2
ONE, POOL = "one process", f"pool of {N_WORKERS}"


def measured(kind: str, takes: Path) -> dict[str, Any]:
    """Seconds by the clock and of CPU for one kind of workers, or for the scheduler at an address."""
    start, own_s = time.perf_counter(), _cpu_s()
    from choreograph.core.cache import caching
    from choreograph.core.workers import working
    from choreograph.library.building.counting import Counting
    from choreograph.library.building.options import BuildOptions
    from choreograph.library.building.takes import measured_takes
    from choreograph.library.builtin import load_motion_counter, pretrained_set
    from choreograph.library.songs import SongCache

    options = BuildOptions(skip_bad=True)
    counter = load_motion_counter(pretrained_set(options.pretrained))
    dask = "" if kind in (ONE, POOL) else kind
    theirs_s = _workers_cpu_s(dask) if dask else 0.0
    with caching(0.0), working(1 if kind == ONE else N_WORKERS, dask):
        found, _ = measured_takes([takes], options, None, Counting(SongCache(options.beats), counter))
    wall_s = time.perf_counter() - start
    theirs_s = _workers_cpu_s(dask) - theirs_s if dask else theirs_s
    return {"takes": len(found), "wall_s": wall_s, "cpu_s": _cpu_s() - own_s + theirs_s}


def _cpu_s() -> float:
    """Of this process and of those that it started and that have ended."""
    used = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(one.ru_utime + one.ru_stime for one in used)


def _workers_cpu_s(address: str) -> float:
    import distributed

    with distributed.Client(address, set_as_default=False) as client:
        return float(sum(client.run(time.process_time).values()))


def main() -> None:
    """Print a row of a table for each kind of workers."""
    if len(sys.argv) > 2:
        print(json.dumps(measured(sys.argv[2], Path(sys.argv[1]))))
        return
    print("| | takes | wall, s | CPU, s |\n| --- | --- | --- | --- |")
    for kind in (ONE, POOL):
        _show(kind, kind)
    from schedulers import scheduler_with_workers

    with TemporaryDirectory() as folder, scheduler_with_workers(Path(folder), N_WORKERS) as address:
        _show(f"Dask, {N_WORKERS} workers", address)


def _show(name: str, kind: str) -> None:
    command = [sys.executable, __file__, sys.argv[1], kind]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    found = json.loads(done.stdout.splitlines()[-1])
    print(f"| {name} | {found['takes']} | {found['wall_s']:.1f} | {found['cpu_s']:.1f} |", flush=True)


if __name__ == "__main__":
    main()
