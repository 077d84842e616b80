"""Reads glTF files: `.glb` and `.vrm` in one piece, `.gltf` with its buffers and images beside it.

All data is copied into one buffer, as in a GLB. Data that is referred to several times is copied once. Files
may be damaged or malicious: sizes are checked before anything is read, and references to files outside of the
folder or on the network are refused. Required extensions that compress animations or bind matrices are
refused. Draco is not, because it compresses only meshes.
"""

from __future__ import annotations

import base64
import binascii
import json
import struct
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from choreograph.core.budgets import BUDGETS
from choreograph.core.errors import FormatError
from choreograph.core.files import without_garbage_collection
from choreograph.formats.gltf_document import (
    BINARY_CHUNK,
    GLB_MAGIC,
    GLB_VERSION,
    JSON_CHUNK,
    MAX_ENTRIES,
    GltfDocument,
    misfit,
)

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
