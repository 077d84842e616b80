"""The metrics of an evaluation by family: label, unit, better direction, source and limits.

They are listed in `metrics.toml`.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from typing import Literal

Better = Literal["higher", "lower", "real"]  # "real": the closer to real dances, the better


@dataclass(frozen=True, kw_only=True)
class Metric:
    """How tables show a metric, and what it measures."""

    name: str
    family: str
    label: str
    unit: str = ""
    better: Better
    source: str = "ours"
    digits: int = 2
    limits: str  # what the number does not tell


_FAMILIES = tomllib.loads(resources.files(__package__).joinpath("metrics.toml").read_text(encoding="utf-8"))
CAPTIONS: Mapping[str, str] = {family: table["caption"] for family, table in _FAMILIES.items()}
METRICS: Mapping[str, Metric] = {
    row["name"]: Metric(family=family, **row)
    for family, table in _FAMILIES.items()
    for row in table["metrics"]
}
