"""Plans a dance and renders it: the loops around an engine.

An engine makes a plan, which is rendered. If the plan has to show certain motifs, the motion is segmented at
its words, and the engine is asked again with what they show: for other words there, or another dance. The
loop ends when the engine has no better plan. Beside parts that are kept of another dance, a few plans with
different seeds are rendered, and the one that meets the kept parts best is blended with them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from choreograph.choreography.enforcement import danced_embeddings, danced_motifs, is_danced, violated_slots
from choreograph.choreography.engine import DanceRequest, Engine, EngineResult
from choreograph.choreography.slots import KeptDance, ResolvedConstraints
from choreograph.core.cache import Memory
from choreograph.core.long_songs import is_long
from choreograph.core.progress import StepReport, part, substage
from choreograph.core.timebase import seconds_to_frames
from choreograph.library.repertoire import Repertoire
from choreograph.motion.motion import Motion
from choreograph.pipeline.keeping import ExistingDance, kept_file_plan
from choreograph.plan.joins import take_motions
from choreograph.plan.plan import Plan, PlannedEdit, words_between
from choreograph.render.filled_gaps import correction_speed_m_s, fill_gaps, of_length
from choreograph.render.rendering import (
    render_generated,
    render_over,
    render_part,
    render_planned,
    with_edit,
)

_STEPS = 10  # of the progress of a rendering
_USUAL = 6  # renderings at most of a plan that is checked
_KEPT_BYTES = 1 << 26  # of what renderings have in common: the runs of a dance of 5 minutes at 60 fps


@dataclass(frozen=True)
class FirstPart:
    """The part of a dance that is shown before all of it is rendered: the one near the playhead of a page."""

    start_s: float
    end_s: float
    tell: Callable[[Motion, float], None]  # gets the motion of the part, and the time of its start

    def show(self, plan: Plan, repertoire: Repertoire, memory: Memory) -> None:
        """Render the part of a plan and tell of it, unless the dance ends before."""
        made = render_part(plan, repertoire, memory, self.start_s, self.end_s)
        if made is not None:
            self.tell(*made)


def plan_and_render(
    engine: Engine, request: DanceRequest, first: FirstPart | None = None
) -> tuple[EngineResult, Motion]:
    """The final plan of an engine, and its motion. Raises as `Engine.plan`.

    A plan with a `Check` is rendered, and the engine is asked again, until it returns a plan with its motion.
    A `first` part of a plan without a check is shown early: as soon as the engine has a likely plan, which is
    then in the memory, or before the rest of the final plan is rendered.
    """
    repertoire, report = request.repertoire, substage(request.report, "rendering")
    saves_memory = is_long(request.song_features.duration_s) and not request.memory.is_on
    memory, unshown, n_rendered = request.memory, [first] if first is not None else [], 0

    def show(plan: Plan) -> None:
        unshown.pop().show(plan, repertoire, memory)
        render_planned(plan, repertoire, memory)

    result = engine.plan(replace(request, likely=show) if unshown and memory.is_on else request)
    if result.check is not None and not (memory.is_on or saves_memory):
        memory = Memory(_KEPT_BYTES)
    while result.check is not None:
        steps = (_STEPS * count for count in (n_rendered, n_rendered + 1, max(_USUAL, n_rendered + 1)))
        motion = _rendered(result, repertoire, memory, part(report, *steps))
        result = result.check.again(motion, danced_embeddings(motion, result.check.bounds_s, repertoire))
        n_rendered += 1
    if result.motion is not None:
        if report is not None:
            report(*[_STEPS * max(_USUAL, n_rendered)] * 2)
        return result, result.motion
    if saves_memory:
        repertoire.forget_rows()  # of clips, which have 70 MB
    if unshown and result.generated is None:
        unshown.pop().show(result.plan, repertoire, memory)
    motion = _rendered(result, repertoire, memory, report)
    return result, motion


def _rendered(
    result: EngineResult, repertoire: Repertoire, memory: Memory, report: StepReport | None
) -> Motion:
    """The motion of a plan: of takes, of a network, or of takes over what a network danced."""
    if result.over is not None:
        return render_over(result.over, [word for word in result.plan.words if word.take], repertoire)
    if result.generated is not None:
        return render_generated(result.generated, result.plan)
    return render_planned(result.plan, repertoire, memory, report=report)


# A dance that keeps parts of another one.


_ATTEMPTS = 4  # with different seeds, to find a filling that needs little correction
_SLOW_M_S = 0.08  # corrections of standing feet at this speed are hardly visible
_SEEDS_APART = 1_000_003  # so that attempts of neighbouring seeds differ


def fill(request: DanceRequest, engine: Engine) -> tuple[EngineResult, Motion]:
    """A new dance that keeps parts of another one: its plan, its unmet requests, and its motion.

    The new parts are edits of the other dance. They rarely end where the kept parts continue, so they are
    moved there. Of a few dances with different seeds, the one with the smallest correction is chosen.

    Raises as the engine does, and `ParameterError` if the dances are of different skeletons.
    """
    kept, config = request.kept, request.config
    assert kept is not None
    base = kept.plan
    if base is None:
        known = ExistingDance(kept.motion, None, kept.name)
        base = kept_file_plan(known, request.song_features, request.song, request.repertoire)
    existing = of_length(kept.motion, max(1, seconds_to_frames(base.duration_s, base.fps)))
    best: tuple[float, EngineResult, Motion] | None = None
    for attempt in range(_ATTEMPTS):
        seed = config.seed + attempt * _SEEDS_APART
        result, motion = plan_and_render(engine, replace(request, config=replace(config, seed=seed)))
        motion = of_length(motion, existing.n_frames)
        fast_m_s = correction_speed_m_s(existing, motion, kept.frames)
        if best is None or (len(result.unmet), fast_m_s) < (len(best[1].unmet), best[0]):
            best = fast_m_s, result, motion
        if fast_m_s <= _SLOW_M_S and not result.unmet:
            break
    assert best is not None
    _, result, motion = best
    edits = tuple(_gap_edit(result.plan, from_s, min(to_s, base.duration_s)) for from_s, to_s in kept.gaps_s)
    if result.plan.from_takes:  # the motion of the plan as it is written
        filled, read_motion = existing, take_motions(request.repertoire)
        for edit in edits:
            filled = with_edit(filled, base, edit, read_motion)
    else:
        filled = fill_gaps(existing, motion, kept.frames)
    broken = _unmet(filled, result.plan, kept, request.constraints, request.repertoire)
    unmet = tuple(dict.fromkeys((*result.unmet, *broken)))
    return replace(result, plan=replace(base, edits=(*base.edits, *edits)), unmet=unmet), filled


def _gap_edit(plan: Plan, start_s: float, end_s: float) -> PlannedEdit:
    """A gap between kept parts as an edit, with the part of a new dance there. Words end on half beats."""
    beats_s = np.array(plan.music_beats_s)
    cuts_s = np.sort(np.concatenate([beats_s, 0.5 * (beats_s[1:] + beats_s[:-1])]))
    words = words_between(plan.planned_blocks, start_s, end_s, cuts_s.tolist())
    return PlannedEdit(start_s, end_s, f"plan {start_s:g}-{end_s:g} again", words)


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
