"""`choreograph build-db`, which builds a repertoire from takes, and `get`, which downloads takes."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import click
from click_option_group import optgroup

from choreograph.cli.declared import (
    Changed,
    Command,
    Given,
    Input,
    Output,
    after_at,
    after_equals,
    argument,
    given_settings,
    grouped,
    local,
    names_of,
    option,
)
from choreograph.cli.present import examples, printable, say, show_notes, stages
from choreograph.core.errors import ChoreographError, ParameterError
from choreograph.core.progress import counted
from choreograph.core.workers import is_of_torchrun

if TYPE_CHECKING:
    from choreograph.formats.download import DataSet
    from choreograph.library.building.options import BuildOptions, BuildResult

# The modes of the command: a build, a check of the sources, and a change of a repertoire.
_BUILD, _CHECK, _CHANGE = "", "check", "change"
_built = partial(grouped, modes=(_BUILD, _CHECK))
_changing = partial(grouped, selects=_CHANGE, multiple=True)


def _is_replaced(given: Given) -> bool:
    """Whether the sources are a repertoire that is replaced."""
    return given["output"] is None and bool(given["add"] or given["replace"] or given["remove"])


_PUBLISHED = ("augment_mirror", "init_from", "keep_networks")  # settings that --published needs as they are
_WIDEST = 80  # letters of a column of --check. Longer cells push the next ones


@click.command(
    "build-db",
    cls=Command,
    reasons={_CHANGE: "keep the networks, while a build from all takes with --init-from trains them"},
    short_help="Build a repertoire from takes and their songs.",
    epilog=examples(
        "choreograph build-db takes/ -o rep.h5                      NAME.bvh with NAME.wav in one folder",
        "choreograph build-db takes/ --check                        which files would be read, and why not",
        "choreograph build-db takes/ -o rep.h5 --resume             continues a build that was stopped",
        "choreograph build-db dance-with-melody/ choreonet/ -o rep.h5   with the counts of both",
        "choreograph build-db aist/motions -o rep.h5 --preset tiny  a fast first try",
        "choreograph build-db new/ -o rep.h5 --init-from old.h5     starts from trained networks",
        "torchrun --nproc-per-node 4 -m choreograph build-db takes/ -o rep.h5   trains on four GPUs",
        "choreograph build-db --add new/ rep.h5                     reads only new/, and keeps the networks",
        "choreograph build-db --replace again/ --remove W_1 rep.h5 -o rep2.h5",
    ),
)
@argument("sources", nargs=-1, required=True, type=Changed("takes", local, _is_replaced))
@optgroup.group("Output")
@grouped("-o", "--output", type=Output(), help="Repertoire to write. Required without --check.")
@grouped(
    "--check", is_flag=True, selects=_CHECK,
    help="Build nothing. Read the sources and print a row for each file with its rig, units, counts and "
    "length, and whether a build would use it.",
)  # fmt: skip
@_built("--compress", is_flag=True, default=None, help="Store motion in 16 bits: a ninth of the size.")
@grouped("-q", "--quiet", is_flag=True, help="Print no progress and no notes.")
@optgroup.group("Changes of the repertoire SOURCES, which is replaced unless -o names another file")
@_changing(
    "--add", type=Input("takes", local), metavar="SOURCE", help="Add the takes of this source. Repeatable."
)
@_changing(
    "--replace", type=Input("takes", local), metavar="SOURCE",
    help="Replace its takes of the same names by those of this source. Repeatable.",
)  # fmt: skip
@_changing(
    "--remove",
    type=Input("list", after_at),
    metavar="TAKE",
    help="Remove this take, or those of @FILE. Repeatable.",
)
@optgroup.group("Takes")
@grouped(
    "--leave-out",
    type=Input("list", after_at),
    multiple=True,
    metavar="TAKE",
    help="Leave out this take, or @FILE of names.",
)
@grouped("--skip-bad", is_flag=True, default=None, help="Skip files that cannot be read, and print a note.")
@_built("--lock-feet/--no-lock-feet", default=None, help="Keep standing feet of takes in place (on).")
@_built(
    "--density", metavar="analytic|learned",
    help="Tempo-density of the clips: from their motion beats (analytic, the default), or of two networks "
    "that are trained for it (learned).",
)  # fmt: skip
@_built(
    "--beats", metavar="network|tempo-path|librosa|beat-this", help="Beat tracker for the songs (network)."
)
@grouped(
    "--allow-outside", is_flag=True, default=None,
    help="Read songs that a manifest.csv names outside of its folder.",
)  # fmt: skip
@grouped(
    "--map", "map_path", type=Input("map"),
    help="Map of the bones of the takes, as written by `retarget --save-map` (.json).",
)  # fmt: skip
@optgroup.group("Networks")
@_built(
    "--preset", metavar="tiny|small|paper",
    help="Size of the networks. tiny: for a first try. small (default): for two CPU cores. paper: for a GPU.",
)  # fmt: skip
@_built(
    "--published", is_flag=True,
    help="Train as both papers were published, for `dance --config published`: their losses, inputs, batch "
    "and rate. The preset scales widths and epochs: 10 epochs for tiny, 100 for small, all 10,000 for paper.",
)  # fmt: skip
@_built("--rollout", is_flag=True, default=None, help="Also train the network of `dance --engine rollout`.")
@_built("--init-from", type=Input("repertoire"), help="Start from the networks of another repertoire.")
@_built(
    "--pretrained", metavar="default|clean|research|nothing",
    help="Shipped networks that style and words start from (preset small), and that count takes by their "
    "motion. clean: trained on our own takes only. research: also on data that states no licence. Default: "
    "clean for style, research for counts.",
)  # fmt: skip
@_built(
    "--keep-networks", is_flag=True, default=None,
    help="Use the networks and motifs of --init-from, or the shipped style and motion words, without "
    "training.",
)  # fmt: skip
@optgroup.group("Training")
@grouped(
    "--workers", type=int, metavar="N",
    help="Processes that read and measure takes: one for each CPU core (0).",
)  # fmt: skip
@grouped(
    "--dask", metavar="ADDRESS",
    help="Dask scheduler whose workers read and measure takes, such as tcp://10.0.0.5:8786.",
)  # fmt: skip
@grouped(
    "--stage", is_flag=True, default=None,
    help="Send takes and songs along to the workers of --dask, which then need no access to them.",
)  # fmt: skip
@grouped(
    "--no-cache", is_flag=True,
    help="Read and measure all takes again, also those that an earlier build has measured.",
)  # fmt: skip
@_built("--resume", is_flag=True, default=None, help="Continue a build that was stopped.")
@_built("--device", metavar="auto|cpu|cuda", help="Where to train: a GPU if there is one (auto).")
@_built("--seed", type=int, help="Seed of the training (0).")
@_built(
    "--set", "assigned", type=Input("setting", after_equals), multiple=True, metavar="NAME=VALUE",
    help="Any other setting, such as words=false. Repeatable. `choreograph settings --build` lists them.",
)  # fmt: skip
def command(
    sources: tuple[Path | str, ...],
    output: Path | None,
    check: bool,
    quiet: bool,
    add: tuple[Path | str, ...],
    replace: tuple[Path | str, ...],
    remove: tuple[str, ...],
    leave_out: tuple[str, ...],
    map_path: Path | None,
    published: bool,
    no_cache: bool,
    assigned: tuple[str, ...],
    **options: Any,
) -> None:
    """Build a repertoire from SOURCES: folders or files of recorded dances with their music.

    A take is NAME.bvh, .c3d, .glb, .npz or (with Blender) .fbx, with its music as NAME.wav|mp3|flac|ogg|m4a
    and an optional manifest.csv. The layouts of dance-with-melody, ChoreoNet (whose lists also count the
    takes of dance-with-melody), AIST++ and AMASS are read as well. A folder may hold several layouts.
    SOURCES may also be addresses, such as s3://bucket/takes (extra `remote`).
    NAME.counts.csv beside NAME.bvh states the counts of a take: time_s,number,figure.

    With --add, --replace or --remove, SOURCES is a repertoire. Only new takes are read, and networks and
    motifs are kept. To train them again, build from all takes with --init-from.
    """
    from choreograph.library.building.options import BuildOptions
    from choreograph.motion.bone_map import read_bone_map
    from choreograph.pipeline.published import published_build

    is_change = bool(add or replace or remove)
    if output is None and not check and not is_change:
        raise click.UsageError("Missing option '-o' / '--output'.")
    options["leave_out"] = names_of(leave_out) or None
    options["cache_gb"] = 0.0 if no_cache else None
    options["bone_map"] = read_bone_map(map_path) if map_path else None
    if is_change:
        _change(sources, output, options, add=add, replace=replace, remove=remove, quiet=quiet)
        return
    settings = given_settings(BuildOptions, options, assigned)
    if "rollout_teacher" in settings and not settings.get("rollout"):
        raise ParameterError("expected --rollout beside --set rollout_teacher, got none")
    if published:
        decided = published_build(settings.get("preset", "small"))
        if given := sorted(set(settings) & {*decided, *_PUBLISHED} - {"preset"}):
            raise ParameterError(f"--published decides {', '.join(given)}: leave these settings out")
        settings |= decided
    built_with = BuildOptions(**settings)
    if check:
        _check(sources, built_with, quiet=quiet)
        return
    assert output is not None
    if is_of_torchrun():
        from choreograph.nets.processes import joined

        with joined() as is_first:
            if is_first:
                _build(sources, output, built_with, quiet=quiet)
        return
    _build(sources, output, built_with, quiet=quiet)


def _build(sources: Sequence[Path | str], output: Path, settings: BuildOptions, *, quiet: bool) -> None:
    """Build the repertoire and print what was built. At Ctrl-C, exit with status 130."""
    import choreograph as cg

    try:
        with stages(quiet=quiet) as shown:
            built = cg.build(
                sources, output, options=settings, report=shown.report, training_report=shown.training
            )
    except KeyboardInterrupt:
        say("stopped: the same command with --resume continues from here", err=True)
        sys.exit(130)
    if not quiet:
        _show(built)


def _show(built: BuildResult) -> None:
    show_notes(built.notes)
    takes, clips = len(built.repertoire.takes), built.repertoire.n_clips
    say(f"{built.path}: {counted(takes, 'take')}, {counted(clips, 'clip')}")


def _change(
    repertoires: Sequence[Path | str],
    output: Path | None,
    options: Mapping[str, Any],
    *,
    add: Sequence[Path | str],
    replace: Sequence[Path | str],
    remove: tuple[str, ...],
    quiet: bool,
) -> None:
    """Add, replace and remove takes of a repertoire."""
    import choreograph as cg

    if len(repertoires) != 1:
        raise ParameterError(f"expected one repertoire to change, got {len(repertoires)} paths")
    [path] = repertoires
    settings: Any = {name: value for name, value in options.items() if value is not None}
    with stages(quiet=quiet) as shown:
        changed = cg.change_takes(
            path, add=add, replace=replace, remove=names_of(remove), output=output, report=shown.report,
            **settings,
        )  # fmt: skip
    if not quiet:
        _show(changed)


def _check(sources: Sequence[Path | str], settings: BuildOptions, *, quiet: bool) -> None:
    """Print a row for each file of the sources. Raises if a build would fail."""
    from choreograph.core.cache import caching
    from choreograph.core.workers import working
    from choreograph.formats.download import local_sources
    from choreograph.library.building.takes import check_takes, checked_files, import_sources

    with (
        stages(quiet=quiet) as shown,
        TemporaryDirectory() as folder,
        local_sources(sources, Path(folder), shown.report) as paths,
        working(settings.workers, settings.dask, stage=settings.stage),
        caching(settings.cache_gb),
    ):
        read = [path.absolute() for path in paths] if settings.dask else paths
        imported = import_sources(read, settings, shown.report)
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
    """The path relative to the current folder, if it is inside."""
    here = Path.cwd()
    return str(path.relative_to(here) if path.is_relative_to(here) else path)


# `choreograph get`, which downloads a public data set after its terms were shown.


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
def get(
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
    from choreograph.formats.download import TABLE, data_set, data_sets

    if name is None:
        known = list(data_sets(table or TABLE).values())
        width = max(len(one.name) for one in known)
        for one in known:
            how = "" if one.files else " (by hand)"
            say(f"{one.name:<{width}}  {one.about}. {one.licence}{how}")
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
    _build_from(folder / chosen.build, build, quiet=quiet)


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


def _build_from(source: Path, target: Path | None, *, quiet: bool) -> None:
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
