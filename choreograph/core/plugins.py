"""Formats, engines and costs that other packages add to groups of entry points.

What cannot be used is left out, and one note names its package. The program goes on without it.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib.metadata import Distribution, EntryPoint, distributions, entry_points
from typing import Any

from choreograph.core.errors import ChoreographError

_log = logging.getLogger("choreograph")
_DAMAGED = (AttributeError, OSError, TypeError, ValueError)  # what reading damaged metadata raises


@dataclass(frozen=True)
class Group:
    """A group of entry points, and the built-in names, which other packages cannot use."""

    name: str
    builtin: tuple[str, ...]


def installed_names(group: Group) -> tuple[str, ...]:
    """The names that other packages add to a group. They are not loaded."""
    return tuple(points_of(group))


@cache
def installed(group: Group, check: Callable[[str, Any], None]) -> dict[str, Any]:
    """The objects that other packages add to a group, by name. The first call loads them.

    `check` raises for a name and an object that cannot be used.
    """
    added = {}
    for name, point in list(points_of(group).items()):
        try:
            found = point.load()
            check(name, found)
        except (Exception, SystemExit) as error:  # noqa: BLE001  # code of others may raise anything
            leave_out(group, name, error)
        else:
            added[name] = found
    return added


@cache
def points_of(group: Group) -> dict[str, EntryPoint]:
    """The entry points of a group by name, except for those that were left out."""
    points: dict[str, EntryPoint] = {}
    for point in _points(group.name):
        if point.name in group.builtin:
            say_left_out(
                _package(point.dist), f"{point.name!r} in {group.name} is the name of a built-in one"
            )
        elif point.name in points:
            other = _package(points[point.name].dist)
            say_left_out(
                _package(point.dist), f"{point.name!r} in {group.name} is also a name of the package {other}"
            )
        else:
            points[point.name] = point
    return points


def leave_out(group: Group, name: str, error: BaseException) -> None:
    """Leave out what a package adds under a name, because of an error, with a note."""
    point = points_of(group).pop(name, None)
    if point is not None:
        is_ours = isinstance(error, ChoreographError)
        reason = " ".join(str(error).split())
        say_left_out(_package(point.dist), reason if is_ours else f"{type(error).__name__}: {reason}")


def _points(group: str) -> list[EntryPoint]:
    try:
        return list(entry_points(group=group))
    except _DAMAGED:
        return [point for one in distributions() for point in _points_of(one) if point.group == group]


def _points_of(distribution: Distribution) -> list[EntryPoint]:
    try:
        return list(distribution.entry_points)
    except _DAMAGED as error:
        say_left_out(_package(distribution), f"its entry points are damaged ({type(error).__name__})")
        return []


def _package(distribution: Distribution | None) -> str:
    try:
        name = distribution.name if distribution is not None else None
    except _DAMAGED:
        name = None
    return name or "of no name"


@cache
def say_left_out(package: str, reason: str) -> None:
    """Log a note, once for each package and reason."""
    _log.warning("the package %s could not be loaded and is left out: %s", package, reason)
