"""The errors that a caller can cause.

A message is one line: "expected X, got Y: likely cause". The command line prints it and exits with
status 2. Any other exception is a bug in this program.
"""

from __future__ import annotations

from collections.abc import Sequence

_LONGEST_LINE = 280  # letters of one of several errors, with room for what the command line puts before it


class ChoreographError(Exception):
    """Base of all errors that a caller can cause."""

    def __str__(self) -> str:
        """The message in one line, also where it quotes a path or text of several."""
        return " ".join(super().__str__().splitlines())

    @property
    def lines(self) -> tuple[str, ...]:
        """The message, a line for each of several errors."""
        return (str(self),)


class ParameterError(ChoreographError, ValueError):
    """An argument, option or config key has an invalid value."""


class FormatError(ChoreographError, ValueError):
    """An input file (song, take, plan, manifest) is damaged or in an unexpected format."""


class UnreadableFilesError(FormatError):
    """Several input files cannot be read: a line on all, and one for each."""

    def __init__(self, summary: str, errors: Sequence[ChoreographError]) -> None:
        super().__init__(summary, errors)
        self.summary = summary
        self.errors = tuple(errors)

    @property
    def lines(self) -> tuple[str, ...]:
        """The summary and the errors, each in a line."""
        return (self.summary, *(_shortened(str(error)) for error in self.errors))

    def __str__(self) -> str:
        """The lines: the only message of several."""
        return "\n".join(self.lines)


class RepertoireError(ChoreographError):
    """A repertoire file is missing, damaged, of another version, or lacks the requested content."""


class NoPathError(ChoreographError):
    """No dance satisfies the given costs: some second has no allowed node."""


def _shortened(line: str) -> str:
    """The line; of one that is too long, its beginning and its end."""
    half = (_LONGEST_LINE - 5) // 2
    return line if len(line) <= _LONGEST_LINE else f"{line[:half]} ... {line[-half:]}"
