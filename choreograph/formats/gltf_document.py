"""A glTF 2.0 document in memory, and the schema of its JSON."""

from __future__ import annotations

import copy
import json
import struct
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.core.errors import FormatError

# The schema of the parts of a document that are read. It is checked once, before anything is read.
#
# A schema is a function that tests a value, a dictionary of the schemas of optional fields, a list with the
# one schema of all entries, or `{...: schema}` for objects with any keys.


MAX_ENTRIES = 100_000  # of a list, such as nodes or channels. A character has some hundreds
_LARGEST_INDEX = 1 << 53
_LARGEST_FLOAT = 1e39  # above what 32 bits hold
_LARGEST_NUMBER = 1e12  # of transforms, in any unit: sizes and products of a few stay finite


def is_whole(value: Any) -> bool:
    """Whether a value is a whole number. VRM 0 has -1 for a missing bone."""
    return type(value) is int and abs(value) < _LARGEST_INDEX


def is_index(value: Any) -> bool:
    """Whether a value is a whole number of 0 or more."""
    return is_whole(value) and value >= 0


def is_number(value: Any) -> bool:
    """Whether a value is a number in the range of geometry."""
    return type(value) in (int, float) and abs(value) < _LARGEST_NUMBER


def is_text(value: Any) -> bool:
    """Whether a value is text without lone surrogates, which can be written again."""
    return isinstance(value, str) and (
        value.isascii() or not any("\ud800" <= letter <= "\udfff" for letter in value)
    )


def _numbers(count: int) -> Any:
    return lambda value: isinstance(value, list) and len(value) == count and all(map(is_number, value))


def _is_bound(value: Any) -> bool:
    """Whether a value is a bound of an accessor. Some programs write the greatest float."""
    return isinstance(value, list) and all(type(x) in (int, float) and abs(x) < _LARGEST_FLOAT for x in value)


_HUMANOID = {"humanoid": {"humanBones": {...: {"node": is_whole}}}}
_SPARSE_PART = {"bufferView": is_index, "byteOffset": is_index, "componentType": is_index}
_DOCUMENT: dict[Any, Any] = {
    "nodes": [
        {
            "name": is_text, "children": [is_index], "mesh": is_index, "skin": is_index,
            "translation": _numbers(3), "rotation": _numbers(4), "scale": _numbers(3), "matrix": _numbers(16),
        }
    ],
    "skins": [{"joints": [is_index], "inverseBindMatrices": is_index}],
    "meshes": [{"primitives": [{"attributes": {...: is_index}}]}],
    "animations": [
        {
            "name": is_text,
            "channels": [{"sampler": is_index, "target": {"node": is_index, "path": is_text}}],
            "samplers": [{"input": is_index, "output": is_index, "interpolation": is_text}],
        }
    ],
    "accessors": [
        {
            "bufferView": is_index, "byteOffset": is_index, "componentType": is_index, "count": is_index,
            "type": is_text, "min": _is_bound, "max": _is_bound,
            "sparse": {"count": is_index, "indices": _SPARSE_PART, "values": _SPARSE_PART},
        }
    ],
    "bufferViews": [
        {
            "buffer": is_index, "byteOffset": is_index, "byteLength": is_index, "byteStride": is_index,
            "extensions": {...: {"buffer": is_index, "byteOffset": is_index}},
        }
    ],
    "buffers": [{"uri": is_text}],
    "images": [{"uri": is_text}],
    "scenes": [{}],
    "extensions": {
        "VRMC_vrm": _HUMANOID,
        "VRMC_vrm_animation": _HUMANOID,
        "VRM": {"humanoid": {"humanBones": [{"bone": is_text, "node": is_whole}]}},
    },
}  # fmt: skip


def misfit(data: Any) -> str:
    """The first place where a document does not match the schema, such as "nodes[3].children", or ""."""
    return _misfit(data, _DOCUMENT).strip(".")


def _misfit(value: Any, shape: Any) -> str:
    """The first place in a value that does not match, beginning with "." or "[", or "." for the value."""
    if isinstance(shape, dict):
        return _misfit_of_fields(value, shape)
    if isinstance(shape, list):
        return _misfit_of_entries(value, shape[0])
    return "" if shape(value) else "."


def _misfit_of_fields(value: Any, shape: dict[Any, Any]) -> str:
    if not isinstance(value, dict):
        return "."
    of_all = shape.get(...)
    for name in value if of_all is not None else shape:
        if name in value:
            where = _misfit(value[name], shape[name] if of_all is None else of_all)
            if where:
                printable = ascii(name)[1:-1][:40]
                return f".{printable}{where}".rstrip(".")
    return ""


def _misfit_of_entries(value: Any, shape: Any) -> str:
    if not isinstance(value, list) or len(value) > MAX_ENTRIES:
        return "."
    for index, entry in enumerate(value):
        where = _misfit(entry, shape)
        if where:
            return f"[{index}]{where}".rstrip(".")
    return ""


# The document: its JSON, and one binary buffer with its arrays.


_TYPE_OF_COMPONENT: dict[int, np.dtype[Any]] = {
    5120: np.dtype("<i1"), 5121: np.dtype("<u1"), 5122: np.dtype("<i2"), 5123: np.dtype("<u2"),
    5125: np.dtype("<u4"), 5126: np.dtype("<f4"),
}  # fmt: skip
_GREATEST = {5120: 127.0, 5121: 255.0, 5122: 32767.0, 5123: 65535.0}  # of normalised integers
_COMPONENT_OF_TYPE = {dtype: component for component, dtype in _TYPE_OF_COMPONENT.items()}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_VECTORS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
_ALIGNMENT = 4  # bytes
_MAX_VALUES = 1 << 26  # of an accessor
_FREE_VALUES = 1 << 20  # that accessors may have beyond a value for each byte of the buffer
VERTICES, INDICES = 34962, 34963  # targets of a view, as numbered by OpenGL
GLB_MAGIC, GLB_VERSION, JSON_CHUNK, BINARY_CHUNK = 0x46546C67, 2, 0x4E4F534A, 0x004E4942


class GltfDocument:
    """A document. `json` can be edited in place, `accessor` adds an array, and `array` reads one."""

    def __init__(
        self, data: dict[str, Any], binary: bytes | bytearray = b"", name: str = "a new document"
    ) -> None:
        self.json = data
        self.name = name  # for errors
        self._binary = binary if isinstance(binary, bytearray) else bytearray(binary)

    @classmethod
    def empty(cls, generator: str) -> GltfDocument:
        """An empty document."""
        return cls({"asset": {"version": "2.0", "generator": generator}})

    @property
    def n_bytes(self) -> int:
        """Size of the binary buffer."""
        return len(self._binary)

    @property
    def n_plausible_values(self) -> int:
        """The number of values that accessors may have in total. More would share bytes of the buffer."""
        return _FREE_VALUES + len(self._binary)

    def copy(self) -> GltfDocument:
        """A deep copy of the document."""
        return GltfDocument(copy.deepcopy(self.json), bytearray(self._binary), self.name)

    def entry(self, kind: str, index: int | None) -> dict[str, Any]:
        """Entry `index` of the list `kind`, such as "nodes". Raises `FormatError` if there is none."""
        entries = self.json.get(kind, [])
        if index is None or not 0 <= index < len(entries):
            raise FormatError(f"{self.name}: expected {kind}[{index}], got none: the file is damaged")
        entry: dict[str, Any] = entries[index]
        return entry

    def add(self, kind: str, entry: dict[str, Any]) -> int:
        """Add an entry to the list `kind`, such as "nodes". Return its index."""
        entries = self.json.setdefault(kind, [])
        entries.append(entry)
        return len(entries) - 1

    def view(self, data: bytes, **properties: Any) -> int:
        """Add bytes. Return the index of the buffer view."""
        self._binary += bytes(-len(self._binary) % _ALIGNMENT)
        entry = {"buffer": 0, "byteOffset": len(self._binary), "byteLength": len(data), **properties}
        self._binary += data
        return self.add("bufferViews", entry)

    def accessor(self, rows: NDArray[Any], *, target: int | None = None, bounds: bool = False) -> int:
        """Add an array (N,) or (N, D) of a type in glTF. Return the index of the accessor.

        `bounds` adds the least and greatest values, which the format requires of positions and key times.
        """
        rows = np.ascontiguousarray(rows)
        dtype = rows.dtype.newbyteorder("<")
        view = self.view(rows.astype(dtype).tobytes(), **({} if target is None else {"target": target}))
        entry: dict[str, Any] = {
            "bufferView": view, "componentType": _COMPONENT_OF_TYPE[dtype], "count": len(rows),
            "type": _VECTORS[1 if rows.ndim == 1 else rows.shape[1]],
        }  # fmt: skip
        if bounds:
            entry["min"] = np.atleast_1d(rows.min(axis=0)).tolist()
            entry["max"] = np.atleast_1d(rows.max(axis=0)).tolist()
        return self.add("accessors", entry)

    def add_animation(
        self, name: str, times_s: NDArray[np.float64], tracks: Iterable[tuple[int, str, NDArray[np.float64]]]
    ) -> None:
        """Add an animation with keys at times (T,), and tracks of node, property and values.

        The property is "rotation" with quaternions (T, 4) `wxyz`, or "translation" with positions (T, 3).
        """
        times = self.accessor(times_s.astype(np.float32), bounds=True)
        samplers: list[dict[str, Any]] = []
        channels: list[dict[str, Any]] = []
        for node, path, values in tracks:
            channels.append({"sampler": len(samplers), "target": {"node": node, "path": path}})
            stored = np.roll(values, -1, axis=-1) if path == "rotation" else values  # as `xyzw`
            output = self.accessor(stored.astype(np.float32))
            samplers.append({"input": times, "output": output, "interpolation": "LINEAR"})
        self.add("animations", {"name": name, "samplers": samplers, "channels": channels})

    def extend_animation(
        self, times_s: NDArray[np.float64], tracks: Iterable[tuple[int, str, NDArray[np.float64]]]
    ) -> None:
        """Add tracks with other times to the last animation, as `add_animation` has them."""
        self.add_animation("", times_s, tracks)
        added, extended = self.json["animations"].pop(), self.json["animations"][-1]
        first = len(extended["samplers"])
        extended["samplers"] += added["samplers"]
        extended["channels"] += [{**each, "sampler": first + each["sampler"]} for each in added["channels"]]

    def array(self, index: int | None, *, most: int = _MAX_VALUES) -> NDArray[np.float64]:
        """The values of an accessor as floats, (N,) for scalars, else (N, D). Normalised integers are scaled.

        Rows after the first `most` are left out. Raises `FormatError` if the accessor is not within the file,
        or has over 2²⁶ values.
        """
        entry = self.entry("accessors", index)
        component, kind, count = entry.get("componentType"), entry.get("type", ""), entry.get("count", 0)
        if component not in _TYPE_OF_COMPONENT or kind not in _WIDTHS:
            raise FormatError(
                f"{self.name}: expected an accessor of a known type, got {component}, {kind:.9}"
            )
        width = _WIDTHS[kind]
        if not 1 <= count <= _MAX_VALUES // width:
            raise FormatError(f"{self.name}: expected 1 to {_MAX_VALUES} values of an accessor, got others")
        if "bufferView" in entry:
            rows = self._rows(entry, component, count, width)
        else:
            rows = np.zeros((count, width), _TYPE_OF_COMPONENT[component])
        if "sparse" in entry:
            rows = self._with_sparse(rows, entry["sparse"], component)
        with np.errstate(invalid="ignore"):  # of NaN
            values = _divided(entry, rows[:most].astype(np.float64))
        return values[:, 0] if width == 1 else values

    def n_values(self, index: int | None) -> int:
        """The number of values in an accessor."""
        entry = self.entry("accessors", index)
        count: int = entry.get("count", 0)
        return count * _WIDTHS.get(entry.get("type", ""), 1)

    def bounds(self, index: int | None) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The least and greatest values (D,) in an accessor, (0,) if they are not stated."""
        entry = self.entry("accessors", index)
        low, high = (_divided(entry, np.array(entry.get(end, []), np.float64)) for end in ("min", "max"))
        return low, high

    def _rows(self, entry: dict[str, Any], component: int, count: int, width: int) -> NDArray[Any]:
        """The stored numbers (N, D) of an accessor, or of a part of a sparse one."""
        dtype = _TYPE_OF_COMPONENT[component]
        view = self.entry("bufferViews", entry.get("bufferView"))
        start = view.get("byteOffset", 0) + entry.get("byteOffset", 0)
        stride = view.get("byteStride") or dtype.itemsize * width
        if start + stride * (count - 1) + dtype.itemsize * width > len(self._binary):
            raise FormatError(
                f"{self.name}: expected {count} values of an accessor, got fewer: the file is cut off"
            )
        return np.ndarray((count, width), dtype, self._binary, start, (stride, dtype.itemsize))

    def _with_sparse(self, rows: NDArray[Any], sparse: dict[str, Any], component: int) -> NDArray[Any]:
        """The numbers (N, D) with the rows of a sparse accessor replaced."""
        indices, values, count = sparse.get("indices", {}), sparse.get("values", {}), sparse.get("count", 0)
        kind = indices.get("componentType")
        if not 1 <= count <= len(rows) or kind not in (5121, 5123, 5125):
            raise FormatError(f"{self.name}: expected rows of a sparse accessor, got {count}: damaged")
        places = self._rows(indices, kind, count, 1)[:, 0]
        if places.max() >= len(rows):
            raise FormatError(f"{self.name}: expected sparse values within an accessor: damaged")
        rows = rows.copy()
        rows[places] = self._rows(values, component, count, rows.shape[1])
        return rows

    def to_glb(self) -> bytes:
        """The document as one binary file."""
        binary = bytes(self._binary) + bytes(-len(self._binary) % _ALIGNMENT)
        whole = {**self.json, "buffers": [{"byteLength": len(binary)}]}
        text = json.dumps(whole, separators=(",", ":"), ensure_ascii=False).encode("utf-8", "replace")
        text += b" " * (-len(text) % _ALIGNMENT)
        chunks = struct.pack("<II", len(text), JSON_CHUNK) + text
        chunks += struct.pack("<II", len(binary), BINARY_CHUNK) + binary
        return struct.pack("<III", GLB_MAGIC, GLB_VERSION, 12 + len(chunks)) + chunks


def _divided(entry: dict[str, Any], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values of an accessor, divided if they are normalised integers."""
    greatest = _GREATEST.get(entry.get("componentType", 0))
    return np.maximum(values / greatest, -1.0) if entry.get("normalized") and greatest else values
