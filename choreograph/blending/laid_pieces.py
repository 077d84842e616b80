"""Pieces of takes laid on a song's beats count by count, one after another, as a choreography says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from choreograph.blending.assembly import assemble
from choreograph.blending.foot_locking import DANCE_SHIFT_S, lock_feet
from choreograph.blending.held_ends import hold_ends
from choreograph.blending.runs import Run, with_transitions
from choreograph.blending.sampled_runs import MotionReader
from choreograph.blending.transition_timing import time_transitions
from choreograph.counts import Counts
from choreograph.errors import ParameterError
from choreograph.motion.motion import Motion
from choreograph.timebase import NET_FPS
from choreograph.warping import SongGrid

_SAME_INSTANT_S = 0.03  # pieces that follow one another in their take within a frame or two are one


@dataclass(frozen=True)
class Piece:
    """A part of a take that lasts a whole number of counts, evenly spaced."""

    take: str
    start_s: float  # in the take
    end_s: float
    n_counts: int


def lay_pieces(
    pieces: Sequence[Piece],
    song_counts: Counts,
    first_beat: int,
    read_motion: MotionReader,
    *,
    duration_s: float,
    fps: float = 60.0,
) -> Motion:
    """The dance of `pieces` to a song of `duration_s`, from its beat `first_beat` on, 60 fps unless given.

    Each count lies on a beat. Before the first and after the last count, poses are held; pieces that the song
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
    motion, _ = assemble(
        with_transitions(whole, timings), read_motion, fps=fps, duration_s=duration_s, blending="inertial"
    )
    held = hold_ends(motion, opening_s, closing_s if closing_s < duration_s - 0.5 else None)
    return lock_feet(held, shift_s=DANCE_SHIFT_S)


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
