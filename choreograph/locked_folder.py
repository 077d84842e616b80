"""Folders of work in progress, in which one process works at a time."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import datetime
from pathlib import Path

from filelock import FileLock, Timeout

from choreograph.errors import ChoreographError
from choreograph.files import atomic_path, writing

_LOCK, _OWNER = "lock", "owner.json"


@contextmanager
def locked_folder(folder: Path, *, doing: str) -> Iterator[None]:
    """Hold a folder, made if missing, while the block runs; removed again if nothing is left in it.

    The operating system frees the lock of a process that ends in whatever way, so no lock is ever stale.
    A second process is told who does it, since when, and what: `doing`, as in "builds rep.h5".

    Raises `ChoreographError` if another process holds the folder, or it cannot be written.
    """
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        lock = FileLock(folder / _LOCK)
        try:
            lock.acquire(timeout=0)
        except Timeout:
            raise ChoreographError(_held_message(folder)) from None
    try:
        with atomic_path(folder / _OWNER) as temporary:
            since = datetime.now().astimezone().isoformat(" ", "seconds")
            temporary.write_text(
                json.dumps({"pid": os.getpid(), "does": doing, "since": since}), encoding="utf-8"
            )
        yield
    finally:
        with suppress(OSError):  # the files may stay, but must go before another process holds the folder
            (folder / _OWNER).unlink(missing_ok=True)
            (folder / _LOCK).unlink(missing_ok=True)
        lock.release()
        with suppress(OSError):  # not empty
            folder.rmdir()


def _held_message(folder: Path) -> str:
    try:
        owner = json.loads((folder / _OWNER).read_text(encoding="utf-8"))
        who = f"process {owner['pid']} {owner['does']} since {owner['since']}"
    except (OSError, ValueError, KeyError, TypeError):  # it has just begun, or just ended
        who = "another process"
    return f"expected {folder} to be free, got one in use: {who}; wait for it, end it, or write elsewhere"
