"""The errors that a caller can cause.

A message is one line, such as "expected X, got Y: likely cause". The command line prints it and exits with
status 2. Any other exception is a bug in this program.
"""

from __future__ import annotations

from collections.abc import Sequence


class ChoreographError(Exception):
    """Base class of all errors that a caller can cause.

    Examples
    --------
    >>> try:
    ...     cg.load_song("missing.mp3")
    ... except cg.ChoreographError as error:
    ...     print(error)
    expected ... missing.mp3...
    """

    def __str__(self) -> str:
        """The message in one line, also where it quotes a text of several lines."""
        return " ".join(super().__str__().splitlines())

    @property
    def lines(self) -> tuple[str, ...]:
        """The message, one line for each error."""
        return (str(self),)


class ParameterError(ChoreographError, ValueError):
    """An argument, option or setting has an invalid value.

    Examples
    --------
    >>> cg.BvhOptions(units_per_m=-1.0)
    Traceback (most recent call last):
    choreograph.core.errors.ParameterError: expected a positive number of units per metre, got -1.0
    """


class FormatError(ChoreographError, ValueError):
    """An input file (song, take, plan, manifest) is damaged or has an unexpected format.

    Examples
    --------
    >>> from pathlib import Path
    >>> _ = Path("walk.bvh").write_text("HIERARCHY")
    >>> cg.load_motion("walk.bvh")
    Traceback (most recent call last):
    choreograph.core.errors.FormatError: walk.bvh: the hierarchy has no joints
    """


class UnreadableFilesError(FormatError):
    """Several input files cannot be read. The message has a summary, and a line for each file."""

    def __init__(self, summary: str, errors: Sequence[ChoreographError]) -> None:
        super().__init__(summary, errors)
        self.summary = summary
        self.errors = tuple(errors)

    @property
    def lines(self) -> tuple[str, ...]:
        """The summary and the errors, one line each."""
        return (self.summary, *map(str, self.errors))

    def __str__(self) -> str:
        """All lines. No other error has a message of several."""
        return "\n".join(self.lines)


class RepertoireError(ChoreographError):
    """A repertoire file is missing, damaged, of another version, or lacks the requested content.

    Examples
    --------
    >>> cg.Repertoire.open("missing.h5")
    Traceback (most recent call last):
    choreograph.core.errors.RepertoireError: ...missing.h5...
    """


class NoPathError(ChoreographError):
    """No dance satisfies the given costs and constraints.

    For example, a cost of infinity forbids all candidates of a second.

    Examples
    --------
    >>> class Never(cg.Cost):
    ...     def node(self, layer, song_features):
    ...         return np.full(layer.n_nodes, np.inf)
    >>> try:
    ...     cg.dance(cg.example_songs()["house"], duration_s=4, engine="graph", costs=[Never()])
    ... except cg.NoPathError as error:
    ...     print(error)
    every node of second 0 is forbidden: relax a cost that returns inf
    """
