"""The command line. Each file is a command that parses, calls the library and presents the result."""

from choreograph.cli.main import main, run

__all__ = ["main", "run"]
