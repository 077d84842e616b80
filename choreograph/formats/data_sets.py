"""Public data sets of motion by name: their terms, their files, and the folder to build from.

They are entries of `data_sets.toml`, which says what each key means. A table of one's own has the same keys.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import urlsplit

from choreograph.core.errors import FormatError, ParameterError
from choreograph.core.files import LOCK_FILES, read_text

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
    _check_glob(where, values["layout"])
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
    if not _is_address(file):
        raise FormatError(f"{where}: expected the address of a file with http or https, got {file.url!r}")
    if file.sum and (len(digits) != _SUMS.get(kind) or set(digits) - set("0123456789abcdef")):
        raise FormatError(f"{where}: expected a sum such as sha256:…, got {file.sum!r}")
    _check_inside(where, file.into)
    return file


def _is_address(file: SetFile) -> bool:
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


def _check_glob(where: str, glob: str) -> None:
    parts = PurePosixPath(glob).parts
    if not parts or any("**" in part and part != "**" for part in parts):
        raise FormatError(f"{where}: expected a glob such as takes/*.bvh, got {glob!r}")
    _check_inside(where, re.sub(r"[*?]", "x", glob))
