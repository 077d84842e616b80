"""Arguments of the public functions, checked: what a caller may give for a song, a repertoire, settings."""

from __future__ import annotations

import reprlib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from choreograph.audio.song import Song, load_song
from choreograph.config import DanceConfig
from choreograph.errors import ParameterError
from choreograph.graph import Cost
from choreograph.repertoire import Repertoire
from choreograph.starter.library import starter_repertoire


def as_song(what: str, song: object, *, start_s: float = 0.0, duration_s: float | None = None) -> Song:
    """A loaded song; `ParameterError` unless it is a `Song` or a path, else as `load_song`."""
    if isinstance(song, Song):
        return song
    if not isinstance(song, str | Path):
        raise ParameterError(f"expected {what} as a path or a Song, got {reprlib.repr(song)}")
    return load_song(song, start_s=start_s, duration_s=duration_s)


def as_repertoire(repertoire: object) -> Repertoire:
    """An opened repertoire, the built-in one for None; `ParameterError` for anything but a path or one."""
    if repertoire is None:
        return starter_repertoire()
    if isinstance(repertoire, Repertoire):
        return repertoire
    if not isinstance(repertoire, str | Path):
        raise ParameterError(f"expected a repertoire or its path, got {reprlib.repr(repertoire)}")
    return Repertoire.open(repertoire)


def as_config(config: object) -> DanceConfig:
    """A `DanceConfig`, the default one for None; `ParameterError` for anything else."""
    if config is None:
        return DanceConfig()
    if not isinstance(config, DanceConfig):
        raise ParameterError(f"expected a DanceConfig as config, got {reprlib.repr(config)}")
    return config


def as_costs(costs: object) -> tuple[Cost, ...]:
    """Costs as a tuple; `ParameterError` unless they are instances of `Cost`."""
    if not isinstance(costs, Iterable):
        raise ParameterError(f"expected costs as a list of Cost, got {reprlib.repr(costs)}")
    checked = tuple(costs)
    for cost in checked:
        if not isinstance(cost, Cost):
            likely = ": a class instead of an instance?" if isinstance(cost, type) else ""
            raise ParameterError(
                f"expected costs that are instances of Cost, got {reprlib.repr(cost)}{likely}"
            )
    return checked


def as_weights(weights: object) -> dict[str, Any]:
    """Weights as a dictionary; `ParameterError` for anything but a mapping. Values: see `DanceConfig`."""
    if not isinstance(weights, Mapping):
        raise ParameterError(
            f"expected weights as a mapping of cost name to number, got {reprlib.repr(weights)}"
        )
    return dict(weights)
