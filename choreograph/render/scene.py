"""Renders the dancers of a scene: what each of them dances, and the way of each over the stage.

A dancer's motion is made of parts of the dances of the scene. Then the body gets its height, and the dancer
goes from place to place on the ground: slowly while both feet stand, and faster while one is in the air. Feet
that stand remain in place, as in a single dance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from choreograph.core.counts import counts_later_s
from choreograph.core.numerics import Floats
from choreograph.core.timebase import NET_FPS, frame_times_s
from choreograph.motion.body import body_pos_m, mirrored_motion
from choreograph.motion.contacts import DANCE_SHIFT_S, foot_contacts, lock_feet
from choreograph.motion.motion import Motion
from choreograph.plan.plan import Plan
from choreograph.plan.runs import Run
from choreograph.plan.scenes import DancerPart, PlannedDancer, ScenePlan, ground_shift_m
from choreograph.render.assembly import assemble
from choreograph.render.rendering import with_dynamics

_SAME_M = 1e-9


def render_scene(plan: ScenePlan, dances: Sequence[Motion]) -> list[Motion]:
    """The motion of each dancer of a scene from the motion of each of its dances."""
    known: dict[tuple[DancerPart, ...], DancedParts] = {}
    motions = []
    for dancer in plan.dancers:
        if dancer.parts not in known:
            known[dancer.parts] = DancedParts.of(dancer.parts, dances, plan.dances[0])
        motions.append(on_stage(known[dancer.parts], dancer))
    return motions


@dataclass(frozen=True, eq=False)
class DancedParts:
    """What a dancer dances, before it gets its height and its way over the stage."""

    motion: Motion
    contacts: Floats  # (T, 4) of its feet

    @classmethod
    def of(cls, parts: Sequence[DancerPart], dances: Sequence[Motion], plan: Plan) -> DancedParts:
        """The parts of a dancer from the dances of a scene. `plan` is that of the leader's dance."""
        motion = danced(parts, dances, plan)
        return cls(motion, foot_contacts(body_pos_m(motion), motion.fps))


def on_stage(parts: DancedParts, dancer: PlannedDancer) -> Motion:
    """The motion of a dancer, with the height and the places of the plan."""
    motion = of_height(parts.motion, dancer.height)
    places_m = np.stack([dancer.x_m, dancer.z_m], axis=1)  # (K, 2)
    way = ground_shift_m(motion, parts.contacts, np.array(dancer.times_s), places_m)
    if np.ptp(way, axis=0).max() < _SAME_M:
        return motion.moved(shift_m=np.array([way[0, 0], 0.0, way[0, 1]]))
    root_pos_m = motion.root_pos_m.copy()
    root_pos_m[:, [0, 2]] += way
    moved = replace(motion, root_pos_m=root_pos_m)
    return lock_feet(moved, parts.contacts, shift_s=DANCE_SHIFT_S)


def of_height(motion: Motion, height: float) -> Motion:
    """The motion on a body that is `height` times as tall, with steps of that length."""
    if height == 1.0:
        return motion
    skeleton = motion.skeleton
    sized = replace(skeleton, offsets_m=skeleton.offsets_m * height, tips_m=skeleton.tips_m * height)
    return replace(motion, skeleton=sized, root_pos_m=motion.root_pos_m * height)


# What a dancer dances, joined as the takes of a dance are.


def danced(parts: Sequence[DancerPart], dances: Sequence[Motion], plan: Plan) -> Motion:
    """The motion of the parts of a dancer. `plan` is that of the leader's dance, with the counts."""
    first = parts[0]
    if len(parts) == 1 and not (first.delay_counts or first.held) and first.size == 1.0:
        motion = dances[first.dance]
        return mirrored_motion(motion) if first.mirrored else motion

    def read(take: str, start_s: float, stop_s: float) -> tuple[Motion, float]:
        motion = dances[int(take)]
        begin = max(0, int(start_s * motion.fps) - _BESIDE_FRAMES)
        end = min(motion.n_frames, int(stop_s * motion.fps) + _BESIDE_FRAMES)
        return motion.sliced(min(begin, end - 2), end), min(begin, end - 2) / motion.fps

    fps, last = dances[0].fps, parts[-1]
    made, joins = assemble(
        _runs(parts, plan), read, fps=fps, duration_s=plan.duration_s, blending="inertial", stage="free"
    )
    opening_s = float(counts_later_s(plan.music_beats_s, plan.opening_s, first.delay_counts))
    as_danced = replace(
        plan,
        opening_s=opening_s if first.delay_counts else 0.0,
        closing_s=plan.closing_s if last.delay_counts or last.held else None,
        stops_s=tuple((part.start_s, part.end_s) for part in parts if part.held),
        amplitudes=_sizes(parts, plan.duration_s),
    )
    motion = with_dynamics(made, joins, as_danced)
    missing = dances[0].n_frames - motion.n_frames
    return motion if missing <= 0 else motion.sampled(np.arange(dances[0].n_frames, dtype=np.float64))


_BESIDE_FRAMES = 64  # for splines, in which the effect of a frame falls to a quarter with every other one


def _runs(parts: Sequence[DancerPart], plan: Plan) -> list[Run]:
    """A run for each part. A part that is held stays at the last time of the part before it."""
    runs: list[Run] = []
    for part in parts:
        n_knots = max(2, round((part.end_s - part.start_s) * NET_FPS)) + 1
        times_s = np.linspace(part.start_s, part.end_s, n_knots)
        if part.held:
            at_s = runs[-1].source_times_s[-1] if runs else 0.0
            source_s = np.full(n_knots, at_s)
        elif part.delay_counts:
            before_s = counts_later_s(plan.music_beats_s, times_s, -part.delay_counts)
            source_s = np.clip(before_s, 0.0, plan.duration_s)
        else:
            source_s = times_s
        runs.append(Run(str(part.dance), part.start_s, part.end_s, source_s, mirrored=part.mirrored))
    return runs


def _sizes(parts: Sequence[DancerPart], duration_s: float) -> tuple[float, ...]:
    """The size of the movement in each second, none if all are 1."""
    if all(part.size == 1.0 for part in parts):
        return ()
    middles_s = frame_times_s(int(np.ceil(duration_s)), 1.0) + 0.5
    ends_s = [part.end_s for part in parts]
    at = np.minimum(np.searchsorted(ends_s, middles_s, side="right"), len(parts) - 1)
    return tuple(parts[index].size for index in at.tolist())
