"""A handful of the faults of `make faults`, and a few of the many dances."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from faults.many_dances import usage_of_dances

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux", reason="processes are watched through /proc"),
]


def test_killed_work_leaves_the_old_or_the_new_and_can_go_on():
    """In a process of its own: forks of one with threads can hang."""
    tasks = ["build", "dance", "evaluate"]
    command = [sys.executable, "-m", "faults.run_faults", "--kills", "2", "--disks", "1", *tasks]
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": str(Path(__file__).parents[1])}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    rows = [line.split() for line in done.stdout.splitlines() if line.split()[0] in tasks]
    assert [row[0] for row in rows] == tasks
    assert all(int(row[1]) >= 1 and int(row[3]) == 1 for row in rows)


def test_dances_leave_nothing_open_and_no_memory_in_use(repertoire, tmp_path):
    usages = list(usage_of_dances(16, tmp_path, repertoire, duration_s=5.0))
    assert usages[-1].open_files == usages[1].open_files
    assert usages[-1].memory_mb < usages[7].memory_mb + 5  # caches fill in the first ones
