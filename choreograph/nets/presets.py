"""Presets of network configurations, with fields changed by name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any, TypeVar

from choreograph.errors import ParameterError

Config = TypeVar("Config", bound=Any)  # a frozen dataclass
MAX_DEPTH = 64  # layers, or blocks of layers, of a network that a file configures
SCHEDULES = ("cosine", "constant")  # of a learning rate: warm-up and half a cosine to zero, or neither


def check_training(epochs: int, schedule: str) -> None:
    """Raise `ParameterError` for a number of epochs below 0, or an unknown schedule."""
    if epochs < 0:
        raise ParameterError(f"expected 0 epochs (steps count) or more, got {epochs}")
    if schedule not in SCHEDULES:
        raise ParameterError(f"expected a schedule among {', '.join(SCHEDULES)}, got {schedule!r}")


def config_from_preset(presets: Mapping[str, Config], preset: str, changes: Mapping[str, Any]) -> Config:
    """One of `presets` with fields changed; `ParameterError` for an unknown name or field."""
    if preset not in presets:
        raise ParameterError(f"expected a preset among {', '.join(presets)}, got {preset!r}")
    config = presets[preset]
    unknown = set(changes) - {field.name for field in fields(config)}
    if unknown:
        raise ParameterError(f"expected fields of {type(config).__name__}, got {', '.join(sorted(unknown))}")
    return replace(config, **changes)
