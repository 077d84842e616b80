"""Parts of pickles that `pickle` does not write, for `fuzz.pickle_programs`."""

from __future__ import annotations

import struct
from typing import Any

NUMBERS = ("b1", "i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8", "f2", "f4", "f8", "c8", "c16")
_KINDS = """
    ? f16 c32 g G e O O8 O4 S1 S8 S0 U1 U24 U0 V0 V8 V1 U100000000 S2147483647 V2147483647 U1000000000 M8
    M8[ns] m8 m8[s] m8[1000000000D] T f8,f8 3f8 (2,3)f8 (1000000,1000000)f8 O,O f8,O i3 f3 f-8 f\u0663 a5 d
    float64 object void str bytes p P i8[ns] {'a':'f8'} \0 f8\0
"""
KINDS = (*NUMBERS, *_KINDS.split(), "", "x" * 5000)
ORDERS = ("<", ">", "=", "|", "", "x", "<<", "I")
EDGES = (0, 1, -1, 2, 8, 255, 65_535, 1 << 30, 1 << 31, 1 << 32, 1 << 62, (1 << 63) - 1, -(1 << 63))
SHAPES: tuple[Any, ...] = (
    *((), (0,), (1,), (-1,), (0, 72), (0, 1 << 62), (1 << 62, 4), (1 << 32, 1 << 32), (1 << 31, 0, 1 << 33)),
    *((-1, 72), (1,) * 33, (1,) * 65, (0,) * 40, (1 << 80,), (True, 3)),
    *((3.0,), ("3",), (None,), 5, None, [3, 4], (1, (2, 3))),
)
TEXTS = (
    *("", "a", "smpl_poses", "latin1", "utf-8", "zlib"),
    *("\xe9\udc80", "\U0010ffff" * 40, "\x1b[2J\n", "x" * 3000),
)
_CALLED = """
    numpy: ndarray dtype matrix recarray memmap void record float64 str_ object_ array frombuffer empty nditer
    numpy.core.multiarray: _reconstruct scalar fromstring
    numpy._core.multiarray: _reconstruct scalar frombuffer empty
    numpy.core.numeric: _frombuffer
    numpy._core.numeric: _frombuffer
    numpy.lib.stride_tricks: as_strided
    numpy.dtypes: Float64DType
    numpy._core._internal: _ctypes
    numpy.random._pickle: __generator_ctor
    _codecs: encode decode
    copyreg: _reconstructor __newobj__ __newobj_ex__
    copy_reg: _reconstructor
    builtins: bytes bytearray object list getattr complex memoryview range set
    __builtin__: bytes
    collections: OrderedDict
    pathlib: PosixPath PurePath
    choreograph.core.counts: Counts make_counts
    choreograph.motion.skeleton: Skeleton
    choreograph.motion.motion: Take
    choreograph.core.cache: DiskCache
    choreograph.cli: main
    os: system
    torch._utils: _rebuild_tensor_v2
    ctypes: c_char
    types: SimpleNamespace
    datetime: datetime
    decimal: Decimal
"""


def _called() -> list[str]:
    """Every module and name, with a space between them."""
    lines = [line.strip().split(": ") for line in _CALLED.strip().splitlines()]
    return [f"{module} {name}" for module, names in lines for name in names.split()]


CALLED = (*_called(), " ", "numpy ", "numpy\0 dtype")
ARGUMENTS: tuple[Any, ...] = (
    *((), (1,), ("a",), (b"x",), (None, None), ([],), ({},), ("f8",), (1 << 40,), ("a",) * 50),
)
# Instructions by themselves, and with what they need but in no order that `pickle` writes.
CODE = (
    *(b"Pid\n", b"NQ", b"\x82\x01", b"\x83\x01\x00", b"\x84\x01\x00\x00\x00", b"\x84\xff\xff\xff\xff"),
    *(b"\x97", b"\x98", b"N\x98", b"0", b"00", b"1", b"2", b"(", b"(1", b"((t", b"a", b"e", b"s", b"u"),
    *(b"(d", b"(Nd", b"\x8f", b"\x8f(K\x01\x90", b"(K\x01\x91", b"(N\x91", b"\x85", b"\x86", b"\x87", b"R"),
    *(b"b", b"o", b"\x81", b"\x92", b"\x93", b"NN\x93", b"\x80\x63", b"\x80\x00", b".", b"\xff"),
    *(b"\x95" + b"\xff" * 8, b"S'\\xff'\n", b"S'a\n", b"I0x\n", b"Iabc\n", b"L\n", b"F1e999\n", b"Fnan\n"),
    *(b"F\n", b"V\\ud800\n", b"V\\U0011ffff\n", b"Na", b"]N\x86b", b"}(NNu", b"}Ns", b"h\xff", b"g-1\n"),
    *(b"g99\n", b"p-1\n", b"j\xff\xff\xff\xff"),
    # Lists, dictionaries and tuples that are in themselves.
    *(b"]q\xfch\xfca", b"}q\xfcK\x01h\xfcs", b"]q\xfc\x85h\xfc0h\xfc0", b"(]q\xfch\xfcal", b"](h\xfct"),
    b"]q\xfch\xfc\x85a0h\xfc\x85",
    # Integers without end.
    *(b"L" + b"9" * 6000 + b"L\n", b"I" + b"9" * 6000 + b"\n", b"p" + b"9" * 5000 + b"\n"),
    *(b"p" + b"9" * 80 + b"\n", b"\x8b" + struct.pack("<i", 70_000) + b"\x7f" * 70_000),
)
# How a value is put into others, again and again: before and after it.
NESTED = (
    *((b"]", b"a"), (b"", b"\x85"), (b"(", b"t"), (b"(", b"l")),
    *((b"}K\x01", b"s"), (b"}", b"\x85"), (b"(K\x01", b"d")),
)
DOUBLED = (b"2\x86", b"q\xfeh\xfe\x86", b"2\x86\x85", b"(h\xfel")
KEYS = (b"N", b")", b"G" + bytes(8), b"]", b")\x85", b"C\x01a")
STATES: tuple[Any, ...] = (
    *({"a": 1}, {"__class__": 1}, (None, {"__dict__": {}}), {1: 2}, "x", None, (), [], (1, 2)),
    *({"dtype": "O"}, ({"shape": (3,)}, {"strides": (1 << 40,)})),
    dict.fromkeys(("times_s", "numbers", "metre", "source", "confidence", "uncertainty")),
)
DESCRS: tuple[Any, ...] = (
    *([("a", "f8"), ("b", "O")], [("a", "f8", (1 << 20,))], ("f8", (1 << 30, 1 << 30)), ("O", "f8")),
    *({"a": ("O", 0)}, ("f8", {"a": ("O", 0)}), ("V8", "O"), [], {}, None, 8),
    {"names": ["a"], "formats": ["O"], "offsets": [3]},
    {"names": ["a", "b"], "formats": ["O", "f8"], "offsets": [0, 0], "itemsize": 8},
)
NPY_HEADERS = (
    *(b"", b"{", b"(" * 3000, b"-" * 3000 + b"1", b"[" * 90, b"{}", b"__import__('os')", b"\xff\xfe"),
    b"{'shape': (" + b"1" * 3900 + b"), }",
    b"{'descr': '<f8', 'fortran_order': False, 'shape': (" + b"1" * 3900 + b" }",
)
