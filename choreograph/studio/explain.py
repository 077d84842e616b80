"""Why something is danced: the take, its credits, what it costs in one sentence each, and the next best."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from choreograph.choreography.edits import edit_slots, slot_bounds_s
from choreograph.choreography.enforcement import AvoidRepeating, KeptBorders
from choreograph.choreography.graph.candidates import AllowedNodes
from choreograph.choreography.graph.cost import Cost
from choreograph.choreography.graph.costs import DEFAULT_WEIGHTS, cost_kinds
from choreograph.choreography.pieces import PieceRequest
from choreograph.core.counts import bars_of
from choreograph.core.errors import ParameterError
from choreograph.core.numerics import default_numerics, one_thread
from choreograph.library.repertoire import Repertoire
from choreograph.pipeline.dancing import Dance
from choreograph.pipeline.editing import Editor
from choreograph.plan.plan import Block, Plan, PlannedSecond, goes_on

_LONGEST_S = 6.0  # of a part for which the next best is looked for

# Of pieces of takes for a part of a dance, in metres of joint distance.
OF_PIECE = {
    "joins": "The poses at both ends differ from the dance around it.",
    "travel": "The path must be corrected to lead back to the dance.",
    "front": "It begins with the back to the audience.",
    "tempo": "It is played faster or slower than it was danced.",
    "count": "It begins on another count of the bar.",
    "genre": "It is of another genre than the dance has here.",
    "energy": "It is livelier or quieter than the dance was here.",
    "again": "The same part of a take is danced nearby.",
    "difference": "It differs from what was danced here.",
}


def explained(dance: Dance, repertoire: Repertoire, at_s: float) -> dict[str, Any]:
    """What is danced at a time, with its reasons, as JSON. Raises `ParameterError` outside of the dance."""
    plan = dance.plan
    if not 0 <= at_s <= plan.duration_s:
        raise ParameterError(f"expected a time within the dance of {plan.duration_s:g} s, got {at_s:g}")
    run = run_at(plan, at_s)
    first, last = run[0], run[-1]
    start_s, end_s = first.start_s, last.end_s
    source_s = last.source_end_s - first.source_start_s
    costs: dict[str, float] = {}
    for block in run:
        if isinstance(block.planned, PlannedSecond):
            for name, cost in block.planned.costs.items():
                costs[name] = costs.get(name, 0.0) + cost
    edits = [edit.request for edit in plan.edits if edit.start_s < end_s and edit.end_s > start_s]
    return {
        "take": first.source, **asdict(first.planned.credits),
        "figure": _figure(repertoire, first, at_s, run),
        "start_s": round(start_s, 4), "end_s": round(end_s, 4), "bars": _bars(plan, start_s, end_s),
        "from_s": round(first.source_start_s, 3), "to_s": round(last.source_end_s, 3),
        "stretched": round((end_s - start_s) / source_s, 4) if source_s > 0 else None,
        "mirrored": first.mirrored, "edits": edits, "reasons": reasons(costs, of_dance()),
        "next_best": next_best(dance, repertoire, (start_s, end_s), at_s),
    }  # fmt: skip


def run_at(plan: Plan, at_s: float) -> Sequence[Block]:
    """The blocks around a time in which one take goes on without a jump."""
    blocks = plan.blocks
    here = next((i for i, block in enumerate(blocks) if block.start_s <= at_s < block.end_s), len(blocks) - 1)
    first = last = here
    while first > 0 and goes_on(blocks[first - 1], blocks[first]):
        first -= 1
    while last < len(blocks) - 1 and goes_on(blocks[last], blocks[last + 1]):
        last += 1
    return blocks[first : last + 1]


def reasons(costs: Mapping[str, float], sentences: Mapping[str, str]) -> list[dict[str, Any]]:
    """The costs in order, each with its share of all and a sentence. Those of 0 are left out."""
    total = sum(costs.values())
    return [
        {
            "name": name, "cost": round(cost, 4), "share": round(cost / total, 4),
            "sentence": sentences.get(name, "A cost of your own."),
        }
        for name, cost in sorted(costs.items(), key=lambda item: -item[1])
        if cost > 0
    ]  # fmt: skip


def of_dance() -> dict[str, str]:
    """The sentences of the costs of the graph engine, by name, also of those that requests add."""
    kinds: list[type[Cost]] = [*cost_kinds(), AllowedNodes, KeptBorders, AvoidRepeating]
    return {kind.name: kind.sentence for kind in kinds}


def weight_choices() -> list[dict[str, Any]]:
    """A slider for the weight of each cost of the graph engine. That of another package is not used at 0."""
    return [
        {"name": cost.name, "label": cost.label, "default": DEFAULT_WEIGHTS.get(cost.name, 0.0), "low": 0.0,
         "high": cost.highest_weight, "sentence": cost.sentence}
        for cost in cost_kinds()
    ]  # fmt: skip


@default_numerics()
@one_thread()
def next_best(
    dance: Dance, repertoire: Repertoire, span_s: tuple[float, float], at_s: float
) -> dict[str, Any] | None:
    """The cheapest piece of a take that could be danced instead, or None if there is none."""
    bounds_s = slot_bounds_s(dance.plan)
    start_s = max(span_s[0], at_s - 0.5 * _LONGEST_S)
    end_s = min(span_s[1], start_s + _LONGEST_S)
    editor = Editor(dance, repertoire, (), 0)
    _, found = editor.pieces(edit_slots(start_s, end_s, bounds_s), PieceRequest(editor.allowed))
    if not found:
        return None
    best = found[0]
    return {
        "take": best.words[0].take, "genre": best.words[0].credits.genre, "why": best.why,
        "start_s": best.words[0].start_s, "end_s": best.words[-1].end_s, "cost": round(best.cost, 4),
        "reasons": reasons(best.costs, OF_PIECE),
    }  # fmt: skip


def _figure(repertoire: Repertoire, first: Block, at_s: float, run: Sequence[Block]) -> str | None:
    """The figure of the take at a time, if it is known."""
    if not first.planned.take:
        return None
    here = next((block for block in run if block.start_s <= at_s < block.end_s), first)
    source_s = here.source_s(at_s)
    figures = repertoire.figures(repertoire.take_index(first.planned.take))
    return next((figure.name for figure in figures if figure.start_s <= source_s < figure.end_s), None)


def _bars(plan: Plan, start_s: float, end_s: float) -> list[int]:
    """The numbers of the first and the last bar of a part, or none if bars are not known."""
    if not plan.music_beat_numbers:
        return []
    beats = zip(plan.music_beats_s, bars_of(plan.music_beat_numbers).tolist(), strict=True)
    inside = [int(bar) for s, bar in beats if start_s <= s < end_s]
    return [inside[0], inside[-1]] if inside else []
