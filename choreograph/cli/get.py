"""`choreograph get`, which downloads a public data set after its terms were shown."""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from choreograph.cli.declared import Command, Given, Input, Output, argument, option
from choreograph.cli.present import examples, say, show_notes, stages
from choreograph.core.errors import ChoreographError
from choreograph.core.progress import counted

if TYPE_CHECKING:
    from choreograph.formats.data_sets import DataSet

_DOWNLOAD = "download"  # the mode with the name of a data set
_of_download = partial(option, modes=(_DOWNLOAD,))


def _default(given: Given) -> tuple[Path, ...]:
    return () if given["name"] is None else (Path(given["name"]),)


@click.command(
    cls=Command,
    short_help="Download a public data set of dances.",
    epilog=examples(
        "choreograph get                              the data sets, with their terms",
        "choreograph get aist++                       shows the terms, asks, downloads to aist++/",
        "choreograph get lafan1 --agree --build rep.h5",
    ),
)
@argument("name", required=False, selects=_DOWNLOAD)
@_of_download(
    "-o",
    "--output",
    type=Output(default=_default),
    metavar="DIR",
    help="Folder of the data set. Default: NAME here.",
)
@_of_download("--agree", is_flag=True, help="Agree to the terms without being asked.")
@_of_download("--build", type=Output(), metavar="FILE", help="Then build this repertoire from it (.h5).")
@option("--table", type=Input("list"), metavar="FILE", help="Table of other data sets (.toml).")
@option("-q", "--quiet", is_flag=True, help="Print no progress and no notes.")
def command(
    name: str | None,
    output: Path | None,
    agree: bool,
    build: Path | None,
    table: Path | None,
    quiet: bool,
) -> None:
    """Download the data set NAME. Without NAME, list the data sets.

    The terms are shown first, and nothing is downloaded unless you agree. A download that was stopped goes on
    where it ended. Sums are compared where they are published (extra `get`).
    """
    from choreograph.formats.data_sets import TABLE, data_set, data_sets

    if name is None:
        _list(list(data_sets(table or TABLE).values()))
        return
    chosen = data_set(name, table or TABLE)
    folder = output or Path(chosen.name)
    _show_terms(chosen)
    if chosen.files:
        if not agree and not _agrees():
            raise ChoreographError("expected that you agree to the terms, got no yes: nothing was downloaded")
        _download(chosen, folder, quiet=quiet)
    if not any(folder.glob(chosen.layout)):
        raise ChoreographError(
            f"{folder}: expected {chosen.layout} in it, got none: the owners ask for a download by hand"
        )
    _build(folder / chosen.build, build, quiet=quiet)


def _list(known: list[DataSet]) -> None:
    width = max(len(one.name) for one in known)
    for one in known:
        how = "" if one.files else " (by hand)"
        say(f"{one.name:<{width}}  {one.about}. {one.licence}{how}")


def _show_terms(chosen: DataSet) -> None:
    say(f"{chosen.title}: {chosen.about}")
    say(f"licence: {chosen.licence}")
    for line in chosen.terms:
        say(f"terms: {line}")
    say(f"in full: {chosen.page}")
    if chosen.by_hand:
        say(f"by hand: {chosen.by_hand}")
    for file in chosen.files:
        say(f"from: {file.url}")


def _agrees() -> bool:
    """Whether the user types yes."""
    try:
        answer: str = click.prompt("Type yes to agree to these terms", default="no", show_default=False)
    except click.Abort:
        return False
    return answer.strip().casefold() == "yes"


def _download(chosen: DataSet, folder: Path, *, quiet: bool) -> None:
    from choreograph.formats.download import ARCHIVES, fetch

    try:
        with stages(quiet=quiet) as shown:
            n_files, notes = fetch(chosen, folder, shown.report)
    except KeyboardInterrupt:
        say("stopped: the same command continues from here", err=True)
        sys.exit(130)
    if not quiet:
        show_notes(notes)
    say(f"{folder}: {counted(n_files, 'file')}. {folder / ARCHIVES} may be deleted")


def _build(source: Path, target: Path | None, *, quiet: bool) -> None:
    """Build the repertoire, or print the command that does."""
    if target is None:
        say(f"build: choreograph build-db {source} -o rep.h5 --skip-bad")
        return
    import choreograph as cg

    with stages(quiet=quiet) as shown:
        built = cg.build([source], target, skip_bad=True, report=shown.report, training_report=shown.training)
    if not quiet:
        show_notes(built.notes)
    say(f"{built.path}: {counted(len(built.repertoire.takes), 'take')}")
