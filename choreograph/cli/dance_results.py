"""What `choreograph dance` writes, and what it prints about it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from choreograph.cli.present import show_notes

if TYPE_CHECKING:
    from choreograph.pipeline import Dance
    from choreograph.plan import Plan

Outputs = tuple[Path, ...]  # the files of one dance


def outputs_for(given: Outputs, stem: str, opened: bool) -> Outputs:
    """The files to write: those given, else a motion and a page; a page in any case if it is to be opened."""
    outputs = given or (Path(f"{stem}.bvh"), Path(f"{stem}.html"))
    if opened and not any(path.suffix.lower() == ".html" for path in outputs):
        outputs = (*outputs, Path(f"{stem}.html"))
    return outputs


def numbered(outputs: Outputs, variations: int | None) -> list[Outputs]:
    """The files of every variation, NAME-1.bvh for NAME.bvh; without variations, `outputs` once."""
    if variations is None:
        return [outputs]
    return [
        tuple(path.with_name(f"{path.stem}-{number}{path.suffix}") for path in outputs)
        for number in range(1, max(variations, 1) + 1)
    ]


def present(
    dances: Sequence[Dance], outputs: Sequence[Outputs], *, as_json: bool, quiet: bool, many: bool
) -> None:
    """Print the dances as JSON (a list if `many`), or their notes and one line each."""
    made = list(zip(dances, outputs, strict=True))
    if as_json:
        facts = [_facts(dance, paths) for dance, paths in made]
        click.echo(json.dumps(facts if many else facts[0], indent=1))
    elif not quiet:
        show_notes(dict.fromkeys(note for dance in dances for note in dance.notes))
        for dance, paths in made:
            click.echo(_summary(dance.plan, paths))


def _summary(plan: Plan, outputs: Outputs) -> str:
    takes = {block.planned.take for block in plan.blocks if block.planned.take}
    sources = [f"{len(takes)} takes"] if takes else []
    if any(not block.source for block in plan.blocks):
        sources.append("the rollout network")
    sources += sorted({block.kept for block in plan.blocks if block.kept})
    of = " and ".join(sources)
    n_words = sum(not word.kept for word in plan.words)
    words = f", {n_words} motion words" if n_words else ""
    return (
        f"{', '.join(str(path) for path in outputs)}: {plan.duration_s:.1f} s from {of}, "
        f"{len(plan.music_beats_s)} music beats{words}"
    )


def _facts(dance: Dance, outputs: Outputs) -> dict[str, Any]:
    plan = dance.plan
    credits = {block.source: block.planned.credits for block in plan.blocks}
    takes_s = sorted(plan.takes_s().items(), key=lambda item: -item[1])
    return {
        "outputs": [str(path) for path in outputs],
        "song": plan.song,
        "repertoire": plan.repertoire,
        "duration_s": plan.duration_s,
        "music_beats": len(plan.music_beats_s),
        "motion_beats": len(dance.motion_beats_s),
        "takes": [
            {"name": name, "seconds": round(danced_s, 3), **vars(credits[name])} for name, danced_s in takes_s
        ],
        "blocks": [
            {"start_s": round(block.start_s, 4), "end_s": round(block.end_s, 4), "source": block.source}
            for block in plan.blocks
        ],
        "engine": plan.engine,
        "motifs": [word.motif for word in plan.words if not word.kept],
        "cost": round(plan.total_cost, 4),
        "notes": list(dance.notes),
    }
