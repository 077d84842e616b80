"""A glTF 2.0 document: the schema of its JSON, its binary buffer, its files, and counts in its animations.

`read_gltf` reads `.glb` and `.vrm` in one piece, and `.gltf` with its buffers and images beside it. All data
is copied into one buffer, as in a GLB. Data that is referred to several times is copied once. Files may be
damaged or malicious: sizes are checked before anything is read, and references to files outside of the folder
or on the network are refused. Required extensions that compress animations or bind matrices are refused.
Draco is not, because it compresses only meshes.

The results of `count` are the entry `choreograph_counts` of the `extras` of an animation, with the fields
that the JSON of `count` has. Times are those of the keys.
"""

from __future__ import annotations

import base64
import binascii
import copy
import json
import struct
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from choreograph.core.counts import ANNOTATED, DATA_SET, NO_COUNTS, Counts, Figure, make_counts
from choreograph.core.errors import FormatError, ParameterError
from choreograph.core.files import BUDGETS, without_garbage_collection
from choreograph.core.numerics import Floats

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
        if not isinstance(value, dict):
            return "."
        of_all = shape.get(...)
        for name in value if of_all is not None else shape:
            if name in value and (where := _misfit(value[name], shape.get(name, of_all))):
                return f".{ascii(name)[1:-1][:40]}{where}".rstrip(".")
        return ""
    if isinstance(shape, list):
        if not isinstance(value, list) or len(value) > MAX_ENTRIES:
            return "."
        for index, entry in enumerate(value):
            if where := _misfit(entry, shape[0]):
                return f"[{index}]{where}".rstrip(".")
        return ""
    return "" if shape(value) else "."


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
        return entries[index]

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

    def add_animation(self, name: str, times_s: Floats, tracks: Iterable[tuple[int, str, Floats]]) -> None:
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

    def extend_animation(self, times_s: Floats, tracks: Iterable[tuple[int, str, Floats]]) -> None:
        """Add tracks with other times to the last animation, as `add_animation` has them."""
        self.add_animation("", times_s, tracks)
        added, extended = self.json["animations"].pop(), self.json["animations"][-1]
        first = len(extended["samplers"])
        extended["samplers"] += added["samplers"]
        extended["channels"] += [{**each, "sampler": first + each["sampler"]} for each in added["channels"]]

    def array(self, index: int | None, *, most: int = _MAX_VALUES) -> Floats:
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

    def bounds(self, index: int | None) -> tuple[Floats, Floats]:
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


def _divided(entry: dict[str, Any], values: Floats) -> Floats:
    """Values of an accessor, divided if they are normalised integers."""
    greatest = _GREATEST.get(entry.get("componentType", 0))
    return np.maximum(values / greatest, -1.0) if entry.get("normalized") and greatest else values


# Reading of files.


MAX_BYTES = BUDGETS["gltf"].file_bytes
MAX_JSON_BYTES = 64 << 20
_MAX_OBJECTS = 2_000_000  # in the JSON. Python needs up to 240 bytes for each
_COMPRESSIONS = ("EXT_meshopt_compression", "KHR_meshopt_compression")  # also of animations and bind matrices
_IMAGE_TYPES = {b"\x89PNG": "image/png", b"RIFF": "image/webp", b"\xabKTX": "image/ktx2"}  # by first bytes
_ARRAYS = (
    "nodes", "meshes", "skins", "animations", "accessors", "bufferViews", "buffers", "images", "scenes",
)  # fmt: skip


def read_gltf(path: str | Path, *, images: bool = True) -> GltfDocument:
    """A document from a `.glb`, `.vrm` or `.gltf` file. Its motion needs no `images`.

    Raises `FormatError` if it cannot be read, is damaged, compressed or larger than 1 GiB, or is not glTF 2.
    """
    path = Path(path)
    text, binary = _chunks(path, memoryview(_read(path)))
    data = _parsed(path, bytes(text))
    document = GltfDocument(data, _merged_buffers(path, data, binary), str(path))
    if images:
        _embed_images(path, document)
    return document


def referenced_files(path: str | Path) -> list[Path]:
    """The files of the buffers and images of a `.gltf`, none if it cannot be read."""
    path = Path(path)
    try:
        data = _parsed(path, bytes(_chunks(path, memoryview(_read(path)))[0]))
        entries = [entry for kind in ("buffers", "images") for entry in data.get(kind, []) if "uri" in entry]
        sources = [_source(path, entry["uri"]) for entry in entries]
    except FormatError:
        return []
    return [source for source in sources if isinstance(source, Path)]


def _read(path: Path) -> bytes:
    try:
        if not path.is_file():
            raise FormatError(f"{path}: expected a glTF file, found none")
        size = path.stat().st_size
        if size > MAX_BYTES:
            raise FormatError(f"{path}: expected at most {MAX_BYTES >> 20} MiB, got {size >> 20} MiB")
        return path.read_bytes()
    except OSError as error:
        raise FormatError(f"{path}: expected a glTF file, could not read it: {error.strerror}") from error


def _chunks(path: Path, content: memoryview) -> tuple[memoryview, memoryview]:
    """The JSON and the binary chunk of a GLB. For other files, the whole content and nothing."""
    if content[:4] != struct.pack("<I", GLB_MAGIC):
        return content, content[:0]
    found: dict[int, memoryview] = {}
    if len(content) < 12 or struct.unpack_from("<I", content, 4)[0] != GLB_VERSION:
        raise FormatError(f"{path}: expected glTF 2.0 in a GLB, got another version or a truncated file")
    at = 12
    while at + 8 <= len(content):
        length, kind = struct.unpack_from("<II", content, at)
        if at + 8 + length > len(content):
            raise FormatError(f"{path}: expected a chunk of {length} bytes, got fewer: the file is truncated")
        found.setdefault(kind, content[at + 8 : at + 8 + length])
        at += 8 + length
    if JSON_CHUNK not in found:
        raise FormatError(f"{path}: expected a JSON chunk in a GLB, got none: the file is truncated")
    return found[JSON_CHUNK], found.get(BINARY_CHUNK, content[:0])


def _parsed(path: Path, text: bytes) -> dict[str, Any]:
    if len(text) > MAX_JSON_BYTES:
        raise FormatError(
            f"{path}: expected at most {MAX_JSON_BYTES >> 20} MiB of JSON, got {len(text) >> 20}"
        )
    if text.count(b"{") + text.count(b"[") > _MAX_OBJECTS:
        raise FormatError(f"{path}: expected at most {_MAX_OBJECTS} objects and lists in the JSON, got more")
    try:
        with without_garbage_collection():
            data: dict[str, Any] = json.loads(text.decode("utf-8-sig"), parse_constant=_refused)
    except (ValueError, RecursionError) as error:
        raise FormatError(
            f"{path}: expected a glTF file, got no valid JSON: damaged or another file"
        ) from error
    asset = data.get("asset") if isinstance(data, dict) else None
    if not (isinstance(asset, dict) and str(asset.get("version", "")).startswith("2.")):
        raise FormatError(f"{path}: expected glTF 2.0, got another version or another file")
    required = data.get("extensionsRequired")
    for name in _COMPRESSIONS:
        if isinstance(required, list) and name in required:
            raise FormatError(
                f"{path}: expected plain data, got {name}, which is not read: export it without compression, "
                "or undo it: gltfpack -i IN.glb -o OUT.glb -kn -noq"
            )
    for kind in _ARRAYS:
        entries = data.get(kind, [])
        if not isinstance(entries, list) or len(entries) > MAX_ENTRIES:
            raise FormatError(f"{path}: expected at most {MAX_ENTRIES} {kind}, got more, or no list")
    wrong = misfit(data)
    if wrong:
        raise FormatError(f"{path}: expected valid glTF, got another value of {wrong}: the file is damaged")
    return data


def _refused(constant: str) -> None:
    """Refuse NaN and infinities, which are not valid JSON."""
    raise ValueError(constant)


def _merged_buffers(path: Path, data: dict[str, Any], binary: memoryview) -> bytearray:
    """All buffers one after another. The views in `data` are changed to refer to them."""
    merged, starts = bytearray(), []
    start_of: dict[str | Path, int] = {}  # position by source
    for index, buffer in enumerate(data.pop("buffers", [])):
        is_own = index == 0 and "uri" not in buffer
        source = "" if is_own else _source(path, buffer.get("uri"))
        if source not in start_of:
            merged += bytes(-len(merged) % 4)
            start_of[source] = len(merged)
            merged += binary if is_own else _content(path, source)
            if len(merged) > MAX_BYTES:
                raise FormatError(f"{path}: expected at most {MAX_BYTES >> 20} MiB of buffers, got more")
        starts.append(start_of[source])
    for view in data.get("bufferViews", []):
        for holder in (view, *view.get("extensions", {}).values()):
            if "buffer" not in holder and holder is not view:
                continue
            buffer = holder.get("buffer", -1)
            if not 0 <= buffer < len(starts):
                raise FormatError(f"{path}: expected a buffer for every view, got {buffer}: damaged")
            holder["byteOffset"] = holder.get("byteOffset", 0) + starts[buffer]
            holder["buffer"] = 0
    return merged


def _embed_images(path: Path, document: GltfDocument) -> None:
    """Copy images beside the file or in its text into the buffer."""
    left = MAX_BYTES
    views: dict[str | Path, tuple[int, str]] = {}  # view and type by source
    for image in document.json.get("images", []):
        if "uri" not in image:
            continue
        source = _source(path, image.pop("uri"))
        if source not in views:
            content = _content(path, source)
            left -= len(content)
            if left < 0:
                raise FormatError(f"{path}: expected at most {MAX_BYTES >> 20} MiB of images, got more")
            views[source] = document.view(content), _IMAGE_TYPES.get(content[:4], "image/jpeg")
        image["bufferView"], found_type = views[source]
        image.setdefault("mimeType", found_type)


def _source(path: Path, uri: Any) -> str | Path:
    """The source of a URI: itself if it holds data, or a file in the folder of the document."""
    if not isinstance(uri, str):
        raise FormatError(f"{path}: expected the URI of a buffer or image, got {uri!r}: damaged")
    if uri.startswith("data:"):
        return uri
    name = unquote(uri)
    file = (path.parent / name.replace("\0", "")).resolve()
    if "://" in uri or "\0" in name or not file.is_relative_to(path.parent.resolve()):
        raise FormatError(f"{path}: expected files in its own folder, got {uri[:80]!r}")
    return file


def _content(path: Path, source: str | Path) -> bytes:
    """The bytes of a data URI or a file."""
    if isinstance(source, Path):
        return _read(source)
    try:
        return base64.b64decode(source.partition(",")[2], validate=True)
    except (binascii.Error, ValueError) as error:
        raise FormatError(f"{path}: expected base64 in a data URI, got something else") from error


# Counts and figures with an animation.


KEY = "choreograph_counts"
SPANS = ("loops", "figures")
_OF_FILE = ("name", "kind", "duration_s")  # of the JSON of `count`, which say nothing of the counts


def with_marks(document: GltfDocument, facts: Mapping[str, Any]) -> GltfDocument:
    """A copy of a document whose animations have the `facts` of `CountedFile.facts`."""
    marked = document.copy()
    for animation in marked.json.get("animations", []):
        own = _moved(of_counts(facts), start_s(marked, animation))
        animation["extras"] = {**_extras(animation), KEY: own}
    return marked


def marks_of(document: GltfDocument, animation: Mapping[str, Any]) -> tuple[Counts, tuple[Figure, ...]]:
    """The counts and figures with an animation, in seconds from its first key. None if they are not certain.

    Counts that were written by hand have the source "data set", so that a table beside the file replaces
    them. Raises `FormatError` if they are damaged.
    """
    facts = _extras(animation).get(KEY)
    if facts is None:
        return NO_COUNTS, ()
    try:
        facts = _moved(facts, -start_s(document, animation))
        if not facts["is_sure"]:
            return NO_COUNTS, ()
        source = DATA_SET if facts["source"] == ANNOTATED else str(facts["source"])
        counts = make_counts(
            facts["times_s"], facts["numbers"], int(facts["metre"]), source=source,
            confidence=float(facts["confidence"]),
        )  # fmt: skip
        figures = [
            Figure(str(each["name"]), each["start_s"], each["end_s"], int(each["n_counts"]))
            for each in facts["figures"]
        ]
    except (KeyError, TypeError, ValueError, ParameterError) as error:
        raise FormatError(
            f"{document.name}: expected {KEY} as `choreograph count` writes it: {error}"
        ) from None
    return counts, tuple(figures)


def start_s(document: GltfDocument, animation: Mapping[str, Any]) -> float:
    """The time of the first key of an animation, 0 if it has none."""
    inputs = {sampler.get("input") for sampler in animation.get("samplers", [])}
    firsts = [float(document.array(index, most=1)[0]) for index in inputs if index is not None]
    return min(firsts, default=0.0)


def of_counts(facts: Mapping[str, Any]) -> dict[str, Any]:
    """Those of the facts of a file that say something of its counts."""
    return {name: value for name, value in facts.items() if name not in _OF_FILE}


def _extras(animation: Mapping[str, Any]) -> dict[str, Any]:
    extras = animation.get("extras")
    return extras if isinstance(extras, dict) else {}


def _moved(facts: Mapping[str, Any], by_s: float) -> dict[str, Any]:
    """The facts with all times later by `by_s`."""
    if by_s == 0.0:
        return dict(facts)
    spans: dict[str, list[dict[str, Any]]] = {
        kind: [
            {**each, "start_s": each["start_s"] + by_s, "end_s": each["end_s"] + by_s} for each in facts[kind]
        ]
        for kind in SPANS
    }
    return {**facts, "times_s": [time_s + by_s for time_s in facts["times_s"]], **spans}
