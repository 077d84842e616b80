"""Stand-ins for what a pickle names: the arrays of NumPy, from their bytes, and classes of other modules.

They take what the pickle passes them, and `array_of_bytes` makes an array if bytes, kind of number and shape
agree. NumPy itself is not called by a pickle and takes no state from it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

_MAX_AXES = 32
_LONGEST_AXIS = 1 << 48
_KIND = re.compile(r"(b1|[iu][1248]|f[248]|c8|c16)|([US][1-9][0-9]{0,3})|(O[48]?)")
_LAST_CODE_POINT = 0x10FFFF
_DTYPE_VERSIONS = (3, 4)
_CODECS = ("latin1", "latin-1", "utf-8")


# Arrays of bytes.


def number_kind(text: str) -> np.dtype[Any] | None:
    """The dtype of a text such as "<f8", or None for one of objects.

    Raises `ValueError` if it is neither that nor one of numbers, or of short texts.
    """
    order, kind = (text[0], text[1:]) if text[:1] in ("<", ">", "|", "=") else ("=", text)
    found = _KIND.fullmatch("b1" if kind == "?" else kind)
    if found is None:
        raise ValueError(f"an array of {text[:20]!a}, not of numbers")
    return None if found[3] else np.dtype(order + found[0])


def array_of_bytes(
    content: bytes | bytearray | memoryview,
    kind: np.dtype[Any],
    shape: tuple[int, ...],
    order: Literal["C", "F"] = "C",
) -> NDArray[Any]:
    """An array of its own memory and in the byte order of the machine.

    Raises `ValueError` if the bytes are not exactly those of the shape, or no values of that kind.
    """
    if len(shape) > _MAX_AXES or not all(0 <= n <= _LONGEST_AXIS for n in shape):
        raise ValueError("an array of a shape that none has")
    if len(content) != math.prod(shape) * kind.itemsize:
        raise ValueError(f"an array of shape {shape} and {kind} in {len(content)} bytes")
    values = np.frombuffer(content, kind) if content else np.zeros(0, kind)
    # Memory that another program wrote can have values that are none, which NumPy relies on.
    if kind.kind == "b" and values.size and values.view(np.uint8).max() > 1:
        raise ValueError("an array of true and false with other values")
    if kind.kind == "U" and values.size:
        points = values.view(np.dtype(np.uint32).newbyteorder(kind.byteorder))
        if points.max() > _LAST_CODE_POINT:
            raise ValueError("an array of texts with characters that do not exist")
    return values.reshape(shape, order=order).astype(kind.newbyteorder("="), order="K")


# Stand-ins for what a pickle names.


class Standin:
    """What a pickle names, in place of it."""


class Named(Standin):
    """A class or function. What `make` returns for the arguments of the pickle is the result of a call."""

    def __init__(self, make: Callable[..., Any]) -> None:
        self.make = make


class Unbuilt(Standin):
    """An object before its state, of which `build` makes the value."""

    def __init__(self) -> None:
        self.places: list[int] = []  # in the memo of the pickle, to which the value goes as well

    def build(self, state: Any) -> Any:
        """The value. Raises `ValueError` if the state is another."""
        raise NotImplementedError


class _Kind(Standin):
    """A dtype: of numbers, or None for objects."""

    def __init__(self, dtype: np.dtype[Any] | None) -> None:
        self.dtype = dtype


class _UnbuiltKind(Unbuilt):
    def __init__(self, text: Any, is_aligned: Any = False, is_copied: Any = True) -> None:
        super().__init__()
        if type(text) is not str:
            raise ValueError("a dtype that is not one of numbers")
        self._text = text

    def build(self, state: Any) -> _Kind:
        """From its version, byte order and parts. The sizes that come after them are not read."""
        version, order, *parts = _parts(state, 8, 9)[:5]
        if version not in _DTYPE_VERSIONS or type(order) is not str or parts != [None, None, None]:
            raise ValueError("a dtype that is not one of numbers")
        return _Kind(number_kind(order + self._text))


class _UnbuiltArray(Unbuilt):
    def __init__(self, subclass: Any, shape: Any, code: Any) -> None:
        super().__init__()
        if subclass is not _NDARRAY:
            raise ValueError("an array of another class")

    def build(self, state: Any) -> Any:
        version, shape, kind, is_fortran, content = _parts(state, 5)
        if type(version) is not int or version != 1 or type(is_fortran) not in (bool, int):
            raise ValueError("an array of another version")
        is_one = type(content) is list and len(content) == math.prod(_shape(shape)) == 1
        if is_one and isinstance(kind, _Kind) and kind.dtype is None:
            return content[0]
        return array_of_bytes(_bytes(content), _dtype(kind), _shape(shape), "F" if is_fortran else "C")


def _scalar(kind: Any, content: Any) -> Any:
    return array_of_bytes(_bytes(content), _dtype(kind), ())[()]


def _from_buffer(content: Any, kind: Any, shape: Any, order: Any, axes: Any = None) -> NDArray[Any]:
    if type(order) is not str or order not in "CFK":
        raise ValueError("an array in an order that none has")
    array = array_of_bytes(_bytes(content), _dtype(kind), _shape(shape), "F" if order == "F" else "C")
    return array.transpose(_shape(axes)) if order == "K" else array


def _encode(text: Any, codec: Any = "latin1") -> bytes:
    """Text encoded as older pickles do. The full registry of codecs has more than text codecs."""
    if type(text) is not str or type(codec) is not str or codec not in _CODECS:
        raise ValueError("a text in an encoding that bytes do not have")
    return text.encode(codec)


def _no_bytes() -> bytes:
    return b""


def _not_called(*_: Any) -> Any:
    raise ValueError("an array that is made in another way than `pickle` does")


def _dtype(kind: Any) -> np.dtype[Any]:
    if not isinstance(kind, _Kind):
        raise ValueError("an array without a dtype")
    if kind.dtype is None:
        raise ValueError("an array of objects")
    return kind.dtype


def _shape(shape: Any) -> tuple[int, ...]:
    if type(shape) is not tuple or len(shape) > _MAX_AXES or not all(type(n) is int for n in shape):
        raise ValueError("an array of a shape that none has")
    return shape


def _bytes(content: Any) -> bytes | bytearray:
    if type(content) is str:  # of Python 2
        return content.encode("latin1")
    if type(content) not in (bytes, bytearray):
        raise ValueError("an array without bytes")
    return content


def _parts(state: Any, *sizes: int) -> tuple[Any, ...]:
    if type(state) is not tuple or len(state) not in sizes:
        raise ValueError("a state that is not one of an array")
    return state


# By module and name. Before NumPy 2 the module was numpy.core. Both kinds of files exist.
_NDARRAY = Named(_not_called)
ARRAYS: dict[tuple[str, str], Named] = {
    ("numpy", "ndarray"): _NDARRAY,
    ("numpy", "dtype"): Named(_UnbuiltKind),
    ("_codecs", "encode"): Named(_encode),
    ("builtins", "bytes"): Named(_no_bytes),
    ("__builtin__", "bytes"): Named(_no_bytes),
}
for _core in ("numpy.core", "numpy._core"):
    ARRAYS[f"{_core}.multiarray", "_reconstruct"] = Named(_UnbuiltArray)
    ARRAYS[f"{_core}.multiarray", "scalar"] = Named(_scalar)
    ARRAYS[f"{_core}.numeric", "_frombuffer"] = Named(_from_buffer)
