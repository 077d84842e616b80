"""`choreograph evaluate`, which measures dances of this program or of any other system."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click
from click_option_group import optgroup

from choreograph.cli.declared import (
    Command,
    Given,
    Input,
    Output,
    Seconds,
    after_at,
    argument,
    grouped,
    is_stdout,
    names_of,
    whole,
)
from choreograph.cli.present import examples, printable, say, show_notes, stages, table_console
from choreograph.core.errors import ChoreographError, ParameterError
from choreograph.core.files import check_target, folder_beside

if TYPE_CHECKING:
    from choreograph.core.progress import ProgressReport
    from choreograph.evaluation.results import Cell, Evaluation
    from choreograph.evaluation.run import EvaluationConfig, KeptDances
    from choreograph.evaluation.songs import EvaluatedSong

# The modes of the command: dances that it makes to songs, and dances in files.
_SONGS, _FILES = "songs", "files"
_of_songs_alone = partial(grouped, modes=(_SONGS,))


def _with_dances(output: Path, given: Given) -> tuple[Path, ...]:
    """An output, and the folder beside it of the dances that are made."""
    if is_stdout(output):
        return ()
    return (output,) if given["files"] else (output, folder_beside(output, ".dances"))


@click.command(
    cls=Command,
    short_help="Measure dances.",
    epilog=examples(
        "choreograph evaluate --db rep.h5 --songs heldout/ --variants baselines --report report.html",
        "choreograph evaluate --db rep.h5 --songs takes/ --only @heldout.txt   beside the real dances",
        "choreograph evaluate dance.bvh song.mp3                 any system's dance",
        "choreograph evaluate ours.bvh edge.pkl bailando.npy song.mp3   several beside each other",
        "choreograph evaluate ours/ edge/ songs/                 dances named as their songs, and real ones",
        "choreograph evaluate ours.bvh edge.pkl song.mp3 --page both.html",
        "choreograph evaluate dance.bvh song.mp3 --beats beats.txt --json -",
    ),
)
@argument("files", nargs=-1, type=Input("takes"), selects=_FILES, metavar="[DANCE... SONG]")
@optgroup.group("Dances")
@grouped(
    "--db", type=Input("repertoire"), multiple=True, metavar="FILE|DIR",
    help="Repertoire to dance with, or a folder of several. Repeatable. Default: the built-in one.",
)  # fmt: skip
@grouped(
    "--songs", "folder", type=Input("takes"), selects=_SONGS, metavar="DIR",
    help="Songs to dance to. Real dances in DIR, in any layout of build-db, are measured as well.",
)  # fmt: skip
@_of_songs_alone(
    "--experts", type=Input("takes"), metavar="DIR",
    help="Dances to compare with, named as the songs, with NAME.counts.csv beside them.",
)  # fmt: skip
@_of_songs_alone(
    "--only",
    type=Input("list", after_at),
    multiple=True,
    metavar="SONG",
    help="Only this song, or @FILE of names.",
)
@_of_songs_alone(
    "--variants", multiple=True, metavar="NAME",
    help="What to compare: engines, baselines, as-published, or one variant of a group. Default: ours.",
)  # fmt: skip
@_of_songs_alone("--seeds", default=5, show_default=True, help="Dances of each variant to each song.")
@_of_songs_alone("--seen", is_flag=True, help="Also measure on songs that the repertoire was made with.")
@optgroup.group("Measuring")
@grouped("--duration", type=Seconds(), help="Seconds of each song. Default: to the end.")
@grouped(
    "--beats", type=Input("beats", whole), metavar="tempo-path|network|librosa|beat-this|FILE",
    help="Beats to measure by: of a tracker (tempo-path), a file of times, or a folder of SONG.txt.",
)  # fmt: skip
@_of_songs_alone(
    "--judge", type=Input("repertoire"), metavar="REPERTOIRE",
    help="Judge motifs by the word network of this one, built with another seed from the same takes.",
)  # fmt: skip
@optgroup.group("Output")
@grouped("--report", type=Output(_with_dances), help="Write tables and plots as one HTML page.")
@grouped(
    "--page", type=Output(), modes=(_FILES,), metavar="FILE.html",
    help="Write a page that plays DANCE files side by side with their song.",
)  # fmt: skip
@grouped(
    "--json",
    "json_path",
    type=Output(_with_dances),
    metavar="FILE",
    help="Write every number as JSON. - prints it.",
)
@_of_songs_alone(
    "--resume", is_flag=True,
    help="Continue an evaluation that was stopped. Its dances are in OUTPUT.dances/ until it is complete.",
)  # fmt: skip
@grouped("-q", "--quiet", is_flag=True, help="No progress, no notes, no table.")
def command(
    files: tuple[Path, ...],
    db: tuple[Path, ...],
    folder: Path | None,
    experts: Path | None,
    only: tuple[str, ...],
    variants: tuple[str, ...],
    seeds: int,
    duration: float | None,
    beats: str | None,
    seen: bool,
    judge: Path | None,
    report: Path | None,
    page: Path | None,
    json_path: Path | None,
    resume: bool,
    quiet: bool,
) -> None:
    """Measure dances that are made with --db to the songs of DIR, or DANCE files of any system to a SONG.

    DANCE and SONG may be folders. Each DANCE folder has the dances of one system, named as the songs.
    """
    from choreograph.evaluation.results import to_json
    from choreograph.evaluation.run import EvaluationConfig, variants_named
    from choreograph.evaluation.songs import find_songs
    from choreograph.music.beats import DEFAULT_TRACKER

    if (folder is None and not files) or len(files) == 1:
        raise ParameterError("expected --songs DIR to dance to, or a DANCE and its SONG")
    targets = [*_targets(report, json_path), *([] if page is None else [check_target(page)])]
    output = targets[-1] if targets else None
    if resume and output is None:
        raise ParameterError("expected --report or --json FILE with --resume: dances are kept beside it")
    beats = beats or DEFAULT_TRACKER
    with stages(quiet=quiet) as shown:
        if files:
            made = _of_folders if files[-1].is_dir() else _of_dances
            evaluation = made(files[:-1], files[-1], db, duration, beats, page)
            _write(evaluation, report, json_path)
        else:
            assert folder is not None
            config = EvaluationConfig(variants_named(variants or ("ours",)), seeds, beats, seen)
            shown.report("finding songs", 0, 0)
            songs = find_songs(folder, only=names_of(only), duration_s=duration)
            with _kept(output, resume) as kept:
                evaluation = _of_songs(songs, db, config, judge, experts, kept, shown.report)
                _write(evaluation, report, json_path)
    if not quiet:
        show_notes(evaluation.notes)
    if is_stdout(json_path):
        click.echo(to_json(evaluation), nl=False)
    elif not quiet:
        _show(evaluation)


def _targets(report: Path | None, json_path: Path | None) -> list[Path]:
    """The files to write. Raises before any work if one cannot be written."""
    from choreograph.evaluation.plots import expect_matplotlib

    if report:
        expect_matplotlib()
    given = (report, None if is_stdout(json_path) else json_path)
    return [check_target(path) for path in given if path is not None]


def _of_dances(
    dances: Sequence[Path],
    song: Path,
    db: tuple[Path, ...],
    duration: float | None,
    beats: str,
    page: Path | None,
) -> Evaluation:
    from choreograph.evaluation.dance_scores import evaluate
    from choreograph.formats.register import load_motion
    from choreograph.library.repertoire import as_repertoire
    from choreograph.music.song import load_song

    loaded = load_song(song, duration_s=duration)
    repertoire = as_repertoire(db) if db else None
    motions = {str(dance): load_motion(dance) for dance in dances}
    if len(motions) < len(dances):
        raise ParameterError("expected different dances to compare, got one of them twice")
    [name, *others] = motions
    measured = motions if others else motions[name]
    evaluation = evaluate(measured, loaded, name=name, beats=beats, repertoire=repertoire)
    if page is not None:
        from choreograph.evaluation.report import write_side_by_side

        assert evaluation.example is not None
        named = {Path(name).name: motion for name, motion in motions.items()}
        shown = named if len(named) == len(motions) else motions
        write_side_by_side(page, shown, loaded, beats_s=evaluation.example.music_beats_s)
    return evaluation


def _of_folders(
    folders: Sequence[Path],
    songs: Path,
    db: tuple[Path, ...],
    duration: float | None,
    beats: str,
    page: Path | None,
) -> Evaluation:
    """Dances of systems to the songs of a folder, beside the real dances there."""
    from choreograph.evaluation.dance_scores import measured_dances
    from choreograph.evaluation.results import REAL
    from choreograph.evaluation.songs import find_songs
    from choreograph.formats.register import load_motion
    from choreograph.library.repertoire import as_repertoire

    if page is not None:
        raise ParameterError("expected DANCE files and one song beside --page, got folders: name a song")
    systems = {folder: _files_by_name(folder) for folder in folders}
    danced = [
        song
        for song in find_songs(songs, duration_s=duration)
        if any(song.name in files for files in systems.values())
    ]
    if not danced:
        raise ParameterError(f"expected dances named as the songs of {songs}, got none: name them SONG.bvh")
    columns = {
        str(folder): (
            str(folder),
            [load_motion(files[song.name]) if song.name in files else None for song in danced],
        )
        for folder, files in systems.items()
    }
    if any(song.take is not None for song in danced):
        real = [None if song.take is None else song.take.motion for song in danced]
        columns[REAL] = "real dances", real
    repertoire = as_repertoire(db) if db else None
    return measured_dances([song.load() for song in danced], columns, beats, repertoire)


def _files_by_name(folder: Path) -> dict[str, Path]:
    """The dances in a folder by their names without suffix."""
    from choreograph.formats.register import is_motion

    if not folder.is_dir():
        raise ParameterError(f"expected folders of dances beside a folder of songs, got {folder}")
    files = sorted(path for path in folder.iterdir() if path.is_file() and is_motion(path))
    if not files:
        raise ParameterError(f"expected motion files in {folder}, got none")
    return {path.stem.removesuffix(".pkl"): path for path in files}  # Bailando writes SONG.pkl.npy


@contextmanager
def _kept(output: Path | None, resume: bool) -> Iterator[KeptDances | None]:
    """The dances that are kept beside the output. Prints the folder if a run ends before all are made."""
    from choreograph.evaluation.run import kept_dances

    if output is None:
        yield None
        return
    folder = folder_beside(output, ".dances")
    with kept_dances(folder, resume=resume, doing=f"evaluates for {output.name}") as kept:
        try:
            yield kept
        except KeyboardInterrupt:
            say(f"stopped: {len(kept)} dances are kept, --resume continues from here", err=True)
            sys.exit(130)
        except ChoreographError as error:
            if len(kept):
                raise type(error)(f"{error} ({len(kept)} dances are kept, --resume continues)") from error
            raise


def _write(evaluation: Evaluation, report: Path | None, json_path: Path | None) -> None:
    from choreograph.core.files import atomic_path
    from choreograph.evaluation.report import write_report
    from choreograph.evaluation.results import to_json

    if report:
        write_report(report, evaluation)
    if json_path is not None and not is_stdout(json_path):
        with atomic_path(json_path) as temporary:
            temporary.write_text(to_json(evaluation), encoding="utf-8")


def _of_songs(
    songs: Sequence[EvaluatedSong],
    db: tuple[Path, ...],
    config: EvaluationConfig,
    judge: Path | None,
    experts: Path | None,
    kept: KeptDances | None,
    report: ProgressReport,
) -> Evaluation:
    from choreograph.evaluation.run import evaluate_variants
    from choreograph.evaluation.songs import read_experts
    from choreograph.library.repertoire import Repertoire, as_repertoire

    repertoire = as_repertoire(db)
    judging = None if judge is None else Repertoire.open(judge)
    references = () if experts is None else read_experts(experts, songs)
    return evaluate_variants(
        repertoire, songs, config, references=references, judge=judging, kept=kept, report=report
    )


def _show(evaluation: Evaluation) -> None:
    """Print the tables. If stdout is not a terminal, they are as wide as they need to be."""
    from rich.table import Table

    from choreograph.evaluation.results import column_title, tables

    console = table_console(max(80, 44 + 30 * len(evaluation.variants)))
    for table in tables(evaluation):
        shown = Table(title=table.family, title_justify="left", title_style="bold", box=None, pad_edge=False)
        shown.add_column("")
        for name in table.columns:
            shown.add_column(printable(column_title(name)), justify="right")
        for row in table.rows:
            unit = f" {row.metric.unit}" if row.metric.unit else ""
            shown.add_row(
                f"{row.metric.label}{unit}", *(_cell(cell, row.metric.digits) for cell in row.cells)
            )
        console.print(shown)
        console.print()


def _cell(cell: Cell | None, digits: int) -> str:
    from choreograph.evaluation.results import number_text

    if cell is None:
        return "-"
    spread = f" ± {number_text(cell.spread, digits)}" if cell.n > 1 else ""
    chance = "" if cell.chance is None else f" (chance {number_text(cell.chance, digits)})"
    return f"{number_text(cell.mean, digits)}{spread}{chance}"
