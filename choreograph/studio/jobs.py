"""Jobs of the studio: work in the background, one after another, with progress, results and cancellation."""

from __future__ import annotations

import logging
import secrets
import threading
import time
from collections import OrderedDict
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from typing import Any, TypeVar

from choreograph.core.errors import ChoreographError
from choreograph.studio.refusals import NotFoundError

_Result = TypeVar("_Result")
_LOG = logging.getLogger("choreograph.studio")
_KEPT = 24  # finished jobs, the latest
_LOG_LINES = 400  # of one job, the latest


class CancelledError(ChoreographError):
    """The user has cancelled the job."""


@dataclass(eq=False)
class Job:
    """Work that runs or has run. Other threads read its fields, and only `cancel` changes it."""

    id: str
    kind: str  # such as "edit"
    state: str = "running"  # or "done", "failed", "cancelled"
    stage: str = ""
    done: int = 0
    total: int = 0  # 0 if it is not known
    log: list[str] = field(default_factory=list)
    result: Any = None
    first: Any = None  # a part of the result (JSON), which is there before all of it
    error: str = ""
    status: int = 400  # HTTP status of the error
    began_s: float = field(default_factory=time.monotonic)
    ended_s: float | None = None
    cancelled: threading.Event = field(default_factory=threading.Event)
    ended: threading.Event = field(default_factory=threading.Event)
    begun: threading.Event = field(default_factory=threading.Event)  # once there is a first part, or an end
    on_change: Callable[[Job], None] = lambda job: None

    def _check(self) -> None:
        if self.cancelled.is_set():
            raise CancelledError("cancelled")

    def report(self, stage: str, done: int, total: int) -> None:
        """Take down progress. Raises `CancelledError` if the job was cancelled."""
        self._check()
        is_news = stage != self.stage or done >= total
        self.stage, self.done, self.total = stage, done, total
        if is_news:
            self.on_change(self)

    def say(self, line: str) -> None:
        """Add a line to the log. Raises as `report`."""
        self._check()
        self.log = [*self.log[1 - _LOG_LINES :], line]
        self.on_change(self)

    def show(self, first: Any) -> None:
        """Give a first part of the result, for which pages wait. Raises as `report`."""
        self._check()
        self.first = first
        self.begun.set()

    @property
    def facts(self) -> dict[str, Any]:
        """The job as JSON."""
        seconds = (self.ended_s or time.monotonic()) - self.began_s
        facts: dict[str, Any] = {
            "job": self.id, "kind": self.kind, "state": self.state, "stage": self.stage, "done": self.done,
            "total": self.total, "seconds": round(seconds, 3), "log": self.log,
        }  # fmt: skip
        if self.state == "done":
            facts["result"] = self.result
        return facts | ({"error": self.error, "status": self.status} if self.error else {})


class Jobs:
    """Runs jobs in lanes, each a thread, in which they run one after another: dances, files and builds."""

    def __init__(
        self,
        on_change: Callable[[Job], None] = lambda job: None,
        said: Callable[[BaseException], str] = str,
    ) -> None:
        """`on_change` is called when a job changes, and `said` returns what pages show of an error."""
        self._on_change, self._said = on_change, said
        self._jobs: OrderedDict[str, Job] = OrderedDict()
        self._lock = threading.Lock()
        self._threads: dict[str, ThreadPoolExecutor] = {}

    def start(self, kind: str, work: Callable[[Job], object], *, lane: str = "dances") -> Job:
        """Begin a job. `work` gets it, reports to it, and returns its result (JSON)."""
        return self._queued(kind, work, lane)[0]

    def do(self, kind: str, work: Callable[[Job], _Result]) -> _Result:
        """Do something short in the order of the jobs. Returns its result, or raises its error."""
        return self._queued(kind, work, "dances")[1].result()

    def _queued(self, kind: str, work: Callable[[Job], _Result], lane: str) -> tuple[Job, Future[_Result]]:
        job = Job(secrets.token_hex(8), kind, on_change=self._on_change)
        with self._lock:
            self._jobs[job.id] = job
            finished = [id for id, one in self._jobs.items() if one.state != "running"]
            for old in finished[: max(0, len(finished) - _KEPT)]:
                del self._jobs[old]
            if lane not in self._threads:
                self._threads[lane] = ThreadPoolExecutor(1, thread_name_prefix=lane)
            future = self._threads[lane].submit(_worked, job, work)
        future.add_done_callback(partial(_end, job, self._said))
        return job, future

    def get(self, id: str) -> Job:
        """A job by its id. Raises `NotFoundError` if there is none."""
        with self._lock:
            if id not in self._jobs:
                raise NotFoundError(f"expected the id of a job, got {id[:40]!r}: it may have ended long ago")
            return self._jobs[id]

    def cancel(self, id: str) -> Job:
        """Ask a job to end. It ends when it next reports."""
        job = self.get(id)
        job.cancelled.set()
        return job

    def close(self) -> None:
        """Cancel all jobs, and end the threads when they have ended."""
        with self._lock:
            for job in self._jobs.values():
                job.cancelled.set()
            for threads in self._threads.values():
                threads.shutdown(wait=False, cancel_futures=True)
            self._threads.clear()


def _worked(job: Job, work: Callable[[Job], _Result]) -> _Result:
    job.report(job.stage, 0, 0)
    return work(job)


def _end(job: Job, said: Callable[[BaseException], str], future: Future[Any]) -> None:
    """Take down how a job ended. A fault of the program goes to the log with its traceback."""
    job.ended_s = time.monotonic()
    error = None if future.cancelled() else future.exception()
    if future.cancelled() or isinstance(error, CancelledError):
        job.state, job.error = "cancelled", "cancelled"
    elif error is None:
        job.result, job.state = future.result(), "done"
    else:
        known = isinstance(error, ChoreographError)
        job.error = (
            said(error) if known else f"unexpected {type(error).__name__}: this is a bug, see the terminal"
        )
        job.status = getattr(error, "status", 400) if known else 500
        job.state = "failed"
        if not known:
            _LOG.error("the studio failed", exc_info=error)
    job.on_change(job)
    job.begun.set()
    job.ended.set()
