"""Reads takes and writes motions in all formats.

`import_takes` detects the layouts of a file or folder and reads them. If a folder has several layouts, all
are read. A `manifest.csv` in a folder describes the takes of all layouts (`formats.manifest`). The counts in
`NAME.counts.csv` are read with the motion in the file of the same name.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from choreograph.core.arguments import check_kind, unexpected
from choreograph.core.errors import ChoreographError, FormatError, ParameterError
from choreograph.core.files import as_path, atomic_path
from choreograph.core.numerics import default_numerics
from choreograph.core.progress import counted
from choreograph.core.timebase import STORE_FPS
from choreograph.formats import (
    added_formats,
    builtin_formats,
    leave_out_format,
    motion_formats,
    writer_of,
)
from choreograph.formats.axes_and_units import body_height
from choreograph.formats.gltf_document import referenced_files
from choreograph.formats.manifest import (
    COUNTS_SUFFIX,
    Manifest,
    SkippedFile,
    foreign_format,
    named_source,
    raise_errors,
    read_manifest,
    skipped_files,
    with_counts_beside,
)
from choreograph.formats.writer import Writer
from choreograph.motion.body import body_pos_m
from choreograph.motion.bone_map import check_bone_map
from choreograph.motion.contacts import estimate_floor_m, sole_pos_m
from choreograph.motion.motion import FARTHEST_M, Motion, Take

_FLOOR_NOTE_M = 0.05
_ACCELERATION_FPS = 30.0
_MAX_ACCELERATION_M_S2 = 30.0  # 3 g. Correct takes have at most 21 m/s²


def import_takes(
    source: str | Path, *, allow_outside: bool = False, bone_map: Mapping[str, str] | None = None
) -> Iterator[Take]:
    """The takes in a file or folder, one by one, at 60 fps or their native rate if lower, floor at Y = 0.

    Damaged files raise an error after all other takes, which names all of them. A manifest may come from an
    untrusted source: the songs that it names outside of the folder are read only with `allow_outside`.
    `bone_map` names the bones of the rig by canonical name. It is used for rigs that have all its bones.

    Raises
    ------
    ParameterError   if `source` does not exist or has no known layout, or `bone_map` is not a bone map
    FormatError      if a file in it is damaged, its rig is not a body, or a song is outside of the folder
    """
    skipped = []
    for found in read_source(source, allow_outside=allow_outside, bone_map=bone_map):
        if isinstance(found, Take):
            yield found
        elif found.error is not None:
            skipped.append(found)
    raise_errors(skipped)


def read_source(
    source: str | Path, *, allow_outside: bool = False, bone_map: Mapping[str, str] | None = None
) -> Iterator[Take | SkippedFile]:
    """The takes of `import_takes`, and the files that gave none, with the reason.

    Raises `ParameterError` if `source` does not exist or has no known layout, or `bone_map` is not a bone
    map.
    """
    source = named_source(source)
    if not source.exists():
        raise ParameterError(f"expected takes at {source}, got nothing: there is no such file or folder")
    check_bone_map(bone_map)
    importers, added = _importers_of(source), added_formats()
    manifest = read_manifest(source)
    used: set[Path] = set()  # files that were read or reported as skipped
    names: set[str] = set()  # of all takes, read or not
    for importer in importers:
        for found in _found_by(importer, source, bone_map):
            if isinstance(found, Take):
                names.add(found.name)
                used.update(found.source_paths)
                found = _finished(found, source, manifest, allow_outside or importer in added)
            elif found.path in used and found.path.is_file():  # reported as damaged by another layout
                continue
            if isinstance(found, SkippedFile):
                names |= {found.path.stem, found.path.name}
                used.add(found.path)
            else:
                used.update(found.source_paths)
            yield found
    yield from manifest.unused(names)
    if source.is_dir() and not any(importer in added for importer in importers):
        yield from skipped_files(source, used)


def annotate_takes(takes: Sequence[Take], source: str | Path) -> list[Take]:
    """The takes of all sources, with the information that `source` adds, such as counts of other takes.

    Raises `ParameterError` if `source` has no known layout, `FormatError` if it is damaged.
    """
    source = named_source(source)
    for importer in _importers_of(source):
        annotate = getattr(importer, "annotate", None)
        takes = takes if annotate is None else annotate(takes, source)
    return list(takes)


def read_beside(path: Path) -> list[Path]:
    """The files that are read with a motion or character: counts, and the files that a .gltf refers to."""
    counts = path.with_suffix(COUNTS_SUFFIX) if path.stem else path
    return [
        *([counts] if os.path.isfile(counts) else []),
        *(referenced_files(path) if path.suffix.lower() == ".gltf" else []),
    ]


def _found_by(
    importer: Any, source: Path, bone_map: Mapping[str, str] | None
) -> Iterator[Take | SkippedFile]:
    """The takes and skipped files of an importer. An error that ends it is an error of the whole source."""
    reads_map = bone_map and getattr(importer, "READS_BONE_MAP", False)
    read: Callable[..., Iterable[Take | SkippedFile]] = importer.read
    try:
        yield from read(source, bone_map) if reads_map else read(source)
    except ChoreographError as error:
        yield SkippedFile.damaged(source, error)


def _finished(take: Take, source: Path, manifest: Manifest, allow_outside: bool) -> Take | SkippedFile:
    """The take as it is stored, with information from its manifest and the counts beside it."""
    try:
        take = manifest.applied(take)
        if not allow_outside:
            _check_inside(take, source)
        return _as_stored(with_counts_beside(take))
    except ChoreographError as error:
        return SkippedFile.damaged(take.source_paths[0] if take.source_paths else source, error)


def _check_inside(take: Take, source: Path) -> None:
    """Raise `FormatError` if the song of a take is outside of the folder."""
    folder = os.path.abspath(source if source.is_dir() else source.parent)
    if take.song_path is not None and not Path(os.path.abspath(take.song_path)).is_relative_to(folder):
        raise FormatError(
            f"{source}: expected songs inside the folder, got {take.song_path} for {take.name!r}: "
            "if you trust the list, use --allow-outside (allow_outside=True)"
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
            f"in 1 % of the frames the pelvis accelerates by {acceleration_m_s2:.0f} m/s² or more, "
            "which is more than a dancer can: is the frame rate right?",
        )
    return replace(take, motion=motion.resampled(min(motion.fps, STORE_FPS)), notes=notes)


def _check_size(motion: Motion) -> None:
    """Raise `FormatError` if a body has no size, or is too large for files in single precision."""
    body_height(motion.skeleton, motion.skeleton.rest_pos_m()[None])
    farthest_m = max(np.abs(motion.root_pos_m).max(), np.abs(motion.skeleton.offsets_m).max())
    if farthest_m >= FARTHEST_M:
        raise FormatError(
            f"expected a body within {FARTHEST_M:g} m, got one at {farthest_m:.3g} m: is the unit right?"
        )


def _pelvis_acceleration_m_s2(motion: Motion) -> float:
    """99th percentile of the acceleration of the pelvis at 30 fps."""
    pos_m = body_pos_m(motion.resampled(_ACCELERATION_FPS))[:, 0]
    if len(pos_m) < 3:
        return 0.0
    return float(
        np.percentile(np.linalg.norm(np.diff(pos_m, n=2, axis=0), axis=-1), 99) * _ACCELERATION_FPS**2
    )


def _importers_of(source: Path) -> list[Any]:
    """The format of another package that reads a source, else the built-in one, or all of a folder."""
    added, builtin = ([f for f in of if hasattr(f, "read")] for of in (added_formats(), builtin_formats()))
    for importer in added:
        if _detects(importer, source):
            return [importer]
    found = [importer for importer in builtin if _detects(importer, source)]
    if found:
        return found if source.is_dir() else found[:1]
    if source.is_dir() and not any(source.iterdir()):
        raise ParameterError(f"expected takes at {source}, got nothing: the folder is empty")
    layouts = "; ".join(importer.LAYOUT for importer in [*added, *builtin])
    foreign = foreign_format(source)
    if foreign is not None:
        raise ParameterError(
            f"{source}: expected a format that is read, got {foreign.what}: {foreign.motion}"
        )
    raise ParameterError(f"expected takes at {source}, got none of a known layout: {layouts}")


def is_motion(path: Path) -> bool:
    """Whether a file is of a format with motions, by its name or its first bytes."""
    readers = (format for format in (*added_formats(), *builtin_formats()) if hasattr(format, "read"))
    return any(_detects(reader, path) for reader in readers)


def _detects(importer: Any, source: Path) -> bool:
    if not hasattr(importer, "detect"):
        return source.is_file() and source.suffix.lower() in importer.SUFFIXES
    try:
        return bool(importer.detect(source))
    except Exception as error:  # code of another package may raise anything
        if importer not in added_formats():
            raise
        leave_out_format(importer, error)
        return False


def read_take(path: str | Path, *, bone_map: Mapping[str, str] | None = None) -> Take:
    """The take of a file that holds one.

    Raises `ParameterError` for a folder or several takes, and errors as `import_takes` does.
    """
    path = named_source(as_path("a file with a motion", path))
    if path.is_dir():
        raise ParameterError(f"{path}: expected a file with one motion, got a folder: name one of its files")
    takes = list(import_takes(path, bone_map=bone_map))
    if len(takes) != 1:
        raise ParameterError(f"{path}: expected a file with one motion, got {counted(len(takes), 'take')}")
    return takes[0]


@default_numerics()
def load_motion(path: str | Path, *, bone_map: Mapping[str, str] | None = None) -> Motion:
    """Read the motion of a file, in any format that `choreograph build-db` reads.

    Parameters
    ----------
    path : str or Path
    bone_map : mapping of str   names of bones in the file by canonical joint, if they are not recognised

    Returns
    -------
    motion : Motion   at 60 fps, or at the rate of the file if that is lower, with the floor at Y = 0

    Raises
    ------
    ParameterError   if the file does not exist, its format is unknown, or it holds several takes
    FormatError      if the file is damaged or its rig is not a body

    Examples
    --------
    >>> motion, _ = cg.starter_repertoire().motion(0, start_s=0.0, stop_s=4.0)
    >>> cg.save_motion("steps.bvh", motion)
    >>> cg.load_motion("steps.bvh")
    <Motion: 102 frames at 25 fps (4.1 s), 24 joints>
    """
    return read_take(path, bone_map=bone_map).motion


def get_writer(format: str) -> Writer:
    """The writer of a format such as "bvh". Raises `ParameterError` if the format is unknown."""
    known = motion_formats()
    if format.lower() not in known:
        raise unexpected(f"a motion format among {', '.join(known)}", format)
    return writer_of(format.lower())()


@default_numerics()
def save_motion(path: str | Path, motion: Motion, *, writer: Writer | None = None) -> None:
    """Write a motion to a file. The file is complete, or it is not written.

    Parameters
    ----------
    path : str or Path   the suffix selects the format: .bvh, .npz, .glb, .vrma, .vmd, .usda, .usdc or .fbx
    motion : Motion
    writer : Writer      used instead of the writer of the suffix, for example `BvhWriter` with options

    Raises
    ------
    ParameterError     if the suffix is unknown, the folder is missing, or the format needs a package or
                       program that is not installed
    ChoreographError   if the disk is full or read-only

    Examples
    --------
    >>> motion, _ = cg.starter_repertoire().motion(0, start_s=0.0, stop_s=4.0)
    >>> cg.save_motion("steps.npz", motion)
    >>> bool(np.array_equal(cg.load_motion("steps.npz").local_quat, motion.local_quat))
    True
    """
    path = as_path("a file to write", path)
    check_kind("the motion to write", motion, Motion)
    if writer is not None:
        check_kind("the writer of a motion", writer, Writer)
    writer = writer or get_writer(path.suffix.removeprefix("."))
    with atomic_path(path) as temporary:
        writer.write(motion, temporary)
