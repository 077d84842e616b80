"""Kill every kind of long work at random moments, and let it run into a full disk; `make faults`.

    OMP_NUM_THREADS=1 PYTHONPATH=tests python -m faults.run_faults [--kills 50] [--disks 10] [TASK ...]

Half of the kills come after a random part of the run's CPU time, half at a file that it opens, renames or
removes. Prints a table, and every failure; exit status 1 if there is one. One thread: others would not
survive a fork.
"""

from __future__ import annotations

import argparse
import signal
import sys
import tempfile
import time
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages

import numpy as np
from faults.injection import small_disk, unmount_left_disks
from faults.tasks import TASKS, write_inputs
from faults.trials import Trials

import choreograph


def import_everything() -> None:
    """Import all modules of the program: a fork of this process then has them."""
    for module in walk_packages(choreograph.__path__, "choreograph."):
        if not module.name.endswith(("__main__", "_in_blender")):
            import_module(module.name)


def can_mount(folder: Path) -> bool:
    """Whether disks of a given size can be made here."""
    try:
        with small_disk(folder, 4096):
            return True
    except OSError:
        return False


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("tasks", nargs="*", metavar="TASK", help=", ".join(TASKS))
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--disks", type=int, default=10)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    unknown = set(given.tasks) - set(TASKS)
    if unknown:
        parser.error(f"expected tasks among {', '.join(TASKS)}, got {', '.join(sorted(unknown))}")
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(128 + number))  # disks are unmounted then
    unmount_left_disks()
    import_everything()
    n_failed = 0
    with tempfile.TemporaryDirectory() as folder:
        write_inputs(Path(folder) / "inputs")
        mount = can_mount(Path(folder) / "disk")
        print("full disks are", "mounted" if mount else "limits on the size of files: none can be mounted")
        print(f"{'task':<18}{'killed':>7}{'ended before':>14}{'disk full':>11}{'failures':>10}{'minutes':>9}")
        for name in given.tasks or TASKS:
            start = time.monotonic()
            trials = Trials(name, TASKS[name], Path(folder) / "inputs", Path(folder) / name.replace(" ", "-"))
            rng = np.random.default_rng([given.seed, list(TASKS).index(name)])
            for i in range(given.kills):
                trials.kill(rng, at_a_file=i % 2 == 1)
            for _ in range(given.disks):
                trials.fill_disk(rng, mount=mount)
            minutes = (time.monotonic() - start) / 60
            print(
                f"{name:<18}{trials.n_killed:>7}{trials.n_ended_before:>14}{trials.n_full:>11}"
                f"{len(trials.failures):>10}{minutes:>9.1f}",
                *trials.failures, sep="\n  ", flush=True,
            )  # fmt: skip
            n_failed += len(trials.failures)
    sys.exit(n_failed > 0)


if __name__ == "__main__":
    main()
