"""What `choreograph dance` prints about its dances."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import click

from choreograph.cli.dance_jobs import Outputs, Result
from choreograph.cli.present import printable, say, show_notes, table_console
from choreograph.errors import ChoreographError

if TYPE_CHECKING:
    from choreograph.pipeline import Dance
    from choreograph.plan import Plan


def present(
    results: Sequence[Result], notes: Sequence[str], *, as_json: bool, quiet: bool, looped: bool, many: bool
) -> None:
    """Print the dances: as JSON (a list if `many` or of several songs), a line each, or a table of songs.

    `notes` are on all of them. Raises `ChoreographError` at the end if some of several songs could not be
    danced.
    """
    made = [pair for result in results for pair in _dances(result)]
    if as_json:
        facts = [_facts(dance, notes, paths) for dance, paths in made]
        facts += [{"song": str(result.job.song), "error": result.error} for result in results if result.error]
        click.echo(json.dumps(facts if many or len(results) > 1 else facts[0], indent=1))
    elif not quiet:
        show_notes(notes)
        many_songs = len(results) > 1
        show_notes(dict.fromkeys(note for result in results for note in _notes(result, named=many_songs)))
        show_notes(_loop_note(dance) for dance, _ in made if looped)
        if many_songs:
            _show_table(results)
        else:
            for dance, paths in made:
                say(_summary(dance.plan, paths))
    failed = [result for result in results if result.error]
    if failed:
        raise ChoreographError(f"{len(failed)} of {len(results)} songs are not danced: {failed[0].error}")


def _dances(result: Result) -> Iterator[tuple[Dance, Outputs]]:
    """The dances and their files; none if the job failed."""
    return zip(result.dances, result.job.outputs, strict=not result.error)


def _notes(result: Result, *, named: bool) -> Iterator[str]:
    """The notes on a song's dances, or why there are none; with the song's name if `named`."""
    notes = [note for dance in result.dances for note in dance.notes]
    notes += [f"not danced: {result.error}"] if result.error else []
    yield from (f"{result.job.song.name}: {note}" if named else note for note in notes)


def _show_table(results: Sequence[Result]) -> None:
    """Print a row for each dance."""
    from rich.table import Table

    table = Table(box=None, pad_edge=False)
    for name in ("song", "files", "seconds", "takes", "beats"):
        table.add_column(name, justify="left" if name in ("song", "files") else "right", no_wrap=True)
    for result in results:
        song = printable(result.job.song.name)
        if result.error:
            table.add_row(song, "not danced", "-", "-", "-")
        for dance, paths in _dances(result):
            plan = dance.plan
            numbers = f"{plan.duration_s:.1f}", str(len(plan.takes_s())), str(len(plan.music_beats_s))
            table.add_row(song, printable(", ".join(map(str, paths))), *numbers)
    table_console().print(table)


def _loop_note(dance: Dance) -> str:
    loop = dance.loop
    return (
        f"{dance.plan.song}: motion files loop, {loop.n_bars} bars from {loop.start_s:.2f} to "
        f"{loop.end_s:.2f} s of the dance"
    )


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


def _facts(dance: Dance, notes: Sequence[str], outputs: Outputs) -> dict[str, Any]:
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
        "notes": [*notes, *dance.notes],
    }
