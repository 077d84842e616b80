"""The same work on many inputs, by the workers of a Dask scheduler, which may be other machines.

Needs the extra `cluster`. Functions, inputs and results are pickled. Files that a function reads must have
the same path for every worker, unless they are sent along.
"""

from __future__ import annotations

import io
import os
import pickle
import warnings
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path, PurePath
from tempfile import TemporaryDirectory
from typing import Any, TypeVar

from choreograph.core.errors import ChoreographError, ParameterError

# Inputs that are sent together with the files that they name, to a machine that does not have the files.
#
# There, the files lie below a temporary folder, under the paths that they have here. The absolute paths of an
# input are changed before the work, and those of the result are changed back, in its messages as well. In
# texts of the input, such as options, the paths of the files that were sent are changed.


_MOST_BYTES = 1 << 30  # of a file

_Input = TypeVar("_Input")


SentFile = tuple[str, bytes]  # path here, and content


@dataclass(frozen=True)
class Staged:
    """An input and the files that it names."""

    content: bytes  # the pickled input
    files: tuple[SentFile, ...]


def staged(one: object, files: Iterable[Path]) -> Staged:
    """An input with its files. Raises as `sent_files`."""
    return Staged(pickle.dumps(one, 5), sent_files(files))


def sent_files(files: Iterable[Path]) -> tuple[SentFile, ...]:
    """The contents of files. Those that do not exist are left out, as where the input was made.

    Raises `ParameterError` for a file of more than a GiB.
    """
    contents = []
    for file in files:
        if not file.is_file():
            continue
        if (size := file.stat().st_size) > _MOST_BYTES:
            raise ParameterError(
                f"{file}: expected a file of at most {_MOST_BYTES >> 30} GiB to send along, got "
                f"{size / 2**30:.1f} GiB: leave out --stage, for workers that share a file system"
            )
        contents.append((os.path.abspath(file), file.read_bytes()))
    return tuple(contents)


@dataclass(frozen=True)
class StagedResult:
    """The result for an input that was sent, with the paths of the machine that sent it."""

    content: bytes

    def received(self) -> Any:
        """The result."""
        return _read(self.content)


def on_staged(
    function: Callable[[_Input], Any], sent: Staged, shared: Iterable[SentFile] = ()
) -> StagedResult:
    """The result of a function for an input that was sent. Its files are removed again.

    `shared` are the files that all inputs name.
    """
    with TemporaryDirectory(prefix="choreograph-") as made:
        folder = os.path.realpath(made)
        there = {}
        for name, content in (*shared, *sent.files):
            path = _below(folder, Path(name))
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
            there[name] = str(path)
        one = _changed(
            pickle.loads(sent.content), lambda path: _there(path, folder), lambda text: _with(text, there)
        )
        result = function(one)
        return StagedResult(
            _written(result, lambda path: _back(path, folder), lambda text: text.replace(folder, ""))
        )


def _below(folder: str, path: PurePath) -> Path:
    """An absolute path below a folder."""
    return Path(folder, *path.parts[1:])


def _there(path: PurePath, folder: str) -> PurePath:
    return _below(folder, path) if path.is_absolute() else path


def _with(text: str, there: Mapping[str, str]) -> str:
    """A text in which the paths of the files that were sent are those below the folder."""
    for name in sorted(there, key=len, reverse=True):
        if name in text:
            return there[name].join(_with(part, there) for part in text.split(name))
    return text


def _back(path: PurePath, folder: str) -> PurePath:
    return Path(path.anchor, path.relative_to(folder)) if path.is_relative_to(folder) else path


class _Writer(pickle.Pickler):
    """Writes paths and texts that are changed by a function."""

    def __init__(
        self, file: io.BytesIO, path: Callable[[PurePath], PurePath], text: Callable[[str], str]
    ) -> None:
        super().__init__(file, 5)
        self._path, self._text = path, text

    def persistent_id(self, obj: Any) -> Any:
        """What is written instead of a path or text, or None for anything else, and for what stays."""
        if isinstance(obj, PurePath):
            changed = self._path(obj)
            return None if changed == obj else ("path", str(changed).encode("utf-8", "surrogatepass"))
        if type(obj) is str:
            text = self._text(obj)
            return (
                None if text == obj else ("text", text.encode("utf-8", "surrogatepass"))
            )  # as bytes, which are not changed again
        return None


class _Reader(pickle.Unpickler):
    def persistent_load(self, pid: Any) -> Any:
        """The path or text that was written."""
        kind, text = pid[0], pid[1].decode("utf-8", "surrogatepass")
        return Path(text) if kind == "path" else text


def _read(content: bytes) -> Any:
    return _Reader(io.BytesIO(content)).load()


def _written(value: Any, path: Callable[[PurePath], PurePath], text: Callable[[str], str]) -> bytes:
    file = io.BytesIO()
    _Writer(file, path, text).dump(value)
    return file.getvalue()


def _changed(value: _Input, path: Callable[[PurePath], PurePath], text: Callable[[str], str]) -> _Input:
    """A copy of a value with other paths and texts."""
    changed: _Input = _read(_written(value, path, text))
    return changed


# The workers of a scheduler.


_AHEAD = 2  # inputs of a worker that are sent before their results are needed
_CONNECT_S = 10.0
_MOST_LOSSES = 5  # of a scheduler, in a row

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
