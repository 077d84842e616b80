"""Builds the shipped repertoire again: `python -m choreograph.starter` (or `make starter`)."""

from __future__ import annotations

from pathlib import Path

import click

from choreograph.cli.present import show_notes, stages
from choreograph.pipeline import BuildOptions, build_repertoire
from choreograph.starter import STARTER_PATH
from choreograph.starter.synth.examples import write_examples
from choreograph.starter.takes import write_takes


@click.command()
@click.option("--work", default="build/starter", show_default=True, type=click.Path(path_type=Path))
@click.option(
    "--learn-from", multiple=True, type=click.Path(path_type=Path), help="Real takes to learn from, too."
)
@click.option("--leave-out", type=click.Path(path_type=Path), help="File of real takes not to learn from.")
@click.option("--preset", default="small", show_default=True)
@click.option("--seed", default=0, show_default=True)
@click.option("-o", "--output", default=STARTER_PATH, show_default=True, type=click.Path(path_type=Path))
def main(
    work: Path, learn_from: tuple[Path, ...], leave_out: Path | None, preset: str, seed: int, output: Path
) -> None:
    """Render the starter's takes and songs, learn from them and from real takes, write the repertoire.

    Only the rendered takes go into it; of the real ones nothing but what the networks learned. A run that
    was stopped goes on where it was.
    """
    work.mkdir(parents=True, exist_ok=True)
    takes = work / "takes"
    left_out = tuple(leave_out.read_text(encoding="utf-8").split()) if leave_out else ()
    learned = BuildOptions(preset=preset, seed=seed, resume=True, leave_out=left_out)
    with stages(quiet=False) as shown:
        if not (takes / "manifest.csv").exists():
            write_takes(takes, report=shown.report)
        _, notes = build_repertoire(
            [takes, *learn_from], work / "learned.h5", learned,
            report=shown.report, training_report=shown.training,
        )  # fmt: skip
        kept = BuildOptions(
            preset=preset, seed=seed, init_from=work / "learned.h5", keep_networks=True, packed=True
        )
        repertoire, more = build_repertoire([takes], output, kept, report=shown.report)
    write_examples()
    show_notes((*notes, *more))
    click.echo(f"{output}: {len(repertoire.takes)} takes, {output.stat().st_size / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
