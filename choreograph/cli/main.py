"""`choreograph`: the group of commands, and how their errors end."""

from __future__ import annotations

import sys
from importlib import import_module

import click

from choreograph.cli.present import examples
from choreograph.errors import ChoreographError

_COMMANDS = {
    "build-db": "build_db", "build-starter": "build_starter", "dance": "dance", "evaluate": "evaluate",
    "inspect": "inspect", "songs": "songs",
}  # fmt: skip


class _Commands(click.Group):
    """Commands are imported when used, so that `--help` answers at once."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(_COMMANDS)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        if name not in _COMMANDS:
            return None
        return import_module(f"choreograph.cli.{_COMMANDS[name]}").command

    def invoke(self, ctx: click.Context):
        try:
            return super().invoke(ctx)
        except ChoreographError as error:
            click.echo(f"choreograph: {' '.join(str(error).split())}", err=True)
            sys.exit(2)


@click.group(
    cls=_Commands,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog=examples(
        "choreograph dance song.mp3 --open              a dance with the built-in takes, to watch",
        "choreograph build-db TAKES -o rep.h5           your own motion library",
        "choreograph dance song.mp3 --db rep.h5         and a dance with it",
    ),
)
@click.version_option(package_name="choreograph")
def main() -> None:
    """Makes dances for music from your own motion library, and explains every second of them."""
