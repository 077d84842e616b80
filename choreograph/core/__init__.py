"""Errors, files, progress, time base, counts, argument checks and small numerics for all rooms."""

from importlib.metadata import version

__version__ = version("choreograph")
