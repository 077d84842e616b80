"""The dances of `choreograph dance` to one song after another, or to several at once in other processes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import chdir
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING
from uuid import uuid4

from choreograph.cli.characters import character_of
from choreograph.cli.dance_jobs import Danced, Job, Result
from choreograph.cli.dance_options import DanceOptions, FileOptions
from choreograph.core.errors import ChoreographError, NoPathError, ParameterError
from choreograph.core.files import atomic_path
from choreograph.core.workers import each, working

if TYPE_CHECKING:
    from choreograph.characters.gltf_character import GltfCharacter
    from choreograph.choreography.edits import EditRequest
    from choreograph.cli.present import StageLines, Stages
    from choreograph.core.clusters import Cluster
    from choreograph.core.progress import ProgressReport
    from choreograph.library.repertoire import Repertoire
    from choreograph.pipeline.dancing import Dance, DanceArguments

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

    def result(self, job: Job, report: ProgressReport | None = None) -> Result:
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

    def attempted(self, job: Job, report: ProgressReport | None = None) -> Result:
        """As `result`, with the reason if it is impossible."""
        try:
            return self.result(job, report)
        except ChoreographError as error:
            return Result(job, error=" ".join(str(error).split()))

    def sent(self, folder: Path, job: Job, *, stage: bool = False) -> tuple[Result, list[bytes]]:
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

    def _made(self, job: Job, report: ProgressReport | None) -> list[Dance]:
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
        from choreograph.pipeline.figures import danced_figures
        from choreograph.pipeline.keeping import render_file

        assert self.plan_path is not None
        plan, motion = render_file(self.plan_path, repertoire, self.asked.existing)
        notes = () if self.sound else ("no SONG was given with the plan: pages and videos are silent",)
        return cg.Dance(motion, plan, notes, self.sound, figures=danced_figures(plan, repertoire))


def with_checked_requests(dances: SongDances, jobs: Sequence[Job]) -> SongDances:
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
    jobs: Sequence[Job],
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
        found = (
            _here(jobs, dances, shown, is_alone)
            if cluster is None
            else _elsewhere(jobs, dances, cluster, shared)
        )
        for result in found:
            results.append(result)
            following = jobs[len(results)].song.name if len(results) < len(jobs) else ""
            shown.report("songs", len(results), len(jobs), following)
    return results


def _here(
    jobs: Sequence[Job], dances: SongDances, shown: Stages | StageLines, is_alone: bool
) -> Iterator[Result]:
    """The results of this process, or of several on this machine."""
    make: Callable[[Job], Result] = (
        partial(dances.attempted, report=shown.report) if is_alone else dances.attempted
    )
    return each(make, jobs, killed=_killed, fewest=_FEWEST)


@dataclass(frozen=True, eq=False)
class _Sent:
    """A job for another machine."""

    dances: SongDances
    folder: Path  # of relative paths
    job: Job
    stage: bool

    def result(self) -> tuple[Result, list[bytes]]:
        return self.dances.sent(self.folder, self.job, stage=self.stage)

    def killed(self) -> tuple[Result, list[bytes]]:
        return _killed(self.job), []

    def files(self) -> tuple[Path, ...]:
        return (self.job.song,)


def _elsewhere(
    jobs: Sequence[Job], dances: SongDances, cluster: Cluster, shared: Sequence[Path]
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


def _killed(job: Job) -> Result:
    why = "expected the dance to end, but the process that made it was killed twice: too little memory?"
    return Result(job, error=why)


@lru_cache(maxsize=1)
def _opened_repertoire(db: tuple[Path, ...], command: str) -> Repertoire:
    """The repertoire of `--db`, opened once in a process."""
    from choreograph.library.builtin import as_repertoire

    return as_repertoire(db)


@lru_cache(maxsize=1)
def _opened_character(path: Path, map_path: Path | None, command: str) -> GltfCharacter:
    """The character of `--character`, read once in a process."""
    return character_of(path, map_path)
