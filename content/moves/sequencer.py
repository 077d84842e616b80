"""Sequencing of a genre's moves to the beats of a song, rendered as takes with ground truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats
from choreograph.motion.motion import Motion
from content.moves.body import animate
from content.moves.carriage import Carriage
from content.moves.curves import Tempo
from content.moves.feet import FootPath
from content.moves.figures import Figure, Manner
from content.moves.keyframes import PlacedMove, build_keyframes
from content.moves.notation import Move, Side, varied

STAGE_M = 2.0  # soft limit of the distance of a home from the middle, for most genres
_EASY_S = 0.5  # duration of a count at which steps have their written size
_LARGEST, _LARGEST_FIGURE = 1.25, 1.4  # at larger sizes, kicks and lunges are out of reach
_RETURNS = 0.3  # how often two bars are danced again, on the other side
_TOO_FAR = 3.0  # cost of a phrase that leaves the stage
_AFTER_S = 0.6  # length of a take after its last beat
_MANNER, _CARRIAGE = Manner(), Carriage()


@dataclass(frozen=True)
class Genre:
    """A genre: its moves and how they are danced."""

    name: str
    moves: tuple[Move, ...] = ()
    figures: tuple[Figure, ...] = ()
    manner: Manner = _MANNER  # of its figures
    steer_deg: float = 20.0  # spread of the turn that is added to a figure
    stage_m: float = STAGE_M
    bar: int = 4  # counts
    size: float = 1.0
    sharpness: float = 0.4  # at middle energy
    bounce: float = 1.0
    carriage: Carriage = _CARRIAGE
    # From this tempo on, moves are danced with two beats per count.
    half_time_from_bpm: float = 400.0


@dataclass(frozen=True, eq=False)
class RenderedTake:
    """A take with its ground truth."""

    motion: Motion
    placed: tuple[PlacedMove, ...]  # the moves, with their start counts and positions
    count_times_s: Floats  # (C,) times of the counts: every beat, or every second one in half time
    feet: dict[Side, FootPath]  # foot paths, with the frames in which each is planted


def render_take(
    genre: Genre,
    beat_times_s: NDArray[np.floating],
    *,
    energy: NDArray[np.floating] | float = 0.5,
    seed: int = 0,
    fps: float = 60.0,
    first_downbeat: int = 0,
    first: Move | None = None,
    middle: Move | None = None,
    last: Move | None = None,
) -> RenderedTake:
    """Dance a genre to a song.

    `beat_times_s` (Q,): the song's beats in seconds from the take's first frame. The beat with index
    `first_downbeat` starts a bar. `energy`: from 0 (small, soft) to 1 (big, sharp), a scalar or one value
    per beat (Q,). A move is repeated for two or four bars, on alternate sides if it ends on the other
    foot. Two bars that begin a phrase of four are often danced again. The next move must start with the
    free foot. The dancer stays within `STAGE_M` of the middle where the moves allow it. The same arguments
    give the same take.

    Raises `ParameterError` if beats are not increasing, or the number of energies is not that of beats.
    """
    beats = np.asarray(beat_times_s, np.float64)
    energies = np.asarray(energy, np.float64)
    if energies.ndim == 0:
        energies = np.full(len(beats), float(energies))
    if len(energies) != len(beats):
        raise ParameterError(f"expected one energy per beat, got {len(energies)} for {len(beats)} beats")
    Tempo(beats)  # checks them
    every = 2 if 60.0 / np.median(np.diff(beats)) >= genre.half_time_from_bpm else 1
    counts_s, energies = beats[first_downbeat::every], energies[first_downbeat::every]
    rng = np.random.default_rng(seed)
    placed = _sequence(genre, counts_s, energies, rng, first, middle, last)
    duration_s = float(beats[-1]) + _AFTER_S
    return render(placed, counts_s, rng=rng, fps=fps, duration_s=duration_s, carriage=genre.carriage)


def render(
    placed: Sequence[PlacedMove],
    count_times_s: NDArray[np.floating],
    *,
    rng: np.random.Generator | None,
    fps: float = 60.0,
    duration_s: float | None = None,
    carriage: Carriage = _CARRIAGE,
) -> RenderedTake:
    """Render placed moves, each starting where and when the previous one ended.

    Without `rng`, exactly as written: no breath, no sway, no variation.
    """
    counts_s = np.asarray(count_times_s, np.float64)
    tempo = Tempo(counts_s)
    until_s = float(counts_s[-1]) + _AFTER_S if duration_s is None else duration_s
    motion, feet = animate(build_keyframes(placed, rng, carriage), tempo, until_s, fps, rng, carriage)
    return RenderedTake(motion, tuple(placed), counts_s, feet)


def sequence_moves(moves: Sequence[Move], **manner: float) -> list[PlacedMove]:
    """Place moves one after another, from count 0 in the middle. `manner` is size, sharpness and so on."""
    placed: list[PlacedMove] = []
    origin, yaw, count = (0.0, 0.0), 0.0, 0
    for move in moves:
        placed.append(PlacedMove(move, False, count, origin, yaw, **manner))
        (origin, yaw), count = placed[-1].end(), count + move.counts
    return placed


def _sequence(
    genre: Genre, counts_s: Floats, energies: Floats, rng: np.random.Generator, first: Move | None,
    middle: Move | None, last: Move | None,
) -> list[PlacedMove]:  # fmt: skip
    placed: list[PlacedMove] = []
    count = 0
    for fixed, until in (
        (first, 0),
        (middle, genre.bar * ((len(counts_s) - 1) // (2 * genre.bar))),
        (last, len(counts_s) - 1 - (last.counts if last else 0)),
    ):
        while count < until:
            placed += _next_phrase(genre, placed, count, counts_s, energies, rng)
            count = placed[-1].start + placed[-1].move.counts
        if fixed is not None:
            placed.append(_fixed(fixed, placed, count, genre))
            count += fixed.counts
    return placed


def _fixed(move: Move, placed: list[PlacedMove], count: int, genre: Genre) -> PlacedMove:
    free = placed[-1].move.free_foot if placed else None
    mirrored = free is not None and move.first_foot not in (None, free)
    origin, yaw = placed[-1].end() if placed else ((0.0, 0.0), 0.0)
    return PlacedMove(move.mirrored() if mirrored else move, mirrored, count, origin, yaw, size=genre.size)


def _next_phrase(
    genre: Genre, placed: list[PlacedMove], count: int, counts_s: Floats, energies: Floats,
    rng: np.random.Generator,
) -> list[PlacedMove]:  # fmt: skip
    """A phrase that follows what is placed, drawn by its cost and by how often it has been danced.

    The figures of two bars are often danced again, on the other side if the feet allow it: four bars in all.
    """
    written = (*genre.moves, *genre.figures)
    again = _two_bars_before(genre, placed, count)
    if again and rng.random() < _RETURNS:
        phrase = _phrase(genre, again, placed, count, counts_s, energies, rng)
        if phrase and _cost(phrase, genre.stage_m) < _TOO_FAR:
            return phrase
    options = [
        phrase
        for move in written
        if not placed or move.name != placed[-1].move.name or len(written) == 1
        for times in [2 if move.counts <= genre.bar and rng.random() < 0.5 else 1]
        for phrase in [_phrase(genre, [move] * times, placed, count, counts_s, energies, rng)]
        if phrase
    ]
    if not options:
        raise ParameterError(f"{genre.name}: no other move can follow {placed[-1].move.name}")
    used = [sum(p.move.name == phrase[0].move.name for p in placed) for phrase in options]
    odds = np.exp([-_cost(phrase, genre.stage_m) - 0.9 * n for phrase, n in zip(options, used, strict=True)])
    return options[rng.choice(len(options), p=odds / odds.sum())]


def _two_bars_before(genre: Genre, placed: list[PlacedMove], count: int) -> list[Move | Figure]:
    """What was danced in the two bars before `count`, if these are the first half of a phrase of four."""
    start = count - 2 * genre.bar
    half = [p for p in placed if p.start >= start]
    by_name = {written.name: written for written in (*genre.moves, *genre.figures)}
    if start % (4 * genre.bar) or not half or half[0].start != start:
        return []
    return [by_name[p.move.name] for p in half if p.move.name in by_name]


def _phrase(
    genre: Genre, figures: Sequence[Move | Figure], placed: list[PlacedMove], count: int, counts_s: Floats,
    energies: Floats, rng: np.random.Generator,
) -> list[PlacedMove]:  # fmt: skip
    """Figures from `count`, the same one again on the other side. Empty if the song is too fast for them."""
    first = min(count, len(counts_s) - 2)
    if counts_s[first + 1] - counts_s[first] < 60.0 / min(written.fastest_bpm for written in figures):
        return []
    phrase: list[PlacedMove] = []
    at = count
    for written in figures:
        before = phrase[-1] if phrase else placed[-1] if placed else None
        free = before.move.free_foot if before else None
        mirrored = bool(rng.random() < 0.5) if not phrase else not phrase[-1].mirrored
        if free is not None and written.first_foot is not None:
            mirrored = written.first_foot != free
        phrase.append(_placed(genre, written, mirrored, before, at, counts_s, energies, rng))
        at += written.counts
    return phrase


def _placed(
    genre: Genre, written: Move | Figure, mirrored: bool, before: PlacedMove | None, at: int,
    counts_s: Floats, energies: Floats, rng: np.random.Generator,
) -> PlacedMove:  # fmt: skip
    """A move from the count `at`, where the one before it ended, as large and sharp as the song asks."""
    largest = _LARGEST_FIGURE if isinstance(written, Figure) else _LARGEST
    origin, yaw = before.end() if before else ((0.0, 0.0), 0.0)
    i = min(at, len(counts_s) - 2)
    lively = float(np.clip(energies[min(at, len(energies) - 1)], 0.0, 1.0))
    fast = float(np.clip(((counts_s[i + 1] - counts_s[i]) / _EASY_S) ** 0.6, 0.65, 1.2))
    return PlacedMove(
        _danced(genre, written, mirrored, rng), mirrored, at, origin, yaw,
        size=float(np.clip(genre.size * fast * (0.74 + 0.42 * lively), 0.6, largest)),
        sharpness=float(np.clip(genre.sharpness + 0.5 * (lively - 0.5), 0.0, 1.0)),
        bounce=genre.bounce * (0.75 + 0.5 * lively),
    )  # fmt: skip


def _danced(genre: Genre, written: Move | Figure, mirrored: bool, rng: np.random.Generator) -> Move:
    """A figure or a move, or its mirror image, as it is danced this time."""
    if isinstance(written, Figure):
        steer_deg = float(rng.normal(0.0, genre.steer_deg))
        return written.move(genre.manner, rng, steer_deg=steer_deg, mirrored=mirrored)
    move = varied(written, rng, length=genre.manner.varies, turn_deg=genre.steer_deg)
    return move.mirrored() if mirrored else move


def _cost(phrase: list[PlacedMove], stage_m: float) -> float:
    """Cost of a phrase: it leaves the stage, or ends with the dancer turned away."""
    ends = [p.end() for p in phrase]
    out = max(float(np.hypot(*origin)) for origin, _ in ends)
    turned = abs((ends[-1][1] + np.pi) % (2 * np.pi) - np.pi)
    from_middle = float(np.hypot(*ends[-1][0])) / stage_m
    return 6.0 * max(0.0, out - 0.75 * stage_m) + from_middle + 0.3 * turned
