"""Training all networks of a repertoire, one after another."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from choreograph.nets.presets import style_config
from choreograph.nets.style_data import StyleTake
from choreograph.nets.style_training import train_style
from choreograph.repertoire import NetArrays

if TYPE_CHECKING:
    from choreograph.pipeline.building import BuildOptions


def train_networks(
    takes: Sequence[StyleTake],
    *,
    work: Path,
    options: BuildOptions,
    start: Mapping[str, NetArrays] | None,
    report: Callable[[Any], None] | None,
) -> dict[str, NetArrays]:
    """Networks by name."""
    style = train_style(takes, style_config(options.preset), seed=options.seed)
    weights, config = style.to_arrays()
    return {"style": NetArrays(config, weights)}
