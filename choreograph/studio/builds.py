"""Builds of repertoires in a process of their own, so that the studio goes on, and with their log."""

from __future__ import annotations

import subprocess
import sys
from collections import deque
from pathlib import Path

from choreograph.core.errors import ChoreographError
from choreograph.studio.jobs import Job

PRESETS = ("tiny", "small")


def build(takes: Path, output: Path, preset: str, job: Job) -> None:
    """Build a repertoire from the files of a folder, as `choreograph build-db` does.

    Raises `ChoreographError` with the last line of the log if the build fails. A job that is cancelled ends
    the process.
    """
    job.report("building the repertoire", 0, 0)
    _run(["build-db", str(takes), "-o", str(output), "--preset", preset, "--skip-bad"], takes, job)


def check(takes: Path, job: Job) -> None:
    """Check the files of a folder, as `choreograph build-db --check` does. Its table is in the log."""
    job.report("checking the takes", 0, 0)
    _run(["build-db", str(takes), "--check"], takes, job)


def _run(arguments: list[str], takes: Path, job: Job) -> None:
    command = [sys.executable, "-m", "choreograph", *arguments]
    last: deque[str] = deque([""], maxlen=1)
    process = subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        encoding="utf-8", errors="replace", cwd=takes.parent,
    )  # fmt: skip
    try:
        assert process.stdout is not None
        for line in process.stdout:
            if text := line.rstrip().replace(f"{takes}/", ""):
                last.append(text)
                job.say(text)
    finally:
        if process.poll() is None:
            process.terminate()
        status = process.wait()
    if status != 0:
        raise ChoreographError(
            last[0].removeprefix("choreograph: ") or f"the build ended with status {status}"
        )
