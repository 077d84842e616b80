"""`choreograph build-db`: takes and their songs to a repertoire."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from choreograph.cli.present import examples, show_notes, stages


@click.command(
    "build-db",
    epilog=examples(
        "choreograph build-db takes/ -o rep.h5                      NAME.bvh with NAME.wav in one folder",
        "choreograph build-db takes/ -o rep.h5 --resume             go on after it was stopped",
        "choreograph build-db aist/motions -o rep.h5 --preset tiny  quickly, to try it out",
        "choreograph build-db new/ -o rep.h5 --init-from old.h5     begin with learned networks",
    ),
)
@click.argument("sources", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path), help="Repertoire to write.")
@click.option(
    "--preset", default="small", show_default=True, metavar="tiny|small|paper",
    help="Size of the networks: tiny for trying out, small for two CPU cores, paper for a GPU.",
)  # fmt: skip
@click.option("--resume", is_flag=True, help="Go on from the checkpoints of a build that was stopped.")
@click.option(
    "--init-from", type=click.Path(path_type=Path), help="Begin with the networks of another repertoire."
)
@click.option(
    "--style-from", metavar="PATH|nothing",
    help="Begin with the style networks of a repertoire. Default: the built-in one's, for preset small.",
)  # fmt: skip
@click.option("--keep-networks", is_flag=True, help="Take those as they are; train only what it lacks.")
@click.option(
    "--density", default=None, metavar="analytic|learned", help="Which tempo-density the clips carry."
)
@click.option(
    "--rollout",
    is_flag=True,
    help="Train the network of `dance --engine rollout`, too (small: half an hour).",
)
@click.option(
    "--mirroring/--no-mirroring", default=True, show_default=True,
    help="Learn from motion seen in a mirror, too; not where left must stay left.",
)  # fmt: skip
@click.option(
    "--hold-feet/--no-hold-feet", default=True, show_default=True,
    help="Stop feet of takes that slide where they stand, before anything is measured.",
)  # fmt: skip
@click.option("--packed", is_flag=True, help="A third of the size: motion in 16 bits.")
@click.option("--leave-out", multiple=True, metavar="TAKE", help="Leave a take out; @FILE names one a line.")
@click.option("--device", default="auto", show_default=True, metavar="auto|cpu|cuda", help="Where to train.")
@click.option("--seed", default=0, show_default=True, type=click.IntRange(min=0), help="Of the training.")
@click.option("-q", "--quiet", is_flag=True, help="No progress, no notes.")
def command(
    sources,
    output,
    preset,
    resume,
    init_from,
    pretrained_style,
    keep_networks,
    density,
    rollout,
    augment_mirror,
    lock_feet,
    packed,
    leave_out,
    device,
    seed,
    quiet,
) -> None:
    """Build a repertoire from SOURCES: folders or files of recorded dances with their music.

    Known layouts: a folder of NAME.bvh with NAME.wav|mp3|flac|ogg|m4a and an optional manifest.csv;
    dance-with-melody; AIST++; AMASS.
    """
    from choreograph.building import BuildOptions, build_repertoire
    from choreograph.starter import STARTER_PATH

    begin = {None: STARTER_PATH if preset == "small" else None, "nothing": None}
    given = {} if density is None else {"density": density}
    options = BuildOptions(
        preset=preset, seed=seed, device=device, resume=resume, init_from=init_from,
        pretrained_style=begin[pretrained_style] if pretrained_style in begin else Path(pretrained_style),
        keep_networks=keep_networks, rollout=rollout, augment_mirror=augment_mirror, lock_feet=lock_feet,
        compress=packed, leave_out=names_of(leave_out), **given,
    )  # fmt: skip
    try:
        with stages(quiet=quiet) as shown:
            repertoire, notes = build_repertoire(
                sources, output, options, report=shown.report, training_report=shown.training
            )
    except KeyboardInterrupt:
        click.echo("stopped; the same command with --resume goes on from here", err=True)
        sys.exit(130)
    if not quiet:
        show_notes(notes)
        click.echo(f"{output}: {len(repertoire.takes)} takes, {repertoire.n_clips} clips")


def names_of(given: tuple[str, ...]) -> tuple[str, ...]:
    """Take names as given, those of each @FILE in its place; `FormatError` if one cannot be read."""
    from choreograph.errors import FormatError

    names: list[str] = []
    for name in given:
        if not name.startswith("@"):
            names.append(name)
            continue
        try:
            lines = Path(name[1:]).read_text(encoding="utf-8").splitlines()
        except (OSError, UnicodeDecodeError) as error:
            raise FormatError(f"{name[1:]}: expected a list of takes, could not read it: {error}") from error
        names += [line.strip() for line in lines if line.strip() and not line.startswith("#")]
    return tuple(names)
