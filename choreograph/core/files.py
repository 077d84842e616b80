"""Writes files atomically and never over an input, reads files from untrusted sources, finds folders."""

from __future__ import annotations

import codecs
import gc
import hashlib
import json
import os
import platform
import re
import stat
import tempfile
import uuid
import zlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import datetime
from itertools import chain, count
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout

from choreograph.core.arguments import unexpected
from choreograph.core.errors import ChoreographError, FormatError, ParameterError

# How large an input of each kind may be, as a file and once it is decompressed.
#
# A file from an untrusted source must not take memory out of proportion to its size. Readers refuse a larger
# one before they read it, and stop where it unpacks to more. Songs are decoded block by block, and
# repertoires are read row by row, so that their sizes have no limit here.


@dataclass(frozen=True)
class Budget:
    """The limits of one kind of input."""

    file_bytes: int
    unpacked_bytes: int  # of what is in memory at once


_MB = 1 << 20
BUDGETS = {
    "text": Budget(16 * _MB, 16 * _MB),  # a plan, a list or another file that a person may read
    "table": Budget(4 * _MB, 4 * _MB),  # each row takes a hundred times its bytes
    "bvh": Budget(512 * _MB, 512 * _MB),
    "c3d": Budget(256 * _MB, 256 * _MB),
    "vmd": Budget(256 * _MB, 256 * _MB),
    "npy": Budget(256 * _MB, 256 * _MB),
    "npz": Budget(1024 * _MB, 1024 * _MB),
    "pkl": Budget(64 * _MB, 64 * _MB),
    "gltf": Budget(1024 * _MB, 1024 * _MB),  # with its buffers and images
    "fbx": Budget(1024 * _MB, 1024 * _MB),
    "project": Budget(190_000_000 // 3, 190_000_000),  # each byte of the file is counted three times
}


MAX_TEXT_BYTES, MAX_TABLE_BYTES = (BUDGETS[kind].file_bytes for kind in ("text", "table"))
_LONG_NAME_BYTES = 100  # of longer names, temporary files have a checksum
_LONG_SUFFIX_BYTES = 16
_NAME_MAX_BYTES = 255  # where the system does not state the limit
# A checksum of this machine, and on Linux of the container, in which process ids are valid.
_PROCESSES = platform.node() + os.path.basename(os.path.realpath("/proc/self/ns/pid"))
_MACHINE = f"{zlib.crc32(_PROCESSES.encode()):08x}"
# How the files begin that are written here and never read from a folder: repertoires, pages, evaluations.
_RESULT = re.compile(rb'\x89HDF\r\n\x1a\n|<!doctype html>|\{\s*"format": "choreograph-evaluation"')
_HEAD_BYTES, _TAIL_BYTES = 1 << 22, 1 << 16  # in a long video, the generator follows the index
_KINDS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}


def as_path(what: str, path: object) -> Path:
    """The path as a `Path`. Raises `ParameterError` unless it is text or a `PathLike`."""
    if not isinstance(path, str | os.PathLike):
        raise unexpected(f"the path of {what}", path)
    return Path(path)


def check_target(path: str | Path) -> Path:
    """The path, as a `Path`, of a file to create or replace.

    Raises `ParameterError` if its folder is missing or read-only, the system does not allow its name, or the
    path is a folder, a pipe, a socket or a device.
    """
    path = Path(path)
    try:
        path.lstat()
    except (FileNotFoundError, NotADirectoryError):
        pass
    except (OSError, ValueError) as error:  # a name that is too long for the file system, or has a NUL
        raise ParameterError(f"cannot write {path}: {getattr(error, 'strerror', None) or error}") from None
    if not path.parent.is_dir():
        raise ParameterError(f"cannot write {path}: there is no folder {path.parent}")
    if path.is_dir():
        raise ParameterError(f"cannot write {path}: it is a folder")
    if path.exists() and not path.is_file():
        raise ParameterError(f"cannot write {path}: it is a pipe, a socket or a device")
    if not os.access(path.parent, os.W_OK):
        raise ParameterError(f"cannot write {path}: the folder {path.parent} is read-only")
    return path


def check_apart(outputs: Iterable[str | Path], inputs: Iterable[str | Path], *, hint: str = "") -> None:
    """Raise `ParameterError` if an output is an input or another output.

    Links are resolved before files are compared. If an input is a folder, all files in it are inputs, except
    repertoires, pages and evaluations, which are not read from folders. `hint` ends the message on two equal
    outputs.
    """
    known: dict[object, Path] = {}
    for output in map(Path, outputs):
        first = known.setdefault(file_identity(output), output)
        if first is not output:
            both = f"{first} twice" if first == output else f"{first} and {output}, which are one file"
            raise ParameterError(f"expected a file of its own for each output, got {both}{hint}")
    replaced = {key: path for key, path in known.items() if os.path.isfile(path) and not _is_result(path)}
    for given in map(Path, inputs):
        found = known.get(file_identity(given))
        if found is None and replaced and os.path.isdir(given):
            found = next(filter(None, (replaced.get(file_identity(f)) for f in _files_below(given))), None)
        if found is not None:
            raise ParameterError(f"cannot write {found}: it is an input, {given}: give another name")


def file_identity(path: Path) -> object:
    """A value that all paths of one file share: its inode, or the resolved path if it does not exist yet."""
    try:
        found = path.stat()
    except (OSError, ValueError):
        return os.path.realpath(path)
    return found.st_dev, found.st_ino


def _files_below(folder: Path) -> Iterator[Path]:
    """All files in a folder and its subfolders. Links are followed, and each folder is visited once."""
    seen: set[object] = set()
    for parent, folders, names in os.walk(folder, followlinks=True):
        identity = file_identity(Path(parent))
        if identity in seen:
            folders.clear()
            continue
        seen.add(identity)
        yield from (Path(parent) / name for name in names)


def _is_result(path: Path) -> bool:
    return _RESULT.match(ends_of(path)) is not None


def free_names(paths: Iterable[Path], is_taken: Callable[[Path], bool]) -> list[Path]:
    """The paths, or if one of them is taken, all of them as NAME-new, NAME-new-2 and so on."""
    paths = list(paths)
    added = chain(("", "-new"), (f"-new-{number}" for number in count(2)))
    named = ([path.with_name(f"{path.stem}{end}{path.suffix}") for path in paths] for end in added)
    return next(names for names in named if not any(map(is_taken, names)))


def ends_of(path: str | Path) -> bytes:
    """The beginning and the end of a file, where formats state its generator. Empty if it cannot be read."""
    with suppress(OSError), open(path, "rb") as file:
        head = file.read(_HEAD_BYTES)
        file.seek(max(file.tell(), os.path.getsize(path) - _TAIL_BYTES))
        return head + file.read(_TAIL_BYTES)
    return b""


def folder_beside(path: Path, suffix: str) -> Path:
    """The work folder of a file. Its name is that of the file, or a checksum of it, and a suffix."""
    try:
        longest = os.pathconf(path.parent, "PC_NAME_MAX")
    except (AttributeError, OSError, ValueError):
        longest = _NAME_MAX_BYTES
    name = path.name + suffix
    return path.with_name(name if len(os.fsencode(name)) <= longest else _name_checksum(path) + suffix)


@contextmanager
def writing(path: str | Path) -> Iterator[None]:
    """Turn an `OSError` in the block, such as a full disk, into a `ChoreographError` that names `path`."""
    try:
        yield
    except OSError as error:
        raise ChoreographError(f"cannot write {path}: {error.strerror or error}") from error


@contextmanager
def atomic_path(path: str | Path) -> Iterator[Path]:
    """A temporary path beside `path`, which is renamed to it at the end and removed if anything fails.

    Temporary files that killed processes left in its folder are removed as well.

    Raises `ParameterError` as `check_target` does, and `ChoreographError` for an `OSError` in the block or
    while renaming.
    """
    path = check_target(path)
    _remove_leftovers(path.parent)
    temporary = path.with_name(_temporary_name(path))
    try:
        with writing(path):
            yield temporary
            temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def _remove_leftovers(folder: Path) -> None:
    """Remove temporary files in a folder whose writers were killed on this machine.

    A process lists the folder before its first write there, and again after as many writes as there were
    files. So the time of a write does not grow with the folder.
    """
    key = os.path.abspath(folder)
    _writes_left[key] = _writes_left.get(key, 0) - 1
    if _writes_left[key] > 0:
        return
    with suppress(OSError):  # a folder that cannot be listed, or a file that another process removes
        names = os.listdir(folder)
        _writes_left[key] = len(names)
        pattern = re.compile(rf"\..+\.{_MACHINE}-(\d+)-[0-9a-f]{{8}}(\.[^.]*)?", re.DOTALL)
        for left in filter(None, map(pattern.fullmatch, names)):
            if not is_running(int(left[1])):
                (folder / left[0]).unlink(missing_ok=True)


_writes_left: dict[str, int] = {}  # until the folder of this path is listed again


def _temporary_name(path: Path) -> str:
    """A new name for a temporary file of a file, short enough for any file system."""
    suffix = path.suffix if len(os.fsencode(path.suffix)) <= _LONG_SUFFIX_BYTES else ""
    is_long = len(os.fsencode(path.name)) > _LONG_NAME_BYTES
    stem = _name_checksum(path) if is_long else path.stem
    return f".{stem}.{_MACHINE}-{os.getpid()}-{uuid.uuid4().hex[:8]}{suffix}"


def _name_checksum(path: Path) -> str:
    return f"{zlib.crc32(os.fsencode(path.name)):08x}"


def is_running(pid: int) -> bool:
    """Whether there is a process with this id. Always True on Windows."""
    if os.name == "nt":  # signal 0 would end the process
        return True
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        return True
    return True


def check_regular(path: str | Path, what: str) -> Path:
    """The path, as a `Path`, of an existing regular file.

    Raises `FormatError` if it is missing, a folder, or a pipe, socket or device, which may never end.
    """
    path = Path(path)
    try:
        mode = path.stat().st_mode
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise FormatError(f"{path}: expected {what}, could not find it: {reason}") from error
    if not stat.S_ISREG(mode):
        kind = _KINDS.get(stat.S_IFMT(mode), "something else")
        raise FormatError(f"{path}: expected {what}, got {kind}: name a regular file")
    return path


def read_bytes(path: str | Path, what: str, *, max_bytes: int = MAX_TEXT_BYTES) -> bytes:
    """The content of a file of at most `max_bytes`.

    Raises `FormatError` as `check_regular` does, and if the file is larger or cannot be read.
    """
    path = check_regular(path, what)
    try:
        with open(path, "rb") as file:
            is_larger = os.fstat(file.fileno()).st_size > max_bytes
            data = b"" if is_larger else file.read(max_bytes + 1)
    except OSError as error:
        raise FormatError(f"{path}: expected {what}, could not read it: {error.strerror}") from error
    if is_larger or len(data) > max_bytes:
        raise FormatError(f"{path}: expected {what} of up to {max_bytes >> 20} MiB, got more: another file?")
    return data


def read_text(
    path: str | Path, what: str, *, fallback: str | None = None, max_bytes: int = MAX_TEXT_BYTES
) -> str:
    """The text of a file in UTF-8, in UTF-16 with a byte order mark, or else in the encoding `fallback`.

    Raises `FormatError` as `read_bytes` does, and if the file is not text.
    """
    data = read_bytes(path, what, max_bytes=max_bytes)
    is_utf_16 = data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    try:
        return data.decode("utf-16" if is_utf_16 else "utf-8-sig")
    except UnicodeDecodeError as error:
        if fallback is None:
            raise FormatError(f"{path}: expected {what}, got no text in UTF-8 ({error.reason})") from error
        return data.decode(fallback, errors="replace")


def read_json(path: str | Path, what: str, *, max_bytes: int = MAX_TEXT_BYTES) -> Any:
    """The content of a JSON file. Raises `FormatError` as `read_text` does, and if it is not valid JSON."""
    text = read_text(path, what, max_bytes=max_bytes)
    try:
        with without_garbage_collection():
            return json.loads(text)
    except (ValueError, RecursionError) as error:
        reason = " ".join(str(error).split())[:120]
        raise FormatError(
            f"{path}: expected {what}, got no valid JSON ({reason}): cut off, or another file"
        ) from error


@contextmanager
def without_garbage_collection() -> Iterator[None]:
    """For a block that makes many objects and no garbage, such as a parser of JSON.

    The collector would visit all of them again and again: with it, nested lists take three times as long.
    """
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            gc.enable()


def sha256_of(path: str | Path) -> str:
    """Hexadecimal SHA-256 of a file."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


# Work folders, in which one process works at a time.


LOCK_FILES = _LOCK, _OWNER = "lock", "owner.json"  # in a folder that is locked


@contextmanager
def locked_folder(folder: Path, *, doing: str) -> Iterator[None]:
    """Lock a folder while the block runs. It is created if missing, and removed if it is empty at the end.

    The operating system releases the lock of a process that ends in any way, so that no lock is stale.
    `doing`, such as "builds rep.h5", is part of the error in another process.

    Raises `ChoreographError` if another process has locked the folder, or it cannot be written.
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
        with suppress(OSError):  # the files may stay, but are removed before the lock is released
            (folder / _OWNER).unlink(missing_ok=True)
            (folder / _LOCK).unlink(missing_ok=True)
        lock.release()
        with suppress(OSError):  # not empty
            folder.rmdir()


def _held_message(folder: Path) -> str:
    try:
        owner = json.loads((folder / _OWNER).read_text(encoding="utf-8"))
        who = f"process {owner['pid']} {owner['does']} since {owner['since']}"
    except (OSError, ValueError, KeyError, TypeError):  # the process has just begun or ended
        who = "another process"
    return f"expected {folder} to be free, got one in use: {who}: wait for it, end it, or write elsewhere"


# Folders for files that are made again if they are missing: compiled code and analyses of songs.


def cache_folder(name: str, given: str = "") -> tuple[Path | None, str]:
    """A folder of this name in the user's cache, and why a better place cannot be used, or "".

    The places are the folder `given` or that of the variable CHOREOGRAPH_CACHE, else the cache folder of the
    user, and then the temporary folder. The result is None if no place can be used. Nobody else may be able
    to write there, since the files are trusted.
    """
    from platformdirs import user_cache_path

    given = given or os.environ.get("CHOREOGRAPH_CACHE", "")
    bases = [Path(given) if given else user_cache_path("choreograph", appauthor=False)]
    user = os.getuid() if hasattr(os, "getuid") else "user"
    with suppress(FileNotFoundError):  # no temporary folder can be written
        bases.append(Path(tempfile.gettempdir()) / f"choreograph-{user}")
    refused: list[str] = []
    for base in bases:
        why_not = _why_unusable(base, base / name)
        if why_not is None:
            return base / name, "".join(refused[:1])
        refused.append(f"{base} cannot be used ({why_not})")
    return None, refused[0]


def _why_unusable(base: Path, folder: Path) -> str | None:
    if not base.is_absolute():
        return "no home folder"
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
        owners = {path.stat().st_uid for path in (base, folder)}
    except OSError as error:
        return error.strerror or str(error)
    if hasattr(os, "getuid") and not owners <= {os.getuid(), 0}:
        return "it belongs to another user"
    return None
