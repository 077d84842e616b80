"""`choreograph studio`, which serves the studio to a browser on this machine."""

from __future__ import annotations

from pathlib import Path

import click

from choreograph.cli.declared import Changed, Command, Given, Input, argument, option
from choreograph.cli.present import examples, say
from choreograph.core.errors import ParameterError


def _beside_song(given: Given) -> tuple[Path, ...]:
    from choreograph.studio.project import project_path

    return () if given["song"] is None else (project_path(given["song"]),)


@click.command(
    cls=Command,
    short_help="Make a dance and change parts of it in the browser.",
    epilog=examples(
        "choreograph studio                       opens an empty studio, into which songs are dropped",
        "choreograph studio song.mp3              opens the project of a song, song.studio.json beside it",
        "choreograph studio song.mp3 --db rep.h5 --character hero.glb",
    ),
)
@argument("song", required=False, type=Input("song"))
@option(
    "--db",
    multiple=True,
    type=Input("repertoire"),
    help="Repertoire to dance with. Repeatable. Default: built in.",
)
@option("--character", type=Input("character"), help="The character that dances (.glb, .gltf or .vrm).")
@option(
    "--project",
    type=Changed("project", default=_beside_song),
    help="The file of the project. Default: SONG.studio.json.",
)
@option("--port", type=click.IntRange(0, 65535), default=0, help="Port of the page. Default: a free one.")
@option("--host", default="127.0.0.1", help="Address to serve. Others than 127.0.0.1 need a token.")
@option("--no-browser", is_flag=True, help="Print the address and open no browser.")
def command(
    song: Path | None,
    db: tuple[Path, ...],
    character: Path | None,
    project: Path | None,
    port: int,
    host: str,
    no_browser: bool,
) -> None:
    """Make a dance for SONG and change parts of it, in the browser.

    All changes are kept in the file of the project as they are made, and can be undone.
    """
    try:
        from choreograph.studio.server import serve, start
    except ModuleNotFoundError as error:
        raise ParameterError(
            f"expected the extra `studio`, got no {error.name}: run pip install 'choreograph[studio]'"
        ) from None
    from choreograph.library.repertoire import as_repertoire

    service = start(song, as_repertoire(db), project=project, character=character)
    serve(
        service, host, port, opened=not no_browser, ready=lambda address: say(f"The studio is at {address}")
    )
