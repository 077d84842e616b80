"""The shape that a glTF document's JSON must have where it is read, so that readers need not ask.

A shape is a function that says whether a value has it, a dictionary of fields with the shape of each that is
there, a list of the one shape of all entries, or `{...: shape}` for objects of any keys.
"""

from __future__ import annotations

from typing import Any

MAX_ENTRIES = 100_000  # of a list: nodes, accessors, channels, … a character has some hundreds
_LARGEST_INDEX = 1 << 53
_LARGEST_FLOAT = 1e39  # above what 32 bits hold
_LARGEST_NUMBER = 1e12  # of transforms, in any unit: sizes and products of a few stay finite


def is_whole(value: Any) -> bool:
    """A whole number, negative ones included: VRM 0 has -1 for a bone that is not there."""
    return type(value) is int and abs(value) < _LARGEST_INDEX


def is_index(value: Any) -> bool:
    """A whole number from 0 on."""
    return is_whole(value) and value >= 0


def is_number(value: Any) -> bool:
    """A number that geometry can have."""
    return type(value) in (int, float) and abs(value) < _LARGEST_NUMBER


def is_text(value: Any) -> bool:
    """Text that can be written again: no half of a surrogate pair."""
    return isinstance(value, str) and (
        value.isascii() or not any("\ud800" <= letter <= "\udfff" for letter in value)
    )


def _numbers(count: int) -> Any:
    return lambda value: isinstance(value, list) and len(value) == count and all(map(is_number, value))


def _is_bound(value: Any) -> bool:
    """Bounds of an accessor, of which some programs write the greatest float there is."""
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
    """Where a document is not shaped as the format says, such as "nodes[3].children"; "" if it is nowhere."""
    return _misfit(data, _DOCUMENT).strip(".")


def _misfit(value: Any, shape: Any) -> str:
    """Where in a value its shape is not kept, beginning with "." or "["; "." for the value itself."""
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
