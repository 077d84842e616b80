"""`choreograph dance`, which makes a dance for a song, or for each of several.

A `DanceJob` is a song with the files of its dances. All is checked before any work: names of files, settings
and edits. Then `SongDances` makes the dances of each job, in this process or in others, and `present` prints
them.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Sequence
from contextlib import chdir, nullcontext
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any
from uuid import uuid4

import click

from choreograph.cli.characters import character_of, check_map_target, write_map
from choreograph.cli.dance_options import (
    SONG,
    DanceCommand,
    DanceOptions,
    FileOptions,
    dance_options,
    default_names,
    numbered,
    options_of,
)
from choreograph.cli.declared import Input, argument, inputs, unused_options
from choreograph.cli.present import StageLines, examples, printable, say, show_notes, stages, table_console
from choreograph.core.errors import ChoreographError, NoPathError, ParameterError
from choreograph.core.files import atomic_path, check_apart, file_identity, free_names
from choreograph.core.progress import counted
from choreograph.core.workers import each, working
from choreograph.settings import MAX_VARIATIONS

if TYPE_CHECKING:
    from choreograph.characters.character import GltfCharacter
    from choreograph.choreography.edits import EditRequest
    from choreograph.cli.dance_options import FileOptions
    from choreograph.cli.present import StageLines, Stages
    from choreograph.core.clusters import Cluster
    from choreograph.core.progress import ProgressReport
    from choreograph.library.repertoire import Repertoire
    from choreograph.pipeline.dancing import Dance, DanceArguments
    from choreograph.plan.plan import Plan


@click.command(
    cls=DanceCommand,
    epilog=examples(
        "choreograph dance song.mp3                          song.bvh and song.html, with the built-in takes",
        "choreograph dance song.mp3 --open                   the same, and opens the page in the browser",
        "choreograph dance song.mp3 --db rep.h5 -o a.mp4     your own takes, as a video",
        "choreograph dance song.mp3 --character hero.glb -o a.glb     your character dances",
        "choreograph dance songs/*.mp3 -o out/{song}.glb     a dance for each song, and a table",
        "choreograph dance song.mp3 --start 30 --duration 20 --weight transition=8",
        "choreograph dance song.mp3 --engine mixer --genre waltz --set planner=greedy",
        "choreograph dance song.mp3 --pin 12.0=motif:41 --pin 30-38=take:NAME --ban genre:tango",
        "choreograph dance song.mp3 --existing a.json --swap 'bar 9-bar 13'   keeps all other bars",
        "choreograph dance song.mp3 --camera cuts -o a.mp4     a film with shots that change at phrases",
        "choreograph dance song.mp3 --plan plan.json -o a.bvh     renders an edited plan",
    ),
)
@argument("songs", nargs=-1, metavar="[SONG]...", type=Input("song"))
@dance_options
def command(
    songs: tuple[Path, ...],
    db: tuple[Path, ...],
    plan_path: Path | None,
    variations: int | None,
    strict: bool,
    workers: int | None,
    dask: str | None,
    **options: Any,
) -> None:
    """Make a dance for SONG (any audio file), or for each of several."""
    if workers is not None and workers < 0:
        raise ParameterError(f"expected --workers of 0 or more, got {workers}")
    files, asked = options_of(FileOptions, options), options_of(DanceOptions, options)
    if plan_path is not None and len(songs) > 1:
        raise ParameterError(f"expected one SONG beside --plan, got {len(songs)}")
    jobs = jobs_of(songs or ((plan_path,) if plan_path else ()), files.output, files.opened, variations)
    notes, read = unused_options(jobs[0].outputs[0]), inputs()
    jobs, moved = with_free_names(jobs, files.output, read, force=files.force)
    check_map_target(files.save_map)
    check_jobs(jobs, files.save_map, read)
    first, notes = jobs[0].outputs[0], (*notes, *moved)
    sound = songs[0] if plan_path is not None and songs else None
    dances = SongDances(db, asked, files, variations, strict, plan_path, sound)
    _check_character(dances, first)
    sounds = _checked_sounds(files.target, jobs, read)
    if sounds and (plan_path is None or sound is not None):  # a plan alone has no sound
        notes = (*notes, f"the danced part of the song is written to {', '.join(map(str, sounds))}")
    dances = with_checked_requests(dances, jobs)
    with_lines = files.as_json and not files.quiet
    with nullcontext(StageLines()) if with_lines else stages(quiet=files.quiet) as shown:
        results = run_jobs(
            jobs, dances, shown, workers=1 if workers is None else workers, dask=dask or "",
            shared=[path for path in read if path not in {job.song for job in jobs}],
        )  # fmt: skip
    if any(result.dances for result in results):
        write_map(files.save_map, dances.character())
    present(results, notes, as_json=files.as_json, quiet=files.quiet, many=variations is not None)
    if files.opened:
        page = next(path for path in first if path.suffix.lower() == ".html")
        click.launch(page.resolve().as_uri())


def _checked_sounds(target: str | None, jobs: Sequence[DanceJob], read: Sequence[Path]) -> list[Path]:
    """The sounds that the program of --for plays with outputs.

    Raises `ParameterError` if the program reads no output, or a sound would replace another file.
    """
    from choreograph.formats.writer import check_target_format, reads
    from choreograph.pipeline.saving import sound_beside

    sounds: list[Path] = []
    if target is None:
        return sounds
    for job in jobs:
        paths = [path for paths in job.outputs for path in paths]
        played = [path for path in paths if reads(target, path)]
        if not played:
            check_target_format(target, paths[0])
        sounds += [sound_beside(path, read) for path in played if target == "mmd"]
    return sounds


def _check_character(dances: SongDances, outputs: tuple[Path, ...]) -> None:
    """Raise `ParameterError` for a map alone, or for a page that cannot show the character."""
    from choreograph.pipeline.saving import check_character

    character = dances.character()
    if character is not None:
        check_character(character, outputs)


# Dances to one song after another, or to several at once in other processes.


_FEWEST = 2  # songs that are danced in several processes: a song takes as long as the start of a process


@dataclass(frozen=True, eq=False)
class SongDances:
    """What is danced to the song of each job, and what is written. It can be sent to other processes."""

    db: tuple[Path, ...]
    asked: DanceOptions
    files: FileOptions
    variations: int | None
    strict: bool
    plan_path: Path | None  # that is rendered
    sound: Path | None  # of the plan
    edits: Sequence[EditRequest] = ()  # of the existing dance
    first: tuple[Path, DanceArguments] | None = None  # the arguments of the first song
    command: str = field(default_factory=lambda: uuid4().hex)  # so that a later one opens its files anew

    def result(self, job: DanceJob, report: ProgressReport | None = None) -> Result:
        """Make the dances of a job and write its files. Raises `ChoreographError` if this is impossible."""
        from choreograph.pipeline.saving import options_used

        made = self._made(job, report)
        unmet = [line for one in made for line in one.unmet]
        if self.strict and unmet:
            raise NoPathError(unmet[0])
        files = self.files
        options = {
            "character": self.character(),
            "loop": files.loop,
            "click": files.with_clicks,
            "camera": files.camera,
            "target": files.target,
        }
        for one, paths in zip(made, job.outputs, strict=True):
            for path in paths:
                one.save(path, **options_used(path, options), report=report)
        return Result(job, tuple(Danced.of(one, files) for one in made))

    def attempted(self, job: DanceJob, report: ProgressReport | None = None) -> Result:
        """As `result`, with the reason if it is impossible."""
        try:
            return self.result(job, report)
        except ChoreographError as error:
            return Result(job, error=" ".join(str(error).split()))

    def sent(self, folder: Path, job: DanceJob, *, stage: bool = False) -> tuple[Result, list[bytes]]:
        """As `attempted`, on a machine that may not write the files, with their contents.

        Relative paths are those of `folder`. With `stage`, the files that are read were sent along.
        """
        if stage:
            folder.mkdir(parents=True, exist_ok=True)
        if not folder.is_dir():
            raise ChoreographError(
                f"expected the folder {folder} on the machines of all workers, got one without it: start "
                "`choreograph dance` in a folder that all have"
            )
        with TemporaryDirectory() as own, chdir(folder):
            there = [
                tuple(Path(own, f"{number}-{index}", path.name) for index, path in enumerate(paths))
                for number, paths in enumerate(job.outputs)
            ]
            written = [path for paths in there for path in paths]
            for path in written:
                path.parent.mkdir()
            result = self.attempted(replace(job, outputs=tuple(there)))
            contents = [] if result.error else [path.read_bytes() for path in written]
        return replace(result, job=job), contents

    def repertoire(self) -> Repertoire:
        """The repertoire to dance with."""
        return _opened_repertoire(self.db, self.command)

    def character(self) -> GltfCharacter | None:
        """The character that dances, if any."""
        path, map_path = self.files.character, self.files.map_path
        return None if path is None else _opened_character(path, map_path, self.command)

    def _made(self, job: DanceJob, report: ProgressReport | None) -> list[Dance]:
        import choreograph as cg

        repertoire, asked = self.repertoire(), self.asked
        if self.plan_path is not None:
            return [self._rendered(repertoire)]
        if self.edits and asked.existing is not None:
            seed = asked.seed or 0
            return [cg.edit(asked.existing, self.edits, repertoire, song=job.song, seed=seed, report=report)]
        if self.first is not None and self.first[0] == job.song:
            own = self.first[1]
        else:
            own = asked.arguments(repertoire, asked.times(job.song, repertoire))
        given: DanceArguments = {**own, "report": report}
        if self.variations is None:
            return [cg.dance(job.song, repertoire, **given)]
        return cg.vary(job.song, repertoire, self.variations, **given)

    def _rendered(self, repertoire: Repertoire) -> Dance:
        """The dance of the plan, with the sound of a song if there is one."""
        import choreograph as cg
        from choreograph.pipeline.dancing import danced_figures
        from choreograph.pipeline.keeping import render_file

        assert self.plan_path is not None
        plan, motion = render_file(self.plan_path, repertoire, self.asked.existing)
        notes = () if self.sound else ("no SONG was given with the plan: pages and videos are silent",)
        return cg.Dance(motion, plan, notes, self.sound, figures=danced_figures(plan, repertoire))


def with_checked_requests(dances: SongDances, jobs: Sequence[DanceJob]) -> SongDances:
    """`dances` with the edits, or with the arguments of the first song. Raises if they are wrong."""
    if dances.plan_path is not None:
        return dances
    asked, repertoire, song = dances.asked, dances.repertoire(), jobs[0].song
    if asked.edits_dance:
        if len(jobs) > 1:
            raise ParameterError(f"expected one SONG for the edits of a dance, got {len(jobs)}")
        return replace(dances, edits=asked.edits(asked.times(song, repertoire)))
    return replace(dances, first=(song, asked.arguments(repertoire, asked.times(song, repertoire))))


def run_jobs(
    jobs: Sequence[DanceJob],
    dances: SongDances,
    shown: Stages | StageLines,
    *,
    workers: int = 1,
    dask: str = "",
    shared: Sequence[Path] = (),
) -> list[Result]:
    """The dances of the jobs. If one of several songs cannot be danced, the others still are.

    With several `workers`, or the Dask scheduler at the address `dask`, songs are danced at once. The songs
    and the files that all dances use, `shared`, are sent along if a worker of the scheduler lacks one.
    """
    if len(jobs) == 1 and not dask:
        return [dances.result(jobs[0], shown.report)]
    results: list[Result] = []
    shown.report("songs", 0, len(jobs), jobs[0].song.name)
    with working(workers, dask, stage=True) as cluster:
        if cluster is not None:
            shown.report(f"connected, {cluster.dashboard}", 0, 0)
        is_alone = cluster is None and workers == 1
        make = partial(dances.attempted, report=shown.report) if is_alone else dances.attempted
        found = (
            each(make, jobs, killed=_killed, fewest=_FEWEST)
            if cluster is None
            else _elsewhere(jobs, dances, cluster, shared)
        )
        for result in found:
            results.append(result)
            following = jobs[len(results)].song.name if len(results) < len(jobs) else ""
            shown.report("songs", len(results), len(jobs), following)
    return results


@dataclass(frozen=True, eq=False)
class _Sent:
    """A job for another machine."""

    dances: SongDances
    folder: Path  # of relative paths
    job: DanceJob
    stage: bool

    def result(self) -> tuple[Result, list[bytes]]:
        return self.dances.sent(self.folder, self.job, stage=self.stage)

    def killed(self) -> tuple[Result, list[bytes]]:
        return _killed(self.job), []

    def files(self) -> tuple[Path, ...]:
        return (self.job.song,)


def _elsewhere(
    jobs: Sequence[DanceJob], dances: SongDances, cluster: Cluster, shared: Sequence[Path]
) -> Iterator[Result]:
    """The results of the workers of a cluster, whose files are written here."""
    shared = _with_files_inside(shared)
    stage = cluster.lacks([Path.cwd(), *(job.song for job in jobs), *shared])
    sent = [_Sent(dances, Path.cwd(), job, stage) for job in jobs]
    files = _Sent.files if stage else None
    results = each(_Sent.result, sent, killed=_Sent.killed, files=files, shared=shared)
    for result, contents in results:
        paths = [path for paths in result.job.outputs for path in paths]
        try:
            for path, content in zip(paths, contents, strict=not result.error):
                with atomic_path(path) as temporary:
                    temporary.write_bytes(content)
        except ChoreographError as error:
            result = Result(result.job, error=" ".join(str(error).split()))
        yield result


def _with_files_inside(paths: Sequence[Path]) -> list[Path]:
    """The files of a list, each once, with the repertoire files of its folders."""
    found = [file for path in paths for file in (sorted(path.glob("*.h5")) if path.is_dir() else [path])]
    return list(dict.fromkeys(found))


def _killed(job: DanceJob) -> Result:
    why = "expected the dance to end, but the process that made it was killed twice: too little memory?"
    return Result(job, error=why)


@lru_cache(maxsize=1)
def _opened_repertoire(db: tuple[Path, ...], command: str) -> Repertoire:
    """The repertoire of `--db`, opened once in a process."""
    from choreograph.library.repertoire import as_repertoire

    return as_repertoire(db)


@lru_cache(maxsize=1)
def _opened_character(path: Path, map_path: Path | None, command: str) -> GltfCharacter:
    """The character of `--character`, read once in a process."""
    return character_of(path, map_path)


# The files that `choreograph dance` writes for each song.


Outputs = tuple[Path, ...]  # the files of one dance


@dataclass(frozen=True)
class DanceJob:
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

    job: DanceJob  # its song and files
    dances: tuple[Danced, ...] = ()  # one for each variation
    error: str = ""  # why there are none


def jobs_of(
    songs: Sequence[Path], given: Outputs, opened: bool, variations: int | None
) -> tuple[DanceJob, ...]:
    """A job for each song.

    Raises `ParameterError` for no song, a number of variations out of range, or two songs with one file.
    """
    if not songs:
        raise ParameterError("expected a SONG, or --plan FILE. `choreograph songs` lists a few to begin with")
    if variations is not None and not 1 <= variations <= MAX_VARIATIONS:
        raise ParameterError(f"expected 1 to {MAX_VARIATIONS} variations, got {variations}")
    jobs = tuple(DanceJob(song, _outputs_for(song, given, opened, variations)) for song in songs)
    hint = f": put {SONG} into the name" if len(songs) > 1 and given else ""
    check_apart(_paths(jobs), (), hint=hint)
    if opened and len(songs) > 1:
        raise ParameterError(f"expected one SONG to --open the page of, got {len(songs)}")
    return jobs


def with_free_names(
    jobs: Sequence[DanceJob], given: Outputs, inputs: Sequence[Path], *, force: bool
) -> tuple[tuple[DanceJob, ...], tuple[str, ...]]:
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


def check_jobs(jobs: Sequence[DanceJob], save_map: Path | None, inputs: Sequence[Path]) -> None:
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


def _paths(jobs: Sequence[DanceJob]) -> list[Path]:
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
        for dance, _ in made:
            if dance.loop is not None:
                bars = counted(dance.loop[0], "bar")
                span = f"{dance.loop[1]:.2f} to {dance.loop[2]:.2f} s of the dance"
                show_notes([f"{dance.plan.song}: motion files loop, {bars} from {span}"])
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
