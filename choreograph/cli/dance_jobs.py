"""Which files `choreograph dance` writes for each song, and the songs danced one after another."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from choreograph.config import MAX_VARIATIONS
from choreograph.errors import ChoreographError, ParameterError

if TYPE_CHECKING:
    from choreograph.cli.present import StageLines, Stages
    from choreograph.pipeline import Dance
    from choreograph.progress import ProgressReport

Outputs = tuple[Path, ...]  # the files of one dance
SONG = "{song}"  # in a file's name: that of the song, without its suffix


@dataclass(frozen=True)
class Job:
    """A song, or a plan, and the files of each of its dances."""

    song: Path
    outputs: tuple[Outputs, ...]


@dataclass(frozen=True, eq=False)
class Result:
    """What came of a job: its dances, or why there are none."""

    job: Job
    dances: tuple[Dance, ...] = ()
    error: str = ""


def jobs_of(songs: Sequence[Path], given: Outputs, opened: bool, variations: int | None) -> tuple[Job, ...]:
    """A job for each song; `ParameterError` if there is none, a number no one wants, or one file for two."""
    if not songs:
        raise ParameterError("expected a SONG, or --plan FILE; `choreograph songs` lists a few to begin with")
    if variations is not None and not 1 <= variations <= MAX_VARIATIONS:
        raise ParameterError(f"expected 1 to {MAX_VARIATIONS} variations, got {variations}")
    jobs = tuple(Job(song, _numbered(_outputs_for(given, song.stem, opened), variations)) for song in songs)
    written = Counter(path for job in jobs for outputs in job.outputs for path in outputs)
    twice = [str(path) for path, n in written.items() if n > 1]
    if twice:
        hint = f": put {SONG} into the name" if len(songs) > 1 and given else ""
        raise ParameterError(f"expected a file of its own for each dance, got {twice[0]} twice{hint}")
    if opened and len(songs) > 1:
        raise ParameterError(f"expected one SONG to --open the page of, got {len(songs)}")
    return jobs


def check_jobs(jobs: Sequence[Job]) -> None:
    """Raise before any work if a file cannot be written; make the folders of several songs' dances."""
    from choreograph.pipeline.saving import check_outputs

    paths = [path for job in jobs for outputs in job.outputs for path in outputs]
    if len(jobs) > 1:
        check_outputs([path.name for path in paths])
        for folder in {path.parent for path in paths}:
            try:
                folder.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise ParameterError(f"cannot make the folder {folder}: {error.strerror}") from error
    check_outputs(paths)


def run_jobs(
    jobs: Sequence[Job], dances_of: Callable[[Job, ProgressReport], list[Dance]], shown: Stages | StageLines
) -> list[Result]:
    """The jobs' dances. Of several songs, one that cannot be danced does not stop the others."""
    if len(jobs) == 1:
        return [Result(jobs[0], tuple(dances_of(jobs[0], shown.report)))]
    results = []
    for done, job in enumerate(jobs):
        shown.report("songs", done, len(jobs), job.song.name)
        try:
            results.append(Result(job, tuple(dances_of(job, shown.report))))
        except ChoreographError as error:
            results.append(Result(job, error=" ".join(str(error).split())))
    shown.report("songs", len(jobs), len(jobs))
    return results


def _outputs_for(given: Outputs, stem: str, opened: bool) -> Outputs:
    """The files to write: those given, else a motion and a page; a page in any case if it is to be opened."""
    named = tuple(Path(str(path).replace(SONG, stem)) for path in given)
    outputs = named or (Path(f"{stem}.bvh"), Path(f"{stem}.html"))
    if opened and not any(path.suffix.lower() == ".html" for path in outputs):
        outputs = (*outputs, Path(f"{stem}.html"))
    return outputs


def _numbered(outputs: Outputs, variations: int | None) -> tuple[Outputs, ...]:
    """The files of every variation, NAME-1.bvh for NAME.bvh; without variations, `outputs` once."""
    if variations is None:
        return (outputs,)
    return tuple(
        tuple(path.with_name(f"{path.stem}-{number}{path.suffix}") for path in outputs)
        for number in range(1, variations + 1)
    )
