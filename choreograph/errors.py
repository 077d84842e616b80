"""The errors that a caller can cause.

A message is one line: "expected X, got Y: likely cause". The command line prints it and exits with
status 2. Any other exception is a bug in this program.
"""

from __future__ import annotations


class ChoreographError(Exception):
    """Base of all errors that a caller can cause."""

    def __str__(self) -> str:
        """The message in one line, also where it quotes a path or text of several."""
        return " ".join(super().__str__().splitlines())


class ParameterError(ChoreographError, ValueError):
    """An argument, option or config key has an invalid value."""


class FormatError(ChoreographError, ValueError):
    """An input file (song, take, plan, manifest) is damaged or in an unexpected format."""


class RepertoireError(ChoreographError):
    """A repertoire file is missing, damaged, of another version, or lacks the requested content."""


class NoPathError(ChoreographError):
    """No dance satisfies the given costs: some second has no allowed node."""
