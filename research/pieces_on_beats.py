"""Dances of experts to a song, placed on its beats count by count."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from choreograph.core.counts import Counts
from choreograph.core.errors import ParameterError
from choreograph.core.timebase import NET_FPS
from choreograph.library.songs import song_counts
from choreograph.motion.contacts import lock_feet
from choreograph.motion.motion import Motion, Take
from choreograph.motion.retargeting import retarget
from choreograph.motion.skeleton import canonical_skeleton
from choreograph.music.bars import level_at_tempo, tempo_bpm
from choreograph.music.beats import DEFAULT_TRACKER
from choreograph.music.count_grids import SongGrid, steady_times_s
from choreograph.music.mel import log_mel
from choreograph.music.song import Song
from choreograph.plan.joins import MotionReader, time_transitions
from choreograph.plan.runs import Run, with_transitions
from choreograph.render.assembly import assemble
from choreograph.render.dynamics import hold_ends
from choreograph.render.rendering import lock_feet_at_joins

# Pieces of takes laid on a song's beats count by count, one after another, as a choreography says.


_SAME_INSTANT_S = 0.03  # pieces that follow one another in their take within a frame or two are one


@dataclass(frozen=True)
class Piece:
    """A part of a take that lasts a whole number of counts, evenly spaced."""

    take: str
    start_s: float  # in the take
    end_s: float
    n_counts: int


def place_pieces(
    pieces: Sequence[Piece],
    song_counts: Counts,
    first_beat: int,
    read_motion: MotionReader,
    *,
    duration_s: float,
    fps: float = 60.0,
) -> Motion:
    """The dance of `pieces` to a song of `duration_s`, from its beat `first_beat` on, 60 fps unless given.

    Each count lies on a beat. Before the first and after the last count, poses are held. Pieces that the song
    is too short for are left out. Feet are locked.

    Raises `ParameterError` without pieces, or if the song has too few beats or ends within a second of the
    first.
    """
    grid = SongGrid.of(song_counts, duration_s)
    runs: list[Run] = []
    if grid is not None and 0 <= first_beat < len(song_counts) - 1:
        # Rounded: the grid is steady, and a first beat that jitters must not move all others.
        first_index = round(float(grid.index_at(song_counts.times_s[[first_beat]])[0]))
        runs = _runs(pieces, grid, first_index, duration_s)
    if not runs:
        raise ParameterError(
            f"expected pieces, and beats to lay them on, got {len(pieces)} and {len(song_counts)}, the first "
            f"of them {first_beat}: the song may be too short"
        )
    opening_s = runs[0].start_s
    closing_s = min(runs[-1].stop_s, duration_s)
    timings = time_transitions(
        runs, [run.start_s for run in runs], dict.fromkeys((run.take for run in runs), np.inf), read_motion,
        fps=fps, blending="inertial",
    )  # fmt: skip
    whole = [_lengthened(runs[0], 0.0, runs[0].stop_s), *runs[1:]]
    whole[-1] = _lengthened(whole[-1], whole[-1].start_s, duration_s)
    motion, joins = assemble(
        with_transitions(whole, timings), read_motion, fps=fps, duration_s=duration_s, blending="inertial"
    )
    held_from_s = closing_s if closing_s < duration_s - 0.5 else None
    held = hold_ends(motion, opening_s, held_from_s)
    lock_feet_at_joins(held, joins, opening_s, held_from_s)
    return held


def _runs(pieces: Sequence[Piece], grid: SongGrid, first_index: int, duration_s: float) -> list[Run]:
    """One run for all pieces that follow one another in one take."""
    groups: list[list[Piece]] = []
    for piece in pieces:
        last = groups[-1][-1] if groups else None
        if last and piece.take == last.take and abs(piece.start_s - last.end_s) < _SAME_INSTANT_S:
            groups[-1].append(piece)
        else:
            groups.append([piece])
    runs: list[Run] = []
    index = first_index
    for group in groups:
        n_counts = np.cumsum([0, *(piece.n_counts for piece in group)])
        borders_s = [group[0].start_s, *(piece.end_s for piece in group)]
        start_s, stop_s = (grid.time_at(index + n) for n in (0, n_counts[-1]))
        if start_s > duration_s - 1.0:
            break
        stop_s = min(stop_s, duration_s)
        times_s = np.linspace(start_s, stop_s, max(2, round((stop_s - start_s) * NET_FPS)) + 1)
        source_s = np.interp(grid.index_at(times_s) - index, n_counts, borders_s)
        runs.append(Run(group[0].take, start_s, stop_s, source_s))
        index += n_counts[-1]
    return runs


def _lengthened(run: Run, start_s: float, stop_s: float) -> Run:
    """The run from earlier or to later, in the poses of its ends: they are held there."""
    knots_s = np.linspace(start_s, stop_s, max(2, round((stop_s - start_s) * NET_FPS)) + 1)
    return Run(run.take, start_s, stop_s, run.source_s(knots_s))


# Experts' dances to a song: a real take, or a listed choreography, laid on the song's beats count by count.
#
# These are the first real dances in phase with their music that such data allows: the row `expert` of the
# tables, and pairs to learn from.


FPS = 60.0


@dataclass(frozen=True, eq=False)
class ExpertDance:
    """An expert's dance to a song."""

    motion: Motion  # from the song's first sample on
    counts: Counts  # of the song's beats that are danced
    listed_share: float  # of the counts: danced by the figures that the choreography lists, not by others


def expert_from_take(take: Take, song: Song, *, tracker: str = DEFAULT_TRACKER) -> ExpertDance:
    """A real take laid on a song's tracked beats, its first count 1 on the first downbeat.

    Raises `ParameterError` if the take has no counts, or the song no beats.
    """
    counts = take.counts
    if not counts.has_bars or len(counts) < 2:
        raise ParameterError(f"{take.name}: expected a take with counts in bars, got {len(counts)} counts")
    first = int(np.flatnonzero(counts.numbers == 1)[0])
    times_s = steady_times_s(counts.times_s[first:])
    pieces = [Piece(take.name, float(start_s), float(end_s), 1) for start_s, end_s in pairwise(times_s)]
    return _laid(pieces, {take.name: _prepared(take)}, song, tempo_bpm(counts), counts.metre, tracker)


def expert_from_figures(
    listed: Sequence[tuple[str, int]],
    recordings: Sequence[Take],
    song: Song,
    *,
    rng: np.random.Generator,
    tracker: str = DEFAULT_TRACKER,
) -> ExpertDance:
    """A choreography, (figure, counts) in order, danced by recorded figures on a song's tracked beats.

    A figure that is not recorded is replaced by a variant of it, or else by a random one, of as many counts
    of the same genre. Figures' names begin with their genre's letter. Names that are empty are time that
    passes.

    Raises `ParameterError` if no figure of the genre that fits is recorded, or the song has no beats.
    """
    letter = next((name[0] for name, _ in listed if name), "")
    recorded = [
        (figure.name, Piece(take.name, figure.start_s, figure.end_s, figure.n_counts), take.counts)
        for take in recordings
        for figure in take.figures
        if figure.name.startswith(letter) and take.counts.has_bars
    ]
    pieces, n_listed = _chosen(listed, [(name, piece) for name, piece, _ in recorded], rng)
    if not pieces:
        raise ParameterError(
            f"expected recorded figures of genre {letter!r} as long as those listed, of takes with counts, "
            f"got none among {len(recorded)} figures"
        )
    used = {piece.take for piece in pieces}
    motions = {take.name: _prepared(take) for take in recordings if take.name in used}
    bpm = float(np.median([60.0 * p.n_counts / (p.end_s - p.start_s) for p in pieces]))
    expert = _laid(pieces, motions, song, bpm, recorded[0][2].metre, tracker)
    return replace(expert, listed_share=n_listed / sum(piece.n_counts for piece in pieces))


def _chosen(
    listed: Sequence[tuple[str, int]], recorded: Sequence[tuple[str, Piece]], rng: np.random.Generator
) -> tuple[list[Piece], int]:
    """The recorded piece for each listed figure, and how many counts are danced as listed."""
    pieces: list[Piece] = []
    n_listed = 0
    for name, n_counts in listed:
        fitting = [(n, piece) for n, piece in recorded if piece.n_counts == n_counts]
        same = [piece for n, piece in fitting if n == name]
        variants = [piece for n, piece in fitting if n.rsplit("-", 1)[0] == name.rsplit("-", 1)[0]]
        options = same or variants or [piece for _, piece in fitting]
        if options:
            pieces.append(options[int(rng.integers(len(options)))])
            n_listed += n_counts if same else 0
        else:  # a length that nothing recorded has: shorter figures of half the counts, twice
            halves = [piece for _, piece in recorded if 2 * piece.n_counts == n_counts]
            pieces += [halves[int(rng.integers(len(halves)))]] * 2 if halves else []
    return pieces, n_listed


def _laid(
    pieces: Sequence[Piece],
    motions: Mapping[str, Motion],
    song: Song,
    bpm: float,
    metre: int,
    tracker: str,
) -> ExpertDance:
    """Pieces laid on a song's beats, counted at the level nearest to their own tempo."""
    mel = log_mel(song.samples)
    counts = level_at_tempo(song.samples, mel, song_counts(song, mel, tracker), metre, bpm)
    downbeats = np.flatnonzero(counts.numbers == 1)
    first = int(downbeats[0]) if len(downbeats) else 0
    motion = place_pieces(
        pieces, counts, first, lambda take, start_s, stop_s: (motions[take], 0.0),
        duration_s=song.duration_s, fps=FPS,
    )  # fmt: skip
    danced = slice(first, first + 1 + sum(piece.n_counts for piece in pieces))
    numbers: NDArray[np.int64] = np.arange(len(counts.times_s[danced])) % metre + 1
    return ExpertDance(motion, Counts(counts.times_s[danced], numbers, metre, "expert", 1.0), 1.0)


def _prepared(take: Take) -> Motion:
    """The take's motion as a repertoire has it: on the canonical skeleton, with its feet locked."""
    motion = take.motion
    if not motion.skeleton.same_as(canonical_skeleton()):
        motion = retarget(motion, canonical_skeleton())
    return lock_feet(motion)
