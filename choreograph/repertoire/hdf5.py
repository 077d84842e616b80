"""HDF5 files of strangers: opened, and looked at before anything of them is read.

Nothing outside the file is followed. All that HDF5 makes of a damaged one becomes one error that names it.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from choreograph.errors import FormatError, RepertoireError
from choreograph.files import check_regular
from choreograph.repertoire.checks import StoredArray


@contextmanager
def opened(path: Path, what: str) -> Iterator[h5py.File]:
    """The open file; `RepertoireError` naming it for all that HDF5 or `checks` find wrong with it."""
    with damage_named(path, what), h5py.File(path, "r") as file:
        yield file


@contextmanager
def damage_named(path: Path, what: str) -> Iterator[None]:
    try:
        check_regular(path, what)
        yield
    except RepertoireError as error:
        message = str(error)
        if message.startswith(str(path)):
            raise
        raise RepertoireError(f"{path}: {message}: a damaged file") from error
    except FormatError as error:  # no file
        raise RepertoireError(str(error)) from error
    except (
        OSError, KeyError, RuntimeError, ValueError, TypeError, AttributeError, OverflowError, MemoryError,
        NotImplementedError,
    ) as error:  # fmt: skip  # all that h5py makes of what it cannot read
        reason = " ".join(str(error).split())[:120]
        raise RepertoireError(
            f"{path}: expected {what} (HDF5), could not read it ({reason}): truncated or "
            "not made by choreograph"
        ) from error


def check_link(file: h5py.File, name: str) -> None:
    """`RepertoireError` unless an object, or its name in the group before it, is in the file itself."""
    try:
        link = file.id.links.get_info(name.encode())
    except (KeyError, RuntimeError):
        raise RepertoireError(f"the repertoire has no {name}") from None
    if link.type != h5py.h5l.TYPE_HARD:
        raise RepertoireError(f"{name}: expected it in this file, got a link to another place")


def stored_array(file: h5py.File, name: str) -> StoredArray:
    """How an array is stored; low-level calls, since opening a repertoire looks at all of them."""
    check_link(file, name)
    data = h5py.h5o.open(file.id, name.encode())
    if not isinstance(data, h5py.h5d.DatasetID):
        raise RepertoireError(f"the repertoire has no {name}")
    plan = data.get_create_plist()
    layout = plan.get_layout()
    is_text = h5py.check_string_dtype(data.dtype) is not None
    return StoredArray(
        name,
        data.dtype,
        is_text,
        is_quantised=h5py.h5a.exists(data, b"step"),
        shape=data.shape or (),
        chunk=plan.get_chunk() if layout == h5py.h5d.CHUNKED else (),
        filters=tuple(plan.get_filter(i)[0] for i in range(plan.get_nfilters())),
        n_stored_bytes=data.get_storage_size(),
        is_elsewhere=layout == h5py.h5d.VIRTUAL or plan.get_external_count() > 0,
    )


def member_names(file: h5py.File, group: str, most: int) -> list[str]:
    check_link(file, group)
    members = file[group]
    if not isinstance(members, h5py.Group) or len(members) > most:
        raise RepertoireError(f"{group}: expected a group of up to {most}, got something else")
    return sorted(members)


def scalar(owner: h5py.Group | h5py.Dataset, name: str) -> Any:
    """An attribute that is one value; None if there is none, or it is an array or a reference."""
    if name not in owner.attrs:
        return None
    header = owner.attrs.get_id(name)
    return owner.attrs[name] if header.shape == () and header.dtype.kind in "iufbO" else None


def attribute(owner: h5py.Group, name: str, kind: type) -> Any:
    value = scalar(owner, name)
    if not isinstance(value, str if kind is str else np.integer):
        raise RepertoireError(
            f"the attribute {name}: expected {kind.__name__}, got something else or nothing"
        )
    return kind(value)


def from_json(text: str, what: str) -> dict[str, Any]:
    try:
        data = json.loads(text)
    except (TypeError, ValueError, RecursionError) as error:
        raise RepertoireError(f"{what}: expected JSON: a damaged file") from error
    if not isinstance(data, dict):
        raise RepertoireError(f"{what}: expected a JSON object: a damaged file")
    return data
