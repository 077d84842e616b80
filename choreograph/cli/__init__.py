"""The command line: one file per command; parse, call, present."""

from choreograph.cli.main import main, run

__all__ = ["main", "run"]
