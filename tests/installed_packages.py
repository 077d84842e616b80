"""Packages of somebody else's that add things by entry points, as pip would install them."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from choreograph.core import plugins


@contextmanager
def installed_package(folder: Path, name: str, source: str, entry_points: str) -> Iterator[None]:
    """The package `name` of one module, with the text of its `entry_points.txt`, in a folder on the path."""
    described = folder / f"{name}-1.0.dist-info"
    described.mkdir(parents=True, exist_ok=True)
    (described / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    (described / "entry_points.txt").write_text(entry_points)
    (folder / f"{name}.py").write_text(source)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(folder)
        _forget()
        try:
            yield
        finally:
            _forget()
            sys.modules.pop(name, None)


def _forget() -> None:
    for known in (plugins.points_of, plugins.installed, plugins.say_left_out):
        known.cache_clear()
