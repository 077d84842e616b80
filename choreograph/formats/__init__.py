"""Readers and writers of all formats and layouts of data sets.

A new format is one module here and one line in `BUILTIN`, which also declares what is written. A format has
any of these names:

- `LAYOUT` describes in one line what is read.
- `read(path) -> Iterable[Take | SkippedFile]` yields the takes of a file or folder in a fixed order.
- `SUFFIXES` are the suffixes of files that hold one take. Such files are read in folders as well.
- `detect(path) -> bool`, for other sources than files with one of the `SUFFIXES`, is fast and never raises.
- `READS_BONE_MAP = True` and `read(path, bone_map=None)` allow names of bones that are not recognised.
- `annotate(takes, path) -> list[Take]` adds information on takes of other sources.
- `WRITERS` are the classes that write motions (`formats.writer.Writer`).

Another package adds a format, which is a module or an object with these names, by an entry point of the group
`choreograph.formats`. Its reader takes precedence over the built-in ones. Its writers say themselves what
they declare in `BUILTIN` here.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from choreograph.core.arguments import as_texts, check_text, unexpected
from choreograph.core.plugins import Group, installed, leave_out

if TYPE_CHECKING:
    from choreograph.formats.writer import Writer


@dataclass(frozen=True)
class OutputFormat:
    """A format that dances are written in: what its files hold, and which options of a dance change them."""

    name: str  # also the suffix of its files, without the dot
    holds: str  # as in "FORMAT: a page to watch"
    uses: tuple[str, ...] = ()  # options of `Dance.save`, and fps
    alone: tuple[str, ...] = ()  # those of them that it uses for one dancer, and not for a scene of several
    together: bool = False  # whether one file holds all dancers of a scene
    saved_by: str = ""  # "module:function" of an output that is no motion, (parts, path, report) -> None


_MOTION, _BODY = "motion", "a body that moves"
_OF_MOTION = ("fps", "loop")
# By module, what it writes. The first format that detects a file reads it. A folder is read by all formats
# that detect it.
BUILTIN: dict[str, tuple[OutputFormat, ...]] = {
    "dance_with_melody": (),  # the dance-with-melody dataset
    "choreonet": (),  # recordings with figures, and counts of the takes of dance_with_melody
    "aist": (),  # AIST++
    "generated": (),  # dances of EDGE, LODGE, FACT and Bailando
    "amass": (),  # AMASS
    "bvh": (OutputFormat("bvh", _MOTION, (*_OF_MOTION, "bvh")),),
    "npz": (OutputFormat("npz", _MOTION, _OF_MOTION),),  # exact arrays, also those of SMPL
    "c3d": (),  # markers
    "gltf": (),  # reads the animations of .glb, .gltf and .vrma
    "glb": (
        OutputFormat("glb", _BODY, (*_OF_MOTION, "character", "camera", "target"), together=True),
        OutputFormat("vrma", "for VRM avatars", _OF_MOTION),
    ),
    "vmd": (OutputFormat("vmd", "for MikuMikuDance", ("loop", "target")),),
    "usd": (
        OutputFormat("usda", _BODY, (*_OF_MOTION, "camera"), together=True),
        OutputFormat("usdc", _BODY, (*_OF_MOTION, "camera"), together=True),
    ),
    "fbx": (OutputFormat("fbx", _BODY, (*_OF_MOTION, "character"), together=True),),  # with Blender
    "folder": (),  # a folder of motion files with songs
}
# What shows a dance or describes it, and the function that writes it from `pipeline.saving.SavedParts`.
_SAVE = "choreograph.pipeline.saving:save"
_FILMED = ("fps", "character", "camera")
SHOWN = (
    OutputFormat("html", "a page to watch", _FILMED, ("character",), True, f"{_SAVE}_page"),
    OutputFormat("mp4", "a video", ("click", "camera"), (), True, f"{_SAVE}_video"),
    OutputFormat("png", "poses on the beats", (), (), True, f"{_SAVE}_strip"),
    OutputFormat("json", "the plan", ("fps",), (), True, f"{_SAVE}_plan"),
)


GROUP = Group("choreograph.formats", tuple(BUILTIN))


def added_formats() -> list[Any]:
    """The formats of other packages."""
    return list(installed(GROUP, _check_added).values())


def leave_out_format(format: Any, error: Exception) -> None:
    """Leave out a format of another package that raised an error where none is allowed, with a note."""
    known = installed(GROUP, _check_added)
    for name in [name for name, one in known.items() if one is format]:
        del known[name]
        leave_out(GROUP, name, error)


def _check_added(_: str, format: Any) -> None:
    """Raise unless a format of another package has what the docstring of this module lists."""
    from choreograph.formats.writer import Writer

    reads, suffixes = hasattr(format, "read"), as_texts("SUFFIXES", getattr(format, "SUFFIXES", ()))
    if not all(suffix.startswith(".") and suffix == suffix.lower() for suffix in suffixes):
        raise unexpected("SUFFIXES such as .bvh", suffixes)
    if reads:
        check_text("LAYOUT", format.LAYOUT)
    if reads and not (suffixes or hasattr(format, "detect")):
        raise unexpected("SUFFIXES or a function detect", format)
    written = getattr(format, "WRITERS", ())
    if not (reads or written):
        raise unexpected("a function read or WRITERS", format)
    builtin = {one.name for of_module in (*BUILTIN.values(), SHOWN) for one in of_module}
    for writer in written:
        if not (isinstance(writer, type) and issubclass(writer, Writer)):
            raise unexpected("WRITERS as subclasses of Writer", writer)
        check_text("the format of a writer", writer.format, writer.holds, *writer.uses)
        if writer.format in builtin:
            raise unexpected("a writer of a format that is not built in", writer.format)


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


def motion_formats() -> dict[str, OutputFormat]:
    """The formats that motions are written in, by name: the built-in ones, then those of other packages."""
    return {written.name: written for of_module in BUILTIN.values() for written in of_module} | {
        name: OutputFormat(name, writer.holds, (*_OF_MOTION, *writer.uses))
        for name, writer in _added_writers()
    }


def output_formats() -> dict[str, OutputFormat]:
    """The formats that dances are written in, by name: those of motions, then those that show a dance."""
    return motion_formats() | {shown.name: shown for shown in SHOWN}


def formats_using(option: str, *, in_scenes: bool = False) -> tuple[str, ...]:
    """The formats whose files an option changes, those that show a dance first.

    With `in_scenes`, they are those of a scene of several dancers.
    """
    found = sorted(output_formats().values(), key=lambda one: one not in SHOWN)
    return tuple(one.name for one in found if option in one.uses and not (in_scenes and option in one.alone))


def writer_of(format: str) -> type[Writer]:
    """The class that writes a format of `motion_formats`. Only its module is imported."""
    added = dict(_added_writers())
    if format in added:
        return added[format]
    module = next(
        module for module, of_module in BUILTIN.items() if any(one.name == format for one in of_module)
    )
    classes: tuple[type[Writer], ...] = import_module(f"{__name__}.{module}").WRITERS
    return next(writer for writer in classes if writer.format == format)


def _added_writers() -> Iterator[tuple[str, type[Writer]]]:
    for format in added_formats():
        for writer in getattr(format, "WRITERS", ()):
            yield writer.format, writer
