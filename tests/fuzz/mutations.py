"""Changes of good files: of their bytes, and of what is in them, for the formats that check their bytes."""

from __future__ import annotations

import copy
import io
import json
import re
import struct
import zipfile
from collections.abc import Callable, Sequence
from typing import Any

import h5py
import numpy as np

Rng = np.random.Generator

MAX_STEPS = 4  # changes of one file
MAX_BYTES = 1 << 22
LONGEST_DIGITS = 5000
STRUCTURED_SHARE = 0.6  # of changes, where a format has a structure
INTEGERS = (
    0,
    1,
    -1,
    2,
    127,
    255,
    256,
    65_535,
    1 << 31,
    (1 << 31) - 1,
    -(1 << 31),
    (1 << 63) - 1,
    10**18,
    10**9,
)
NUMBERS: tuple[Any, ...] = (
    *INTEGERS,
    0.5,
    -0.0,
    1e-9,
    1e-3,
    1e30,
    -1e9,
    1e308,
    float("nan"),
    float("inf"),
    10**400,
)
TEXTS = (
    "",
    " ",
    "\0",
    "nan",
    "1e999",
    "-1",
    "0",
    "../../etc/passwd",
    "/dev/zero",
    "é\u202e",
    "x" * 5000,
    "=1+1",
    '"',
    "\n",
)
CELLS = (*TEXTS, "1e-300", "1e300", "-1e9", "0x10", "1_0", "٣", "12", "13", "0.0", "true", ",,,")


def mutated(kind: str, seeds: Sequence[bytes], rng: Rng) -> bytes:
    """A seed after one to `MAX_STEPS` changes."""
    data = seeds[rng.integers(len(seeds))]
    structured = _STRUCTURED.get(kind)
    for _ in range(rng.integers(1, MAX_STEPS + 1)):
        if structured is not None and rng.random() < STRUCTURED_SHARE:
            data = tried(structured, data, rng) or data
        else:
            data = _BYTES[rng.integers(len(_BYTES))](data, seeds, rng)
    return data[:MAX_BYTES]


def tried(structured: Callable[[bytes, Rng], Any], data: bytes, rng: Rng) -> Any:
    """The structured change of a file; None where it is damaged already and has no structure to change."""
    try:
        return structured(data, rng)
    except Exception:  # noqa: BLE001  # whatever the format's own library raises
        return None


def _flip(data: bytes, seeds: Sequence[bytes], rng: Rng) -> bytes:
    changed = bytearray(data)
    for _ in range(rng.integers(1, 9) if data else 0):
        changed[rng.integers(len(changed))] ^= 1 << rng.integers(8)
    return bytes(changed)


def _overwrite(data: bytes, seeds: Sequence[bytes], rng: Rng) -> bytes:
    """An integer of 1 to 8 bytes that is at the edge of something."""
    size = int(rng.choice((1, 2, 4, 8)))
    value = INTEGERS[rng.integers(len(INTEGERS))] % (1 << (8 * size))
    at = int(rng.integers(len(data) + 1))
    return data[:at] + value.to_bytes(size, "little" if rng.random() < 0.8 else "big") + data[at + size :]


def _truncate(data: bytes, seeds: Sequence[bytes], rng: Rng) -> bytes:
    return data[: rng.integers(len(data) + 1)]


def _block(data: bytes, seeds: Sequence[bytes], rng: Rng) -> bytes:
    """A block taken out, doubled, zeroed or moved."""
    start, stop = sorted(rng.integers(len(data) + 1, size=2).tolist())
    stop = min(stop, start + 4096)
    block = data[start:stop]
    other = (b"", block * 2, bytes(len(block)), block[::-1])[rng.integers(4)]
    return data[:start] + other + data[stop:]


def _splice(data: bytes, seeds: Sequence[bytes], rng: Rng) -> bytes:
    other = seeds[rng.integers(len(seeds))]
    return data[: rng.integers(len(data) + 1)] + other[rng.integers(len(other) + 1) :]


def _join(data: bytes, seeds: Sequence[bytes], rng: Rng) -> bytes:
    """Two whole files, one after the other."""
    return data + seeds[rng.integers(len(seeds))]


def _lengthen_digits(data: bytes, seeds: Sequence[bytes], rng: Rng) -> bytes:
    """A run of digits made longer."""
    runs = list(_DIGITS.finditer(data))
    if not runs:
        return data
    run = runs[rng.integers(len(runs))]
    more = rng.integers(10, size=round(10 ** rng.uniform(0, np.log10(LONGEST_DIGITS))))
    return data[: run.end()] + bytes(b"0123456789"[digit] for digit in more) + data[run.end() :]


_DIGITS = re.compile(rb"\d+")
_BYTES = (_flip, _overwrite, _truncate, _block, _splice, _join, _lengthen_digits)


def _json(data: bytes, rng: Rng) -> bytes:
    content = json.loads(data)
    if isinstance(content, dict | list) and content:
        _change_within(content, rng)
    text = json.dumps(_value(rng) if rng.random() < 0.02 else content)
    if rng.random() < 0.02:
        text = "[" * 50_000 + text
    return text.encode()


def _change_within(content: Any, rng: Rng) -> None:
    """One entry somewhere in lists and objects replaced, left out, doubled or renamed."""
    holder = content
    key = key_in(holder, rng)
    while isinstance(holder[key], dict | list) and holder[key] and rng.random() < 0.85:
        holder = holder[key]
        key = key_in(holder, rng)
    change = rng.random()
    if change < 0.6:
        holder[key] = _value(rng)
    elif change < 0.75:
        del holder[key]
    elif change < 0.85 and isinstance(holder, list):
        holder.extend(copy.deepcopy(holder[key]) for _ in range(rng.integers(1, 200)))
    elif isinstance(holder, dict):
        holder[TEXTS[rng.integers(len(TEXTS))]] = holder[key]
    else:
        holder[key] = [holder[key]]


def key_in(holder: Any, rng: Rng) -> Any:
    at = int(rng.integers(len(holder)))
    return list(holder)[at] if isinstance(holder, dict) else at


def _value(rng: Rng) -> Any:
    values = (*NUMBERS, *TEXTS, None, True, False, [], {}, [[]], {"a": 1}, [0] * 50, [1, 2, 3])
    return copy.deepcopy(values[rng.integers(len(values))])


def _table(data: bytes, rng: Rng) -> bytes:
    """A cell of a table replaced, a row or a column left out or doubled, or a cell without end."""
    rows = [row.split(",") for row in data.decode("utf-8", "replace").split("\n")]
    row = rows[rng.integers(len(rows))]
    column = int(rng.integers(len(row)))
    change = rng.random()
    if change < 0.6:
        row[column] = CELLS[rng.integers(len(CELLS))]
    elif change < 0.7:
        rows.remove(row)
    elif change < 0.8:
        rows.extend([row] * int(rng.integers(1, 1000)))
    elif change < 0.9:
        row.insert(column, row[column])
    else:
        row[column] = "x" * 200_000 if rng.random() < 0.5 else '"' + row[column]
    return "\n".join(",".join(cells) for cells in rows).encode("utf-8", "replace")


_TOKEN = re.compile(r"[\w.+-]+")


def _words(data: bytes, rng: Rng) -> bytes:
    """A word or number of a text replaced, left out, doubled or moved."""
    text = data.decode("utf-8", "replace")
    tokens = list(_TOKEN.finditer(text))
    if not tokens:
        return data
    token, other = (tokens[rng.integers(len(tokens))] for _ in range(2))
    choices = (
        CELLS[rng.integers(len(CELLS))],
        str(NUMBERS[rng.integers(len(NUMBERS))]),
        "",
        token[0] * 2,
        other[0],
    )
    return (text[: token.start()] + choices[rng.integers(len(choices))] + text[token.end() :]).encode(
        "utf-8", "replace"
    )


def _glb(data: bytes, rng: Rng) -> bytes:
    """Its JSON changed, and its lengths made right."""
    text, _ = glb_parts(data)
    return with_json(data, _json(text, rng))


def glb_parts(data: bytes) -> tuple[bytes, bytes]:
    """The JSON of a GLB, and what follows it."""
    length = int.from_bytes(data[12:16], "little")
    return data[20 : 20 + length].rstrip(), data[20 + length :]


def with_json(data: bytes, text: bytes) -> bytes:
    _, rest = glb_parts(data)
    text += b" " * (-len(text) % 4)
    size = 20 + len(text) + len(rest)
    return data[:8] + struct.pack("<III", size & 0xFFFFFFFF, len(text), 0x4E4F534A) + text + rest


def _npz(data: bytes, rng: Rng) -> bytes:
    """An array replaced by one of another shape, dtype or value, or its header made up."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = {info.filename: archive.read(info) for info in archive.infolist()}
    name = list(members)[rng.integers(len(members))]
    array = np.load(io.BytesIO(members[name]), allow_pickle=False)
    if rng.random() < 0.3:
        shape = str(tuple(int(n) for n in rng.choice((0, 1, 3, 24, 10**6, 10**12), size=rng.integers(4))))
        kind = str(rng.choice(("<f8", "|O", "<M8[s]", "|V1000000", "<U5", ">i2", "<c16", "[('a','<f8')]")))
        header = f"{{'descr': {kind!r}, 'fortran_order': False, 'shape': {shape}, }}\n".encode()
        members[name] = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header + members[name][-64:]
    else:
        content = io.BytesIO()
        np.save(content, _changed_array(array, rng), allow_pickle=False)
        members[name] = content.getvalue()
    packed = io.BytesIO()
    with zipfile.ZipFile(
        packed, "w", zipfile.ZIP_DEFLATED if rng.random() < 0.5 else zipfile.ZIP_STORED
    ) as archive:
        for member, content_bytes in members.items():
            archive.writestr(member, content_bytes)
    return packed.getvalue()


def _changed_array(array: np.ndarray, rng: Rng) -> np.ndarray:
    change = rng.random()
    if change < 0.5 and array.size and array.dtype.kind in "iuf":
        changed = array.astype(np.float64) if rng.random() < 0.5 else array.copy()
        value = NUMBERS[rng.integers(len(NUMBERS) - 1)]
        at = rng.integers(changed.size, size=1 + int(rng.random() < 0.2) * changed.size)
        with np.errstate(all="ignore"):
            changed.reshape(-1)[at] = np.array(value, np.float64).astype(changed.dtype)
        return changed
    if change < 0.7:
        return array[: rng.integers(len(array) + 1)] if array.ndim else array[None]
    if change < 0.72:
        return np.zeros((200_000, *array.shape[1:]), array.dtype) if array.ndim else array
    return array.astype(str(rng.choice(("f2", "f8", "i8", "U8", "c16", "?"))))


def _hdf5(data: bytes, rng: Rng) -> bytes:
    """A dataset or attribute replaced, left out, linked elsewhere or changed in some values."""
    content = io.BytesIO(data)
    with h5py.File(content, "a") as file:
        names: list[str] = []
        file.visit(names.append)
        _change_object(file, names[rng.integers(len(names))], rng)
    return content.getvalue()


def _change_object(file: h5py.File, name: str, rng: Rng) -> None:
    item = file[name]
    change = rng.random()
    if change < 0.2:
        owner = item if rng.random() < 0.5 and len(item.attrs) else file
        key = list(owner.attrs)[rng.integers(len(owner.attrs))]
        values = (
            *NUMBERS[:-1],
            *(text for text in TEXTS if "\0" not in text),
            [1, 2],
            h5py.Empty("f"),
            "{}",
            "[]",
        )
        owner.attrs[key] = values[rng.integers(len(values))]
    elif change < 0.6 and isinstance(item, h5py.Dataset) and item.dtype.kind in "iuf" and item.size:
        array = item[()]
        item[...] = _changed_array(np.asarray(array), rng).reshape(array.shape)
    elif change < 0.8 and isinstance(item, h5py.Dataset):
        array = np.asarray(item[()])
        del file[name]
        file[name] = _changed_array(array, rng) if array.dtype.kind in "iuf" else np.zeros(array.shape)
    else:
        del file[name]
        links = (h5py.SoftLink("/" + name), h5py.ExternalLink("x.h5", "/"), h5py.SoftLink("/takes"), None)
        link = links[rng.integers(len(links))]
        if link is not None:
            file[name] = link


_STRUCTURED: dict[str, Callable[[bytes, Rng], bytes]] = {
    "json": _json,
    "table": _table,
    "words": _words,
    "glb": _glb,
    "npz": _npz,
    "hdf5": _hdf5,
}
