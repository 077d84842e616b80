"""Reading glTF files: `.glb` and `.vrm` in one piece, `.gltf` with its buffers and images beside it.

All is brought into one buffer, as a GLB has it. Files from others may be damaged or hostile: sizes are
checked before anything is read, references lead nowhere outside the file's folder, nothing is fetched.
"""

from __future__ import annotations

import base64
import binascii
import json
import struct
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from choreograph.errors import FormatError
from choreograph.gltf._structure import MAX_ENTRIES, misfit
from choreograph.gltf.document import (
    BINARY_CHUNK,
    GLB_MAGIC,
    GLB_VERSION,
    JSON_CHUNK,
    GltfDocument,
)

MAX_BYTES = 1 << 30
MAX_JSON_BYTES = 64 << 20
_MAX_OBJECTS = 2_000_000  # of all kinds in the JSON: Python takes up to 240 bytes for each
_ARRAYS = (
    "nodes",
    "meshes",
    "skins",
    "animations",
    "accessors",
    "bufferViews",
    "buffers",
    "images",
    "scenes",
)


def read_gltf(path: str | Path) -> GltfDocument:
    """A document from a `.glb`, `.vrm` or `.gltf` file.

    Raises `FormatError` if it cannot be read, is damaged, larger than 1 GiB, or not glTF 2.
    """
    path = Path(path)
    content = _read(path)
    text, binary = _chunks(path, content)
    data = _parsed(path, text)
    document = GltfDocument(data, _merged_buffers(path, data, binary), str(path))
    _embed_images(path, document)
    return document


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


def _chunks(path: Path, content: bytes) -> tuple[bytes, bytes]:
    """The JSON and the binary chunk of a GLB; of other files, all and nothing."""
    if content[:4] != struct.pack("<I", GLB_MAGIC):
        return content, b""
    found: dict[int, bytes] = {}
    if len(content) < 12 or struct.unpack_from("<I", content, 4)[0] != GLB_VERSION:
        raise FormatError(f"{path}: expected glTF 2.0 in a GLB, got another version or a truncated file")
    at = 12
    while at + 8 <= len(content):
        length, kind = struct.unpack_from("<II", content, at)
        if at + 8 + length > len(content):
            raise FormatError(f"{path}: expected a chunk of {length} bytes, the file ends before: truncated")
        found.setdefault(kind, content[at + 8 : at + 8 + length])
        at += 8 + length
    if JSON_CHUNK not in found:
        raise FormatError(f"{path}: expected a JSON chunk in a GLB, got none: the file is truncated")
    return found[JSON_CHUNK], found.get(BINARY_CHUNK, b"")


def _parsed(path: Path, text: bytes) -> dict[str, Any]:
    if len(text) > MAX_JSON_BYTES:
        raise FormatError(
            f"{path}: expected at most {MAX_JSON_BYTES >> 20} MiB of JSON, got {len(text) >> 20}"
        )
    if text.count(b"{") + text.count(b"[") > _MAX_OBJECTS:
        raise FormatError(f"{path}: expected at most {_MAX_OBJECTS} objects and lists in the JSON, got more")
    try:
        data = json.loads(text.decode("utf-8"), parse_constant=_refused)
    except (ValueError, RecursionError) as error:
        raise FormatError(
            f"{path}: expected a glTF file, got no valid JSON: damaged or another file"
        ) from error
    asset = data.get("asset") if isinstance(data, dict) else None
    if not (isinstance(asset, dict) and str(asset.get("version", "")).startswith("2.")):
        raise FormatError(f"{path}: expected glTF 2.0, got another version or another file")
    for kind in _ARRAYS:
        entries = data.get(kind, [])
        if not isinstance(entries, list) or len(entries) > MAX_ENTRIES:
            raise FormatError(f"{path}: expected at most {MAX_ENTRIES} {kind}, got more, or no list")
    wrong = misfit(data)
    if wrong:
        raise FormatError(f"{path}: expected {wrong} as glTF has it, got something else: the file is damaged")
    return data


def _refused(constant: str) -> None:
    """Called for NaN and infinities, which JSON does not have and no player reads."""
    raise ValueError(constant)


def _merged_buffers(path: Path, data: dict[str, Any], binary: bytes) -> bytes:
    """All buffers one after another, with the views in `data` changed to lie in them."""
    merged, starts = bytearray(), []
    for index, buffer in enumerate(data.pop("buffers", [])):
        content = binary if index == 0 and "uri" not in buffer else _referenced(path, buffer.get("uri"))
        merged += bytes(-len(merged) % 4)
        starts.append(len(merged))
        merged += content
        if len(merged) > MAX_BYTES:
            raise FormatError(f"{path}: expected at most {MAX_BYTES >> 20} MiB of buffers, got more")
    for view in data.get("bufferViews", []):
        for holder in (view, *view.get("extensions", {}).values()):
            if "buffer" not in holder and holder is not view:
                continue
            buffer = holder.get("buffer", -1)
            if not 0 <= buffer < len(starts):
                raise FormatError(f"{path}: expected a buffer for every view, got {buffer}: damaged")
            holder["byteOffset"] = holder.get("byteOffset", 0) + starts[buffer]
            holder["buffer"] = 0
    return bytes(merged)


def _embed_images(path: Path, document: GltfDocument) -> None:
    """Images beside the file or in its text, brought into the buffer."""
    left = MAX_BYTES
    for image in document.json.get("images", []):
        if "uri" not in image:
            continue
        content = _referenced(path, image["uri"])
        left -= len(content)
        if left < 0:
            raise FormatError(f"{path}: expected at most {MAX_BYTES >> 20} MiB of images, got more")
        image.setdefault("mimeType", "image/png" if content[:4] == b"\x89PNG" else "image/jpeg")
        image["bufferView"] = document.view(content)
        del image["uri"]


def _referenced(path: Path, uri: Any) -> bytes:
    """What a URI holds: data in the text itself, or a file in the document's folder."""
    if not isinstance(uri, str):
        raise FormatError(f"{path}: expected the URI of a buffer or image, got {uri!r}: damaged")
    if uri.startswith("data:"):
        try:
            return base64.b64decode(uri.partition(",")[2], validate=True)
        except (binascii.Error, ValueError) as error:
            raise FormatError(f"{path}: expected base64 in a data URI, got something else") from error
    name = unquote(uri)
    file = (path.parent / name.replace("\0", "")).resolve()
    if "://" in uri or "\0" in name or not file.is_relative_to(path.parent.resolve()):
        raise FormatError(f"{path}: expected files in its own folder, got {uri[:80]!r}: it is not read")
    return _read(file)
