"""The commands `write` and `show` of `python -m research.study`."""

from __future__ import annotations

import json
from pathlib import Path

import click
from rich.table import Table
from rich.text import Text

from choreograph.cli.declared import (
    Command,
    Given,
    Input,
    Output,
    Seconds,
    after_at,
    argument,
    is_stdout,
    names_of,
    option,
)
from choreograph.cli.present import examples, printable, say, stages, table_console
from choreograph.core.errors import ChoreographError
from choreograph.core.files import atomic_path, check_target
from choreograph.core.progress import counted
from choreograph.evaluation.run import variants_named
from choreograph.evaluation.songs import find_songs
from choreograph.library.repertoire import as_repertoire
from choreograph.studio.ratings import KEY_NAME
from research.study.results import Difference, Score, StudyResults, read_study
from research.study.writing import (
    PAGE_NAME,
    PAIR_QUESTIONS,
    QUESTIONS,
    STUDIO_QUESTION,
    check_study_folder,
    make_study_dances,
    write_study,
)


def _pages(folder: Path, _: Given) -> tuple[Path, ...]:
    """What a study writes to its folder."""
    return folder / PAGE_NAME, folder / KEY_NAME


@click.group(
    "python -m research.study",
    epilog=examples(
        "python -m research.study write --songs heldout/ --variants baselines -o study/",
        "python -m research.study write --songs heldout/ --variants rollout --ask pairs -o pairs/",
        "python -m research.study show study/",
    ),
)
def command() -> None:
    """Let people rate or compare dances in a blind study: write a page, then show the answers."""


@command.command("write", cls=Command, short_help="Write a page for raters.")
@option("--songs", "folder", required=True, type=Input("takes"), metavar="DIR", help="Songs to dance to.")
@option("-o", "--output", required=True, type=Output(_pages), metavar="DIR", help="New folder of the study.")
@option(
    "--db", type=Input("repertoire"), multiple=True, metavar="FILE|DIR",
    help="Repertoire to dance with, or a folder of several. Repeatable. Default: the built-in one.",
)  # fmt: skip
@option(
    "--only",
    type=Input("list", after_at),
    multiple=True,
    metavar="SONG",
    help="Only this song, or @FILE of names.",
)
@option(
    "--variants", multiple=True, metavar="NAME",
    help="What to compare: engines, as-published, or one variant of a group. Default: baselines.",
)  # fmt: skip
@option("--seen", is_flag=True, help="Also use songs that the repertoire was made with.")
@option("--duration", type=Seconds(), help="Seconds of each song to dance. Default: to the end.")
@option(
    "--excerpt",
    type=Seconds(),
    default=6.0,
    show_default=True,
    help="Seconds of each dance to show, from its middle.",
)
@option(
    "--ask", type=click.Choice(("ratings", "pairs", "both")), default="ratings", show_default=True,
    help="Rate each dance by four questions, or compare two to a song: which is more of the genre, "
    "and which was made by a computer.",
)  # fmt: skip
@option("--silent", is_flag=True, help="No sound, and no question about music.")
@option("--order-seed", default=0, show_default=True, help="Seed of the order of the dances.")
@option("-q", "--quiet", is_flag=True, help="No progress, no summary.")
def write(
    folder: Path,
    output: Path,
    db: tuple[Path, ...],
    only: tuple[str, ...],
    variants: tuple[str, ...],
    seen: bool,
    duration: float | None,
    excerpt: float,
    ask: str,
    silent: bool,
    order_seed: int,
    quiet: bool,
) -> None:
    """Dance in every variant to every song of DIR, and write one page that shows them in random order."""
    check_study_folder(output)
    chosen = variants_named(variants or ("baselines",))
    repertoire = as_repertoire(db)
    with stages(quiet=quiet) as shown:
        songs = find_songs(folder, only=names_of(only), duration_s=duration)
        dances = make_study_dances(repertoire, songs, chosen, seen=seen, report=shown.report)
        shown.report("writing the study", 0, 0)
        write_study(dances, output, seed=order_seed, sound=not silent, excerpt_s=excerpt, ask=ask)
    if not quiet:
        n_dances = sum(len(own) for own in dances.values())
        say(
            f"{output / PAGE_NAME}: {n_dances} dances of {len(dances)} variants. Give raters this page only, "
            f"never {KEY_NAME}."
        )
        say(f"Put the files they send back into {output}, then run: python -m research.study show {output}")


@command.command("show", cls=Command, short_help="Show the ratings.")
@argument("study", type=Input("takes"))
@option(
    "--json", "json_path", type=Output(), metavar="FILE", help="Write the ratings as JSON. - prints them."
)
@option("-q", "--quiet", is_flag=True, help="No table.")
def show(study: Path, json_path: Path | None, quiet: bool) -> None:
    """Show the answers in the folder STUDY: means with 95 % intervals, and differences of variants."""
    if json_path is not None and not is_stdout(json_path):
        check_target(json_path)
    results = read_study(study)
    text = json.dumps(results.to_dict(), indent=1, ensure_ascii=False) + "\n"
    if is_stdout(json_path):
        click.echo(text, nl=False)
        return
    if json_path is not None:
        with atomic_path(json_path) as temporary:
            temporary.write_text(text, encoding="utf-8")
    if not quiet:
        _show_tables(results)


def _show_tables(results: StudyResults) -> None:
    console = table_console()
    raters, songs = counted(results.n_raters, "rater"), counted(results.n_songs, "song")
    say(f"{raters}, {songs}; 95 % intervals in brackets")
    for question in QUESTIONS:
        scores = [score for score in results.scores if score.question == question.id]
        if not scores:
            continue
        title = f"{question.title}, 0 to 5"
        table = Table(title=title, title_justify="left", title_style="bold", box=None, pad_edge=False)
        for name in ("", "mean", "ratings"):
            table.add_column(name, justify="right" if name else "left")
        for score in scores:
            table.add_row(printable(score.variant), _with_interval(score), str(score.n_ratings))
        console.print()
        console.print(table)
        for difference in (d for d in results.differences if d.question == question.id):
            unclear = "" if difference.is_clear else ", not significant"
            say(f"  {difference.variant} over {difference.other}: {_with_interval(difference, '+')}{unclear}")
    for pair_question in (*PAIR_QUESTIONS, STUDIO_QUESTION):
        preferences = [p for p in results.preferences if p.question == pair_question.id]
        if preferences:
            asked = Text(pair_question.text.format(genre="of the genre"), style="bold")
            console.print("\n", asked, " 0.50 by chance", sep="")
        for p in preferences:
            unclear = "" if p.is_clear else ", not significant"
            shares = _interval(p.share, p.low, p.high)
            say(f"  {p.variant}, not {p.other}: {shares}, {p.n_answers} answers{unclear}")


def _with_interval(estimate: Score | Difference, sign: str = "") -> str:
    return _interval(estimate.mean, estimate.low, estimate.high, sign)


def _interval(mean: float, low: float | None, high: float | None, sign: str = "") -> str:
    if low is None:
        return f"{mean:{sign}.2f}"
    return f"{mean:{sign}.2f} ({low:{sign}.2f} to {high:{sign}.2f})"


if __name__ == "__main__":
    try:
        command(prog_name="python -m research.study")
    except ChoreographError as error:
        say(f"choreograph: {error}", err=True)
        raise SystemExit(2) from None
