"""Scores of a plan: its transitions, repeats, variety and genre of its takes, and how fast it plays them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from choreograph.blending.rendering import plan_runs
from choreograph.counts import Counts
from choreograph.evaluation.danced_counts import figure_borders_s
from choreograph.evaluation.scores import Scores
from choreograph.metrics import structure, transitions, warping
from choreograph.plan import Plan
from choreograph.repertoire import Repertoire
from choreograph.timebase import NET_FPS, NODE_FRAMES

Floats = NDArray[np.float64]


def plan_scores(plan: Plan, repertoire: Repertoire, genre: str = "") -> Scores:
    """Structure and warping of a plan; empty unless it is made from takes.

    `genre` is that of the song, where it is known.
    """
    if not plan.from_takes:
        return Scores({})
    blocks = plan.blocks
    takes = [block.planned.take for block in blocks]
    pieces_s = np.array([(b.start_s, b.end_s, b.source_start_s, b.source_end_s) for b in blocks])
    scores = {
        "longest_repeat_s": structure.longest_repeat_s(takes, pieces_s),
        "distinct_takes_per_minute": structure.distinct_takes_per_minute(takes, plan.duration_s),
    }
    if plan.seconds:
        scores |= warping.evaluate(time_maps(plan))
    genres = {take.name: take.credits.genre for take in repertoire.takes}
    if genre not in genres.values():
        return Scores(scores)
    of_genre_s = sum(length_s for take, length_s in plan.takes_s().items() if genres[take] == genre)
    lengths_s = np.array([take.duration_s for take in repertoire.takes])
    chance = float(
        lengths_s[[take.credits.genre == genre for take in repertoire.takes]].sum() / lengths_s.sum()
    )
    return Scores(scores | {"own_genre": of_genre_s / plan.duration_s}, {"own_genre": chance})


def transition_scores(plan: Plan, repertoire: Repertoire, music: Counts) -> Scores:
    """How often the takes change and whether at borders of bars and figures; empty unless made from takes.

    Chance is transitions at random instants of the song's beats.
    """
    if not plan.from_takes:
        return Scores({})
    scores = transitions.evaluate(
        transition_times_s(plan),
        plan.duration_s,
        music.times_s,
        music.numbers,
        figure_borders_s(plan, repertoire),
    )
    known = {name: value for name, value in scores.items() if np.isfinite(value)}
    chance = transitions.uniform_chance(max(1, music.metre))
    return Scores(known, {name: level for name, level in chance.items() if name in known})


def genre_by_second(plan: Plan, repertoire: Repertoire) -> list[str]:
    """Genre of the take danced in the middle of every whole second; empty strings without takes."""
    genres = {take.name: take.credits.genre for take in repertoire.takes}
    middles_s = np.arange(int(plan.duration_s)) + 0.5
    blocks = plan.blocks
    starts_s = [block.start_s for block in blocks]
    danced = np.clip(np.searchsorted(starts_s, middles_s, side="right") - 1, 0, None)
    return [genres.get(blocks[index].planned.take, "") for index in danced]


def time_maps(plan: Plan) -> Floats:
    """The take's frame at every frame of the plan's seconds, ends included, (S, 21) at 20 fps."""
    times_s = np.array([second.source_times_s for second in plan.seconds], np.float64)
    return times_s.reshape(-1, NODE_FRAMES + 1) * NET_FPS


def transition_times_s(plan: Plan) -> Floats:
    """Times in seconds, (B,), at which one run of a take takes over from another; none without takes."""
    if not plan.from_takes:
        return np.zeros(0)
    return np.array([run.start_s for run in plan_runs(plan)[1:]])
