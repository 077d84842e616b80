"""Dask schedulers and workers in processes of their own, on loopback."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

HERE = [str(Path(__file__).parent), str(Path(__file__).parents[1])]  # of what workers import
START_S = 60.0


def started(name: str, *arguments: str) -> subprocess.Popen:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(HERE), "OMP_NUM_THREADS": "1"}
    return subprocess.Popen(
        [sys.executable, "-m", "distributed.cli." + name, *arguments], env=environment,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip


def scheduler_at(port: int) -> subprocess.Popen:
    return started(
        "dask_scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard", "--no-show",
    )  # fmt: skip


def worker_of(address: str, folder: Path, *options: str) -> subprocess.Popen:
    return started(
        "dask_worker", address, "--nthreads", "1", "--no-dashboard", "--local-directory", str(folder),
        *options,
    )  # fmt: skip


def free_port() -> int:
    with socket.socket() as asked:
        asked.bind(("127.0.0.1", 0))
        return asked.getsockname()[1]


def wait_for(address: str, n_workers: int) -> None:
    import distributed

    with distributed.Client(address, timeout=START_S, set_as_default=False) as client:
        client.wait_for_workers(n_workers, timeout=START_S)


@contextmanager
def ended(*processes: subprocess.Popen) -> Iterator[None]:
    try:
        yield
    finally:
        for process in processes:
            process.send_signal(signal.SIGCONT)
            process.terminate()
        for process in processes:
            try:
                process.wait(timeout=5)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


@contextmanager
def scheduler_with_workers(folder: Path, n_workers: int = 2) -> Iterator[str]:
    """The address of a scheduler. Each of its workers has a nanny that starts it again."""
    address = f"tcp://127.0.0.1:{(port := free_port())}"
    scheduler, *workers = scheduler_at(port), *(worker_of(address, folder) for _ in range(n_workers))
    with ended(*workers, scheduler):
        wait_for(address, n_workers)
        yield address
