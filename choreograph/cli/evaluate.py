"""`choreograph evaluate`: dances measured, ours or anybody's."""

from __future__ import annotations

from pathlib import Path

import click

from choreograph.cli.build_db import names_of
from choreograph.cli.present import examples, show_notes, stages
from choreograph.errors import ParameterError


@click.command(
    epilog=examples(
        "choreograph evaluate --db rep.h5 --songs heldout/ --variants paper --report report.html",
        "choreograph evaluate --db rep.h5 --songs takes/ --only @heldout.txt   real dances beside",
        "choreograph evaluate dance.bvh song.mp3                 any system's dance",
        "choreograph evaluate dance.bvh song.mp3 --beats beats.txt --json -",
        "choreograph evaluate --songs heldout/ --variants paper --study DIR   a page for people to rate",
        "choreograph evaluate --study DIR                        what they said",
    )
)
@click.argument("dance", required=False, type=click.Path(path_type=Path))
@click.argument("song", required=False, type=click.Path(path_type=Path))
@click.option(
    "--db", type=click.Path(path_type=Path), help="Repertoire to dance with. Default: the built-in one."
)
@click.option(
    "--songs", "folder", type=click.Path(path_type=Path), metavar="DIR",
    help="Songs to dance to; if they come with real dances, in any layout of build-db, these stand beside.",
)  # fmt: skip
@click.option(
    "--only", multiple=True, metavar="SONG", help="Of those, only this one; repeat, or @FILE of names."
)
@click.option(
    "--variants", multiple=True, metavar="NAME",
    help="What to compare (ours): paper, ablations, engines, or one of their variants; repeat for more.",
)  # fmt: skip
@click.option("--seeds", default=5, show_default=True, help="Dances of each variant to each song.")
@click.option("--duration", type=float, help="Seconds of each song to dance; default to the end.")
@click.option(
    "--beats", metavar="tempo-path|librosa|beat-this|FILE",
    help="Beats to measure by: a tracker's (tempo-path), a file of instants, or a folder of SONG.txt.",
)  # fmt: skip
@click.option("--seen", is_flag=True, help="Measure on songs that the repertoire was made with, too.")
@click.option("--report", type=click.Path(path_type=Path), help="Write tables and plots as one HTML page.")
@click.option(
    "--json",
    "json_path",
    metavar="FILE",
    help="Write every number as JSON; - prints it instead of the table.",
)
@click.option(
    "--study", type=click.Path(path_type=Path), metavar="DIR",
    help="Instead of measuring, write a blinded page into DIR on which people rate the dances (--variants "
    "paper unless given). Without --songs: show what they said in the files that they sent back.",
)  # fmt: skip
@click.option(
    "--excerpt", default=6.0, show_default=True, help="Of a study: seconds of each dance, about its middle."
)
@click.option("--silent", is_flag=True, help="Of a study: no sound, and no question about music.")
@click.option("--order-seed", default=0, show_default=True, help="Of a study: seed of the dances' order.")
@click.option("-q", "--quiet", is_flag=True, help="No progress, no notes, no table.")
def command(
    dance, song, db, folder, only, variants, seeds, duration, beats, seen, report, json_path, study, excerpt,
    silent, order_seed, quiet,
) -> None:  # fmt: skip
    """Measure dances: made with --db to the songs of DIR, or DANCE (BVH, NPZ, …), to its SONG."""
    from choreograph.cli import study as studies
    from choreograph.evaluation import to_json, write_report
    from choreograph.evaluation.plots import expect_matplotlib
    from choreograph.features.music_beats import DEFAULT_TRACKER
    from choreograph.files import atomic_path, check_target

    if study is not None and folder is None and dance is None:
        studies.show(study, json_path=json_path, quiet=quiet)
        return
    if (folder is None) == (dance is None) or (dance is not None and song is None):
        raise ParameterError("expected --songs DIR to dance to, or a DANCE and its SONG")
    if dance is not None and (only or variants):
        raise ParameterError("--variants and --only are of --songs: expected none beside a DANCE")
    if study is not None:
        if dance is not None or report or json_path:
            raise ParameterError("--study is of --songs: expected no DANCE, --report or --json with them")
        studies.write(
            study, folder, db, only=names_of(only), variants=variants, duration_s=duration, seen=seen,
            excerpt_s=excerpt, sound=not silent, seed=order_seed, quiet=quiet,
        )  # fmt: skip
        return
    targets = [report] if report else []
    if json_path not in (None, "-"):
        targets.append(Path(json_path))
    for path in targets:
        check_target(path)
    if report:
        expect_matplotlib()
    beats = beats or DEFAULT_TRACKER
    with stages(quiet=quiet) as shown:
        if dance is not None:
            evaluation = _of_dance(dance, song, db, duration, beats)
        else:
            evaluation = _of_songs(
                folder, db, names_of(only), variants, seeds, duration, beats, seen, shown.report
            )
        if report:
            shown.report("writing the report", 0, 0)
            write_report(report, evaluation)
    text = to_json(evaluation) if json_path else ""
    if json_path not in (None, "-"):
        with atomic_path(json_path) as temporary:
            temporary.write_text(text, encoding="utf-8")
    if not quiet:
        show_notes(evaluation.notes)
    if json_path == "-":
        click.echo(text, nl=False)
    elif not quiet:
        _show(evaluation)


def _of_dance(dance, song, db, duration, beats):
    from choreograph.audio.song import load_song
    from choreograph.evaluation import evaluate_dance
    from choreograph.importers import import_takes
    from choreograph.repertoire import Repertoire

    takes = list(import_takes(dance))
    if len(takes) != 1:
        raise ParameterError(f"{dance}: expected one dance, got {len(takes)} takes: name one file")
    repertoire = None if db is None else Repertoire.open(db)
    loaded = load_song(song, duration_s=duration)
    return evaluate_dance(takes[0].motion, loaded, name=str(dance), beats=beats, repertoire=repertoire)


def _of_songs(folder, db, only, variants, seeds, duration, beats, seen, report):
    from choreograph.evaluation import EvaluationConfig, evaluate, find_songs, variants_named
    from choreograph.repertoire import Repertoire
    from choreograph.starter import starter_repertoire

    config = EvaluationConfig(variants_named(variants or ("ours",)), seeds, beats, seen)
    repertoire = starter_repertoire() if db is None else Repertoire.open(db)
    report("finding songs", 0, 0)
    songs = find_songs(folder, only=only, duration_s=duration)
    return evaluate(repertoire, songs, config, report=report)


def _show(evaluation) -> None:
    """The tables on the terminal, as wide as they need to be where nobody watches."""
    from rich.console import Console
    from rich.table import Table

    from choreograph.evaluation import tables
    from choreograph.evaluation.tables import column_title

    console = Console(highlight=False)
    if not console.is_terminal:
        console = Console(highlight=False, width=max(80, 44 + 30 * len(evaluation.variants)))
    for table in tables(evaluation):
        shown = Table(title=table.family, title_justify="left", title_style="bold", box=None, pad_edge=False)
        shown.add_column("")
        for name in table.columns:
            shown.add_column(column_title(name), justify="right")
        for row in table.rows:
            unit = f" {row.metric.unit}" if row.metric.unit else ""
            shown.add_row(
                f"{row.metric.label}{unit}", *(_cell(cell, row.metric.digits) for cell in row.cells)
            )
        console.print(shown)
        console.print()


def _cell(cell, digits: int) -> str:
    from choreograph.evaluation.tables import number_text

    if cell is None:
        return "-"
    spread = f" ± {number_text(cell.spread, digits)}" if cell.n > 1 else ""
    chance = "" if cell.chance is None else f" (chance {number_text(cell.chance, digits)})"
    return f"{number_text(cell.mean, digits)}{spread}{chance}"
