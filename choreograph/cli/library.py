"""`choreograph library`, which keeps repertoire files in a folder that is danced with as one library."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from choreograph.cli.declared import Changed, Command, Input, Output, argument, option
from choreograph.cli.present import examples, say
from choreograph.core.progress import counted

if TYPE_CHECKING:
    from choreograph.library.shards import AnyFile


@click.group(
    short_help="Keep several repertoire files as one library.",
    epilog=examples(
        "choreograph library create archive/ monday.h5 tuesday.h5",
        "choreograph library add archive/ wednesday.h5",
        "choreograph library remove archive/ monday",
        "choreograph library check archive/",
        "choreograph library merge archive/ -o all.h5",
        "choreograph dance song.mp3 --db archive/",
    ),
)
def command() -> None:
    """Keep repertoire files in a folder that is one library, for the option --db of other commands.

    The files have the same networks, motifs and skeleton. `build-db --init-from FILE --keep-networks` builds
    one that has those of FILE. Takes of a file are changed by `build-db --add`, --replace and --remove.
    """


@command.command("create", cls=Command, short_help="Make a folder of repertoire files.")
@argument("directory", metavar="DIR", type=Changed("repertoire"))
@argument("files", nargs=-1, required=True, type=Input("repertoire"))
def create(directory: Path, files: tuple[Path, ...]) -> None:
    """Copy repertoire FILES to the new folder DIR, if they can be read as one library."""
    from choreograph.library.catalogue import create_library

    _show(directory, create_library(directory, files))


@command.command("add", cls=Command, short_help="Add repertoire files.")
@argument("directory", metavar="DIR", type=Changed("repertoire"))
@argument("files", nargs=-1, required=True, type=Input("repertoire"))
def add(directory: Path, files: tuple[Path, ...]) -> None:
    """Copy repertoire FILES to DIR, if they have the networks, motifs and skeleton of its files."""
    from choreograph.library.catalogue import add_files

    _show(directory, add_files(directory, files))


@command.command("remove", cls=Command, short_help="Delete files of a library.")
@argument("directory", metavar="DIR", type=Changed("repertoire"))
@argument("names", nargs=-1, required=True)
def remove(directory: Path, names: tuple[str, ...]) -> None:
    """Delete the files NAMES of the library DIR."""
    from choreograph.library.catalogue import remove_files

    _show(directory, remove_files(directory, names))


@command.command("check", cls=Command, short_help="Compare all data with its checksums.")
@argument("directory", metavar="DIR", type=Input("repertoire"))
def check(directory: Path) -> None:
    """Read all of the library DIR, and compare every block with its checksum."""
    from choreograph.cli.archive import show_check
    from choreograph.library.repertoire import Repertoire

    show_check(Repertoire.open(directory), as_json=False)


@command.command("merge", cls=Command, short_help="Write all takes to one file.")
@argument("paths", metavar="DIR|FILE...", nargs=-1, required=True, type=Input("repertoire"))
@option("-o", "--output", required=True, type=Output(), help="Repertoire to write.")
def merge(paths: tuple[Path, ...], output: Path) -> None:
    """Write the takes of a library, or of several files, to one repertoire."""
    from choreograph.library.catalogue import merge_library

    _show(output, merge_library(paths, output))


def _show(path: Path, file: AnyFile) -> None:
    shapes = file.shapes
    takes, clips = counted(shapes["takes/fps"][0], "take"), counted(shapes["clips/take"][0], "clip")
    say(f"{path}: {takes}, {clips}")
