"""Runs of a task in a process of its own, which is killed, or for which the disk is full.

The process is forked from this one, which has imported everything: a run takes as long as its work.
"""

from __future__ import annotations

import os
import resource
import signal
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from subprocess import DEVNULL, run

from choreograph.core.files import is_running

_POLL_S = 0.002
_TICKS_PER_S = os.sysconf("SC_CLK_TCK")
_DISK = "choreograph-faults-"  # and the process that mounted it: a disk's name in the table of mounts
_CRASHED = 99  # exit status after an exception that nothing handled
# What Python does with files, as audit events: where a kill is likeliest to leave something half-done.
_FILE_EVENTS = ("open", "os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.truncate", "shutil.")


@dataclass(frozen=True)
class Ended:
    """How a run ended."""

    status: int  # exit status, or minus the signal that killed it
    cpu_s: float
    told: str  # what it printed on stderr
    n_file_events: int = 0  # what it did with files, if it came to its end and that was counted

    @property
    def killed(self) -> bool:
        return self.status == -signal.SIGKILL


def fork_run(
    work: Callable[[], int],
    stderr: Path,
    *,
    kill_at_cpu_s: float | None = None,
    kill_at_file_event: int | None = None,
    under: Path | None = None,
    largest_file: int | None = None,
) -> Ended:
    """Run `work` in a fork of this process, which is killed (SIGKILL) after as much CPU time if given.

    Or at the n-th thing that it does with files in the folder `under`, which are counted. `largest_file`
    limits the size of what it writes, in bytes.
    """
    stderr.write_bytes(b"")
    counted = stderr.with_suffix(".events")
    counted.write_text("0", encoding="utf-8")
    pid = os.fork()
    if pid == 0:
        _become_run(work, stderr, kill_at_file_event, under, largest_file)
    while True:
        ended, status, used = os.wait4(pid, os.WNOHANG)
        if ended:
            told = stderr.read_text(encoding="utf-8", errors="replace")
            n_events = int(counted.read_text(encoding="utf-8"))
            cpu_s = used.ru_utime + used.ru_stime
            return Ended(os.waitstatus_to_exitcode(status), cpu_s, told, n_events)
        if kill_at_cpu_s is not None and _cpu_s(pid) >= kill_at_cpu_s:
            os.kill(pid, signal.SIGKILL)
        time.sleep(_POLL_S)


def _cpu_s(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / _TICKS_PER_S


def _become_run(work, stderr, kill_at_file_event, under, largest_file) -> None:
    """Do the work, and end this process without a word to what the parent has open."""
    status, n_events = _CRASHED, [0]
    try:
        descriptor = os.open(stderr, os.O_WRONLY | os.O_APPEND)
        os.dup2(descriptor, 2)
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        sys.stdout, sys.stderr = os.fdopen(1, "w"), os.fdopen(2, "w")
        if largest_file is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (largest_file, largest_file))
        if under is not None:
            _watch_files(under, n_events, kill_at_file_event)
        status = work()
    finally:
        if status == _CRASHED:  # by an exception, which the parent reads
            traceback.print_exc()
        stderr.with_suffix(".events").write_text(str(n_events[0]), encoding="utf-8")
        sys.stderr.flush()
        os._exit(status)


def _watch_files(under: Path, n_events: list[int], kill_at: int | None) -> None:
    """Count what this process does with files in a folder; be killed at the given number."""
    prefix = str(under)

    def hook(event, arguments):
        if event.startswith(_FILE_EVENTS) and any(str(a).startswith(prefix) for a in arguments[:2]):
            n_events[0] += 1
            if n_events[0] == kill_at:
                os.kill(os.getpid(), signal.SIGKILL)

    sys.addaudithook(hook)


@contextmanager
def small_disk(folder: Path, n_bytes: int) -> Iterator[None]:
    """A disk of its own at `folder`, of so many bytes; `OSError` where disks cannot be mounted.

    A process that is killed leaves it: see `unmount_left_disks`.
    """
    folder.mkdir(parents=True, exist_ok=True)
    size = f"size={-(-n_bytes // 4096) * 4096}"
    try:
        mounted = run(
            ["mount", "-t", "tmpfs", "-o", size, f"{_DISK}{os.getpid()}", folder], stderr=DEVNULL, check=False
        )
    except FileNotFoundError as error:
        raise OSError("no mount") from error
    if mounted.returncode:
        raise OSError("not allowed to mount a disk")
    try:
        yield
    finally:
        run(["umount", folder], check=True)


def unmount_left_disks() -> None:
    """Unmount the disks of earlier processes that were killed."""
    for line in Path("/proc/self/mounts").read_text(encoding="utf-8").splitlines():
        name, folder = line.split()[:2]
        if name.startswith(_DISK) and not is_running(int(name.removeprefix(_DISK))):
            run(["umount", folder.encode().decode("unicode_escape")], check=False)
