"""Presets of network configurations, with fields changed by name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any, TypeVar

from choreograph.errors import ParameterError

Config = TypeVar("Config", bound=Any)  # a frozen dataclass


def config_from_preset(presets: Mapping[str, Config], preset: str, changes: Mapping[str, Any]) -> Config:
    """One of `presets` with fields changed; `ParameterError` for an unknown name or field."""
    if preset not in presets:
        raise ParameterError(f"expected a preset among {', '.join(presets)}, got {preset!r}")
    config = presets[preset]
    unknown = set(changes) - {field.name for field in fields(config)}
    if unknown:
        raise ParameterError(f"expected fields of {type(config).__name__}, got {', '.join(sorted(unknown))}")
    return replace(config, **changes)
