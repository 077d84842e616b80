"""Pickles made instruction by instruction: what no change of a good file would come upon.

A program is one of arrays as `pickle` would write it, in which each part may be another: every dtype and its
state, every way to make an array, shapes and bytes that do not agree, and instructions that no pickle of
arrays has.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from typing import Any

from fuzz.mutations import Rng
from fuzz.odd_parts import (
    ARGUMENTS,
    CALLED,
    CODE,
    DESCRS,
    DOUBLED,
    EDGES,
    KEYS,
    KINDS,
    NESTED,
    ORDERS,
    SHAPES,
    STATES,
    TEXTS,
)

# How long an argument is, by the instruction.
_LENGTHS = {
    **dict.fromkeys("\x8a\x8cC", "<B"),
    **dict.fromkeys("X\x8bTB", "<I"),
    **dict.fromkeys("\x8d\x8e\x96", "<Q"),
}


def _sized(code: str, data: bytes) -> bytes:
    """An instruction with the length of its argument."""
    return code.encode("latin1") + struct.pack(_LENGTHS[code], len(data)) + data


class Program:
    """Instructions, written one after the other."""

    def __init__(self, rng: Rng, odd: float) -> None:
        self._rng = rng
        self._odd = odd
        self._code = bytearray()
        self._n_kept = 0  # in the memo
        self._depth = 0

    def finished(self, protocol: int) -> bytes:
        start = b"" if protocol < 2 else bytes((0x80, protocol))
        if protocol >= 4 and self._rng.random() < 0.8:
            size = len(self._code) + 1 if self._rng.random() < 0.8 else self._one_of(EDGES) % (1 << 64)
            start += b"\x95" + struct.pack("<Q", size)
        return start + bytes(self._code) + b"."

    def _one_of(self, choices: Sequence[Any]) -> Any:
        return choices[self._rng.integers(len(choices))]

    def _is_odd(self, times: float = 1.0) -> bool:
        return bool(self._rng.random() < times * self._odd)

    def _with_chance(self, share: float) -> bool:
        return bool(self._rng.random() < share)

    def add(self, *code: bytes) -> None:
        self._code += b"".join(code)

    # Values.

    def value(self, value: Any) -> None:
        """A value of Python, by one of the instructions that make it."""
        if value is None:
            self.add(b"N")
        elif isinstance(value, bool):
            self.add(self._one_of((b"\x88", b"I01\n") if value else (b"\x89", b"I00\n")))
        elif isinstance(value, int):
            self._integer(value)
        elif isinstance(value, float):
            self.add(self._one_of((b"G" + struct.pack(">d", value), f"F{value!r}\n".encode())))
        elif isinstance(value, str):
            self._text(value)
        elif isinstance(value, bytes):
            self._bytes(value)
        elif isinstance(value, dict):
            self.add(b"}(")
            for key, item in value.items():
                self.value(key)
                self.part(item)
            self.add(b"u")
        elif isinstance(value, list | tuple):
            self._items(value)
        else:
            value()

    def part(self, value: Any) -> None:
        """A value, or another one in place of it."""
        if self._depth < 3 and self._is_odd(0.25):
            self._depth += 1
            self.odd_value()
            self._depth -= 1
        else:
            self.value(value)
        if self._with_chance(0.1):
            self._remember()

    def _integer(self, value: int) -> None:
        packed = value.to_bytes(max(1, (value.bit_length() + 8) // 8), "little", signed=True)
        ways = [b"L%dL\n" % value, b"I%d\n" % value, _sized("\x8a", packed), _sized("\x8b", packed)]
        if 0 <= value < 256:
            ways += [b"K" + bytes((value,))] * 4
        if -(1 << 31) <= value < 1 << 31:
            ways += [b"J" + struct.pack("<i", value)]
        self.add(self._one_of(ways))

    def _text(self, value: str) -> None:
        encoded = value.encode("utf-8", "surrogatepass")
        ways = [_sized("X", encoded), _sized("\x8d", encoded)]
        if len(encoded) < 256:
            ways += [_sized("\x8c", encoded)] * 2
        if value.isascii() and "\n" not in value:
            ways += [b"V" + encoded.replace(b"\\", b"\\u005c") + b"\n", _sized("T", encoded)]
        self.add(self._one_of(ways))

    def _bytes(self, value: bytes) -> None:
        if self._with_chance(0.2):
            self.call("_codecs encode", value.decode("latin1"), "latin1")
        else:
            self.add(_sized(self._one_of("B\x8e\x96T" if len(value) > 255 else "B\x8e\x96TC"), value))

    def _items(self, value: list | tuple) -> None:
        is_list = isinstance(value, list)
        is_short = not is_list and len(value) <= 3 and self._with_chance(0.5)
        self.add(b"" if is_short else b"(")
        self._each(value)
        self.add((b")", b"\x85", b"\x86", b"\x87")[len(value)] if is_short else b"l" if is_list else b"t")

    def _remember(self) -> None:
        n = self._n_kept
        self.add(self._one_of((b"\x94", b"q%c" % (n % 256), b"p%d\n" % n, b"r" + struct.pack("<I", n))))
        self._n_kept += 1

    # Calls.

    def name(self, named: str) -> None:
        if self._is_odd(0.25):
            named = self._one_of(CALLED)
        module, _, name = named.partition(" ")
        if self._with_chance(0.5):
            self._text(module)
            self._text(name)
            self.add(b"\x93")
        else:
            self.add(b"c", module.encode(), b"\n", name.encode(), b"\n")

    def call(self, named: str, *arguments: Any) -> None:
        """A call as `pickle` writes it, or one in another way."""
        if not self._is_odd(0.5):
            self.name(named)
            self.value(tuple(arguments))
            self.add(b"R")
            return
        helpers = ("copyreg __newobj__", "copyreg _reconstructor", "copyreg __newobj_ex__")
        by = self._one_of((*helpers, "OBJ", "INST", "", ""))
        if by in ("OBJ", "INST"):
            self.add(b"(")
            if by == "OBJ":
                self.name(named)
            self._each(arguments)
            self.add(b"o" if by == "OBJ" else b"i" + "\n".join(named.split(" ", 1)).encode() + b"\n")
        elif by:
            self.name(by)
            self.value((lambda: self.name(named), *arguments))
            self.add(b"R")
        else:
            self.name(named)
            self.value(tuple(arguments))
            self.add(self._one_of((b"\x81", b"}\x92")))

    def _each(self, values: Sequence[Any]) -> None:
        for value in values:
            self.part(value)

    def kind(self, text: str) -> None:
        """A dtype with its state, each part of which may be another."""
        odd = self._is_odd()
        order = self._one_of(ORDERS) if odd else "|" if text[:1] in "bSOV?" else self._one_of("<<<>")
        parts = [None, None, None]
        numbers: list[Any] = [-1, -1, 63 if text[:1] == "O" else 0]
        while odd and self._with_chance(0.5):
            self._odd_state(parts, numbers)
        version = self._one_of((0, 1, 2, 5, -1, None)) if odd and self._with_chance(0.3) else 3
        state: Any = (version, order, *parts, *numbers)
        if odd and self._with_chance(0.3):
            others = state[:-1], (*state, {"a": 1}), (*state, None, None), state[1:]
            state = self._one_of((*others, *STATES))
        descr = self._odd_descr() if self._is_odd(0.5) else text
        self.call("numpy dtype", descr, False, self._one_of((True, 1)))
        if self._with_chance(0.3):
            self._remember()
        if not self._is_odd(0.25):
            self.value(state)
            self.add(b"b")

    def _odd_descr(self) -> Any:
        def of_one() -> None:
            self.kind(self._one_of(KINDS))

        return self._one_of((*DESCRS, of_one, (of_one, (3,))))

    def _odd_state(self, parts: list[Any], numbers: list[Any]) -> None:
        def of_one() -> None:
            self.kind(self._one_of(("O", "f8", "V8", "U4")))

        fields = {"a": (of_one, 0), "b": (of_one, self._one_of(EDGES))}
        where = int(self._rng.integers(6))
        if where == 0:
            parts[0] = self._one_of(((of_one, (2, 3)), (of_one, 3), (of_one, (1 << 40,)), of_one, ()))
        elif where == 1:
            parts[1] = self._one_of((("a", "b"), ("a",), (), (None,), ["a"], "ab"))
        elif where == 2:
            parts[2] = self._one_of((fields, {}, [], {"a": 3}, {"a": (of_one,)}))
        elif where == 3:
            parts[1:] = [("a", "b"), fields]
        else:
            numbers[int(self._rng.integers(3))] = self._one_of((*EDGES, None, "8", 63, 27, 16))

    def array(self, text: str, shape: Any, content: Any) -> None:
        """An array, by one of the ways to make it."""
        if self._is_odd():
            shape = self._one_of(SHAPES)
        order = self._one_of(("C", "C", "F", "K", "A", "x", None)) if self._is_odd() else "C"

        def kind() -> None:
            if self._is_odd(0.25):
                self.value(self._one_of((text, None, "O", 3)))
            else:
                self.kind(text)

        ways = 1.0 if self._is_odd() else 0.9 if shape in ((), (1,)) else 0.8
        way = self._rng.random() * ways
        core = self._one_of(("numpy.core", "numpy._core"))
        if way < 0.55:
            first = self._one_of(((0,), (), (5,), (1 << 40,), (-1,))) if self._is_odd(0.5) else (0,)
            self.call(f"{core}.multiarray _reconstruct", lambda: self.name("numpy ndarray"), first, b"b")
            if self._with_chance(0.5):
                self._remember()
            self.state_of_array(kind, shape, content)
        elif way < 0.8:
            more = ((1, 0),) if order == "K" and self._with_chance(0.7) else ()
            self.call(f"{core}.numeric _frombuffer", content, kind, shape, order, *more)
        elif way < 0.9:
            self.call(f"{core}.multiarray scalar", kind, content)
        else:
            strides = self._one_of((None, (8,), (1 << 40, 1)))
            given = (shape, kind, content, self._one_of(EDGES), strides, order)
            self.call("numpy ndarray", *given[: self._rng.integers(1, 7)])

    def state_of_array(self, kind: Callable[[], None], shape: Any, content: Any) -> None:
        is_fortran = self._one_of((None, "x", 2)) if self._is_odd() else self._one_of((False, True, 0, 1))
        version = self._one_of((0, 2, None, "1")) if self._is_odd(0.5) else 1
        state: Any = (version, shape, kind, is_fortran, content)
        if self._is_odd(0.5):
            state = self._one_of((state[1:], (*state, 1), state[:3], {"data": content}, *STATES))
        for _ in range(1 + self._is_odd(0.5)):
            self.value(state)
            self.add(b"b")

    # Parts that no pickle of arrays has.

    def odd_value(self) -> None:
        ways = (
            *(self._odd_code, self._odd_code, self._odd_build, self._odd_call, self._nested, self._doubled),
            *(self._odd_keys, self._from_memo, self._odd_sizes, self._edge, self._odd_array),
        )
        self._one_of(ways)()

    def _edge(self) -> None:
        others = (10**400, b"x" * 300, 1e400, -0.0, float("nan"), None, True)
        self.value(self._one_of((*EDGES, *TEXTS, *others)))

    def _odd_array(self) -> None:
        self.array(self._one_of(KINDS), self._one_of(SHAPES), bytes(self._one_of((0, 1, 8, 64))))

    def _odd_code(self) -> None:
        self.add(self._one_of(CODE))

    def _odd_build(self) -> None:
        """An object that is not an array, with a state."""
        array = "numpy._core.multiarray _reconstruct"
        holders: tuple[Callable[[], None], ...] = (
            *(lambda: self.name(self._one_of(CALLED)), lambda: self.kind("f8"), lambda: self.value(None)),
            *(lambda: self.value([]), lambda: self.value({"a": 1})),
            lambda: self.array("f8", (2,), bytes(16)),
            lambda: self.call(array, lambda: self.name("numpy ndarray"), (0,), b"b"),
            lambda: self.call("choreograph.core.counts Counts"),
        )
        self._one_of(holders)()
        content = self._one_of((b"x" * 8, [1]))
        self.value(self._one_of((*STATES, (1, (1,), lambda: self.kind("O"), False, content))))
        self.add(b"b")

    def _odd_call(self) -> None:
        self.call(self._one_of(CALLED), *self._one_of(ARGUMENTS))

    def _nested(self) -> None:
        n = int(10 ** self._rng.uniform(1, 5))
        start, end = self._one_of(NESTED)
        self.add(start * n, b"N", end * n)

    def _doubled(self) -> None:
        """Tuples, lists or texts of the same one twice, again and again."""
        way = self._one_of(DOUBLED)
        self.add(b"N", way * int(self._rng.integers(2, 60)))
        if self._with_chance(0.5):
            self.add(b"q\xfd0}h\xfdNs")  # as a key, which is hashed

    def _odd_keys(self) -> None:
        n = int(10 ** self._rng.uniform(0, 4))
        self.add(b"}(")
        for i in range(n):
            key = _sized("\x8a", struct.pack("<q", i << 32)) if n > 1 else self._one_of(KEYS)
            self.add(key, b"N")
        self.add(b"u")

    def _from_memo(self) -> None:
        n = int(self._rng.integers(max(1, self._n_kept + 1)))
        self.add(self._one_of((b"h%c" % (n % 256), b"j" + struct.pack("<I", n), b"g%d\n" % n)))

    def _odd_sizes(self) -> None:
        """A text, bytes or integer of another size than is there."""
        size = self._one_of((1, 1 << 20, (1 << 31) - 1, 1 << 31, (1 << 32) - 1))
        long = self._one_of((1 << 40, 1 << 62, (1 << 63) - 1, (1 << 64) - 1))
        code = self._one_of("XBT\x8br\x8d\x8e\x96")
        is_long = code in "\x8d\x8e\x96"
        self.add(code.encode("latin1"), struct.pack("<Q", long) if is_long else struct.pack("<I", size))
