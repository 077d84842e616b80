"""Errors, files, progress, time base, counts, argument checks and small numerics for all rooms."""

from functools import cache
from importlib.metadata import entry_points, version
from typing import Any

from choreograph.core.errors import ParameterError

__version__ = version("choreograph")


@cache
def installed_names(group: str) -> tuple[str, ...]:
    """The names that other packages add to a group of entry points. They are not loaded."""
    return tuple(point.name for point in entry_points(group=group))


@cache
def installed(group: str) -> dict[str, Any]:
    """The objects that other packages add to a group of entry points, by name. The first call loads them.

    Raises `ParameterError`, which names the package, if one cannot be loaded.
    """
    added = {}
    for point in entry_points(group=group):
        try:
            added[point.name] = point.load()
        except (ImportError, AttributeError) as error:
            package = point.dist.name if point.dist is not None else "a package"
            raise ParameterError(
                f"expected {point.value} from {package} for the entry point {point.name!r} of {group}, got "
                f"{type(error).__name__}: {error}: update or uninstall {package}"
            ) from error
    return added
