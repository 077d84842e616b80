"""Takes from files: `import_takes` detects the layouts of a file or folder and reads them.

dance_with_melody   the dance-with-melody dataset
choreonet           ChoreoNet: recordings with figures, and lists that count dance_with_melody's takes
aist                AIST++
amass               AMASS
npz                 motions written by this program
bvh                 one BVH file
c3d                 one C3D file
gltf                one glTF file (.glb, .gltf, .vrma): each of its animations
fbx                 one FBX file, by way of Blender
folder              a folder of BVH, C3D, glTF, NPZ or FBX files with songs

An importer is a module with `LAYOUT` (one line: what it reads), `detect(path) -> bool` and
`read(path) -> Iterable[Take | Unread]`; with `annotate(takes, path) -> list[Take]` if it also knows something
about takes of other sources, and with `READS_BONE_MAP` and `read(path, bone_map)` if its rigs name their own
bones. A new layout is one module here; `register` adds one from outside.

A folder may have several layouts: all are read. A `manifest.csv` in it says more of the takes of all of them
(`_manifest`). Counts beside any take's motion, `NAME.counts.csv` next to NAME.bvh, are read with it.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Protocol

import numpy as np

from choreograph.count_files import SUFFIX
from choreograph.errors import ChoreographError, FormatError, ParameterError
from choreograph.foreign_formats import foreign_format
from choreograph.gltf import referenced_files
from choreograph.importers._axes_and_units import body_height, unit_in_notes
from choreograph.importers._count_annotation import with_counts_beside
from choreograph.importers._manifest import Manifest, read_manifest
from choreograph.importers._unread import (
    Unread,
    named_source,
    raise_errors,
    unread_files,
    unread_notes,
)
from choreograph.motion.body import body_pos_m
from choreograph.motion.bone_map import check_bone_map
from choreograph.motion.floor import estimate_floor_m, sole_pos_m
from choreograph.motion.motion import FARTHEST_M, Motion
from choreograph.takes import Take
from choreograph.timebase import STORE_FPS

__all__ = [
    "Importer", "Unread", "annotate_takes", "import_takes", "raise_errors", "read_source", "register",
    "unit_in_notes", "unread_notes",
]  # fmt: skip


class Importer(Protocol):
    """The interface of a layout's module."""

    LAYOUT: str

    def detect(self, path: Path) -> bool:
        """Whether `path` has this layout; fast, and never raises."""

    def read(self, path: Path) -> Iterable[Take | Unread]:
        """The takes in `path`, one by one, in a fixed order, and files that gave none and why.

        A `FormatError` names the file, and ends the takes of this layout.
        """


_BUILTIN = (
    "dance_with_melody",
    "choreonet",
    "aist",
    "amass",
    "npz",
    "bvh",
    "c3d",
    "gltf",
    "fbx",
    "folder",
)  # of those that detect a file the first reads it; of a folder all read what they know
_FLOOR_NOTE_M = 0.05
_ACCELERATION_FPS = 30.0
_MAX_ACCELERATION_M_S2 = 30.0  # 3 g; takes known to be correct have at most 21 m/s²
_registered: list[Importer] = []


def register(importer: Importer) -> None:
    """Add an importer, which takes precedence over the built-in ones."""
    _registered.insert(0, importer)


def import_takes(
    source: str | Path, *, allow_outside: bool = False, bone_map: Mapping[str, str] | None = None
) -> Iterator[Take]:
    """The takes in a file or folder, one by one, at 60 fps or their native rate if lower, floor at Y = 0.

    Takes that cannot be read are an error after the others, which names all their files; none is skipped
    silently. A manifest may come from a stranger: songs that it names outside of the folder are read only
    with `allow_outside`. `bone_map` says which bone is which, canonical name to the rig's name, for the takes
    whose rig has all bones of it.

    Raises
    ------
    ParameterError   if `source` does not exist or has no known layout, or the map is none
    FormatError      if a file in it is damaged, its rig is no body, or a song is elsewhere
    """
    unread = []
    for found in read_source(source, allow_outside=allow_outside, bone_map=bone_map):
        if isinstance(found, Take):
            yield found
        elif found.error is not None:
            unread.append(found)
    raise_errors(unread)


def read_source(
    source: str | Path, *, allow_outside: bool = False, bone_map: Mapping[str, str] | None = None
) -> Iterator[Take | Unread]:
    """The takes in a file or folder as `import_takes` gives them, and files that gave none and why.

    Raises `ParameterError` if `source` does not exist or has no known layout, or the map is none.
    """
    source = named_source(source)
    if not source.exists():
        raise ParameterError(f"expected takes at {source}, got nothing: there is no such file or folder")
    check_bone_map(bone_map)
    importers = _importers_of(source)
    manifest = read_manifest(source)
    used: set[Path] = set()  # files that were read, or are said to be unread
    names: set[str] = set()  # of all takes, read or not
    for importer in importers:
        for found in _found_by(importer, source, bone_map):
            if isinstance(found, Take):
                names.add(found.name)
                used.update(found.source_paths)
                found = _finished(found, source, manifest, allow_outside or importer in _registered)
            elif found.path in used and found.path.is_file():  # damaged, and said so by another layout
                continue
            if isinstance(found, Unread):
                names |= {found.path.stem, found.path.name}
                used.add(found.path)
            else:
                used.update(found.source_paths)
            yield found
    yield from manifest.unused(names)
    if source.is_dir() and not any(importer in _registered for importer in importers):
        yield from unread_files(source, used)


def annotate_takes(takes: Sequence[Take], source: str | Path) -> list[Take]:
    """The takes of all sources, with what `source` knows about them, such as counts of another's takes.

    Raises `ParameterError` if it has no known layout, `FormatError` if it is damaged.
    """
    source = named_source(source)
    for importer in _importers_of(source):
        annotate = getattr(importer, "annotate", None)
        takes = takes if annotate is None else annotate(takes, source)
    return list(takes)


def read_beside(path: Path) -> list[Path]:
    """The files that are read with a file of motion or a character: its counts, what a .gltf refers to."""
    counts = path.with_suffix(SUFFIX) if path.stem else path
    return [
        *([counts] if os.path.isfile(counts) else []),
        *(referenced_files(path) if path.suffix.lower() == ".gltf" else []),
    ]


def _found_by(
    importer: Importer, source: Path, bone_map: Mapping[str, str] | None
) -> Iterator[Take | Unread]:
    """What an importer reads; an error that ends it is of the whole source."""
    reads_map = bone_map and getattr(importer, "READS_BONE_MAP", False)
    read: Callable[..., Iterable[Take | Unread]] = importer.read
    try:
        yield from read(source, bone_map) if reads_map else read(source)
    except ChoreographError as error:
        yield Unread.damaged(source, error)


def _finished(take: Take, source: Path, manifest: Manifest, allow_outside: bool) -> Take | Unread:
    """The take with what stands beside it, as it is stored."""
    try:
        take = manifest.applied(take)
        if not allow_outside:
            _check_inside(take, source)
        return _as_stored(with_counts_beside(take))
    except ChoreographError as error:
        return Unread.damaged(take.source_paths[0] if take.source_paths else source, error)


def _check_inside(take: Take, source: Path) -> None:
    """`FormatError` if the take's song is named by a path that leaves the folder."""
    folder = os.path.abspath(source if source.is_dir() else source.parent)
    if take.song_path is not None and not Path(os.path.abspath(take.song_path)).is_relative_to(folder):
        raise FormatError(
            f"{source}: {take.name!r} is danced to {take.song_path}, outside of the folder: is the list your "
            "own? Then --allow-outside (allow_outside=True)"
        )


def _as_stored(take: Take) -> Take:
    try:
        _check_size(take.motion)
        floor_m = estimate_floor_m(sole_pos_m(take.motion))
    except (FormatError, ParameterError) as error:
        raise FormatError(f"{take.source_paths[0]}: {error}") from None
    motion = take.motion.moved(shift_m=np.array([0.0, -floor_m, 0.0]))
    notes = take.notes
    if abs(floor_m) > _FLOOR_NOTE_M:
        notes += (f"the floor was at {floor_m:.2f} m and was moved to 0",)
    acceleration_m_s2 = _pelvis_acceleration_m_s2(motion)
    if acceleration_m_s2 > _MAX_ACCELERATION_M_S2:
        notes += (
            f"in one frame of a hundred the pelvis accelerates by {acceleration_m_s2:.0f} m/s² or more, "
            "which no dancer does: is the frame rate right?",
        )
    return replace(take, motion=motion.resampled(min(motion.fps, STORE_FPS)), notes=notes)


def _check_size(motion: Motion) -> None:
    """`FormatError` if a body has no size, or one that files in single precision cannot hold."""
    body_height(motion.skeleton, motion.skeleton.rest_pos_m()[None])
    farthest_m = max(np.abs(motion.root_pos_m).max(), np.abs(motion.skeleton.offsets_m).max())
    if farthest_m >= FARTHEST_M:
        raise FormatError(
            f"expected a body within {FARTHEST_M:g} m, got one at {farthest_m:.3g} m: is the unit right?"
        )


def _pelvis_acceleration_m_s2(motion: Motion) -> float:
    """99th percentile of the pelvis acceleration, at 30 fps."""
    pos_m = body_pos_m(motion.resampled(_ACCELERATION_FPS))[:, 0]
    if len(pos_m) < 3:
        return 0.0
    return float(
        np.percentile(np.linalg.norm(np.diff(pos_m, n=2, axis=0), axis=-1), 99) * _ACCELERATION_FPS**2
    )


def _importers_of(source: Path) -> list[Importer]:
    """The importers that read a file or folder: an added one alone, else all built-in ones of a folder."""
    builtin: list[Importer] = [import_module(f"{__name__}.{name}") for name in _BUILTIN]
    for importer in _registered:
        if importer.detect(source):
            return [importer]
    found = [importer for importer in builtin if importer.detect(source)]
    if found:
        return found if source.is_dir() else found[:1]
    if source.is_dir() and not any(source.iterdir()):
        raise ParameterError(f"expected takes at {source}, got nothing: the folder is empty")
    layouts = "; ".join(importer.LAYOUT for importer in [*_registered, *builtin])
    foreign = foreign_format(source)
    if foreign is not None:
        raise ParameterError(
            f"{source}: expected a format that is read, got {foreign.what}: {foreign.motion}"
        )
    raise ParameterError(f"expected takes at {source}, got none of a known layout: {layouts}")
