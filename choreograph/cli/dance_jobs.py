"""The songs of `choreograph dance` and the files for them, and the printed results."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from choreograph.cli.dance_options import SONG, default_names, numbered
from choreograph.cli.present import printable, say, show_notes, table_console
from choreograph.core.errors import ChoreographError, ParameterError
from choreograph.core.files import check_apart, file_identity, free_names
from choreograph.core.progress import counted
from choreograph.settings import MAX_VARIATIONS

if TYPE_CHECKING:
    from choreograph.cli.dance_options import FileOptions
    from choreograph.pipeline.dancing import Dance
    from choreograph.plan.plan import Plan

# The files that `choreograph dance` writes for each song.


Outputs = tuple[Path, ...]  # the files of one dance


@dataclass(frozen=True)
class Job:
    """A song, or a plan, and the files of each of its dances."""

    song: Path
    outputs: tuple[Outputs, ...]


@dataclass(frozen=True, eq=False)
class Danced:
    """What is printed of a dance."""

    plan: Plan
    notes: tuple[str, ...]
    n_motion_beats: int  # 0 if they are not printed
    loop: tuple[int, float, float] | None  # its bars, and its start and end in seconds of the dance

    @classmethod
    def of(cls, dance: Dance, files: FileOptions) -> Danced:
        """What `files` prints of a dance."""
        loop = (dance.loop.n_bars, dance.loop.start_s, dance.loop.end_s) if files.loop else None
        return cls(dance.plan, dance.notes, len(dance.motion_beats_s) if files.as_json else 0, loop)


@dataclass(frozen=True, eq=False)
class Result:
    """The result of a job: its dances, or the reason why there are none."""

    job: Job  # its song and files
    dances: tuple[Danced, ...] = ()  # one for each variation
    error: str = ""  # why there are none


def jobs_of(songs: Sequence[Path], given: Outputs, opened: bool, variations: int | None) -> tuple[Job, ...]:
    """A job for each song.

    Raises `ParameterError` for no song, a number of variations out of range, or two songs with one file.
    """
    if not songs:
        raise ParameterError("expected a SONG, or --plan FILE. `choreograph songs` lists a few to begin with")
    if variations is not None and not 1 <= variations <= MAX_VARIATIONS:
        raise ParameterError(f"expected 1 to {MAX_VARIATIONS} variations, got {variations}")
    jobs = tuple(Job(song, _outputs_for(song, given, opened, variations)) for song in songs)
    hint = f": put {SONG} into the name" if len(songs) > 1 and given else ""
    check_apart(_paths(jobs), (), hint=hint)
    if opened and len(songs) > 1:
        raise ParameterError(f"expected one SONG to --open the page of, got {len(songs)}")
    return jobs


def with_free_names(
    jobs: Sequence[Job], given: Outputs, inputs: Sequence[Path], *, force: bool
) -> tuple[tuple[Job, ...], tuple[str, ...]]:
    """The jobs, renamed where files exist that no dance made here may replace, and notes on these.

    Names `given` by the user stay. The others, which contain the name of a song, are changed if they are
    those of an input, or of a file that is not a dance written by this program, unless `force` is set.
    """
    from choreograph.pipeline.saving import is_saved_dance

    used = {file_identity(path) for path in (*_paths(jobs), *inputs)}
    read = {file_identity(path) for path in inputs}
    notes = []

    def is_kept(path: Path) -> bool:
        is_strange = os.path.lexists(path) and not is_saved_dance(path)
        return file_identity(path) in read or (is_strange and not force)

    def renamed(outputs: Outputs) -> Outputs:
        made = [path for path in outputs if path not in given]
        kept = next(filter(is_kept, made), None)
        if kept is None:
            return outputs
        names = free_names(made, lambda path: file_identity(path) in used or is_kept(path))
        used.update(map(file_identity, names))
        why = "an input" if file_identity(kept) in read else "not a dance written by choreograph"
        cure = "" if file_identity(kept) in read else ". Use --force to replace it"
        notes.append(
            f"{kept} is {why} and is kept: the dance is written to {' and '.join(map(str, names))}{cure}"
        )
        new = dict(zip(made, names, strict=True))
        return tuple(new.get(path, path) for path in outputs)

    jobs = tuple(replace(job, outputs=tuple(map(renamed, job.outputs))) for job in jobs)
    return jobs, tuple(notes)


def check_jobs(jobs: Sequence[Job], save_map: Path | None, inputs: Sequence[Path]) -> None:
    """Raise before any work if a file is an input or cannot be written. Makes the folders."""
    from choreograph.pipeline.saving import check_outputs

    paths = _paths(jobs)
    if len(jobs) > 1:
        check_outputs([path.name for path in paths])
        for folder in {path.parent for path in paths}:
            try:
                folder.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise ParameterError(f"cannot make the folder {folder}: {error.strerror}") from error
    check_outputs(paths)
    check_apart([*paths, *([save_map] if save_map else [])], inputs)


def _paths(jobs: Sequence[Job]) -> list[Path]:
    return [path for job in jobs for outputs in job.outputs for path in outputs]


def _outputs_for(song: Path, given: Outputs, opened: bool, variations: int | None) -> tuple[Outputs, ...]:
    """The files of each variation: those given, else those of the song. If a page is opened, one is added."""
    motion, page = default_names(song)
    outputs = tuple(Path(str(path).replace(SONG, page.stem)) for path in given) or (motion, page)
    if opened and not any(path.suffix.lower() == ".html" for path in outputs):
        outputs = (*outputs, page)
    return tuple(zip(*(numbered(path, variations) for path in outputs), strict=True))


# The output of `choreograph dance` about its dances.


def present(
    results: Sequence[Result], notes: Sequence[str], *, as_json: bool, quiet: bool, many: bool
) -> None:
    """Print the dances as JSON (a list if `many` or for several songs), as one line each, or as a table.

    `notes` are about all of them. Raises `ChoreographError` at the end if some of several songs could not be
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
        show_notes(note for dance, _ in made for note in _loop_notes(dance))
        if many_songs:
            _show_table(results)
        else:
            for dance, paths in made:
                say(_summary(dance.plan, paths))
    failed = [result for result in results if result.error]
    if failed:
        raise ChoreographError(
            f"{len(failed)} of {counted(len(results), 'song')} could not be danced: {failed[0].error}"
        )


def _dances(result: Result) -> Iterator[tuple[Danced, Outputs]]:
    """The dances and their files, or none if the job failed."""
    return zip(result.dances, result.job.outputs, strict=not result.error)


def _notes(result: Result, *, named: bool) -> Iterator[str]:
    """The notes on a song's dances, or why there are none, with the song's name if `named`."""
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


def _loop_notes(dance: Danced) -> Iterator[str]:
    if dance.loop is not None:
        n_bars, start_s, end_s = dance.loop
        yield (
            f"{dance.plan.song}: motion files loop, {counted(n_bars, 'bar')} from {start_s:.2f} to "
            f"{end_s:.2f} s of the dance"
        )


def _summary(plan: Plan, outputs: Outputs) -> str:
    takes = {block.planned.take for block in plan.blocks if block.planned.take}
    sources = [counted(len(takes), "take")] if takes else []
    if any(not block.source for block in plan.blocks):
        sources.append("the rollout network")
    sources += sorted({block.kept for block in plan.blocks if block.kept})
    of = " and ".join(sources)
    n_words = sum(not word.kept for word in plan.words)
    counts = ((n_words, "motion word"), (len(plan.edits), "edit"))
    words = "".join(f", {counted(n, what)}" for n, what in counts if n)
    return (
        f"{', '.join(str(path) for path in outputs)}: {plan.duration_s:.1f} s from {of}, "
        f"{len(plan.music_beats_s)} music beats{words}"
    )


def _facts(dance: Danced, notes: Sequence[str], outputs: Outputs) -> dict[str, Any]:
    plan = dance.plan
    credits = {block.source: block.planned.credits for block in plan.blocks}
    takes_s = sorted(plan.takes_s().items(), key=lambda item: -item[1])
    return {
        "outputs": [str(path) for path in outputs],
        "song": plan.song,
        "repertoire": plan.repertoire,
        "duration_s": plan.duration_s,
        "music_beats": len(plan.music_beats_s),
        "motion_beats": dance.n_motion_beats,
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
