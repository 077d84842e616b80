"""Takes from elsewhere: public data sets, which are downloaded, and sources at addresses, which are copied.

The data sets, with their terms, are the entries of `data_sets.toml`, which says what each key means. A table
of one's own has the same keys. `fetch` downloads the files of one with pooch. A file is written to NAME.part
first. A later call asks the host for the rest of it, if the host still has the same file (an entity tag or a
date says so). pooch compares the sum and moves the file to its name. What is unpacked keeps the last part of
its name only, so that nothing is written outside of the folder.

`local_sources` copies what is at an address such as `s3://bucket/takes`. It needs the package `fsspec`, and
for some protocols another one that it names, such as `s3fs`.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import tomllib
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from fnmatch import fnmatch
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import urlsplit

from choreograph.core.errors import ChoreographError, FormatError, ParameterError
from choreograph.core.files import LOCK_FILES, atomic_path, locked_folder, read_text, writing
from choreograph.core.progress import ProgressReport

# The data sets.


TABLE = Path(__file__).with_name("data_sets.toml")
_SCHEMES = ("http", "https")
_MAX_NAME = 200  # characters
_FORBIDDEN = set('<>:"|?*\\/')  # in names, on some systems
_SUMS = {"sha256": 64, "md5": 32}  # digits of each


@dataclass(frozen=True)
class SetFile:
    """One file of a data set at an address, and what is unpacked of it."""

    url: str
    max_bytes: int  # of the download
    keep: tuple[str, ...]  # globs of names
    into: str  # folder inside that of the data set
    max_unpacked_bytes: int
    sum: str = ""  # such as "sha256:…", or "" if none is published

    @property
    def name(self) -> str:
        """The name of the file at the end of its address."""
        return PurePosixPath(urlsplit(self.url).path).name


@dataclass(frozen=True)
class DataSet:
    """A data set with its terms. Without files, its owners ask for a form first."""

    name: str
    title: str
    about: str
    licence: str
    terms: tuple[str, ...]
    page: str
    build: str  # folder to build from, inside that of the data set
    layout: str  # glob of the files that are read, inside that of the data set
    files: tuple[SetFile, ...] = ()
    by_hand: str = ""  # what is downloaded by hand, and where to put it


def data_sets(table: Path = TABLE) -> dict[str, DataSet]:
    """The data sets of a table by name. Raises `FormatError` for another file."""
    text = read_text(table, "a table of data sets")
    try:
        entries = tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # a number of too many digits is not a TOMLDecodeError
        raise FormatError(
            f"{table}: expected a table of data sets in TOML, got another text: {error}"
        ) from None
    if not entries:
        raise FormatError(f"{table}: expected a data set in it, got none")
    return {name: _data_set(table, name, entry) for name, entry in entries.items()}


def data_set(name: str, table: Path = TABLE) -> DataSet:
    """The data set of a name in any case. Raises `ParameterError` if there is none, and as `data_sets`."""
    known = data_sets(table)
    found = known.get(name.casefold())
    if found is None:
        raise ParameterError(f"expected a data set among {', '.join(known)}, got {name!r}")
    return found


def _data_set(table: Path, name: str, entry: Any) -> DataSet:
    where = f"{table}: {name}"
    if not isinstance(entry, dict):
        raise FormatError(f"{where}: expected a table of keys, got {type(entry).__name__}")
    files = entry.get("files", [])
    if not isinstance(files, list):
        raise FormatError(f"{where}: expected [[{name}.files]], got {type(files).__name__}")
    if not is_usual_name(name):
        raise FormatError(f"{where}: expected a name that a folder can have, got {name!r}")
    if name != name.casefold() or not (files or entry.get("by_hand")):
        raise FormatError(f"{where}: expected a name in small letters, and files or by_hand, got other keys")
    values = _checked(where, {k: v for k, v in entry.items() if k != "files"}, DataSet, ("name", "files"))
    _check_inside(where, values["build"])
    glob = PurePosixPath(values["layout"]).parts
    if not glob or any("**" in part and part != "**" for part in glob):
        raise FormatError(f"{where}: expected a glob such as takes/*.bvh, got {values['layout']!r}")
    _check_inside(where, re.sub(r"[*?]", "x", values["layout"]))
    found = DataSet(name=name, files=tuple(_file(where, file) for file in files), **values)
    names = {file.name.casefold() for file in found.files}  # they lie in one folder, which is locked
    if len(names) < len(files):
        raise FormatError(f"{where}: expected addresses that end in different names, got one name twice")
    if taken := names.intersection(LOCK_FILES):
        raise FormatError(f"{where}: expected no file named {min(taken)}, which locks the folder")
    return found


def _file(where: str, entry: Any) -> SetFile:
    values = _checked(where, entry if isinstance(entry, dict) else {}, SetFile, ())
    file = SetFile(**values)
    kind, _, digits = file.sum.partition(":")
    if not _is_of_web(file):
        raise FormatError(f"{where}: expected the address of a file with http or https, got {file.url!r}")
    if file.sum and (len(digits) != _SUMS.get(kind) or set(digits) - set("0123456789abcdef")):
        raise FormatError(f"{where}: expected a sum such as sha256:…, got {file.sum!r}")
    _check_inside(where, file.into)
    return file


def _is_of_web(file: SetFile) -> bool:
    try:
        address = urlsplit(file.url)
        has_host = bool(address.hostname) and address.port != 0
    except ValueError:  # a host or port that none can be
        return False
    return has_host and address.scheme in _SCHEMES and file.url.isprintable() and is_usual_name(file.name)


def _checked(where: str, entry: Mapping[str, Any], of: type, computed: tuple[str, ...]) -> dict[str, Any]:
    """The values of an entry by field: texts, positive numbers or tuples of texts."""
    fields = {name: field for name, field in of.__dataclass_fields__.items() if name not in computed}  # type: ignore[attr-defined]
    required = [name for name in fields if not hasattr(of, name)]
    missing, unknown = set(required) - set(entry), set(entry) - set(fields)
    if missing or unknown:
        raise FormatError(
            f"{where}: expected the keys {', '.join(fields)}, got "
            + (f"no {', '.join(sorted(missing))}" if missing else f"also {', '.join(sorted(unknown))}")
        )
    values: dict[str, Any] = {}
    for name, value in entry.items():
        kind = fields[name].type
        if kind.startswith("tuple"):
            good = isinstance(value, list) and bool(value) and all(isinstance(one, str) for one in value)
            values[name] = tuple(value) if good else value
        else:
            good = type(value) is int and value > 0 if kind == "int" else isinstance(value, str)
            values[name] = value
        if not good:
            raise FormatError(f"{where}: expected {name} to be of another kind, got {value!r}")
    return values


def is_usual_name(name: str) -> bool:
    """Whether every system allows a file or folder of this name, and does not hide it."""
    is_plain = name.isprintable() and not set(name) & _FORBIDDEN and name == name.strip()
    return is_plain and 0 < len(name) <= _MAX_NAME and not name.startswith(".")


def _check_inside(where: str, folder: str) -> None:
    if not all(map(is_usual_name, PurePosixPath(folder).parts)):
        raise FormatError(f"{where}: expected a folder inside that of the data set, got {folder!r}")


# Download, comparison of sums, unpacking.


ARCHIVES = "downloads"  # folder inside that of a data set
_TRIES = 3  # connections for one call
_TIMEOUT_S = 60.0  # without any byte
_BLOCK_BYTES = 1 << 18  # what a break loses
_SHOWN = 3  # names in a note
_MAX_FILES = 100_000  # of an archive


def fetch(
    data_set: DataSet, folder: Path, report: ProgressReport | None = None
) -> tuple[int, tuple[str, ...]]:
    """Download and unpack what is missing of a data set.

    Parameters
    ----------
    folder : folder of the data set, created if missing
    report : called with the megabytes of each file

    Returns
    -------
    int, tuple of str   the number of unpacked files, and notes on files without a published sum and on
        unpacked files that were changed, which are left as they are

    Raises
    ------
    ParameterError   pooch is not installed
    ChoreographError   a host that does not answer, an address without the file, a full disk, or another
        process that works in the folder
    FormatError   a wrong sum, or an archive that is damaged or larger than stated
    """
    notes, n_files = [], 0
    with locked_folder(folder / ARCHIVES, doing=f"downloads {data_set.title}"):
        for file in data_set.files:
            archive = _downloaded(file, folder / ARCHIVES, data_set.page, report)
            if not file.sum:
                notes.append(f"{file.name}: its owners publish no sum. {_recorded(archive)}")
            kept, changed = unpack(archive, folder / file.into, file)
            n_files += len(kept)
            if changed:
                others = len(changed) - _SHOWN
                names = ", ".join(changed[:_SHOWN]) + (f" and {others} more" if others > 0 else "")
                notes.append(
                    f"{folder / file.into}: files that differ from those in {file.name} are left as they "
                    f"are: {names}. Remove those that you want to unpack again"
                )
    return n_files, tuple(notes)


def _downloaded(file: SetFile, folder: Path, page: str, report: ProgressReport | None) -> Path:
    """The file in the folder, downloaded unless it is there with the right sum."""
    try:
        import pooch
        import requests
    except ImportError as error:
        raise ParameterError(
            f"{file.url}: expected the package pooch to download, it is not installed: pip install "
            "'choreograph[get]'"
        ) from error
    pooch.get_logger().setLevel("ERROR")
    receiver = _Receiver(file, folder / f"{file.name}.part", report)
    expected = file.sum or _known_sum(folder / file.name)
    by_hand = f"download it in a browser ({page}) and put it into {folder}, or try again later"
    try:
        found = pooch.retrieve(file.url, expected, file.name, folder, downloader=receiver)
    except requests.HTTPError as error:
        answer = (
            "an error" if error.response is None else f"{error.response.status_code} {error.response.reason}"
        )
        raise ChoreographError(f"{file.url}: expected the file, got {answer}: {by_hand}") from None
    except requests.RequestException as error:
        reason = type(error).__name__
        raise ChoreographError(
            f"{file.url}: expected the file, the connection failed ({reason}): the same command goes on, or "
            f"{by_hand}"
        ) from None
    except OSError as error:
        raise ChoreographError(f"cannot write {folder / file.name}: {error.strerror or error}") from None
    except ChoreographError:
        raise
    except ValueError:
        raise FormatError(
            f"{file.url}: expected the sum {expected}, got another: the host has changed the file, or it was "
            "damaged on the way"
        ) from None
    return Path(found)


def _known_sum(archive: Path) -> str | None:
    """The sum that an earlier download recorded beside a file, or None.

    Raises `FormatError` for a record that has none.
    """
    record = archive.with_name(f"{archive.name}.sha256")
    if not record.is_file():
        return None
    found = re.match(r"[0-9a-f]{64}\b", read_text(record, "a sum as sha256sum writes it"))
    if not found:
        raise FormatError(
            f"{record}: expected the SHA-256 of {archive.name}, got another text: remove this file to record "
            "the sum again"
        )
    return f"sha256:{found[0]}"


def _recorded(archive: Path) -> str:
    """Record the sum of a file beside it, as sha256sum does. What was recorded, as a sentence."""
    record = archive.with_name(f"{archive.name}.sha256")
    if not record.is_file():
        with archive.open("rb") as content:
            digits = hashlib.file_digest(content, "sha256").hexdigest()
        with atomic_path(record) as temporary:
            temporary.write_text(f"{digits}  {archive.name}\n", encoding="ascii")
    return f"Its sum is in {record}"


class _Receiver:
    """The downloader that pooch calls. It continues a part, and tries again after a break."""

    def __init__(self, file: SetFile, part: Path, report: ProgressReport | None) -> None:
        self.file, self.part, self.report = file, part, report
        self.tag = part.with_name(f"{part.name}.tag")

    def __call__(self, url: str, output_file: str, pooch: Any = None) -> None:
        """Receive the file and move it to `output_file`."""
        import requests

        for left in reversed(range(_TRIES)):
            try:
                self._receive(url)
                break
            except (requests.ConnectionError, requests.Timeout, requests.exceptions.ChunkedEncodingError):
                if not left:
                    raise
            except (requests.RequestException, ChoreographError):
                raise
            except ValueError as error:
                raise ChoreographError(
                    f"{url}: expected the file, got an address or an answer that is not of HTTP: {error}"
                ) from None
        shutil.move(self.part, output_file)
        self.tag.unlink(missing_ok=True)

    def _receive(self, url: str) -> None:
        """Write what the host sends to the part, after what is there of the same file."""
        import requests

        had = self.part.stat().st_size if self.part.is_file() else 0
        tag = self.tag.read_text(encoding="latin-1") if self.tag.is_file() else ""
        headers = {"Accept-Encoding": "identity"}
        if had and tag:
            headers |= {"Range": f"bytes={had}-", "If-Range": tag}
        with requests.get(url, headers=headers, stream=True, timeout=_TIMEOUT_S) as answer:
            if answer.status_code == requests.codes.requested_range_not_satisfiable:
                self.part.unlink()
                raise requests.ConnectionError("the part is longer than the file")
            answer.raise_for_status()
            span = answer.headers.get("Content-Range", "")
            is_rest = answer.status_code == requests.codes.partial_content
            if is_rest and not span.startswith(f"bytes {had}-"):
                self.part.unlink(missing_ok=True)
                raise requests.ConnectionError(f"another part than asked for: {span[:40]}")
            start = had if is_rest else 0
            total = start + int(answer.headers.get("Content-Length", 0))
            self._check_size(total)
            entity = answer.headers.get("ETag", "")  # tells this version of the file from others
            if not entity or entity.startswith("W/"):  # a weak tag does not promise the same bytes
                entity = answer.headers.get("Last-Modified", "")
            self.tag.write_text(entity, encoding="latin-1")
            with self.part.open("ab" if is_rest else "wb") as out:
                done = start
                for block in answer.iter_content(_BLOCK_BYTES):
                    done += len(block)
                    self._check_size(done)
                    out.write(block)
                    if self.report is not None:
                        self.report(f"downloading {self.file.name} (MB)", done >> 20, total >> 20)
            if done < total:
                raise requests.ConnectionError("the connection ended early")

    def _check_size(self, n_bytes: int) -> None:
        if n_bytes > self.file.max_bytes:
            self.part.unlink(missing_ok=True)
            raise FormatError(
                f"{self.file.url}: expected at most {self.file.max_bytes} bytes, got more: it is another file"
            )


def unpack(archive: Path, folder: Path, file: SetFile) -> tuple[list[str], list[str]]:
    """Write the kept files of a ZIP file to a folder, under the last part of their names.

    Files that are there are left as they are, since somebody may have changed them. Returns the names of the
    kept files, and of those that are there with another content. Raises `FormatError` for another file, a
    damaged or locked one, two files of one name, or more than is allowed.
    """
    changed = []
    try:
        with zipfile.ZipFile(archive) as content:
            kept = _kept(archive, content, file)
            with writing(folder):
                folder.mkdir(parents=True, exist_ok=True)
            for name, info in kept.items():
                target = folder / name
                if not target.is_file():
                    with atomic_path(target) as temporary, content.open(info) as source:
                        _copy(source.read, temporary, info.file_size, f"{archive}: {name}")
                elif _is_changed(target, info):
                    changed.append(name)
    except ChoreographError:
        raise
    except Exception as error:  # of a damaged file, zipfile and its decoders raise a dozen kinds
        raise FormatError(f"{archive}: expected a ZIP file, got a damaged or locked one: {error}") from error
    return list(kept), changed


def _is_changed(path: Path, info: zipfile.ZipInfo) -> bool:
    """Whether a file has another content than an entry of an archive. True if it cannot be read."""
    with suppress(OSError):
        if path.stat().st_size == info.file_size:
            found = 0
            with path.open("rb") as content:
                while block := content.read(_BLOCK_BYTES):
                    found = zlib.crc32(block, found)
            return found != info.CRC
    return True


def _kept(archive: Path, content: zipfile.ZipFile, file: SetFile) -> dict[str, zipfile.ZipInfo]:
    """The entries to unpack by the name that they get."""
    kept: dict[str, zipfile.ZipInfo] = {}
    seen: set[str] = set()
    for info, name in _named(content):
        if not any(fnmatch(name, pattern) for pattern in file.keep):
            continue
        if not is_usual_name(name):
            raise FormatError(f"{archive}: expected usual names of files, got {name[:80]!r}")
        if name.casefold() in seen:  # some systems do not tell small letters from capitals
            raise FormatError(f"{archive}: expected one file of each name, got two named {name}")
        seen.add(name.casefold())
        kept[name] = info
    if not kept:
        raise FormatError(f"{archive}: expected {' or '.join(file.keep)} in it, got none: another version?")
    size = sum(info.file_size for info in kept.values())
    if size > file.max_unpacked_bytes or len(kept) > _MAX_FILES:
        raise FormatError(
            f"{archive}: expected at most {file.max_unpacked_bytes} bytes, got {size} in {len(kept)} files"
        )
    return kept


def _named(content: zipfile.ZipFile) -> Iterator[tuple[zipfile.ZipInfo, str]]:
    """The files of an archive, and the last parts of their names. Hidden ones are left out."""
    for info in content.infolist():
        name = PurePosixPath(info.filename.replace("\\", "/")).name
        if not info.is_dir() and name and not name.startswith("."):
            yield info, name


def _copy(read: Callable[[int], bytes], target: Path, n_bytes: int, what: str) -> None:
    """Copy as many bytes as stated. Raises `FormatError` if there are more."""
    done = 0
    with target.open("wb") as out:
        while block := _block(read, what):
            done += len(block)
            if done > n_bytes:
                raise FormatError(f"{what}: expected {n_bytes} bytes, got more")
            out.write(block)


def _block(read: Callable[[int], bytes], what: str) -> bytes:
    """The next bytes. The decoder of bzip2 raises `OSError`, which is not one of the file that is written."""
    try:
        return read(_BLOCK_BYTES)
    except OSError as error:
        raise FormatError(f"{what}: expected a ZIP file, got a damaged one: {error}") from error


# Sources at addresses.


_FOLDER = "fetched"  # in the work folder


def is_address(source: str | os.PathLike[str]) -> bool:
    """Whether a source is an address with a protocol, rather than a path."""
    protocol, found, _ = str(source).partition("://")
    return isinstance(source, str) and bool(found) and protocol.replace("+", "").isalnum()


@contextmanager
def local_sources(
    sources: Sequence[str | Path], work: Path, report: ProgressReport | None = None
) -> Iterator[tuple[Path, ...]]:
    """The sources as paths. What is at an address is copied to the folder `work`, and removed at the end.

    Raises `ParameterError` for an address that cannot be read, or without the package that reads it.
    """
    folder = work / _FOLDER
    try:
        yield tuple(
            _copied(source, folder / str(index), report)
            if isinstance(source, str) and is_address(source)
            else Path(source)
            for index, source in enumerate(sources)
        )
    finally:
        if folder.exists():
            shutil.rmtree(folder, ignore_errors=True)


def _copied(address: str, folder: Path, report: ProgressReport | None) -> Path:
    """The copy of a file or folder at an address, in a folder, under its own name."""
    try:
        from fsspec.core import url_to_fs
    except ImportError as error:
        raise ParameterError(
            f"{address}: expected the package fsspec to read addresses, it is not installed: pip install "
            "'choreograph[remote]'"
        ) from error
    try:
        filesystem, path = url_to_fs(address)
        is_folder = filesystem.isdir(path)
        files = sorted(filesystem.find(path)) if is_folder else [path]
        if not files or not (is_folder or filesystem.exists(path)):
            raise ParameterError(f"expected takes at {address}, got nothing: there is no such file or folder")
        name = PurePosixPath(path.rstrip("/")).name
        name = "takes" if name in ("", "..") else name
        for done, file in enumerate(files):
            inside = PurePosixPath(file).relative_to(path) if is_folder else PurePosixPath()
            if ".." in inside.parts or inside.is_absolute():
                raise ParameterError(f"{address}: expected files below it, got {str(inside)[:80]!r}")
            _copy_file(filesystem, file, folder / name / inside)
            if report is not None:
                report("copying takes", done + 1, len(files))
    except ChoreographError:
        raise
    except Exception as error:  # each protocol raises its own
        is_clear = isinstance(error, ImportError | ValueError | OSError) and str(error)
        reason = " ".join((str(error) if is_clear else f"{type(error).__name__}: {error}").split())
        raise ParameterError(f"{address}: expected takes, could not read them: {reason}") from error
    return folder / name


def _copy_file(filesystem: Any, file: str, target: Path) -> None:
    with writing(target):
        target.parent.mkdir(parents=True, exist_ok=True)
    try:
        filesystem.get_file(file, str(target))
    except FileNotFoundError as error:
        raise ChoreographError(f"expected {file} where it was listed, it is gone") from error
