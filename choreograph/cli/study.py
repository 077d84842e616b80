"""`choreograph evaluate --study`: a rating page written, and its ratings shown."""

from __future__ import annotations

import json
from pathlib import Path

import click

from choreograph.cli.present import stages


def write(
    study: Path, songs_folder: Path, db: Path | None, *, only, variants, duration_s, seen, excerpt_s, sound,
    seed, quiet,
) -> None:  # fmt: skip
    """Dance in every variant to every song, write the study, and say what to do with it."""
    from choreograph.evaluation import find_songs, variants_named
    from choreograph.evaluation.study import KEY_NAME, PAGE_NAME, check_study_folder, write_study
    from choreograph.evaluation.study_dances import make_study_dances
    from choreograph.repertoire import Repertoire
    from choreograph.starter import starter_repertoire

    check_study_folder(study)
    chosen = variants_named(variants or ("paper",))
    repertoire = starter_repertoire() if db is None else Repertoire.open(db)
    with stages(quiet=quiet) as shown:
        songs = find_songs(songs_folder, only=only, duration_s=duration_s)
        dances = make_study_dances(repertoire, songs, chosen, seen=seen, report=shown.report)
        shown.report("writing the study", 0, 0)
        write_study(dances, study, seed=seed, sound=sound, excerpt_s=excerpt_s)
    if not quiet:
        n_dances = sum(len(own) for own in dances.values())
        click.echo(
            f"{study / PAGE_NAME}: {n_dances} dances of {len(dances)} variants. Give raters this page alone, "
            f"never {KEY_NAME};\nput the files they send back into {study}, "
            f"and run choreograph evaluate --study {study}"
        )


def show(folder: Path, *, json_path: str | None, quiet: bool) -> None:
    """The ratings of a study as tables, or as JSON."""
    from choreograph.evaluation.study_results import read_study
    from choreograph.files import atomic_path

    results = read_study(folder)
    text = json.dumps(results.to_dict(), indent=1, ensure_ascii=False) + "\n"
    if json_path == "-":
        click.echo(text, nl=False)
        return
    if json_path is not None:
        with atomic_path(json_path) as temporary:
            temporary.write_text(text, encoding="utf-8")
    if not quiet:
        _show_tables(results)


def _show_tables(results) -> None:
    from rich.console import Console
    from rich.table import Table

    from choreograph.evaluation.study import QUESTIONS

    console = Console(highlight=False)
    click.echo(f"{results.n_raters} raters, {results.n_songs} songs; 0 to 5, 95 % intervals in brackets")
    for question in QUESTIONS:
        scores = [score for score in results.scores if score.question == question.id]
        if not scores:
            continue
        table = Table(
            title=question.title, title_justify="left", title_style="bold", box=None, pad_edge=False
        )
        for name in ("", "mean", "ratings"):
            table.add_column(name, justify="right" if name else "left")
        for score in scores:
            table.add_row(score.variant, _with_interval(score), str(score.n_ratings))
        console.print()
        console.print(table)
        for apart in (d for d in results.differences if d.question == question.id):
            clear = "" if apart.is_clear else ", not told apart"
            console.print(f"  {apart.variant} over {apart.other}: {_with_interval(apart, '+')}{clear}")


def _with_interval(estimate, sign: str = "") -> str:
    if estimate.low is None:
        return f"{estimate.mean:{sign}.2f}"
    return f"{estimate.mean:{sign}.2f} ({estimate.low:{sign}.2f} to {estimate.high:{sign}.2f})"
