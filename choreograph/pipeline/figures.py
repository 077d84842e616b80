"""The figures that a dance consists of, by the takes of its plan, and those of each dancer of a scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from choreograph.core.counts import Figure, counts_later_s
from choreograph.library.repertoire import Repertoire
from choreograph.plan.plan import Plan
from choreograph.plan.scenes import DancerPart

_SHORTEST_S = 0.25  # parts of a figure that are shorter say little of it


def danced_figures(plan: Plan, repertoire: Repertoire) -> tuple[Figure, ...]:
    """The figures of the takes that are danced, in seconds of the dance and in order.

    A figure of which a part is danced has the time of that part. Parts that follow each other are one.
    Takes without figures and dances of networks have none.
    """
    index_of = {take.name: index for index, take in enumerate(repertoire.takes)}
    found: list[Figure] = []
    for block in plan.blocks:
        take = index_of.get(block.source)
        length_s = block.source_end_s - block.source_start_s
        if take is None or block.kept or length_s <= 0.0:
            continue
        speed = (block.end_s - block.start_s) / length_s
        for figure in repertoire.figures(take):
            start_s = max(figure.start_s, block.source_start_s)
            end_s = min(figure.end_s, block.source_end_s)
            if end_s <= start_s:
                continue
            part = Figure(
                figure.name,
                block.start_s + speed * (start_s - block.source_start_s),
                block.start_s + speed * (end_s - block.source_start_s),
                figure.n_counts,
            )
            before = found[-1] if found else None
            if before is not None and before.name == part.name and part.start_s - before.end_s < _SHORTEST_S:
                found[-1] = Figure(part.name, before.start_s, part.end_s, part.n_counts)
            else:
                found.append(part)
    return tuple(figure for figure in found if figure.end_s - figure.start_s >= _SHORTEST_S)


def figures_from(figures: Sequence[Figure], start_s: float) -> tuple[Figure, ...]:
    """The figures of a part of a dance that begins at `start_s`, with times from there."""
    if start_s == 0.0:
        return tuple(figures)
    return tuple(
        replace(figure, start_s=max(0.0, figure.start_s - start_s), end_s=figure.end_s - start_s)
        for figure in figures
        if figure.end_s > start_s
    )


def figures_of_parts(
    parts: Sequence[DancerPart], of_dances: Sequence[Sequence[Figure]], plan: Plan
) -> tuple[Figure, ...]:
    """The figures that a dancer of a scene dances, in order, from those of each of its dances.

    Where a pose is held, the figure before goes on. `plan` is that of the leader's dance, with the counts.
    """
    found: list[Figure] = []
    for part in parts:
        if part.held:
            if found and found[-1].end_s >= part.start_s - _SHORTEST_S:
                found[-1] = replace(found[-1], end_s=part.end_s)
            continue
        for figure in of_dances[part.dance]:
            later_s = np.array([figure.start_s, figure.end_s])
            if part.delay_counts:
                later_s = counts_later_s(plan.music_beats_s, later_s, part.delay_counts)
            start_s, end_s = max(float(later_s[0]), part.start_s), min(float(later_s[1]), part.end_s)
            if end_s > start_s:
                found.append(replace(figure, start_s=start_s, end_s=end_s))
    return tuple(found)
