"""Dances to a song that was danced before, which keep parts of a dance or avoid repetitions."""

from __future__ import annotations

import reprlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from choreograph.choreography.constraints import Constraints, Keep
from choreograph.choreography.slots import KeptDance, check_pins_in_gaps, kept_dance
from choreograph.core.errors import ParameterError
from choreograph.formats.bvh import read_bvh
from choreograph.formats.npz import read_npz
from choreograph.library.repertoire import Repertoire
from choreograph.motion.motion import Credits, Motion
from choreograph.music.song import Song, as_song, cached_song
from choreograph.music.song_features import SongFeatures
from choreograph.plan.plan import Plan, PlannedWord
from choreograph.render.rendering import render
from choreograph.settings import DanceConfig

_SAME_BEAT_S = 0.07  # between two beats that are one
_SAME_SONG = 0.6  # least share of beats that two songs have in common if they are one. By chance, it is .3


@dataclass(frozen=True, eq=False)
class ExistingDance:
    """A dance that was made before: its motion, and its plan if it is known."""

    motion: Motion  # the whole dance
    plan: Plan | None  # if it is known
    name: str  # of its file


def read_existing(path: str | Path, repertoire: Repertoire) -> ExistingDance:
    """The dance in a motion file (.bvh, .npz), or that of a plan (.json), which is rendered.

    Raises `FormatError` if the file cannot be read, `ParameterError` for another suffix or a plan that cannot
    be rendered, `RepertoireError` for a plan of another repertoire.
    """
    path = Path(path)
    if path.suffix.lower() == ".json":
        plan, motion = render_file(path, repertoire)
        return ExistingDance(motion, plan, path.name)
    return ExistingDance(_read_motion(path, "or .json (its plan)"), None, path.name)


def render_file(
    path: str | Path, repertoire: Repertoire, existing: str | Path | None = None
) -> tuple[Plan, Motion]:
    """A plan file and its motion.

    If the plan keeps a motion file, that is `existing`, or the file of this name beside the plan. Raises as
    `read_existing`, and `ParameterError` if the motion file is not found, or if `existing` is given and the
    plan keeps none.
    """
    plan = Plan.read(path)
    if existing is None and plan.kept_of:
        existing = Path(path).with_name(Path(plan.kept_of).name)
        if not existing.is_file() or existing.name != plan.kept_of:
            raise ParameterError(
                f"{path}: expected {plan.kept_of}, which it keeps, in its folder, got no such file: give it "
                "with --existing"
            )
    if existing is None:
        return plan, render(plan, repertoire)
    return plan, render(
        plan, repertoire, existing=_read_motion(Path(existing), "beside a plan that keeps it")
    )


def _read_motion(path: Path, otherwise: str) -> Motion:
    suffix = path.suffix.lower()
    if suffix == ".bvh":
        return read_bvh(path)[0]
    if suffix == ".npz":
        return read_npz(path)
    raise ParameterError(
        f"expected an existing dance as .bvh, .npz {otherwise}, got {reprlib.repr(str(path))}"
    )


def part_of(
    song: object, start_s: float | None, duration_s: float | None, existing: Plan | None, *, keep: bool
) -> Song:
    """The part of a song to dance to. Without start or length, it is that of an existing dance's plan.

    With `keep`, a file is decoded only if its samples are needed (`cached_song`).
    """
    begins_s = song.start_s if isinstance(song, Song) else 0.0
    if existing is not None and start_s is None:
        start_s = existing.start_s - begins_s
        if start_s < 0:
            raise ParameterError(
                f"expected a song from {existing.start_s:g} s of its file on, as in the existing dance, got "
                f"one from {begins_s:g} s on"
            )
    if existing is not None and duration_s is None:
        duration_s = existing.duration_s
    if isinstance(song, str | Path):
        return cached_song(song, start_s=start_s or 0.0, duration_s=duration_s, keep=keep)
    return as_song("a song", song, start_s=start_s or 0.0, duration_s=duration_s)


def check_same_song(existing: Plan, features: SongFeatures) -> None:
    """Raise `ParameterError` if a song of another name than that of an existing dance has other beats, too.

    A song that was renamed has the same beats.
    """
    beats_s = np.array(existing.music_beats_s)
    if features.name == existing.song or not len(beats_s):
        return
    times_s = np.append(features.beat_times_s, np.inf)
    nearest_s = np.abs(beats_s[:, None] - times_s).min(axis=1)  # (Q,)
    if np.mean(nearest_s < _SAME_BEAT_S) < _SAME_SONG:
        raise ParameterError(
            f"expected the song {existing.song!r} of the existing dance, got {features.name!r}, which has "
            "other beats: give that song, or make a new dance"
        )


def kept_parts(
    existing: ExistingDance,
    keep: tuple[Keep, ...],
    requested: Constraints,
    duration_s: float,
    config: DanceConfig,
) -> KeptDance:
    """The kept parts of an existing dance. Raises `ParameterError` if they do not fit the new dance."""
    if existing.motion.fps != config.fps:
        raise ParameterError(
            f"expected the {existing.motion.fps:g} fps of the existing dance, which is kept as it is, got "
            f"{config.fps:g}: leave out fps"
        )
    kept = kept_dance(existing.motion, keep, duration_s, name=existing.name, plan=existing.plan)
    check_pins_in_gaps(requested, kept)
    return kept


def kept_file_plan(
    existing: ExistingDance, features: SongFeatures, song: Song, repertoire: Repertoire
) -> Plan:
    """The plan of a dance to a song that is known only as a motion file: one word, which keeps this file."""
    counts, duration_s, defaults = features.counts, features.duration_s, DanceConfig()
    whole = PlannedWord(0.0, duration_s, 0, "", 0.0, duration_s, Credits(), kept=existing.name)
    return Plan(
        song=features.name, duration_s=duration_s, start_s=song.start_s, repertoire=repertoire.path.name,
        planner=defaults.planner, blending=defaults.blending, seed=defaults.seed, fps=existing.motion.fps,
        weights={}, music_beats_s=tuple(float(beat) for beat in features.beat_times_s), seconds=(),
        engine="mixer", words=(whole,),
        music_beat_numbers=tuple(map(int, counts.numbers)) if counts.has_bars else (), metre=counts.metre,
    )  # fmt: skip


_MOVED_S = 0.05  # by which a border of a pin may be moved without a note


def moved_pins(plan: Plan, requested: Constraints) -> tuple[str, ...]:
    """A note on each pin of a take that is danced from or to another time than was asked."""
    notes = []
    for pin in requested.take_pins:
        spans_s = [(b.start_s, b.end_s) for b in plan.blocks if b.planned.take == pin.take]
        joined: list[tuple[float, float]] = []
        for start_s, end_s in spans_s:
            if joined and start_s - joined[-1][1] < _MOVED_S:
                joined[-1] = joined[-1][0], end_s
            else:
                joined.append((start_s, end_s))
        danced = [span_s for span_s in joined if span_s[0] < pin.end_s and span_s[1] > pin.start_s]
        if not danced:
            continue
        start_s, end_s = danced[0][0], danced[-1][1]
        if max(abs(start_s - pin.start_s), abs(end_s - pin.end_s)) > _MOVED_S:
            notes.append(
                f"{pin} is danced from {start_s:.1f} to {end_s:.1f} s, because a new dance is shaped around "
                "it: with --existing, only what is asked for changes"
            )
    return tuple(notes)
