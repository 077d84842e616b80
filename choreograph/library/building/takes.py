"""The takes of a build: read from their sources, cleaned of jumps, retargeted, foot-locked and measured.

All takes of a repertoire are on one skeleton. Takes without counts are counted as they are measured.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from choreograph.core.arguments import unexpected
from choreograph.core.cache import DiskCache, each_cached, key_of
from choreograph.core.counts import Counts
from choreograph.core.errors import ChoreographError, ParameterError
from choreograph.core.progress import ProgressReport
from choreograph.core.timebase import CLIP_S, NET_FPS, STORE_FPS
from choreograph.formats.axes_and_units import unit_in_notes
from choreograph.formats.manifest import SkippedFile, raise_errors
from choreograph.formats.register import annotate_takes, read_source
from choreograph.library.building.counting import Counting, counted_take, uncounted_notes
from choreograph.library.building.options import BuildOptions
from choreograph.library.notes import Note
from choreograph.library.writing import MeasuredTake
from choreograph.motion.body import body_pos_m
from choreograph.motion.bone_map import has_bones
from choreograph.motion.cleaning import without_jumps
from choreograph.motion.contacts import lock_feet
from choreograph.motion.motion import Take
from choreograph.motion.motion_beats import motion_beat_times_s
from choreograph.motion.retargeting import retarget
from choreograph.motion.skeleton import Skeleton, canonical_skeleton

if TYPE_CHECKING:
    pass

LEFT_OUT = "left out, as requested"


@dataclass(frozen=True, eq=False)
class Imported:
    """The content of the sources of a build, before any change to the takes."""

    takes: list[Take]  # with counts and figures that other sources state about them
    left_out: list[Take]  # because of the options
    skipped: list[tuple[Path, SkippedFile]]  # source and file
    not_found: list[str]  # names to leave out that no take has

    def notes(self) -> list[Note]:
        """Notes of the readers on takes, on files that gave none, and on names that no take has."""
        notes = [Note("import", take.name, {"text": note}) for take in self.takes for note in take.notes]
        for source, file in self.skipped:
            kind = "skipped file" if file.error is None else "unreadable file"
            why = file.why.replace(f"{file.path.parent}{os.sep}", "")  # no paths of this machine
            notes.append(Note(kind, path_within(file.path, [source]), {"text": why}))
        return [*notes, *(Note("unknown take", name) for name in self.not_found)]


def path_within(path: Path, folders: Sequence[Path]) -> str:
    """The path relative to the first of the folders that contains it, else the name of the file."""
    real = Path(os.path.realpath(path.parent)) / path.name  # a link to a file keeps its own name
    resolved = (Path(os.path.realpath(folder)) for folder in folders)
    inside = (real.relative_to(folder) for folder in resolved if folder in real.parents)
    return next(inside, Path(path.name)).as_posix()


def measured_takes(
    sources: Iterable[str | Path],
    options: BuildOptions,
    report: ProgressReport | None,
    counting: Counting | None = None,
) -> tuple[list[MeasuredTake], list[Note]]:
    """All takes of the sources with their features, on one skeleton, and notes on what was unusual.

    With `counting`, those without counts are counted.

    Raises `ParameterError` if no take is left or two share a name, and `FormatError` if a source is damaged.
    It raises neither for files and names that the options skip.
    """
    imported = import_sources([Path(source) for source in sources], options, report)
    check_takes(imported, options)
    first = imported.takes[0].motion.skeleton
    on_one = all(take.motion.skeleton.same_as(first) for take in imported.takes)
    measured, jumps, count_notes = prepared_takes(
        imported.takes, options, report, counting, target=None if on_one else canonical_skeleton()
    )
    notes = [*imported.notes(), *jumps, *([] if on_one else [Note("retargeted")])]
    return measured, [*notes, *short_notes(measured), *count_notes]


def prepared_takes(
    takes: Sequence[Take],
    options: BuildOptions,
    report: ProgressReport | None,
    counting: Counting | None = None,
    *,
    target: Skeleton | None,
) -> tuple[list[MeasuredTake], list[Note], list[Note]]:
    """The takes without jumps, on the skeleton `target` if there is one, with their features, and notes.

    With `counting`, those without counts are counted. All of this is one task for each take, since takes
    are large and are sent to other processes. The notes are those on jumps, and those on counts.
    """
    songs = [None] * len(takes) if counting is None else counting.song_counts(takes)
    count = None if counting is None else partial(counted_take, counting.count_motion)
    measure = partial(_measured, target=target, lock=options.lock_feet)
    counter_key = b"" if counting is None else counting.key
    measured, jumps, counted = [], [], []
    each_take = each_cached(
        partial(_prepared, measure, count),
        zip(takes, songs, strict=True),
        key=lambda one: None if counter_key is None else key_of(measure, counter_key, *one),
        named=lambda one: one[0].name,
    )
    for done, (one, jumps_of_one, note) in enumerate(each_take):
        measured.append(one)
        jumps += jumps_of_one
        counted += [note] if note is not None else []
        if report is not None:
            report("measuring", done + 1, len(takes))
    return measured, jumps, [] if counting is None else [*counted, *uncounted_notes(measured)]


def kept_notes(kept: DiskCache, n_takes: int) -> list[Note]:
    """A note on the takes whose measurements were kept from an earlier build, if there are any."""
    n_kept = kept.n_read[_prepared.__name__]
    return [Note("kept takes", values={"kept": n_kept, "takes": n_takes})] if n_kept else []


def short_notes(measured: Sequence[MeasuredTake]) -> list[Note]:
    """Notes on the takes that are too short for a clip."""
    return [Note("short", m.take.name, {"clip_s": CLIP_S}) for m in measured if is_short(len(m.body_pos_m))]


def _prepared(
    measure: Callable[[Take], tuple[MeasuredTake, list[Note]]],
    count: Callable[[MeasuredTake, Counts | None], tuple[MeasuredTake, Note | None]] | None,
    take_and_song: tuple[Take, Counts | None],
) -> tuple[MeasuredTake, list[Note], Note | None]:
    """A take that was measured and perhaps counted, with notes on its jumps and its counts."""
    take, song = take_and_song
    measured, jumps = measure(take)
    counted, note = (measured, None) if count is None else count(measured, song)
    return counted, jumps, note


def _measured(take: Take, *, target: Skeleton | None, lock: bool) -> tuple[MeasuredTake, list[Note]]:
    """A take without jumps, on the skeleton `target` if there is one, with its features, and notes."""
    motion, n_jumps, limbs = without_jumps(take.motion)
    notes = []
    if n_jumps:
        notes = [Note("jumps", take.name, {"jumps": n_jumps, "limbs": ", ".join(limbs)})]
        take = replace(take, motion=motion, notes=(*take.notes, notes[0].text))
    if target is not None:
        take = replace(take, motion=retarget(take.motion, target))
    if lock:
        take = replace(take, motion=lock_feet(take.motion))
    return measure_take(take), notes


def import_sources(sources: Sequence[Path], options: BuildOptions, report: ProgressReport | None) -> Imported:
    """The takes of the sources and the files without takes. The second of two takes of one name is skipped.

    Raises `ParameterError` if a source does not exist or has no known layout.
    """
    takes: list[Take] = []
    left_out: list[Take] = []
    skipped: list[tuple[Path, SkippedFile]] = []
    names: set[str] = set()
    excluded, found_excluded = set(options.leave_out), set()
    for source in sources:
        for found in read_source(source, allow_outside=options.allow_outside, bone_map=options.bone_map):
            if isinstance(found, SkippedFile):
                if found.path.stem in excluded:
                    found_excluded.add(found.path.stem)
                    found = SkippedFile(found.path, LEFT_OUT)
                skipped.append((source, found))
            elif found.name in excluded:
                found_excluded.add(found.name)
                left_out.append(found)
            elif found.name in names:
                error = ParameterError(
                    f"expected a name for each take, but two takes are called {found.name!r}: the sources "
                    "overlap, or need other names"
                )
                path = found.source_paths[0] if found.source_paths else source
                skipped.append((source, SkippedFile.damaged(path, error)))
            else:
                names.add(found.name)
                takes.append(found)
            if report is not None:
                report("importing", len(takes), 0)
    for source in sources:  # after all are read, since any source may describe takes of any other
        try:
            takes = annotate_takes(takes, source)
        except ChoreographError as error:
            skipped.append((source, SkippedFile.damaged(source, error)))
    return Imported(takes, left_out, skipped, sorted(excluded - found_excluded))


def check_takes(imported: Imported, options: BuildOptions) -> None:
    """Raise the error of a file that cannot be read, or one that lists several, unless `skip_bad` is set.

    Raises `ParameterError` if there is no take, or none on a rig that a map of bones fits.
    """
    if not options.skip_bad:
        raise_errors(
            (file for _, file in imported.skipped),
            cure=" (--skip-bad, or skip_bad=True, builds from the others)",
        )
    if not imported.takes:
        why = next((f"{file.path}: {file.why}" for _, file in imported.skipped), "all left out?")
        raise ParameterError(f"expected a take or more to build from, got none: {why}")
    if options.bone_map:
        check_map_fits(imported.takes, options.bone_map)


class CheckedFile(NamedTuple):
    """What a build would do with a file. Texts that do not apply are ""."""

    path: Path
    rig: str  # the root joint and the number of joints
    units: str  # of length, found from the body or stated by the format
    counts: str
    length: str
    happens: str  # read, left out, skipped or bad, with the reason
    is_read: bool = False
    is_bad: bool = False


def checked_files(imported: Imported) -> list[CheckedFile]:
    """A row for each take and each file without takes, by path."""
    rows = [_checked_take(take, "") for take in imported.takes]
    rows += [_checked_take(take, LEFT_OUT) for take in imported.left_out]
    for _, file in imported.skipped:
        is_bad = file.error is not None
        happens = LEFT_OUT if file.why == LEFT_OUT else f"{'bad' if is_bad else 'skipped'}: {file.why}"
        rows.append(CheckedFile(file.path, "", "", "", "", happens, is_bad=is_bad))
    return sorted(rows, key=lambda row: row.path)


def _checked_take(take: Take, left_out: str) -> CheckedFile:
    motion = take.motion
    song = f"to {take.song_path.name}" if take.song_path else "without music"
    short = f", shorter than {CLIP_S} s: no clip" if is_short(motion.resampled(NET_FPS).n_frames) else ""
    return CheckedFile(
        path=take.source_paths[0] if take.source_paths else Path(take.name),
        rig=f"{motion.skeleton.names[0][:24]}, {motion.skeleton.n_joints} joints",
        units=unit_in_notes(take.notes) or "stated",
        counts=f"{len(take.counts)}" if len(take.counts) else "none",
        length=f"{motion.duration_s:.1f} s",
        happens=left_out or f"read as {take.name}, {song}{short}",
        is_read=not left_out,
    )


def is_short(n_frames: int) -> bool:
    """Whether a take of `n_frames` at 20 fps is too short for a clip."""
    return n_frames < CLIP_S * NET_FPS


def measure_take(take: Take) -> MeasuredTake:
    """A take with its body positions at 20 fps and its motion beats."""
    fine = body_pos_m(take.motion.resampled(STORE_FPS))
    coarse = body_pos_m(take.motion.resampled(NET_FPS)).astype(np.float32)
    return MeasuredTake(take, coarse, motion_beat_times_s(fine, STORE_FPS))


def check_map_fits(takes: Sequence[Take], bone_map: Mapping[str, str]) -> None:
    """Raise `ParameterError` if no take is on a rig with all bones of the map."""
    rigs = [take.motion.skeleton.names for take in takes]
    if not any(has_bones(names, bone_map) for names in rigs):
        names = max(rigs, key=lambda names: len(set(bone_map.values()) & set(names)))
        lacking = next(name for name in bone_map.values() if name not in names)
        raise unexpected("a take whose rig has all bones of the map", lacking, "no joint has this name")
