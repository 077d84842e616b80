"""The same work on many inputs, by the workers of a Dask scheduler, which may be other machines.

Needs the extra `cluster`. Functions, inputs and results are pickled. Files that a function reads must have
the same path for every worker, unless they are sent along (`core.staging`).
"""

from __future__ import annotations

import warnings
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, TypeVar

from choreograph.core.errors import ChoreographError
from choreograph.core.staging import StagedResult, on_staged, sent_files, staged

_AHEAD = 2  # inputs of a worker that are sent before their results are needed
_CONNECT_S = 10.0
_MOST_LOSSES = 5  # of a scheduler, in a row

_Input = TypeVar("_Input")
_Result = TypeVar("_Result")


class WorkerKilled(Exception):
    """Workers were killed again and again while they worked on one input."""


class Cluster:
    """A connection to a scheduler whose workers can do the work of this program."""

    def __init__(self, address: str, client: Any) -> None:
        self.address, self._client = address, client

    @property
    def dashboard(self) -> str:
        """The address of the scheduler's page in a browser."""
        return str(self._client.dashboard_link)

    @property
    def n_workers(self) -> int:
        """The number of workers, at least 1."""
        return max(1, len(self._client.scheduler_info(n_workers=-1)["workers"]))

    def lacks(self, paths: Iterable[Path]) -> bool:
        """Whether a worker has not all of these files and folders, under their absolute paths."""
        absolute = [path.absolute() for path in paths]
        return not all(self._client.run(_has, absolute).values())

    def each(
        self,
        function: Callable[[_Input], _Result],
        inputs: Sequence[_Input],
        files: Callable[[_Input], Iterable[Path]] | None = None,
        shared: Sequence[Path] = (),
    ) -> Generator[_Result, None, None]:
        """The result of `function` for each input, in order.

        With `files`, those of an input are sent along, and those of all inputs (`shared`) once to a worker.

        Work that is lost with a worker or a scheduler is done again. Raises what `function` raises,
        `WorkerKilled` when the scheduler gives an input up, which may have been beside the one that kills
        workers, and `ChoreographError` when the scheduler is lost.
        """
        from distributed import CancelledError, KilledWorker
        from distributed.comm import CommClosedError

        done, losses = 0, 0
        while done < len(inputs):
            try:
                for result in self._in_order(function, inputs[done:], files, shared):
                    yield result
                    done, losses = done + 1, 0
            except KilledWorker as error:
                raise WorkerKilled from error
            except (CancelledError, CommClosedError, OSError) as error:
                losses += 1
                if losses > _MOST_LOSSES or not self._is_back():
                    raise ChoreographError(
                        f"expected the scheduler {self.address} and its workers to answer, lost them: are "
                        "they running?"
                    ) from error

    def _in_order(
        self,
        function: Callable[[_Input], _Result],
        inputs: Sequence[_Input],
        files: Callable[[_Input], Iterable[Path]] | None,
        shared: Sequence[Path],
    ) -> Iterator[_Result]:
        """Results in order. Only as many inputs are sent as workers need, since some are whole takes."""
        n_ahead = _AHEAD * self.n_workers
        sent = self._client.scatter([*sent_files(shared)], broadcast=True) if shared and files else []
        running: deque[Any] = deque()
        try:
            for one in inputs:
                running.append(self._submitted(function, one, files, sent))
                if len(running) > n_ahead:
                    yield _received(running.popleft().result())
            while running:
                yield _received(running.popleft().result())
        finally:
            self._client.cancel(list(running))

    def _submitted(
        self,
        function: Callable[[_Input], _Result],
        one: _Input,
        files: Callable[[_Input], Iterable[Path]] | None,
        shared: Sequence[Any],
    ) -> Any:
        """The future result, sent back as it is or, with the files of the input, as a `StagedResult`."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # on the size of whole takes
            if files is None:
                return self._client.submit(function, one, pure=False)
            work = partial(on_staged, function)
            return self._client.submit(work, staged(one, files(one)), shared, pure=False)

    def _is_back(self) -> bool:
        """Whether the scheduler has a worker, now or within some seconds."""
        from distributed.comm import CommClosedError

        try:
            self._client.wait_for_workers(1, timeout=_CONNECT_S)
        except (CommClosedError, OSError):  # a time that is over is an OSError
            return False
        return True


def _has(paths: Sequence[Path]) -> bool:
    return all(path.exists() for path in paths)


def _received(result: Any) -> Any:
    return result.received() if isinstance(result, StagedResult) else result


@contextmanager
def connected(address: str) -> Iterator[Cluster]:
    """The workers of a scheduler, such as tcp://10.0.0.5:8786.

    Raises `ChoreographError` if there is no scheduler, or if its workers have another version of this program
    or several threads.
    """
    try:
        from distributed import Client
    except ImportError as error:
        raise ChoreographError(
            "expected the extra `cluster` to use a Dask scheduler, it is not installed: "
            "pip install 'choreograph[cluster]'"
        ) from error
    try:
        client: Any = Client(address, timeout=_CONNECT_S, set_as_default=False)
    except (OSError, ValueError) as error:
        reason = " ".join(str(error).split())[:120]
        raise ChoreographError(
            f"expected a Dask scheduler at {address}, could not connect: {reason}"
        ) from error
    try:
        _check_workers(client, address)
        yield Cluster(address, client)
    finally:
        client.close()


def _check_workers(client: Any, address: str) -> None:
    threads = client.nthreads()
    if not threads:
        raise ChoreographError(f"expected workers of the scheduler {address}, got none: start `dask worker`")
    for worker, n_threads in threads.items():
        if n_threads != 1:
            raise ChoreographError(
                f"expected workers with one thread, got {n_threads} in {worker}: "
                "start them with `dask worker --nthreads 1`"
            )
    own = version("choreograph")
    for worker, found in client.run(version, "choreograph", on_error="return").items():
        if found != own:
            got = "none" if isinstance(found, PackageNotFoundError) else found
            raise ChoreographError(f"expected choreograph {own} in every worker, got {got} in {worker}")
