"""Takes from files: `import_takes` detects the layout of a file or folder and reads it.

dance_with_melody   the dance-with-melody dataset
choreonet           ChoreoNet: recordings with figures, and lists that count dance_with_melody's takes
aist                AIST++
amass               AMASS
npz                 motions written by this program
bvh                 one BVH file
c3d                 one C3D file
gltf                one glTF file (.glb, .gltf, .vrma): each of its animations
fbx                 one FBX file, by way of Blender
folder              a folder of BVH, C3D or glTF files with songs and a manifest

An importer is a module with `LAYOUT` (one line: what it reads), `detect(path) -> bool` and
`read(path) -> Iterable[Take]`; with `annotate(takes, path) -> list[Take]` if it also knows something about
takes of other sources, and with `READS_BONE_MAP` and `read(path, bone_map)` if its rigs name their own bones.
A new layout is one module here; `register` adds one from outside.

Counts beside any take's motion, `NAME.counts.csv` next to NAME.bvh, are read with it.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Protocol

import numpy as np

from choreograph.errors import FormatError, ParameterError
from choreograph.foreign_formats import foreign_format
from choreograph.importers._count_annotation import with_counts_beside
from choreograph.motion.body import body_pos_m
from choreograph.motion.bone_map import check_bone_map
from choreograph.motion.floor import estimate_floor_m, sole_pos_m
from choreograph.motion.motion import Motion
from choreograph.takes import Take
from choreograph.timebase import STORE_FPS

__all__ = ["Importer", "annotate_takes", "import_takes", "register"]


class Importer(Protocol):
    """The interface of a layout's module."""

    LAYOUT: str

    def detect(self, path: Path) -> bool:
        """Whether `path` has this layout; fast, and never raises."""

    def read(self, path: Path) -> Iterable[Take]:
        """The takes in `path`, one by one, in a fixed order; a `FormatError` names the file."""


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
)  # the first that detects its layout reads
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

    A take that cannot be read is an error that names its file; none is skipped silently. A manifest may come
    from a stranger: songs that it names outside of the folder are read only with `allow_outside`. `bone_map`
    says which bone is which, canonical name to the rig's name, for the takes whose rig has all bones of it.

    Raises
    ------
    ParameterError   if `source` does not exist or has no known layout, or the map is none
    FormatError      if a file in it is damaged, its rig is no body, or a song is elsewhere
    """
    source = _named_source(source)
    if not source.exists():
        raise ParameterError(f"expected takes at {source}, got nothing: there is no such file or folder")
    importer = _importer_of(source)
    check_bone_map(bone_map)
    reads_map = bone_map and getattr(importer, "READS_BONE_MAP", False)
    read: Callable[..., Iterable[Take]] = importer.read
    for take in read(source, bone_map) if reads_map else read(source):
        if importer not in _registered and not allow_outside:
            _check_inside(take, source)
        yield _as_stored(with_counts_beside(take))


def annotate_takes(takes: Sequence[Take], source: str | Path) -> list[Take]:
    """The takes of all sources, with what `source` knows about them, such as counts of another's takes.

    Raises as `import_takes` does.
    """
    source = _named_source(source)
    annotate = getattr(_importer_of(source), "annotate", None)
    return list(takes) if annotate is None else annotate(takes, source)


def source_notes(source: str | Path) -> tuple[str, ...]:
    """What a source holds that looks like motion or music and is not read, a line for each reason.

    Raises as `import_takes` does if `source` has no known layout.
    """
    source = _named_source(source)
    notes = getattr(_importer_of(source), "notes", None)
    return () if notes is None else notes(source)


def _named_source(source: str | Path) -> Path:
    """The source by a path that ends in its own name, which some layouts read; "." and links do not."""
    path = Path(source)
    real = path.resolve()
    return real if path.is_dir() and path.name != real.name else path


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
        floor_m = estimate_floor_m(sole_pos_m(take.motion))
    except ParameterError as error:
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


def _pelvis_acceleration_m_s2(motion: Motion) -> float:
    """99th percentile of the pelvis acceleration, at 30 fps."""
    pos_m = body_pos_m(motion.resampled(_ACCELERATION_FPS))[:, 0]
    if len(pos_m) < 3:
        return 0.0
    return float(
        np.percentile(np.linalg.norm(np.diff(pos_m, n=2, axis=0), axis=-1), 99) * _ACCELERATION_FPS**2
    )


def _importer_of(source: Path) -> Importer:
    importers = [*_registered, *(import_module(f"{__name__}.{name}") for name in _BUILTIN)]
    for importer in importers:
        if importer.detect(source):
            return importer
    if source.is_dir() and not any(source.iterdir()):
        raise ParameterError(f"expected takes at {source}, got nothing: the folder is empty")
    layouts = "; ".join(importer.LAYOUT for importer in importers)
    foreign = foreign_format(source)
    if foreign is not None:
        raise ParameterError(
            f"{source}: expected a format that is read, got {foreign.what}: {foreign.motion}"
        )
    raise ParameterError(f"expected takes at {source}, got none of a known layout: {layouts}")
