"""Files in which one part is repeated many times: bytes, lines, or an entry of the content."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from fuzz.mutations import MAX_BYTES, STRUCTURED_SHARE, Rng, glb_parts, key_in, mutated, tried, with_json

MAX_UNPACKED_BYTES = 1 << 26  # of an array that is repeated
REPEATS = (10, 10**6)  # of a part
REPEATED_BYTES = (1, 4096)  # of a part that is repeated as bytes
MOST_KEYS = (
    10_000  # of an object: dictionaries of many more are slow by themselves, out of the processor's cache
)


@dataclass(frozen=True)
class Repeated:
    """A file in which one part is repeated."""

    times: int
    make: Callable[[int], bytes] = field(compare=False)  # the file with the part that many times


def repeated(kind: str, seeds: Sequence[bytes], rng: Rng) -> Repeated:
    """A seed, untouched or changed, with a part many times: bytes, lines, or an entry of its content."""
    data = seeds[rng.integers(len(seeds))] if rng.random() < 0.7 else mutated(kind, seeds, rng)
    make = _repeated_bytes(data, rng)
    if kind in _REPEATED and rng.random() < STRUCTURED_SHARE:
        make = tried(_REPEATED[kind], data, rng) or make
    part_bytes = max(1, (len(make(11)) - len(make(1))) // 10)
    times = round(10 ** rng.uniform(*np.log10(REPEATS)))
    return Repeated(max(REPEATS[0], min(times, MAX_BYTES // part_bytes)), make)


def _repeated_bytes(data: bytes, rng: Rng) -> Callable[[int], bytes]:
    """Any bytes, or whole lines."""
    start = int(rng.integers(len(data) + 1))
    stop = min(len(data), start + round(10 ** rng.uniform(*np.log10(REPEATED_BYTES))))
    if rng.random() < 0.5:
        start = data.rfind(b"\n", 0, start) + 1
        stop = data.find(b"\n", stop) + 1 or len(data)
    part = data[start:stop] or b"\n"
    return lambda n: data[:start] + part * n + data[stop:]


def _repeated_json(data: bytes, rng: Rng) -> Callable[[int], bytes]:
    """An entry of a list somewhere in the content, or of an object under names of its own."""
    holders = [holder for holder in _holders(json.loads(data)) if holder]
    at = int(rng.integers(len(holders)))
    key = key_in(holders[at], rng)

    def make(n: int) -> bytes:
        content = json.loads(data)
        holder = [holder for holder in _holders(content) if holder][at]
        if isinstance(holder, dict):
            holder.update({f"{key}{i}": holder[key] for i in range(min(n, MOST_KEYS) - 1)})
        else:
            holder[key : key + 1] = [holder[key]] * n
        return json.dumps(content).encode()

    return make


def _holders(content: Any) -> list[Any]:
    """All lists and objects in a content, itself included."""
    found, i = [content] if isinstance(content, dict | list) else [], 0
    while i < len(found):
        entries = found[i].values() if isinstance(found[i], dict) else found[i]
        found += [entry for entry in entries if isinstance(entry, dict | list)]
        i += 1
    return found


def _repeated_glb(data: bytes, rng: Rng) -> Callable[[int], bytes]:
    text, _ = glb_parts(data)
    make = _repeated_json(text, rng)
    return lambda n: with_json(data, make(n))


def _repeated_npz(data: bytes, rng: Rng) -> Callable[[int], bytes]:
    """An array's entries along its first axis."""
    with np.load(io.BytesIO(data), allow_pickle=False) as archive:
        arrays = dict(archive)
    name = list(arrays)[rng.integers(len(arrays))]
    most = max(1, MAX_UNPACKED_BYTES // max(1, arrays[name].nbytes))

    def make(n: int) -> bytes:
        packed = io.BytesIO()
        array = np.concatenate([np.atleast_1d(arrays[name])] * min(n, most))
        np.savez(packed, **arrays | {name: array})
        return packed.getvalue()

    return make


_REPEATED: dict[str, Callable[[bytes, Rng], Callable[[int], bytes]]] = {
    "json": _repeated_json,
    "glb": _repeated_glb,
    "npz": _repeated_npz,
}
