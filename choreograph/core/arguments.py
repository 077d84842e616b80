"""Checks of arguments, shared by public functions.

Public functions check their arguments once. Kernels do not check them again.
"""

from __future__ import annotations

import math
import reprlib
import sys
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import fields
from types import UnionType
from typing import Any, TypeGuard

import numpy as np
from numpy.typing import NDArray

from choreograph.core.errors import FormatError, ParameterError

_EXACT = 2.0**53  # below it, floats hold every whole number


def unexpected(wanted: str, got: object, likely: str = "") -> ParameterError:
    """The error "expected WANTED, got GOT: LIKELY", to be raised. The value is shortened."""
    return ParameterError(f"expected {wanted}, got {reprlib.repr(got)}{likely and f': {likely}'}")


def is_number(value: Any) -> bool:
    """Whether a value from TOML or JSON is a finite number. True, False and 10**400 are not."""
    limit = sys.float_info.max
    return isinstance(value, int | float) and not isinstance(value, bool) and -limit <= value <= limit


def is_whole(value: Any) -> TypeGuard[int | np.integer]:
    """Whether a value is a whole number of Python or NumPy. True and False are not."""
    return isinstance(value, int | np.integer) and not isinstance(value, bool)


def check_kind(what: str, value: object, kind: type, likely: str = "") -> None:
    """Raise `ParameterError` unless a value is an instance of `kind` or of a subclass."""
    if not isinstance(value, kind):
        raise unexpected(f"{what} as {_NAMES.get(kind, kind.__name__)}", value, likely)


_NAMES: dict[type, str] = {str: "text", bool: "True or False", np.ndarray: "an array"}


def check_text(what: str, *values: object) -> None:
    """Raise `ParameterError` unless all values are text."""
    for value in values:
        check_kind(what, value, str)


def check_choice(what: str, value: object, choices: Collection[str]) -> None:
    """Raise `ParameterError` unless a value is one of the texts."""
    if not isinstance(value, str) or value not in choices:
        raise unexpected(f"{what} among {', '.join(choices)}", value)


def as_number(wanted: str, value: Any, *, above: float = -math.inf) -> float:
    """The value as a float. Raises `ParameterError` unless it is a finite number greater than `above`."""
    plain = value.item() if isinstance(value, np.integer | np.floating) else value
    if not is_number(plain) or not plain > above:
        raise unexpected(wanted, value)
    return float(plain)


def as_index(what: str, value: Any, n: int) -> int:
    """The value as an int. Raises `ParameterError` unless it is a whole number from 0 to `n` - 1."""
    if not is_whole(value) or not 0 <= value < n:
        raise unexpected(f"{what} as a whole number from 0 to {n - 1}", value)
    return int(value)


def as_floats(what: str, values: Any) -> NDArray[np.float64]:
    """Numbers as an array of float64, not copied if it is one. Raises `ParameterError` otherwise."""
    return as_array(what, values).astype(np.float64, copy=False)


def as_whole_numbers(what: str, values: Any) -> NDArray[np.int64]:
    """Whole numbers as an array of int64, not copied if it is one. Raises `ParameterError` otherwise."""
    array = as_array(what, values)
    if array.dtype.kind == "f" and not (np.abs(array) < _EXACT).all():
        raise unexpected(f"{what} as whole numbers", values)
    whole = array.astype(np.int64, copy=False)
    if not np.equal(whole, array).all():
        raise unexpected(f"{what} as whole numbers", values)
    return whole


def as_array(what: str, values: Any) -> NDArray[Any]:
    """Numbers of any type as an array, not copied if it is one. Raises `ParameterError` otherwise."""
    try:
        array = np.asarray(values)
    except (TypeError, ValueError, RuntimeError):  # ragged lists, arrays on other devices
        raise unexpected(f"{what} as an array of numbers", values) from None
    if array.dtype.kind not in "biuf":
        raise unexpected(f"{what} as an array of numbers", values)
    return array


def as_list(what: str, values: Any, kinds: str, types: type | UnionType) -> tuple[Any, ...]:
    """Values of `types` as a tuple. Raises `ParameterError` for other values, which names them `kinds`.

    Text is not a collection here, and True is not a number.
    """
    if isinstance(values, str | bytes | Mapping) or not isinstance(values, Iterable):
        raise unexpected(f"{what} as a list of {kinds}", values)
    listed = tuple(values)
    for value in listed:
        if isinstance(value, bool) or not isinstance(value, types):
            likely = "a class instead of an instance?" if isinstance(value, type) else ""
            raise unexpected(f"{what} as {kinds}", value, likely)
    return listed


def as_texts(what: str, values: Any) -> tuple[str, ...]:
    """A list of texts as a tuple. Raises `ParameterError` for anything else, also for a single text."""
    return as_list(what, values, "texts", str)


def as_stage_m(stage: str) -> tuple[float, float] | None:
    """Width and depth of a stage in metres, or None for "near" and "free".

    Raises `ParameterError` unless the text is one of these or of the form "4x3", with 1 to 100 m each.
    """
    if stage in ("near", "free"):
        return None
    try:
        width_m, depth_m = (float(side) for side in stage.split("x"))
    except ValueError:
        width_m = depth_m = math.nan
    if not (1.0 <= width_m <= 100.0 and 1.0 <= depth_m <= 100.0):
        raise unexpected("a stage near, free, or its width and depth in metres, 1 to 100, such as 4x3", stage)
    return width_m, depth_m


def check_function(what: str, value: object) -> None:
    """Raise `ParameterError` unless a value is None or a function."""
    if not (value is None or callable(value)):
        raise unexpected(f"a function as {what}", value)


# Fields of dataclasses in JSON.


def fields_of_json(
    kind: type, data: Any, where: str, *, missing: str, except_for: tuple[str, ...] = ()
) -> dict[str, Any]:
    """The fields of dataclass `kind` in JSON `data`, each of its declared type.

    Raises `FormatError` otherwise. If a key is missing, the error ends with the text `missing`.
    """
    if not isinstance(data, dict):
        raise FormatError(f"{where}: expected {kind.__name__.lower()} by key, got {reprlib.repr(data)}")
    wanted = {f.name: str(f.type) for f in fields(kind)}
    unknown = set(data) - set(wanted)
    if unknown:
        raise FormatError(f"{where}: expected keys among {', '.join(wanted)}, got {min(unknown)[:80]!r}")
    known = {}
    for key, declared in wanted.items():
        if key in except_for:
            continue
        if key not in data:
            raise FormatError(f"{where}: expected a key {key}, got none: {missing}")
        value = data[key]
        if not _IS_A[declared](value):
            raise FormatError(f"{where}: expected {key} as {declared}, got {reprlib.repr(value)}")
        known[key] = _as_tuple(value)
    return known


def _as_tuple(value: Any) -> Any:
    """A list as a tuple, and its lists as tuples. Other values are returned as they are."""
    return tuple(_as_tuple(item) for item in value) if isinstance(value, list) else value


def _is_span(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 2 and all(map(is_number, value))


# Declared type of a field -> whether a value from JSON is one. Whole numbers here count or index.
_IS_A: dict[str, Callable[[Any], bool]] = {
    "str": lambda v: isinstance(v, str),
    "int": lambda v: is_number(v) and isinstance(v, int) and v >= 0,
    "float": is_number,
    "bool": lambda v: isinstance(v, bool),
    "dict[str, float]": lambda v: isinstance(v, dict) and all(map(is_number, v.values())),
    "float | None": lambda v: v is None or is_number(v),
    "tuple[int, ...]": lambda v: isinstance(v, list) and all(is_number(n) and isinstance(n, int) for n in v),
    "tuple[float, ...]": lambda v: isinstance(v, list) and all(map(is_number, v)),
    "tuple[tuple[float, float], ...]": lambda v: isinstance(v, list) and all(map(_is_span, v)),
}
