"""Recipe of the shipped repertoire: render its takes, train its networks, write `starter.h5`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from shutil import copyfile
from typing import Any

import click

from choreograph.cli.declared import Command, Output, option
from choreograph.cli.present import examples, say, show_notes, stages
from choreograph.core.files import atomic_path, check_apart, check_target, locked_folder
from choreograph.core.numerics import one_thread
from choreograph.core.progress import ProgressReport
from choreograph.library.building.build import build_repertoire
from choreograph.library.building.options import BuildOptions
from choreograph.library.builtin import STARTER_PATH
from choreograph.library.repertoire import Repertoire
from content.starter_takes import take_specs, write_takes

# Recipe of the shipped repertoire: render its takes, train its networks, write `starter.h5`.


def build_starter(
    work: Path,
    output: Path = STARTER_PATH,
    *,
    preset: str = "small",
    seed: int = 0,
    report: ProgressReport | None = None,
    training_report: Callable[[Any], None] | None = None,
) -> tuple[Repertoire, tuple[str, ...]]:
    """Render the built-in takes, train on them, and write the repertoire.

    With preset small the style networks are those of the shipped set `clean`, which were trained on most of
    these takes, in an earlier version. Other networks are trained in one thread, so that the bytes do not
    depend on the number of cores. Takes and checkpoints stay in `work`, so that an interrupted run can
    resume. Returns the repertoire and notes. Raises as `build_repertoire`, and `ChoreographError` if another
    process works in `work`.
    """
    check_apart([check_target(output)], [work / "takes"])
    with locked_folder(work, doing=f"builds {output.name}"), one_thread():
        return _built_starter(work, output, preset, seed, report, training_report)


def _built_starter(
    work: Path,
    output: Path,
    preset: str,
    seed: int,
    report: ProgressReport | None,
    training_report: Callable[[Any], None] | None,
) -> tuple[Repertoire, tuple[str, ...]]:
    takes = work / "takes"
    if not (takes / "manifest.csv").exists():
        write_takes(takes, take_specs(), report=report)
    # Feet of rendered takes never slide, so no foot lock is needed.
    options = BuildOptions(
        preset=preset, seed=seed, resume=True, lock_feet=False, pretrained="clean",
        keep_networks=preset == "small", train_words=True, compress=True, rollout=True,
        rollout_teacher=False,  # built-in takes are on the count already
    )  # fmt: skip
    made, notes = build_repertoire(
        [takes], work / output.name, options, report=report, training_report=training_report
    )
    with atomic_path(output) as temporary:
        copyfile(made.path, temporary)
    return Repertoire.open(output), notes


# `python -m content.starter`: make the built-in repertoire again.


@click.command(
    "python -m content.starter",
    cls=Command,
    epilog=examples("python -m content.starter --preset tiny -o starter.h5"),
)
@option(
    "--work", default="build/starter", show_default=True, type=Output(),
    help="Folder of rendered takes and checkpoints.",
)  # fmt: skip
@option("--preset", default="small", show_default=True, metavar="tiny|small|paper")
@option("--seed", default=0, show_default=True, type=click.IntRange(min=0))
@option("-o", "--output", type=Output(), help="Default: in the package.")
def command(work, preset, seed, output) -> None:
    """Render the built-in takes and songs, train on them, and write the built-in repertoire."""
    from choreograph.library.builtin import STARTER_PATH

    work.mkdir(parents=True, exist_ok=True)
    output = output or STARTER_PATH
    with stages(quiet=False) as shown:
        repertoire, notes = build_starter(
            work, output, preset=preset, seed=seed, report=shown.report, training_report=shown.training,
        )  # fmt: skip
    show_notes(notes)
    say(f"{output}: {len(repertoire.takes)} takes, {output.stat().st_size / 1e6:.1f} MB")


if __name__ == "__main__":
    from choreograph.core.errors import ChoreographError

    try:
        command(prog_name="python -m content.starter")
    except ChoreographError as error:
        say(f"choreograph: {error}", err=True)
        raise SystemExit(2) from None
