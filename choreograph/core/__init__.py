"""What every room stands on: errors, files, progress, time base, counts, argument checks, small numerics."""

from importlib.metadata import version

__version__ = version("choreograph")
