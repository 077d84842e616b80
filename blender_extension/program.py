# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs the installed program `choreograph`, follows its progress and reads its files."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .errors import DanceError
from .glb import Skeleton, Tracks, read_tracks, write_skeleton

_PROGRESS = re.compile(r"(?P<stage>.+) (?P<done>\d+)/(?P<total>\d+)")
_GRACE_S = 0.4  # between SIGTERM and SIGKILL
_CHECK_EVERY_S = 0.02


@dataclass(frozen=True)
class Request:
    """The song and options of a dance."""

    song: Path
    fps: float
    start_s: float = 0.0  # in the song
    duration_s: float = 0.0  # 0 for all until the end of the song
    seed: int = 0
    genre: str = ""  # empty for the genre nearest to the song
    pins: tuple[str, ...] = ()  # values of `choreograph dance --pin`
    repertoire: str = ""  # empty for the built-in one
    bone_map: str = ""  # empty if the program finds the bones

    def arguments(self) -> list[str]:
        """The request as options of `choreograph dance`."""
        given = {
            "--start": self.start_s, "--duration": self.duration_s, "--genre": self.genre,
            "--db": self.repertoire, "--map": self.bone_map,
        }  # fmt: skip
        options = ["--fps", f"{self.fps:.10g}", "--seed", str(self.seed)]
        for option, value in given.items():
            options += [option, str(value)] if value else []
        for pin in self.pins:
            options += ["--pin", pin]
        return [str(self.song), *options]


@dataclass(frozen=True)
class Dance:
    """A dance that the program made."""

    tracks: Tracks
    plan: dict  # the file of the plan
    facts: dict  # the JSON that the program prints


class Run:
    """A running program. Poll `ended`, then call `dance`, or call `stop` before that."""

    def __init__(self, program: str, request: Request, skeleton: Skeleton) -> None:
        found = shutil.which(program)
        if found is None:
            raise DanceError(
                f"expected the program choreograph, found none at {program!r}: `pip install choreograph`, or "
                "set its path in the preferences of the add-on"
            )
        self.stage, self.fraction = "starting", 0.0
        self._last_line = ""
        self._folder = tempfile.TemporaryDirectory(prefix="choreograph-")
        folder = Path(self._folder.name)
        self._character, self._made, self._plan, self._facts = (
            folder / name for name in ("character.glb", "dance.glb", "plan.json", "facts.json")
        )
        write_skeleton(self._character, skeleton)
        command = [
            found, "dance", *request.arguments(), "--character", str(self._character),
            "-o", str(self._made), "-o", str(self._plan), "--json",
        ]  # fmt: skip
        self._process = self._started(command)
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()

    def _started(self, command: list[str]) -> subprocess.Popen:
        try:
            with self._facts.open("wb") as facts:
                return subprocess.Popen(
                    command, stdin=subprocess.DEVNULL, stdout=facts, stderr=subprocess.PIPE, encoding="utf-8",
                    errors="replace", env=_environment(), **_own_group(),
                )  # fmt: skip
        except OSError as error:
            self._folder.cleanup()
            raise DanceError(
                f"{command[0]}: expected the program choreograph, got {error.strerror}"
            ) from error

    def _listen(self) -> None:
        for line in self._process.stderr:
            progress = _PROGRESS.fullmatch(line.strip())
            if progress:
                self.stage = progress["stage"]
                self.fraction = min(int(progress["done"]) / max(int(progress["total"]), 1), 1.0)
            elif line.strip():
                self._last_line = line.strip()

    def ended(self) -> bool:
        """Whether the program has ended, successfully or not."""
        return self._process.poll() is not None and not self._listener.is_alive()

    def dance(self) -> Dance:
        """Wait for the end and return the dance. Raises `DanceError` with the error of a failed program."""
        try:
            status = self._process.wait()
            self._listener.join()
        except KeyboardInterrupt:  # the process group of the program does not receive it
            self.stop()
            raise
        try:
            if status != 0 or not self._made.is_file():
                error = self._last_line.removeprefix("choreograph: ")
                raise DanceError(error or f"expected a dance, got nothing: status {status} of the program")
            plan, facts = (json.loads(path.read_text("utf-8")) for path in (self._plan, self._facts))
            return Dance(read_tracks(self._made), plan, facts)
        finally:
            self._folder.cleanup()

    def stop(self) -> None:
        """End the program and all processes that it started, within a second."""
        if sys.platform == "win32":
            _end_tree(self._process.pid)
        else:
            self._end_group()
        self._process.wait()
        self._listener.join(_GRACE_S)  # a process that left the group may hold the pipe
        self._folder.cleanup()

    def _end_group(self) -> None:
        """Terminate the process group, and kill the rest of it after `_GRACE_S`."""
        until_s = time.monotonic() + _GRACE_S
        try:
            os.killpg(self._process.pid, signal.SIGTERM)
            while time.monotonic() < until_s:
                self._process.poll()  # a group lasts until its ended processes are waited for
                os.killpg(self._process.pid, 0)
                time.sleep(_CHECK_EVERY_S)
            os.killpg(self._process.pid, signal.SIGKILL)
        except (ProcessLookupError, PermissionError):  # macOS forbids what Linux does not find
            return


def _own_group() -> dict[str, Any]:
    """The arguments of `Popen` for a separate process group without a window."""
    if sys.platform == "win32":
        return {"creationflags": subprocess.CREATE_NO_WINDOW | subprocess.CREATE_NEW_PROCESS_GROUP}
    return {"start_new_session": True}


def _end_tree(pid: int) -> None:
    """End a process on Windows and all processes that it started."""
    subprocess.run(
        ["taskkill", "/T", "/F", "/PID", str(pid)], capture_output=True, check=False,
        creationflags=subprocess.CREATE_NO_WINDOW,
    )  # fmt: skip


def _environment() -> dict[str, str]:
    """The environment without the variables for the Python of Blender."""
    kept = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    return kept | {"PYTHONUTF8": "1"}
