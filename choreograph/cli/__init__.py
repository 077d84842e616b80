"""The command line: one file per command; parse, call, present."""

from choreograph.cli.main import main

__all__ = ["main"]
