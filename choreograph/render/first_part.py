"""A part of a dance that is shown before all of it is rendered: the one near the playhead of a page."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from choreograph.core.timebase import seconds_to_frames
from choreograph.motion.motion import Motion
from choreograph.music.danced_span import coming_to_rest_s, setting_off_s
from choreograph.plan import Plan
from choreograph.render.dynamics import STOP_EASE_S, scaled_root
from choreograph.render.held_poses import copied
from choreograph.render.runs import Run
from choreograph.render.transitions import Joins

_BESIDE_S = 2.0  # of the dance on either side, on which amplitudes and locked feet of the part depend


@dataclass(frozen=True)
class FirstPart:
    """The part of a dance from one time to another, and what gets its motion, with the time of its start.

    The part is that of the finished dance, except that its floor and the shifts of its feet are found without
    the rest of the dance. They differ by some millimetres. It may be shown before a search has ended that
    rarely changes the dance.
    """

    start_s: float
    end_s: float
    tell: Callable[[Motion, float], None]

    def runs_of(self, runs: Sequence[Run]) -> Sequence[Run]:
        """The runs of a dance until after the part, which are assembled first, if they are few."""
        later = (index for index, run in enumerate(runs) if run.start_s > self.end_s + 2 * _BESIDE_S)
        n_needed = next(later, len(runs)) + 1
        return runs[:n_needed] if n_needed <= len(runs) / 2 else ()

    def show_rendered(self, motion: Motion) -> None:
        """Tell of the part of a dance that is rendered already."""
        first = seconds_to_frames(self.start_s, motion.fps)
        stop = min(motion.n_frames, seconds_to_frames(self.end_s, motion.fps))
        if first < stop:
            self.tell(copied(motion.sliced(first, stop)), first / motion.fps)

    def show(
        self, motion: Motion, joins: Joins, plan: Plan, finish: Callable[[Motion, Joins, Plan], Motion]
    ) -> None:
        """Finish the part of a dance, assembled until after it or to its end, and tell of it.

        `motion` stays as it is. `finish` adds the dynamics of a plan to a motion and locks its feet.
        """
        fps, n_frames = motion.fps, motion.n_frames
        from_s = _beside_s(plan, self.start_s)
        begin, first = seconds_to_frames(from_s, fps), seconds_to_frames(self.start_s, fps)
        stop = min(n_frames, seconds_to_frames(self.end_s, fps))
        end = min(n_frames, seconds_to_frames(self.end_s + _BESIDE_S, fps))
        if first >= stop:
            return
        part = copied(motion.sliced(begin, end))
        window = part_of_plan(plan, from_s, part.duration_s)
        whole_m = scaled_root(motion.root_pos_m, plan.amplitudes, fps)[first]
        shift_m = whole_m - scaled_root(part.root_pos_m, window.amplitudes, fps)[first - begin]
        made = finish(part, joins.between(begin, end, fps), window).sliced(first - begin, stop - begin)
        moved_m = made.root_pos_m + shift_m * np.array([1.0, 0.0, 1.0])  # on the ground
        self.tell(replace(made, root_pos_m=moved_m), first / fps)


def _beside_s(plan: Plan, start_s: float) -> int:
    """From when a part needs the dance, a whole second, for the amplitudes. Held poses are not cut."""
    rests_s, _ = coming_to_rest_s(plan.opening_s, plan.danced_until_s)
    held_s = (0.0, setting_off_s(plan.opening_s)[1]), *plan.stops_s, (rests_s, plan.duration_s)
    from_s = start_s - _BESIDE_S
    for begins_s, ends_s in reversed(held_s):
        if begins_s - _BESIDE_S < from_s < ends_s + STOP_EASE_S:
            from_s = begins_s - _BESIDE_S
    return max(0, int(from_s))


def part_of_plan(plan: Plan, from_s: int, duration_s: float) -> Plan:
    """What the dynamics of a part of a plan need: its held poses and amplitudes, from `from_s` on."""
    closing_s = plan.danced_until_s - from_s
    stops_s = [(rests_s - from_s, moves_s - from_s) for rests_s, moves_s in plan.stops_s]
    return replace(
        plan, seconds=(), words=(), edits=(), duration_s=duration_s,
        opening_s=max(0.0, plan.opening_s - from_s),
        closing_s=closing_s if closing_s < duration_s else None,
        stops_s=tuple(span_s for span_s in stops_s if span_s[0] > STOP_EASE_S and span_s[1] < duration_s),
        amplitudes=plan.amplitudes[from_s:],
    )  # fmt: skip
