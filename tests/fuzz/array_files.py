"""Files with pickles or arrays in them, made part by part: pickles, NPY and NPZ."""

from __future__ import annotations

import io
import math
import struct
import zipfile
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from fuzz.mutations import Rng
from fuzz.odd_parts import KINDS, NPY_HEADERS, NUMBERS, SHAPES
from fuzz.pickle_programs import Program

ODD = (0.0, 0.005, 0.02, 0.1)  # the share of parts that are not as programs write them, of one file
N_FRAMES = 20
LAYOUTS: tuple[dict[str, tuple[int, ...]], ...] = (
    {"smpl_poses": (N_FRAMES, 72), "smpl_trans": (N_FRAMES, 3), "smpl_scaling": (1,)},
    {"smpl_poses": (N_FRAMES, 72), "smpl_trans": (N_FRAMES, 3)},
    {"pred_position": (N_FRAMES, 72)},
    {"full_pose": (N_FRAMES, 24, 3)},
    {"other": (3,)},
)
NPY_SHAPES = ((N_FRAMES, 72), (N_FRAMES, 24, 3), (N_FRAMES, 139), (N_FRAMES, 225), (1, 72))


def content_of(text: str, shape: Any, odd: float, rng: Rng) -> bytes:
    """Bytes of an array, mostly as many as it has."""
    try:
        size = int(np.dtype(text.replace("O", "V")).itemsize * math.prod(shape))
    except Exception:  # noqa: BLE001  # no dtype, or no shape
        size = 8
    if rng.random() < odd:
        size += int(rng.choice((-1, 1, 7, 8, -8)))
    size = size if 0 <= size < 1 << 20 else 64
    if text == "f8" and rng.random() < 0.7:
        return rng.normal(size=size // 8 + 1).tobytes()[:size]
    pattern = (b"\0\0", b"\xff\xff", b"\x01\0", b"\x7f\x3f")[rng.integers(4)]
    return (pattern * (size // 2 + 1))[:size]


def _kind(odd: float, rng: Rng) -> str:
    if rng.random() < 2 * odd:
        return KINDS[rng.integers(len(KINDS))]
    return "f8" if rng.random() < 0.5 else str(rng.choice(NUMBERS))


def pickle_program(rng: Rng) -> bytes:
    """A pickle: a dictionary of arrays, or another value, or an array of one object."""
    odd = float(rng.choice(ODD))
    program = Program(rng, odd)
    content: dict[str, Callable[[], None]] = {}
    for name, shape in LAYOUTS[rng.integers(len(LAYOUTS))].items():
        text = _kind(odd, rng)
        content[name] = partial(program.array, text, shape, content_of(text, shape, odd, rng))
    way = rng.random()
    if way < 0.7:
        program.part(content)
    elif way < 0.85:
        program.array("O", (), [content])
    else:
        program.odd_value()
    data = program.finished(int(rng.integers(6)) if rng.random() >= odd else int(rng.integers(256)))
    return data[: rng.integers(len(data) + 1)] if rng.random() < odd else data


def npy_program(rng: Rng, shapes: Sequence[Any] = NPY_SHAPES) -> bytes:
    """An NPY file: a header, each part of which may be another, and bytes or a pickle."""
    odd = float(rng.choice(ODD))
    text, shape = _kind(odd, rng), shapes[rng.integers(len(shapes))]
    if rng.random() < 0.3 and shapes is NPY_SHAPES:
        text, shape = "O", ()
    if rng.random() < odd:
        shape = SHAPES[rng.integers(len(SHAPES))]
    content = pickle_program(rng) if "O" in text and rng.random() < 0.9 else content_of(text, shape, odd, rng)
    orders = ("<", "|", ">", "=", "") if rng.random() < odd else ("<", "<", "<", ">")
    order = orders[rng.integers(len(orders))] if text[:1] not in "bO" else "|"
    descr: Any = order + text
    if rng.random() < odd:
        others = ([("a", text)], (text, (3, 4)), {"names": ["a"], "formats": ["O"]}, 1, "x" * 4000)
        descr = others[rng.integers(len(others))]
    header: Any = {"descr": descr, "fortran_order": bool(rng.random() < 0.3), "shape": shape}
    if rng.random() < odd:
        header[("fortran_order", "shape")[rng.integers(2)]] = (None, 1, "x", [], (), 1 << 70)[rng.integers(6)]
    written = repr(header).encode("utf-8", "replace") + b"\n"
    if rng.random() < odd:
        headers = (*NPY_HEADERS, written * 9, written.replace(b"(", b"(1,"))
        written = headers[rng.integers(len(headers))]
    version = int(rng.choice((0, 3, 4, 255))) if rng.random() < odd else int(rng.integers(1, 3))
    n_bytes = len(written) if rng.random() >= odd / 2 else int(rng.integers(1 << 16))
    size = struct.pack("<H", n_bytes % (1 << 16)) if version == 1 else struct.pack("<I", n_bytes)
    data = b"\x93NUMPY" + bytes((version, 0)) + size + written + content
    return data[: rng.integers(len(data) + 1)] if rng.random() < odd else data


def npz_program(good: Sequence[bytes], rng: Rng) -> bytes:
    """An NPZ file of good arrays, some of which are other ones, packed in any way."""
    with zipfile.ZipFile(io.BytesIO(good[rng.integers(len(good))])) as archive:
        members = {info.filename: archive.read(info) for info in archive.infolist()}
    for name in rng.choice(list(members), size=rng.integers(1, 3), replace=False):
        shape = np.load(io.BytesIO(members[str(name)])).shape
        members[str(name)] = npy_program(rng, [shape]) if rng.random() < 0.9 else pickle_program(rng)
    packed = io.BytesIO()
    ways = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA)
    with zipfile.ZipFile(packed, "w", ways[rng.integers(4 if rng.random() < 0.1 else 2)]) as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    data = bytearray(packed.getvalue())
    if rng.random() < 0.1:
        at = data.find(b"PK\x01\x02")
        data[at + 6 + rng.integers(22)] = rng.integers(256)
    return bytes(data)
