"""`choreograph build-starter`: make the built-in repertoire again."""

from __future__ import annotations

from pathlib import Path

import click

from choreograph.cli.options import Command
from choreograph.cli.present import examples, say, show_notes, stages


@click.command(
    "build-starter",
    cls=Command,
    hidden=True,  # for those who work on choreograph itself
    epilog=examples("choreograph build-starter --preset tiny -o starter.h5"),
)
@click.option(
    "--work", default="build/starter", show_default=True, type=click.Path(path_type=Path),
    help="Folder of rendered takes and checkpoints.",
)  # fmt: skip
@click.option("--preset", default="small", show_default=True, metavar="tiny|small|paper")
@click.option("--seed", default=0, show_default=True, type=click.IntRange(min=0))
@click.option("-o", "--output", type=click.Path(path_type=Path), help="Default: in the package.")
def command(work, preset, seed, output) -> None:
    """Render the built-in takes and songs, train on them, and write the built-in repertoire."""
    from choreograph.starter import STARTER_PATH
    from choreograph.starter.recipe import build_starter

    work.mkdir(parents=True, exist_ok=True)
    output = output or STARTER_PATH
    with stages(quiet=False) as shown:
        repertoire, notes = build_starter(
            work, output, preset=preset, seed=seed, report=shown.report, training_report=shown.training,
        )  # fmt: skip
    show_notes(notes)
    say(f"{output}: {len(repertoire.takes)} takes, {output.stat().st_size / 1e6:.1f} MB")
