"""The same work on many inputs, in several processes or machines, with the results in order of the inputs.

The results do not depend on the number of processes. A process that is killed, such as for lack of memory,
costs the work that it had begun, which is done again. Processes are those of joblib, which need no
`if __name__ == "__main__"` in the program that imports this one.
"""

from __future__ import annotations

import ctypes
import os
import pickle
import sys
import warnings
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import TypeVar

from choreograph.core.clusters import Cluster, WorkerKilled, connected
from choreograph.core.errors import ChoreographError

FEWEST = 6  # inputs for which processes are started, each of which takes two seconds
_GROWTH_BYTES = 1 << 31  # of a process before it is ended as one that loses memory
_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3  # names of options in malloc.h
_AHEAD = 2  # inputs of a process that are worked on before their results are needed

_Input = TypeVar("_Input")
_Result = TypeVar("_Result")
_n_workers: ContextVar[int] = ContextVar("n_workers", default=1)
_cluster: ContextVar[Cluster | None] = ContextVar("cluster", default=None)
_sends_files: ContextVar[bool] = ContextVar("sends_files", default=False)


def n_cores() -> int:
    """The number of CPU cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def is_of_torchrun() -> bool:
    """Whether `torchrun` started this process, beside others that train with it (`nets.processes`)."""
    return "TORCHELASTIC_RUN_ID" in os.environ


def pickled(value: object) -> bytes:
    """A value, which may have functions that are defined in functions, as bytes for `pickle.loads`."""
    from joblib import wrap_non_picklable_objects

    return pickle.dumps(wrap_non_picklable_objects(value, keep_wrapper=False))


@contextmanager
def workers(n: int) -> Iterator[None]:
    """Inside, `each` and `beside` use `n` processes, or this one if `n` is 1. They end with the block."""
    token = _n_workers.set(n)
    try:
        yield
    finally:
        _n_workers.reset(token)
        if n > 1 and _n_workers.get() == 1:
            _end_processes()


@contextmanager
def cluster(address: str, *, stage: bool = False) -> Iterator[Cluster]:
    """Inside, `each` uses the workers of the Dask scheduler at `address`, and `beside` this process.

    With `stage`, files that are read are sent along, to workers that share no file system.

    Raises as `clusters.connected`.
    """
    with connected(address) as of_address:
        tokens = _cluster.set(of_address), _n_workers.set(1), _sends_files.set(stage)
        try:
            yield of_address
        finally:
            _cluster.reset(tokens[0])
            _n_workers.reset(tokens[1])
            _sends_files.reset(tokens[2])


def working(n: int, dask: str, *, stage: bool = False) -> AbstractContextManager[Cluster | None]:
    """A context in which `each` uses the scheduler at the address `dask`, or `n` processes if it is empty.

    `n` is 0 for one process for each CPU core. `stage` is that of `cluster`.
    """
    return cluster(dask, stage=stage) if dask else workers(n or n_cores())


def _end_processes() -> None:
    """Idle processes would keep their memory, and a fork of this process would wait for them for ever."""
    from joblib.externals.loky import get_reusable_executor

    get_reusable_executor(reuse=True).shutdown(wait=True)


def each(
    function: Callable[[_Input], _Result],
    inputs: Iterable[_Input],
    *,
    killed: Callable[[_Input], _Result] | None = None,
    named: Callable[[_Input], str] = str,
    fewest: int = FEWEST,
    files: Callable[[_Input], Iterable[Path]] | None = None,
    shared: Sequence[Path] = (),
) -> Iterator[_Result]:
    """The result of `function` for each input, in order, when it is needed.

    In processes, which are started for `fewest` inputs or more, `function`, inputs and results are pickled.
    An input whose process is killed twice has the result `killed(input)`. `files(input)` are the files that
    `function` reads, and `shared` those that it reads for every input. They may have to be sent along.

    Raises what `function` raises, and `ChoreographError` for such an input without `killed`, which is called
    `named(input)` there.
    """
    inputs = list(inputs)
    elsewhere = _cluster.get()
    n = min(_n_workers.get(), len(inputs)) if elsewhere is None else elsewhere.n_workers
    if elsewhere is None and (n == 1 or len(inputs) < fewest):
        yield from map(function, inputs)
        return
    sent = files if _sends_files.get() else None
    start = partial(_started, n) if elsewhere is None else partial(elsewhere.each, files=sent, shared=shared)
    done, one_by_one = 0, 0
    while done < len(inputs):
        stop = done + 1 if one_by_one else len(inputs)
        try:
            with _ended(start(partial(_result, function), inputs[done:stop])) as results:
                for result in results:
                    yield _taken(result)
                    done, one_by_one = done + 1, max(0, one_by_one - 1)
        except (BrokenProcessPool, WorkerKilled):
            if one_by_one == 0:  # any of those that were begun may have done it
                one_by_one = (_AHEAD + 1) * n
                continue
            if killed is None:
                raise ChoreographError(
                    f"expected the work on {named(inputs[done])} to end, but its process was killed more "
                    "than once: too little memory?"
                ) from None
            yield killed(inputs[done])
            done, one_by_one = done + 1, one_by_one - 1


@contextmanager
def beside(
    here: Callable[[], _Result], elsewhere: Callable[[], _Result] | None
) -> Iterator[Callable[[], _Result]]:
    """Inside, `elsewhere` works in another process. What is yielded waits for its result and returns it.

    With one worker, without `elsewhere`, and if its process is killed, `here` is called when the result is
    wanted. At an exception inside, the process is ended.
    """
    if elsewhere is None or _n_workers.get() == 1:
        yield here
        return
    with _ended(_started(2, partial(_result, _call), [elsewhere])) as running:

        def result() -> _Result:
            try:
                return _taken(next(running))
            except BrokenProcessPool:
                return here()

        yield result


@contextmanager
def _ended(
    running: Generator[_Result | _Failed, None, None],
) -> Iterator[Generator[_Result | _Failed, None, None]]:
    """At the end, work that is still running is given up."""
    try:
        yield running
    finally:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # on work that is given up
            running.close()


@dataclass(frozen=True)
class _Failed:
    """An error of the caller, which is raised when the results before it are taken."""

    error: ChoreographError


def _started(
    n: int, function: Callable[[_Input], _Result], inputs: Sequence[_Input]
) -> Generator[_Result, None, None]:
    """The results in order, of work that begins at once."""
    from joblib import Parallel, delayed

    # Without `max_nbytes`, large arrays would be passed as read-only files.
    parallel = Parallel(max(n, 2), return_as="generator", max_nbytes=None, pre_dispatch=_AHEAD * n)
    results: Generator[_Result, None, None] = parallel(delayed(_in_process)(function, one) for one in inputs)
    return results


def _in_process(function: Callable[[_Input], _Result], one: _Input) -> _Result:
    """The result in a process of joblib.

    joblib ends a process that has grown by 300 MB, as if it lost memory. The import of torch takes as much,
    and would be done again in the next process.
    """
    from joblib.externals.loky import process_executor

    process_executor._MAX_MEMORY_LEAK_SIZE = _GROWTH_BYTES
    return function(one)


def _result(function: Callable[[_Input], _Result], one: _Input) -> _Result | _Failed:
    """The result, or the error: joblib would raise the error that comes first in time."""
    _reuse_freed_memory()
    try:
        return function(one)
    except ChoreographError as error:
        return _Failed(error)


@cache
def _reuse_freed_memory() -> None:
    """Let the C library keep the memory of freed arrays for the next ones, where it can be told so.

    Otherwise, it returns that of each array to the system, and workers of Dask always do: a quarter of the
    time of an analysis is then spent on new pages.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    if mallopt is not None:
        mallopt(_MMAP_THRESHOLD, 32 << 20)  # the largest that is allowed
        mallopt(_TRIM_THRESHOLD, 256 << 20)


def _taken(result: _Result | _Failed) -> _Result:
    if isinstance(result, _Failed):
        raise result.error
    return result


def _call(function: Callable[[], _Result]) -> _Result:
    return function()
