"""`choreograph build-db`: takes and their songs to a repertoire."""

from __future__ import annotations

import sys
from pathlib import Path

import click
from click_option_group import optgroup

from choreograph.cli.present import (
    Command,
    check_outputs_apart,
    examples,
    given_options,
    names_of,
    printable,
    say,
    show_notes,
    stages,
)
from choreograph.core.errors import ParameterError
from choreograph.core.progress import counted

_FILE = click.Path(path_type=Path)
_WIDEST = 80  # letters of a column of --check; longer cells push the next ones
# By --published.
_DECIDED = {
    "--augment-mirror", "--density", "--init-from", "--keep-networks", "--lock-feet", "--pretrained",
}  # fmt: skip


@click.command(
    "build-db",
    cls=Command,
    short_help="Build a repertoire from takes and their songs.",
    epilog=examples(
        "choreograph build-db takes/ -o rep.h5                      NAME.bvh with NAME.wav in one folder",
        "choreograph build-db takes/ --check                        what would be read, and why not",
        "choreograph build-db takes/ -o rep.h5 --resume             continues a build that was stopped",
        "choreograph build-db dance-with-melody/ choreonet/ -o rep.h5   takes, counted by the other's lists",
        "choreograph build-db aist/motions -o rep.h5 --preset tiny  quick, to try it out",
        "choreograph build-db new/ -o rep.h5 --init-from old.h5     starts from trained networks",
    ),
)
@click.argument("sources", nargs=-1, required=True, type=_FILE)
@optgroup.group("Output")
@optgroup.option("-o", "--output", type=_FILE, help="Repertoire to write; required without --check.")
@optgroup.option(
    "--check", is_flag=True,
    help="Build nothing: read the sources and print a row for each file with rig, units, counts, length, "
    "and what a build does with it.",
)  # fmt: skip
@optgroup.option("--compress", is_flag=True, help="A third of the size: motion in 16 bits.")
@optgroup.option("-q", "--quiet", is_flag=True, help="No progress, no notes.")
@optgroup.group("Takes")
@optgroup.option(
    "--leave-out",
    multiple=True,
    metavar="TAKE",
    help="Leave out this take, or @FILE of names.",
)
@optgroup.option(
    "--skip-bad", is_flag=True, help="Build from the others where files cannot be read, and note those."
)
@optgroup.option(
    "--lock-feet/--no-lock-feet", default=True, show_default=True,
    help="Lock feet of takes that slide where they stand.",
)  # fmt: skip
@optgroup.option(
    "--density", metavar="analytic|learned",
    help="Tempo-density of the clips: from their motion beats (analytic), or of two networks, which are "
    "trained for it alone.",
)  # fmt: skip
@optgroup.option(
    "--beats",
    default="network",
    show_default=True,
    metavar="network|tempo-path|librosa|beat-this",
    help="Beat tracker of the takes' songs.",
)
@optgroup.option(
    "--allow-outside", is_flag=True, help="Read songs that a manifest.csv names outside of its folder."
)
@optgroup.option(
    "--map", "map_path", type=_FILE,
    help="Which bone is which in the takes, as `retarget --save-map` writes it (.json).",
)  # fmt: skip
@optgroup.group("Networks")
@optgroup.option(
    "--preset", default="small", show_default=True, metavar="tiny|small|paper",
    help="Size of the networks. tiny: to try it out. small: for two CPU cores. paper: for a GPU.",
)  # fmt: skip
@optgroup.option(
    "--published", is_flag=True,
    help="Train as ChoreoGraph was published, for `dance --config published`: its losses, inputs, batch and "
    "rate. The preset scales widths and epochs: 10 epochs for tiny, 100 for small, all 10,000 for paper.",
)  # fmt: skip
@optgroup.option("--rollout", is_flag=True, help="Also train the network of `dance --engine rollout`.")
@optgroup.option(
    "--rollout-teacher/--no-rollout-teacher", default=True, show_default=True,
    help="Let that network learn from graph dances as well, to the takes' songs and to synthesised ones of "
    "their genres. They are on the count, which takes need not be; it takes half as long again.",
)  # fmt: skip
@optgroup.option("--init-from", type=_FILE, help="Start from the networks of another repertoire.")
@optgroup.option(
    "--pretrained", default="default", metavar="default|clean|research|nothing",
    help="Shipped networks that style begins with (preset small), and that count takes without counts by "
    "their motion. clean: trained on our own takes; their counts know no recorded dancer. research: also "
    "on data that states no licence. Default: style clean, counts research.",
)  # fmt: skip
@optgroup.option(
    "--keep-networks", is_flag=True,
    help="Do not train the networks of --init-from, or the style of --pretrained, any further.",
)  # fmt: skip
@optgroup.option(
    "--augment-mirror/--no-augment-mirror", default=True, show_default=True,
    help="Train on mirrored motion as well. Not where left must stay left.",
)  # fmt: skip
@optgroup.group("Training")
@optgroup.option("--resume", is_flag=True, help="Continue from the checkpoints of a build that was stopped.")
@optgroup.option("--device", default="auto", show_default=True, metavar="auto|cpu|cuda")
@optgroup.option("--seed", default=0, show_default=True, type=click.IntRange(min=0), help="Seed.")
def command(sources, output, check, quiet, leave_out, map_path, density, published, **options) -> None:
    """Build a repertoire from SOURCES: folders or files of recorded dances with their music.

    Known layouts, of which a folder may have several: NAME.bvh, .c3d, .glb, .npz or (with Blender) .fbx with
    NAME.wav|mp3|flac|ogg|m4a and an optional manifest.csv; dance-with-melody; ChoreoNet, whose lists also
    count dance-with-melody's takes; AIST++; AMASS. NAME.counts.csv beside NAME.bvh says where a take is
    counted: time_s,number,figure.
    """
    import choreograph as cg
    from choreograph.motion.bone_map import read_bone_map
    from choreograph.settings import published_build

    if output is None and not check:
        raise click.UsageError("Missing option '-o' / '--output'.")
    check_outputs_apart([output], named_by=("output",))
    if density is not None:
        options["density"] = density
    options["leave_out"] = names_of(leave_out)
    if "--rollout-teacher" in given_options() and not options["rollout"]:
        raise ParameterError("expected --rollout beside --rollout-teacher or --no-rollout-teacher, got none")
    options["bone_map"] = read_bone_map(map_path) if map_path else None
    if published:
        given = sorted(set(given_options()) & _DECIDED)
        if given:
            raise ParameterError(
                f"--published decides how networks are trained: leave out {', '.join(given)}"
            )
        options |= published_build(options["preset"])
    if check:
        _check(sources, options, quiet=quiet)
        return
    try:
        with stages(quiet=quiet) as shown:
            built = cg.build(sources, output, report=shown.report, training_report=shown.training, **options)
    except KeyboardInterrupt:
        say("stopped: the same command with --resume continues from here", err=True)
        sys.exit(130)
    if not quiet:
        show_notes(built.notes)
        takes, clips = len(built.repertoire.takes), built.repertoire.n_clips
        say(f"{output}: {counted(takes, 'take')}, {counted(clips, 'clip')}")


def _check(sources, options, *, quiet: bool) -> None:
    """Print a row for each file of the sources; an error if a build would be refused."""
    from choreograph.library.building.options import BuildOptions
    from choreograph.library.building.takes import check_takes, checked_files, import_sources

    settings = BuildOptions(**options)
    with stages(quiet=quiet) as shown:
        imported = import_sources(sources, settings, shown.report)
    files = checked_files(imported)
    table = [("file", "rig", "units", "counts", "length", "what happens")]
    table += [(_shown(f.path), f.rig, f.units, f.counts, f.length, f.happens) for f in files]
    rows = [tuple(map(printable, row)) for row in table]
    widths = [min(max(map(len, column)), _WIDEST) for column in zip(*rows, strict=True)]
    for row in rows:
        cells = [f"{cell:<{width}}" for cell, width in zip(row, widths, strict=True)]
        say("  ".join(cells).rstrip())
    n_read, n_bad = sum(file.is_read for file in files), sum(file.is_bad for file in files)
    say(f"{len(files)} rows: {n_read} read, {n_bad} bad, {len(files) - n_read - n_bad} not read")
    check_takes(imported, settings)


def _shown(path: Path) -> str:
    """The path from the current folder, if it is there."""
    here = Path.cwd()
    return str(path.relative_to(here) if path.is_relative_to(here) else path)
