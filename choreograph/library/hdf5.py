"""HDF5 files from untrusted sources, opened and validated before any data is read.

Links to other files are refused. Every error of HDF5 and of `checks` becomes one that names the file.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from choreograph.core.errors import FormatError, ParameterError, RepertoireError
from choreograph.core.files import check_regular
from choreograph.library.checks import StoredArray

# The errors of h5py for a file that it cannot read. It depends on the damaged bytes which is raised.
H5PY_ERRORS = (
    OSError, KeyError, RuntimeError, ValueError, TypeError, AttributeError, OverflowError, MemoryError,
    NotImplementedError,
)  # fmt: skip


@contextmanager
def opened(path: Path, what: str) -> Iterator[h5py.File]:
    """Open a file of a kind, such as "a repertoire". Raises `RepertoireError` if it is not valid."""
    with file_named(path, what), h5py.File(path, "r") as file:
        yield file


@contextmanager
def file_named(path: Path, what: str) -> Iterator[None]:
    """Raise the errors of HDF5 and of `checks` as a `RepertoireError` that names the file."""
    try:
        check_regular(path, what)
        yield
    except (RepertoireError, FormatError, *H5PY_ERRORS) as error:
        if isinstance(error, RepertoireError) and str(error).startswith(str(path)):
            raise
        raise RepertoireError(_with_file(error, path, what)) from error


def _with_file(error: Exception, path: Path, what: str) -> str:
    """The message of an error, with the name of the file."""
    if isinstance(error, RepertoireError | ParameterError):
        return f"{path}: {error}: a damaged file"
    if isinstance(error, FormatError):  # there is no such file, and the message names it
        return str(error)
    reason = " ".join(str(error).split())[:120]
    return (
        f"{path}: expected {what} (HDF5), could not read it ({reason}): truncated or not made by choreograph"
    )


def check_link(file: h5py.File, name: str) -> None:
    """Raise `RepertoireError` if an object does not exist or is a link to another place."""
    try:
        link = file.id.links.get_info(name.encode())
    except (KeyError, RuntimeError):
        raise RepertoireError(f"the repertoire has no {name}") from None
    if link.type != h5py.h5l.TYPE_HARD:
        raise RepertoireError(f"{name}: expected it in this file, got a link to another place")


def stored_array(file: h5py.File, name: str) -> StoredArray:
    """How an array is stored. Calls are low-level, since opening a repertoire checks every array."""
    check_link(file, name)
    data = h5py.h5o.open(file.id, name.encode())
    if not isinstance(data, h5py.h5d.DatasetID):
        raise RepertoireError(f"the repertoire has no {name}")
    plan = data.get_create_plist()
    layout = plan.get_layout()
    return StoredArray(
        name,
        data.dtype,
        is_quantised=h5py.h5a.exists(data, b"step"),
        shape=data.shape or (),
        chunk=plan.get_chunk() if layout == h5py.h5d.CHUNKED else (),
        filters=tuple(plan.get_filter(i)[0] for i in range(plan.get_nfilters())),
        n_stored_bytes=data.get_storage_size(),
        is_elsewhere=layout == h5py.h5d.VIRTUAL or plan.get_external_count() > 0,
    )


def member_names(file: h5py.File, group: str, most: int) -> list[str]:
    """The sorted names in a group. Raises `RepertoireError` if it is no group, or has more than `most`."""
    check_link(file, group)
    members = file[group]
    if not isinstance(members, h5py.Group) or len(members) > most:
        raise RepertoireError(
            f"{group}: expected a group of up to {most} members, got another object or a larger group"
        )
    return sorted(members)


def scalar(owner: h5py.Group | h5py.Dataset, name: str) -> Any:
    """An attribute that is a single number or text of fixed length, or None for anything else.

    Texts of any length are in heaps, on which HDF5 2.0 loops endlessly if they are damaged.
    """
    if name not in owner.attrs:
        return None
    header = owner.attrs.get_id(name)
    return owner.attrs[name] if header.shape == () and header.dtype.kind in "iufbS" else None


def text_attribute(owner: h5py.Group, name: str) -> str | None:
    """An attribute that is one text, or None for anything else."""
    value = scalar(owner, name)
    return value.decode(errors="replace") if isinstance(value, bytes) else None


def attribute(owner: h5py.Group, name: str, kind: type) -> Any:
    """An attribute that is one text or whole number. Raises `RepertoireError` for anything else."""
    value = text_attribute(owner, name) if kind is str else scalar(owner, name)
    if not isinstance(value, str if kind is str else np.integer):
        raise RepertoireError(
            f"the attribute {name}: expected {kind.__name__}, got another type or no such attribute"
        )
    return kind(value)
