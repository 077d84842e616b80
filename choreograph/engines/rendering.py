"""From a plan to its motion, and which motifs the motion really dances."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from choreograph.blending.assembly import assemble
from choreograph.blending.foot_locking import DANCE_SHIFT_S, lock_feet
from choreograph.blending.runs import (
    Run,
    TransitionTiming,
    overlay_runs,
    to_runs,
    with_transitions,
    words_to_runs,
)
from choreograph.blending.sampled_runs import MotionReader
from choreograph.blending.transition_search import REACH_S, search_transitions
from choreograph.building.segmentation import WORD_FPS
from choreograph.constraints.spec import TakePin
from choreograph.errors import ParameterError
from choreograph.motifs.words import segment_words
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion import Motion
from choreograph.plan import Plan
from choreograph.repertoire import Repertoire

_LENGTH_SLACK_S = 0.1  # a take's first and last frames are held that long


def render(plan: Plan, repertoire: Repertoire) -> Motion:
    """The motion of a plan: seconds and words sampled from their takes, joined, feet locked.

    Raises `RepertoireError` if the plan names a take that the repertoire does not have,
    `ParameterError` if it wants a take beyond its end, or holds words of no take.
    """
    if plan.engine == "rollout":
        raise ParameterError("a plan of the rollout engine holds motifs, no takes: dance to its song again")
    indices = {block.planned.take: repertoire.take_index(block.planned.take) for block in plan.blocks}
    for block in plan.blocks:
        length = repertoire.takes[indices[block.planned.take]].duration_s
        if block.source_start_s < -_LENGTH_SLACK_S or block.source_end_s > length + _LENGTH_SLACK_S:
            raise ParameterError(
                f"the plan wants {block.source_start_s:.2f} to {block.source_end_s:.2f} s of take "
                f"{block.planned.take!r} at {block.start_s:.2f} s, but it lasts {length:.2f} s"
            )
    motion, _ = assemble(
        plan_runs(plan),
        _reader(repertoire),
        fps=plan.fps,
        duration_s=plan.duration_s,
        blending=plan.blending,
    )
    return lock_feet(motion, over_s=DANCE_SHIFT_S)


def plan_runs(plan: Plan) -> list[Run]:
    """What is played without a join: runs of the plan's seconds, and its words in their place."""
    words = words_to_runs(
        [word.take for word in plan.words],
        np.array([(word.start_s, word.end_s) for word in plan.words]),
        np.array([(word.source_start_s, word.source_end_s) for word in plan.words]),
        [word.pinned for word in plan.words],
    )
    seconds = _unjoined(plan)
    firsts = [plan.seconds[round(run.start_s)] for run in seconds]
    transitions = [TransitionTiming(first.start_s, first.transition_s) for first in firsts]
    return overlay_runs(with_transitions(seconds, transitions), words)


def with_searched_transitions(plan: Plan, repertoire: Repertoire, take_pins: Sequence[TakePin] = ()) -> Plan:
    """The plan whose seconds take over from one another as the rendered motion keeps the beat best.

    Where a take is pinned no other one comes in earlier, or plays on later, than planned.
    """
    runs = _unjoined(plan)
    held = [False, *(any(_between_pinned(pin, *pair) for pin in take_pins) for pair in pairwise(runs))]
    transitions = search_transitions(
        runs, np.array(plan.music_beats_s), {take.name: take.duration_s for take in repertoire.takes},
        _reader(repertoire), fps=plan.fps, blending=plan.blending, held=held,
    )  # fmt: skip
    found = {round(run.start_s): join for run, join in zip(runs, transitions, strict=True)}
    seconds = []
    for second in plan.seconds:
        join = found.get(second.second, TransitionTiming(second.second))
        transition_s = second.transition_s if join.transition_s is None else join.transition_s
        seconds.append(replace(second, start_s=round(join.start_s, 5), transition_s=transition_s))
    return replace(plan, seconds=tuple(seconds))


def _between_pinned(pin: TakePin, before: Run, after: Run) -> bool:
    """Whether one run takes over from the other at or in a pinned take's time, and not both are that take."""
    near = pin.start_s - REACH_S < after.start_s < pin.end_s + REACH_S
    return near and not before.take == after.take == pin.take


def _unjoined(plan: Plan) -> list[Run]:
    """The runs of a plan's seconds, each from its own second on."""
    return to_runs([s.take for s in plan.seconds], [s.source_times_s for s in plan.seconds])


def _reader(repertoire: Repertoire) -> MotionReader:
    indices = {take.name: index for index, take in enumerate(repertoire.takes)}
    return lambda take, start_s, stop_s: repertoire.motion(indices[take], start_s, stop_s)


def danced_motifs(motion: Motion, bounds_s: NDArray[np.float64], repertoire: Repertoire) -> NDArray[np.int64]:
    """The motif of each word (N,) of a motion, cut at `bounds_s` (N + 1,), as a repertoire's own are."""
    body = body_pos_m(motion.resampled(WORD_FPS))
    inside = np.clip(bounds_s, 0.0, (len(body) - 1) / WORD_FPS)
    words = segment_words(body, WORD_FPS, inside)
    motifs = np.full(len(bounds_s) - 1, -1, np.int64)
    if len(words):
        slots = np.searchsorted(bounds_s, (words.start_s + words.end_s) / 2, side="right") - 1
        embedded = repertoire.word_net().embed(words.body_pos_m)
        motifs[slots] = repertoire.vocabulary.motifs.nearest(embedded)
    return motifs
