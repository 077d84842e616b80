"""One fault, and what must hold after it.

After a kill: under a final name is the old file or the new one, whole, and what else is there is hidden or
in the folder of work in progress. After a run that follows, the bytes of a run without a fault, and nothing
left of the killed one. After a full disk: one line, status 2, the old file, and nothing else.
"""

from __future__ import annotations

import io
import shutil
from contextlib import redirect_stdout
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from faults.injection import Ended, fork_run, small_disk
from faults.tasks import Task

_OLD = b"the file of an earlier run"


@dataclass
class Trials:
    """Faults of one task, in a folder of their own."""

    name: str
    task: Task
    inputs: Path
    folder: Path
    failures: list[str] = field(default_factory=list)
    n_killed: int = 0
    n_ended_before: int = 0  # that were through when the kill came
    n_full: int = 0

    def __post_init__(self) -> None:
        """Run without a fault, twice: the first fills caches, also those of this process, which is forked."""
        self.reference: dict[str, bytes] = {}
        with redirect_stdout(io.StringIO()):
            status = self.task.run(self.inputs, self._fresh(), resume=False)
        self.whole = self._run(self._fresh(), resume=False, under=self._out)
        if status or self.whole.status:
            raise AssertionError(f"{self.name}: status {status}: {self.whole.told}")
        self.reference = {name: (self._out / name).read_bytes() for name in self.task.outputs}

    @property
    def _out(self) -> Path:
        return self.folder / "out"

    def _fresh(self) -> Path:
        shutil.rmtree(self._out, ignore_errors=True)
        self._out.mkdir(parents=True)
        return self._out

    def _run(self, out: Path, *, resume: bool, **fault) -> Ended:
        return fork_run(
            lambda: self.task.run(self.inputs, out, resume=resume), self.folder / "stderr.txt", **fault
        )

    def kill(self, rng: np.random.Generator, *, at_a_file: bool) -> None:
        """Kill a run at a random moment, or at a random file that it opens, renames or removes; run again."""
        out = self._fresh()
        old = rng.random() < 0.5
        if old:
            for name in self.task.outputs:
                (out / name).write_bytes(_OLD)
        if at_a_file:
            event = int(rng.integers(1, self.whole.n_file_events + 1))
            fault, moment = {"kill_at_file_event": event, "under": out}, f"file event {event}"
        else:
            cpu_s = float(rng.uniform(0.0, self.whole.cpu_s))
            fault, moment = {"kill_at_cpu_s": cpu_s}, f"{cpu_s:.2f} s"
        ended = self._run(out, resume=False, **fault)
        self.n_killed += ended.killed
        self.n_ended_before += not ended.killed
        what = f"{self.name}, killed at {moment}"
        if not ended.killed and ended.status:
            self.failures.append(f"{what}: status {ended.status}: {ended.told}")
        self._check_whole(what, old=old)
        after = self._run(out, resume=True)
        if after.status:
            self.failures.append(f"{what}: the next run ended with {after.status}: {after.told}")
        for name, content in self.reference.items():
            if not (out / name).exists() or (out / name).read_bytes() != content:
                self.failures.append(f"{what}: after the next run, {name} has other bytes")
        if left := self._left():
            self.failures.append(f"{what}: after the next run, there is {', '.join(left)}")

    def fill_disk(self, rng: np.random.Generator, *, mount: bool) -> None:
        """Run on a disk that has less room than is needed, or where files cannot grow as large as needed."""
        largest = max(len(content) for content in self.reference.values())
        room = int(rng.integers(0, largest))
        out, what = self._fresh(), f"{self.name}, room for {room} bytes"
        if not mount:
            self._run_out_of_room(what, out, largest_file=room)
            return
        with small_disk(out, room + 4096):
            self._run_out_of_room(what, out)

    def _run_out_of_room(self, what: str, out: Path, **limit) -> None:
        ended = self._run(out, resume=False, **limit)
        self.n_full += 1
        lines = ended.told.strip().splitlines()
        if ended.status != 2 or len(lines) != 1 or "cannot write" not in lines[0]:
            self.failures.append(f"{what}: status {ended.status}: {ended.told}")
        self._check_whole(what, old=False)
        if left := self._left(kept=()):
            self.failures.append(f"{what}: there is {', '.join(left)}")

    def _check_whole(self, what: str, *, old: bool) -> None:
        for name, content in self.reference.items():
            path = self._out / name
            allowed = [content, _OLD] if old else [content]
            if path.exists() and path.read_bytes() not in allowed:
                self.failures.append(f"{what}: {name} is neither the old file nor the new one")
            if old and not path.exists():
                self.failures.append(f"{what}: the old {name} is gone")
        for path in self._out.iterdir():
            if path.is_file() and path.name not in self.reference and path.name[0] != ".":
                self.failures.append(f"{what}: there is a {path.name}")

    def _left(self, kept: tuple[str, ...] = (".dances",)) -> list[str]:
        """Temporary files, and folders whose names end like one of `kept`: they go when a run is through."""
        return sorted(
            str(path.relative_to(self._out))
            for path in self._out.rglob("*")
            if path.name[0] == "." or path.name.endswith(kept) or path.name in ("lock", "owner.json")
        )
