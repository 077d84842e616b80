"""`choreograph songs`: the built-in songs."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import click

from choreograph.cli.options import Command, given_options
from choreograph.cli.present import examples, say
from choreograph.errors import ParameterError
from choreograph.files import atomic_path


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
    from choreograph.starter import example_songs

    songs = example_songs()
    if name is not None:
        if len(given := given_options()) > 1:
            raise ParameterError(f"expected --path alone, got {', '.join(given)}")
        if name not in songs:
            raise ParameterError(f"expected a song among {', '.join(songs)}, got {name!r}")
        click.echo(songs[name])
        return
    if folder is not None:
        for path in songs.values():
            with atomic_path(folder / path.name) as temporary:
                shutil.copyfile(path, temporary)
        songs = {song: folder / path.name for song, path in songs.items()}
    if as_json:
        click.echo(json.dumps({song: str(path) for song, path in songs.items()}, indent=1))
        return
    width = max(map(len, songs), default=0)
    for song, path in songs.items():
        say(f"{song:<{width}}  {path}")
