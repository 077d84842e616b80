"""NPY: one array of numbers, or a pickle, which is not read here.

A header is Python code, which NumPy evaluates. The headers that it and other programs write have one form,
and no other is read. An array has the bytes that its header states, and its values are numbers or short
texts.
"""

from __future__ import annotations

import math
import re
import struct
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from choreograph.core.errors import FormatError
from choreograph.core.standins import array_of_bytes, number_kind

MAGIC = b"\x93NUMPY"
_SIZES = {1: "<H", 2: "<I", 3: "<I"}  # of the length of the header, by the version of the format
_MAX_HEADER_BYTES = 1 << 12
_HEADER = re.compile(
    rb"\{\s*'descr':\s*'([^'\\]{1,20})',\s*'fortran_order':\s*(True|False),\s*"
    rb"'shape':\s*\(([\dL, ]*)\),?\s*\}\s*"
)
_NUMBER = re.compile(rb"\d+")


class Header(NamedTuple):
    """What an NPY file states before its values."""

    kind: np.dtype[Any] | None  # None for objects, which are pickled
    is_fortran: bool
    shape: tuple[int, ...]
    n_bytes: int  # before the values


def header_of(data: bytes) -> Header:
    """The header of a file. Raises `FormatError` if it is damaged, or its values are not numbers or texts."""
    size = _SIZES.get(data[6]) if data.startswith(MAGIC) and len(data) > len(MAGIC) else None
    if size is None or len(data) < 8 + struct.calcsize(size):
        raise FormatError("expected an array (.npy), got no header of one: damaged, or another format")
    start = 8 + struct.calcsize(size)
    n_bytes = start + int(struct.unpack_from(size, data, 8)[0])
    found = _HEADER.fullmatch(data[start : min(n_bytes, start + _MAX_HEADER_BYTES)])
    if found is None or n_bytes > len(data):
        raise FormatError("expected an array of numbers (.npy), got another header: damaged?")
    descr, order, shape = found.groups()
    try:
        kind = number_kind(descr.decode("ascii"))
    except ValueError as error:
        raise FormatError(f"expected an array of numbers, got {error}") from None
    return Header(kind, order == b"True", tuple(map(int, _NUMBER.findall(shape))), n_bytes)


def array_of(data: bytes, header: Header | None = None) -> NDArray[Any]:
    """The array of a file. Raises `FormatError` if it is damaged or cut off, or has objects."""
    header = header or header_of(data)
    if header.kind is None:
        raise FormatError("expected an array of numbers, got one of objects, which is not read from here")
    n_bytes = math.prod(header.shape) * header.kind.itemsize
    content = memoryview(data)[header.n_bytes : header.n_bytes + n_bytes]
    try:
        return array_of_bytes(content, header.kind, header.shape, "F" if header.is_fortran else "C")
    except ValueError as error:
        raise FormatError(f"expected an array of numbers, got {error}: cut off?") from None
