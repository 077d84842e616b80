"""Readers and writers of all formats and layouts of data sets.

A new format is one module here and one line in `BUILTIN`. A format has any of these names:

- `LAYOUT` describes in one line what is read.
- `read(path) -> Iterable[Take | SkippedFile]` yields the takes of a file or folder in a fixed order.
- `SUFFIXES` are the suffixes of files that hold one take. Such files are read in folders as well.
- `detect(path) -> bool`, for other sources than files with one of the `SUFFIXES`, is fast and never raises.
- `READS_BONE_MAP = True` and `read(path, bone_map=None)` allow names of bones that are not recognised.
- `annotate(takes, path) -> list[Take]` adds information on takes of other sources.
- `WRITERS` are the classes that write motions (`formats.writer.Writer`).

Another package adds a format, which is a module or an object with these names, by an entry point of the group
`choreograph.formats`. Its reader takes precedence over the built-in ones.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from choreograph.core import installed

if TYPE_CHECKING:
    from choreograph.formats.writer import Writer

GROUP = "choreograph.formats"
# The first format that detects a file reads it. A folder is read by all formats that detect it.
BUILTIN = (
    "dance_with_melody",  # the dance-with-melody dataset
    "choreonet",  # recordings with figures, and counts of the takes of dance_with_melody
    "aist",  # AIST++
    "generated",  # dances of EDGE, LODGE, FACT and Bailando
    "amass",  # AMASS
    "bvh",
    "npz",  # exact arrays, also those of SMPL if the skeleton is the canonical one
    "c3d",  # markers
    "gltf",  # reads the animations of .glb, .gltf and .vrma
    "glb",  # writes .glb and .vrma
    "vmd",  # MikuMikuDance
    "usd",  # writes .usda and .usdc
    "fbx",  # with Blender
    "folder",  # a folder of motion files with songs
)


def added_formats() -> list[Any]:
    """The formats of other packages."""
    return list(installed(GROUP).values())


def builtin_formats() -> list[Any]:
    """The modules of the built-in formats."""
    return [import_module(f"{__name__}.{name}") for name in BUILTIN]


def motion_suffixes() -> tuple[str, ...]:
    """The suffixes of files that hold one take, such as ".bvh"."""
    return tuple(_by_suffix())


def reader_of(path: Path) -> Any:
    """The format that reads a file of one of the `motion_suffixes`."""
    return _by_suffix()[path.suffix.lower()]


def _by_suffix() -> dict[str, Any]:
    formats = (*builtin_formats(), *added_formats())
    return {suffix: format for format in formats for suffix in getattr(format, "SUFFIXES", ())}


def writers() -> dict[str, type[Writer]]:
    """The writers of motions by format, such as "bvh", which is also the suffix of its files."""
    formats = (*builtin_formats(), *added_formats())
    return {writer.format: writer for format in formats for writer in getattr(format, "WRITERS", ())}
