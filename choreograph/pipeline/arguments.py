"""Checks and conversions of the arguments of public functions: songs, repertoires and settings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from choreograph.choreography.graph.costs import Cost
from choreograph.core.arguments import as_list, unexpected
from choreograph.library.builtin import starter_repertoire
from choreograph.library.repertoire import Repertoire
from choreograph.music.song import Song, load_song
from choreograph.settings import DanceConfig

_SHORTER_S = 0.1  # largest difference to the requested duration without a note


def as_song(what: str, song: object, *, start_s: float = 0.0, duration_s: float | None = None) -> Song:
    """The part of a song, or of a song's file, with a note if it is shorter than `duration_s`.

    Raises `ParameterError` unless it is a `Song` or a path, and the errors of `load_song`.
    """
    if isinstance(song, Song):
        loaded = song.part(start_s, duration_s)
    elif isinstance(song, str | Path):
        loaded = load_song(song, start_s=start_s, duration_s=duration_s)
    else:
        raise unexpected(f"{what} as a path or a Song", song)
    if duration_s is None or loaded.duration_s > duration_s - _SHORTER_S:
        return loaded
    note = f"{loaded.name}: {duration_s:g} s were requested, the song ends after {loaded.duration_s:.2f} s"
    return replace(loaded, notes=(*loaded.notes, note))


def as_repertoire(repertoire: object) -> Repertoire:
    """An opened repertoire, for None the built-in one. Raises `ParameterError` unless given one or a path."""
    if repertoire is None:
        return starter_repertoire()
    if isinstance(repertoire, Repertoire):
        return repertoire
    if not isinstance(repertoire, str | Path):
        raise unexpected("a repertoire or its path", repertoire)
    return Repertoire.open(repertoire)


def as_config(config: object) -> DanceConfig:
    """A `DanceConfig`. Raises `ParameterError` for anything else."""
    if not isinstance(config, DanceConfig):
        raise unexpected("a DanceConfig as config", config)
    return config


def as_costs(costs: object) -> tuple[Cost, ...]:
    """Costs as a tuple. Raises `ParameterError` unless they are instances of `Cost`."""
    return as_list("costs", costs, "Cost", Cost)


def as_weights(weights: object) -> dict[str, Any]:
    """Weights as a dictionary, as in `DanceConfig`. Raises `ParameterError` for anything but a mapping."""
    if not isinstance(weights, Mapping):
        raise unexpected("weights as a mapping of cost name to number", weights)
    return dict(weights)
