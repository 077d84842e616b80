"""Takes for a repertoire: read, rid of jumps, brought to one skeleton, their feet locked, and measured."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from choreograph.arguments import unexpected
from choreograph.blending.foot_locking import lock_feet
from choreograph.building.options import BuildOptions
from choreograph.errors import ParameterError
from choreograph.features.motion_beats import motion_beat_times_s
from choreograph.importers import annotate_takes, import_takes, source_notes
from choreograph.motion.body import body_pos_m
from choreograph.motion.bone_map import has_bones
from choreograph.motion.despiking import without_jumps
from choreograph.motion.retargeting import retarget
from choreograph.motion.skeleton import canonical_skeleton
from choreograph.progress import ProgressReport
from choreograph.repertoire.contents import MeasuredTake
from choreograph.takes import Take
from choreograph.timebase import CLIP_S, NET_FPS, STORE_FPS


def measured_takes(
    sources: Iterable[str | Path], options: BuildOptions, report: ProgressReport | None
) -> tuple[list[MeasuredTake], tuple[str, ...]]:
    """All takes of the sources with their features, on one skeleton, and notes on what was unusual.

    Raises `ParameterError` if no take is left or two share a name, `FormatError` if a source is damaged.
    """
    takes, notes = _imported(sources, options, report)
    if options.lock_feet:
        takes = [replace(take, motion=lock_feet(take.motion)) for take in takes]
    measured = [measure_take(take) for take in takes]
    short = [m.take.name for m in measured if len(m.body_pos_m) < CLIP_S * NET_FPS]
    if short:
        notes = (*notes, f"{', '.join(short)}: shorter than {CLIP_S} s: no clip comes from there")
    return measured, notes


def measure_take(take: Take) -> MeasuredTake:
    """A take with its body positions at 20 fps and its motion beats."""
    fine = body_pos_m(take.motion.resampled(STORE_FPS))
    coarse = body_pos_m(take.motion.resampled(NET_FPS)).astype(np.float32)
    return MeasuredTake(take, coarse, motion_beat_times_s(fine, STORE_FPS))


def _without_jumps(take: Take) -> Take:
    """The take without one-frame jumps of its markers, and a note on how many there were."""
    motion, count, limbs = without_jumps(take.motion)
    if count == 0:
        return take
    jumps = "one-frame jump" if count == 1 else "one-frame jumps"
    note = f"{count} {jumps} of markers ({', '.join(limbs)}) smoothed"
    return replace(take, motion=motion, notes=(*take.notes, note))


def check_map_fits(takes: Sequence[Take], bone_map: Mapping[str, str]) -> None:
    """`ParameterError` if no take is on a rig with all bones of the map."""
    rigs = [take.motion.skeleton.names for take in takes]
    if not any(has_bones(names, bone_map) for names in rigs):
        names = max(rigs, key=lambda names: len(set(bone_map.values()) & set(names)))
        lacking = next(name for name in bone_map.values() if name not in names)
        raise unexpected("a take whose rig has all bones of the map", lacking, "no joint has this name")


def _imported(
    sources: Iterable[str | Path], options: BuildOptions, report: ProgressReport | None
) -> tuple[list[Take], tuple[str, ...]]:
    """All takes on one skeleton, and notes."""
    sources = list(sources)
    takes: list[Take] = []
    for source in sources:
        for take in import_takes(source, allow_outside=options.allow_outside, bone_map=options.bone_map):
            if take.name not in options.leave_out:
                takes.append(_without_jumps(take))
            if report is not None:
                report("importing", len(takes), 0)
    if not takes:
        given = ", ".join(map(str, sources)) or "no source"
        raise ParameterError(f"expected a take or more to build from, got none in {given}: all left out?")
    if options.bone_map:
        check_map_fits(takes, options.bone_map)
    for source in sources:  # after all are read: any may know about takes of any other
        takes = annotate_takes(takes, source)
    names = [take.name for take in takes]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ParameterError(
            f"expected a name for each take, but two takes are called {twice[0]!r}: the sources overlap, or "
            "need other names"
        )
    notes = [f"{take.name}: {note}" for take in takes for note in take.notes]
    notes += [f"{source}: {note}" for source in sources for note in source_notes(source)]
    first = takes[0].motion.skeleton
    if all(take.motion.skeleton.same_as(first) for take in takes):
        return takes, tuple(notes)
    notes.append("the takes are on different skeletons: all are retargeted to the canonical body")
    body = canonical_skeleton()
    return [replace(take, motion=retarget(take.motion, body)) for take in takes], tuple(notes)
