"""`choreograph songs`: the built-in songs."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path

import click

from choreograph.cli.present import Command, examples, given_options, say, show_notes
from choreograph.core.errors import ParameterError
from choreograph.core.files import atomic_path, free_names, sha256_of


@click.command(
    cls=Command,
    epilog=examples(
        "choreograph songs                       their names and paths",
        "choreograph songs --copy .              copies all of them here",
        "choreograph dance $(choreograph songs --path house) --open",
    ),
)
@click.option(
    "--copy", "folder", type=click.Path(path_type=Path), metavar="FOLDER", help="Copy them to a folder."
)
@click.option("--path", "name", metavar="NAME", help="Print the path of this song.")
@click.option("--json", "as_json", is_flag=True, help="Print names and paths as JSON.")
def command(folder, name, as_json) -> None:
    """List the built-in songs. The project made them; use them as you like."""
    from choreograph.library.builtin import example_songs

    songs = example_songs()
    if name is not None:
        if len(given := given_options()) > 1:
            raise ParameterError(f"expected --path alone, got {', '.join(given)}")
        if name not in songs:
            raise ParameterError(f"expected a song among {', '.join(songs)}, got {name!r}")
        click.echo(songs[name])
        return
    if folder is not None:
        songs = {song: _copied(path, folder / path.name) for song, path in songs.items()}
    if as_json:
        click.echo(json.dumps({song: str(path) for song, path in songs.items()}, indent=1))
        return
    width = max(map(len, songs), default=0)
    for song, path in songs.items():
        say(f"{song:<{width}}  {path}")


def _copied(song: Path, target: Path) -> Path:
    """The copy of a song, under another name than `target` where that is another file."""
    [path] = free_names([target], lambda at: os.path.lexists(at) and not _is_copy(at, song))
    if path != target:
        show_notes([f"{target} is another file and is kept: the song is copied to {path}"])
    if not path.exists():
        with atomic_path(path) as temporary:
            shutil.copyfile(song, temporary)
    return path


def _is_copy(path: Path, song: Path) -> bool:
    return path.is_file() and sha256_of(path) == sha256_of(song)
