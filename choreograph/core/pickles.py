"""Pickles from untrusted files, read without the module `pickle`: they hold values, and nothing else.

A pickle is a program, and `pickle` calls and changes the objects that it names. A list of harmless names is
not enough: an array of NumPy takes its dtype and its memory from the file, and one of objects makes addresses
of its bytes. So the instructions are followed here, and what they call are stand-ins: arrays of NumPy from
their bytes, and classes of other modules. They take what the pickle passes them, and `array_of_bytes` makes
an array if bytes, kind of number and shape agree.

Values are numbers, texts, bytes, lists, tuples, dictionaries whose keys are texts or integers, and arrays of
numbers or of short texts. An array of one object is that object. Time and memory are in proportion to the
pickle.
"""

from __future__ import annotations

import math
import pickle
import pickletools
import re
from collections.abc import Callable
from dataclasses import is_dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

# Stand-ins for what a pickle names. NumPy itself is not called by a pickle and takes no state from it.


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


MAX_OPCODES = 20_000  # an array takes about thirty
_MADE_RATIO = 2  # bytes of arrays and of encoded texts, by those of the pickle
_MADE_BYTES = 1 << 10  # and besides
_LARGEST_INTEGER = 1 << 64
_MAX_PROTOCOL = 5
_LONGEST_REASON = 200
_LONGEST_NAME = 100


def unpickled(
    data: bytes,
    *,
    named: Callable[[str, str], Named | None] = lambda module, name: None,
    max_opcodes: int = MAX_OPCODES,
) -> Any:
    """The value that is pickled in `data`, read without running code of it.

    `named(module, name)` returns stand-ins for classes beside those of arrays. Raises `UnpicklingError`, of
    one line, for anything else than values, and if their arrays are larger than the data.
    """
    machine = _Machine(named, _MADE_BYTES + _MADE_RATIO * len(data))
    try:
        for i, (opcode, argument, _) in enumerate(pickletools.genops(data)):
            if i > max_opcodes:
                raise ValueError("it is larger or more complicated than a pickle of arrays")
            machine.follow(opcode.name, argument)
        return _plain(machine.stack.pop())
    except LookupError:
        reason = "it takes values that are not there"
    except TypeError:
        reason = "it calls functions with other arguments than they have"
    except MemoryError:
        reason = "it needs more memory than there is"
    except (ValueError, OverflowError) as error:
        reason = " ".join(str(error).split())[:_LONGEST_REASON]
    raise pickle.UnpicklingError(reason)


def _plain(value: Any) -> Any:
    """The value. Raises `ValueError` if a stand-in is left somewhere in it."""
    found, seen = [value], set()
    while found:
        one = found.pop()
        if isinstance(one, Standin):
            raise ValueError("an object that is not a value")
        if id(one) in seen:
            continue
        if isinstance(one, list | tuple):
            found += one
        elif isinstance(one, dict):
            found += one.values()
        elif is_dataclass(one):
            found += vars(one).values()
        else:
            continue
        seen.add(id(one))
    return value


class _Machine:
    """The stack and the memo of a pickle while its instructions are followed."""

    def __init__(self, named: Callable[[str, str], Named | None], made_bytes: int) -> None:
        self.stack: list[Any] = []
        self._marks: list[int] = []  # sizes of the stack
        self._memo: dict[int, Any] = {}
        self._named = named
        self._bytes_left = made_bytes

    def follow(self, name: str, argument: Any) -> None:
        """Follow one instruction. Raises `ValueError` if it is not one of those that make values."""
        if name in _PUSHES:
            self._push(argument)
        elif name in _CONSTANTS:
            self.stack.append(_CONSTANTS[name])
        elif name in _STEPS:
            _STEPS[name](self, argument)
        elif name not in ("FRAME", "STOP"):
            raise ValueError(f"it has the instruction {name}, which a pickle of arrays does not need")

    def protocol(self, version: int) -> None:
        if version > _MAX_PROTOCOL:
            raise ValueError(f"it is of protocol {version}")

    def _push(self, value: Any) -> None:
        if type(value) is int and not -_LARGEST_INTEGER < value < _LARGEST_INTEGER:
            raise ValueError("an integer of more than 64 bits")
        self.stack.append(value)

    def mark(self, _: Any) -> None:
        self._marks.append(len(self.stack))

    def _from_mark(self) -> list[Any]:
        start = self._marks.pop()
        items = self.stack[start:]
        del self.stack[start:]
        return items

    def pop(self, _: Any) -> None:
        if self._marks and self._marks[-1] == len(self.stack):
            self._marks.pop()
        else:
            self.stack.pop()

    def pop_mark(self, _: Any) -> None:
        self._from_mark()

    def duplicate(self, _: Any) -> None:
        self.stack.append(self.stack[-1])

    def get(self, place: int) -> None:
        self.stack.append(self._memo[place])

    def put(self, place: int | None) -> None:
        place, value = len(self._memo) if place is None else place, self.stack[-1]
        self._memo[place] = value
        if isinstance(value, Unbuilt):
            value.places.append(place)

    def empty_list(self, _: Any) -> None:
        self.stack.append([])

    def empty_dict(self, _: Any) -> None:
        self.stack.append({})

    def append(self, _: Any) -> None:
        item = self.stack.pop()
        self._extend([item])

    def appends(self, _: Any) -> None:
        self._extend(self._from_mark())

    def _extend(self, items: list[Any]) -> None:
        if type(self.stack[-1]) is not list:
            raise ValueError("items of an object that is not a list")
        self.stack[-1].extend(items)

    def make_list(self, _: Any) -> None:
        self.stack.append(self._from_mark())

    def make_tuple(self, _: Any) -> None:
        self.stack.append(tuple(self._from_mark()))

    def short_tuple(self, size: int) -> None:
        if len(self.stack) < size:
            raise ValueError("a tuple of items that are not there")
        items = tuple(self.stack[-size:])
        del self.stack[-size:]
        self.stack.append(items)

    def set_item(self, _: Any) -> None:
        value, key = self.stack.pop(), self.stack.pop()
        self._update([key, value])

    def set_items(self, _: Any) -> None:
        self._update(self._from_mark())

    def make_dict(self, _: Any) -> None:
        items = self._from_mark()
        self.stack.append({})
        self._update(items)

    def _update(self, items: list[Any]) -> None:
        if type(self.stack[-1]) is not dict or len(items) % 2:
            raise ValueError("names of an object that is not a dictionary")
        # The hash of another key, such as a tuple of tuples of tuples, may take any time or all of the stack.
        if not all(type(key) in (str, int) for key in items[::2]):
            raise ValueError("a dictionary whose keys are not texts or integers")
        self.stack[-1].update(zip(items[::2], items[1::2], strict=True))

    def name(self, of_file: str) -> None:
        module, _, name = of_file.partition(" ")
        self._refer(module, name)

    def name_on_stack(self, _: Any) -> None:
        name, module = self.stack.pop(), self.stack.pop()
        self._refer(module, name)

    def _refer(self, module: Any, name: Any) -> None:
        if type(module) is not str or type(name) is not str:
            raise ValueError("a name that is not a text")
        found = ARRAYS.get((module, name)) or self._named(module, name)
        if found is None:
            what = ascii(f"{module}.{name}"[: _LONGEST_REASON // 2])[1:-1]
            raise ValueError(f"it refers to {what}, which is not an array and may run code")
        self.stack.append(found)

    def call(self, _: Any) -> None:
        arguments, function = self.stack.pop(), self.stack.pop()
        if not isinstance(function, Named) or type(arguments) is not tuple:
            raise ValueError("it calls an object that is not a function")
        self._spent(function.make(*arguments))

    def build(self, _: Any) -> None:
        state, unbuilt = self.stack.pop(), self.stack.pop()
        if not isinstance(unbuilt, Unbuilt):
            raise ValueError("it changes an object")
        self._spent(unbuilt.build(state))
        for place in unbuilt.places:
            self._memo[place] = self.stack[-1]

    def _spent(self, value: Any) -> None:
        """Push a value that was made, whose bytes are in proportion to the pickle."""
        if isinstance(value, np.ndarray | np.generic):
            self._bytes_left -= value.nbytes
        elif isinstance(value, bytes):
            self._bytes_left -= len(value)
        if self._bytes_left < 0:
            raise ValueError("it makes arrays that are larger than the pickle")
        self.stack.append(value)


_PUSHES = frozenset((
    "INT", "BININT", "BININT1", "BININT2", "LONG", "LONG1", "LONG4", "FLOAT", "BINFLOAT",
    "STRING", "BINSTRING", "SHORT_BINSTRING", "BINBYTES", "SHORT_BINBYTES", "BINBYTES8", "BYTEARRAY8",
    "UNICODE", "BINUNICODE", "SHORT_BINUNICODE", "BINUNICODE8",
))  # fmt: skip
_CONSTANTS = {"NONE": None, "NEWTRUE": True, "NEWFALSE": False, "EMPTY_TUPLE": ()}
_STEPS: dict[str, Callable[[_Machine, Any], None]] = {
    "PROTO": _Machine.protocol, "MARK": _Machine.mark, "POP": _Machine.pop, "POP_MARK": _Machine.pop_mark,
    "DUP": _Machine.duplicate,
    **dict.fromkeys(("GET", "BINGET", "LONG_BINGET"), _Machine.get),
    **dict.fromkeys(("PUT", "BINPUT", "LONG_BINPUT", "MEMOIZE"), _Machine.put),
    "EMPTY_LIST": _Machine.empty_list, "LIST": _Machine.make_list,
    "APPEND": _Machine.append, "APPENDS": _Machine.appends,
    "TUPLE": _Machine.make_tuple, "TUPLE1": lambda machine, _: machine.short_tuple(1),
    "TUPLE2": lambda machine, _: machine.short_tuple(2), "TUPLE3": lambda machine, _: machine.short_tuple(3),
    "EMPTY_DICT": _Machine.empty_dict, "DICT": _Machine.make_dict,
    "SETITEM": _Machine.set_item, "SETITEMS": _Machine.set_items,
    "GLOBAL": _Machine.name, "STACK_GLOBAL": _Machine.name_on_stack,
    **dict.fromkeys(("REDUCE", "NEWOBJ"), _Machine.call), "BUILD": _Machine.build,
}  # fmt: skip
