"""Every error a caller can cause, as one small family.

A message is one line: what was expected, what came, the likely cause. The command line prints it
and exits with status 2; anything outside this family is a defect of ours.
"""

from __future__ import annotations


class ChoreographError(Exception):
    """Base of all errors that a caller can cause."""


class ParameterError(ChoreographError, ValueError):
    """An argument, option or config key has a value that cannot be used."""


class FormatError(ChoreographError, ValueError):
    """A file that came in (song, take, plan, manifest) is not what it should be."""


class RepertoireError(ChoreographError):
    """A repertoire file is missing, damaged, of another version, or lacks what is asked of it."""


class NoPathError(ChoreographError):
    """No dance exists under the given costs: some second has no allowed node."""
