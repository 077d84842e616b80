"""Presets of network configurations, with fields changed by name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any, TypeVar

from choreograph.arguments import check_choice, unexpected
from choreograph.errors import ParameterError

Config = TypeVar("Config", bound=Any)  # a frozen dataclass
_MAX_ITEMS = 16  # of a field of several values
_MAX_SIZE = 1e9  # of a number in a configuration
MAX_DEPTH = 64  # layers, or blocks of layers, of a network that a file configures
PRESET_NAMES = ("tiny", "small", "paper")  # for tests, for two CPU cores, and the papers' own sizes
DEVICES = ("auto", "cpu", "cuda")  # to train on; auto: a GPU if there is one
SCHEDULES = ("cosine", "constant")  # of a learning rate: warm-up and half a cosine to zero, or neither


def check_training(epochs: int, schedule: str) -> None:
    """Raise `ParameterError` for a number of epochs below 0, or an unknown schedule."""
    if epochs < 0:
        raise ParameterError(f"expected 0 epochs (steps count) or more, got {epochs}")
    if schedule not in SCHEDULES:
        raise ParameterError(f"expected a schedule among {', '.join(SCHEDULES)}, got {schedule!r}")


def config_from_preset(presets: Mapping[str, Config], preset: str, changes: Mapping[str, Any]) -> Config:
    """One of `presets` with fields changed; `ParameterError` if a name, a field or a value cannot be."""
    check_choice("a preset", preset, presets)
    config = presets[preset]
    return replace(config, **check_fields(type(config), changes))


def check_fields(config_class: type, values: Mapping[str, Any]) -> dict[str, Any]:
    """Values of a configuration's fields, lists, as JSON has them, as tuples.

    Raises `ParameterError` unless each is of the kind of its field's default, and finite.
    """
    defaults = {field.name: field.default for field in fields(config_class)}
    unknown = [name for name in values if name not in defaults]
    if unknown:
        listed = ", ".join(sorted(map(str, unknown)))
        raise ParameterError(f"expected fields of {config_class.__name__}, got {listed}")
    checked = {name: tuple(value) if isinstance(value, list) else value for name, value in values.items()}
    for name, value in checked.items():
        if not _is_like(value, defaults[name]):
            raise unexpected(f"{name} of {config_class.__name__} as {defaults[name]!r} is", value)
    return checked


def _is_like(value: Any, default: Any) -> bool:
    if isinstance(default, tuple):
        is_short = isinstance(value, tuple) and 0 < len(value) <= _MAX_ITEMS
        return is_short and all(_is_like(item, default[0]) for item in value)
    if isinstance(default, bool | str):
        return type(value) is type(default)
    kinds = int | float if isinstance(default, float) else int
    return isinstance(value, kinds) and not isinstance(value, bool) and abs(value) <= _MAX_SIZE
