"""Dances to a song that was danced before, which keep parts of a dance or avoid repetitions."""

from __future__ import annotations

import reprlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from choreograph.choreography.constraints import Keep
from choreograph.choreography.enforcement import danced_motifs, is_danced, violated_slots
from choreograph.choreography.engine import DanceRequest, Engine, EngineResult
from choreograph.choreography.graph.cost import Cost
from choreograph.choreography.graph.layers import Layer
from choreograph.choreography.slots import KeptDance, ResolvedConstraints
from choreograph.core.errors import ParameterError
from choreograph.core.progress import substage
from choreograph.core.timebase import NET_FPS
from choreograph.formats.bvh import read_bvh
from choreograph.formats.npz import read_npz
from choreograph.library.repertoire import Repertoire
from choreograph.motion.motion import Credits, Motion
from choreograph.music.song_features import SongFeatures
from choreograph.plan import Plan, PlannedWord
from choreograph.render.filled_gaps import correction_speed_m_s, fill_gaps, of_length
from choreograph.render.rendering import render, render_planned

_SAME_S = 0.5  # parts of a take that are nearer look the same


class AvoidRepeating(Cost):
    """1 for a node that an earlier dance had in this second, in the same take within half a second."""

    name = "unlike"  # in plans

    def __init__(self, earlier: Sequence[Plan]) -> None:
        self._earlier = [plan for plan in earlier if plan.seconds]

    def node(self, layer: Layer, song_features: SongFeatures) -> NDArray[np.floating]:
        same = np.zeros(layer.n_nodes, bool)
        start_s = layer.take_frames[:, 0] / NET_FPS
        for plan in self._earlier:
            there = plan.seconds[layer.second]
            same |= (layer.take_names == there.take) & (abs(start_s - there.source_times_s[0]) < _SAME_S)
        return same.astype(np.float64)


_ATTEMPTS = 4  # with different seeds, to find a filling that needs little correction
_SLOW_M_S = 0.08  # corrections of standing feet at this speed are hardly visible
_SEEDS_APART = 1_000_003  # so that attempts of neighbouring seeds differ


@dataclass(frozen=True, eq=False)
class ExistingDance:
    """A dance that was made before: its motion, and its plan if it is known."""

    motion: Motion  # the whole dance
    plan: Plan | None  # if it is known
    name: str  # of its file


def read_existing(path: str | Path, repertoire: Repertoire) -> ExistingDance:
    """The dance in a motion file (.bvh, .npz), or that of a plan (.json), which is rendered.

    Raises `FormatError` if the file cannot be read, `ParameterError` for another suffix or a plan that cannot
    be rendered, `RepertoireError` for a plan of another repertoire.
    """
    return _read_existing(Path(path), repertoire, ())


def render_file(
    path: str | Path, repertoire: Repertoire, existing: str | Path | None = None
) -> tuple[Plan, Motion]:
    """A plan file and its motion, with the dance of which it keeps parts.

    This dance is `existing`, or a file of the name in the plan beside it. Raises as `read_existing`, and
    `ParameterError` if this dance is not found, or if `existing` is given and the plan keeps no parts.
    """
    return _render_file(Path(path), repertoire, None if existing is None else Path(existing), ())


def _render_file(
    path: Path, repertoire: Repertoire, existing: Path | None, readers: tuple[Path, ...]
) -> tuple[Plan, Motion]:
    """As `render_file`. `readers` are the plans that keep parts of this one, directly or not."""
    plan = Plan.read(path)
    if existing is None and plan.kept_of:
        existing = path.with_name(Path(plan.kept_of).name)
        if not existing.is_file() or existing.name != plan.kept_of:
            raise ParameterError(
                f"{path}: expected {plan.kept_of}, of which it keeps parts, in its folder, got no such file: "
                "give it with --existing"
            )
    if existing is None:
        return plan, render(plan, repertoire)
    known = _read_existing(existing, repertoire, (*readers, path.resolve()))
    return plan, render(plan, repertoire, existing=known.motion)


def _read_existing(path: Path, repertoire: Repertoire, readers: tuple[Path, ...]) -> ExistingDance:
    """As `read_existing`. `readers` are the plans that keep parts of this dance, directly or not."""
    suffix = path.suffix.lower()
    if suffix == ".json":
        if path.resolve() in readers:
            raise ParameterError(f"{path}: expected a plan that keeps parts of another dance, got its own")
        plan, motion = _render_file(path, repertoire, None, readers)
        return ExistingDance(motion, plan, path.name)
    if suffix == ".bvh":
        return ExistingDance(read_bvh(path)[0], None, path.name)
    if suffix == ".npz":
        return ExistingDance(read_npz(path), None, path.name)
    raise ParameterError(
        f"expected an existing dance as .bvh, .npz or .json (its plan), got {reprlib.repr(str(path))}"
    )


def fill(request: DanceRequest, engine: Engine) -> tuple[EngineResult, Motion]:
    """A new dance that keeps parts of another one: its plan, its unmet requests, and its motion.

    The new parts rarely end where the kept parts continue, so they are moved there. Of a few dances with
    different seeds, the one with the smallest correction is chosen.

    Raises as the engine does, and `ParameterError` if the dances are of different skeletons.
    """
    kept, config = request.kept, request.config
    assert kept is not None
    best: tuple[float, EngineResult, Motion] | None = None
    for attempt in range(_ATTEMPTS):
        seed = config.seed + attempt * _SEEDS_APART
        result = engine.plan(replace(request, config=replace(config, seed=seed)))
        motion = result.motion
        if motion is None:
            rendering = substage(request.report, "rendering")
            motion = render_planned(result.plan, request.repertoire, request.memory, report=rendering)
        existing = of_length(kept.motion, motion.n_frames)
        fast_m_s = correction_speed_m_s(existing, motion, kept.frames)
        if best is None or (len(result.unmet), fast_m_s) < (len(best[1].unmet), best[0]):
            best = fast_m_s, result, motion
        if fast_m_s <= _SLOW_M_S and not result.unmet:
            break
    assert best is not None
    _, result, motion = best
    plan = _with_kept(result.plan, kept)
    if result.plan.from_takes:  # the motion of the plan as it is written
        filled = render_planned(plan, request.repertoire, request.memory, existing=kept.motion)
    else:
        filled = fill_gaps(existing, motion, kept.frames)
    broken = _unmet(filled, result.plan, kept, request.constraints, request.repertoire)
    unmet = tuple(dict.fromkeys((*result.unmet, *broken)))
    return replace(result, plan=plan, unmet=unmet), filled


def _with_kept(plan: Plan, kept: KeptDance) -> Plan:
    """The plan with the kept parts as words, which replace the planned parts there."""
    words = [part for word in plan.words for part in _in_gaps(word, kept.stretches)]
    words += [word for keep in kept.stretches for word in _kept_words(keep, kept, plan.duration_s)]
    return replace(plan, words=tuple(sorted(words, key=lambda word: word.start_s)))


def _in_gaps(word: PlannedWord, stretches: tuple[Keep, ...]) -> Iterator[PlannedWord]:
    """The parts of a word outside of all stretches."""
    start_s = word.start_s
    for keep in (*stretches, Keep(word.end_s, word.end_s)):
        end_s = min(keep.start_s, word.end_s)
        if end_s > start_s:
            yield _part(word, start_s, end_s)
        start_s = max(start_s, keep.end_s)


def _part(word: PlannedWord, start_s: float, end_s: float) -> PlannedWord:
    span_s, source_s = (word.start_s, word.end_s), (word.source_start_s, word.source_end_s)
    first_s, last_s = np.interp([start_s, end_s], span_s, source_s).round(6).tolist()
    return replace(word, start_s=start_s, end_s=end_s, source_start_s=first_s, source_end_s=last_s)


def _kept_words(keep: Keep, kept: KeptDance, duration_s: float) -> Iterator[PlannedWord]:
    """The kept parts, with the credits of each take of the existing dance there, if known."""
    end_s = min(keep.end_s, duration_s)
    spans = [(keep.start_s, end_s, Credits())]
    if kept.plan is not None:
        spans = [
            (max(b.start_s, keep.start_s), min(b.end_s, end_s), b.planned.credits)
            for b in kept.plan.blocks
            if b.start_s < end_s and b.end_s > keep.start_s
        ]
    for first_s, last_s, credits in spans:
        yield PlannedWord(first_s, last_s, 0, "", first_s, last_s, credits, kept=kept.name)


def _unmet(
    motion: Motion, plan: Plan, kept: KeptDance, constraints: ResolvedConstraints, repertoire: Repertoire
) -> tuple[str, ...]:
    """A line on each pin and ban that is not met because of transitions from and to kept parts."""
    if not constraints.constrains_motifs:
        return ()
    pinned = {slot: constraints.motifs[slot] for slot in constraints.pinned}
    danced = danced_motifs(motion, constraints.bounds_s, repertoire, pinned)
    broken = violated_slots(danced, replace(constraints, motifs=pinned))
    lines = []
    for slot in broken:
        start_s, end_s = constraints.bounds_s[slot : slot + 2].tolist()
        if is_danced(slot, plan, constraints) and not kept.keeps(start_s, end_s):
            wanted = f"motif {pinned[slot]}" if slot in pinned else "no banned motif"
            lines.append(
                f"expected {wanted} at {start_s:.1f} s, but a transition from or to what is kept changes it: "
                "move it, or keep less"
            )
    return tuple(lines)
