"""A dance of which stretches are kept, held against the song that it is danced to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from choreograph.blending.filled_gaps import stretch_frames
from choreograph.blending.rendering import LENGTH_SLACK_S
from choreograph.constraints.spec import Constraints, Keep, MotifPin
from choreograph.errors import ParameterError
from choreograph.motion.motion import Motion
from choreograph.plan import Plan

SHORTEST_GAP_S = 2.0  # two transitions of half a second, and as long between them
_SHORTEST_END_S = 1.0  # before or after all that is kept: one transition, and as long beside it
_TOUCH_S = 1e-6


@dataclass(frozen=True, eq=False)
class KeptDance:
    """Stretches of a dance that are kept; the gaps between them are danced anew."""

    motion: Motion  # (T frames) the whole dance, at the rate of the new one
    stretches: tuple[Keep, ...]  # in order, disjoint
    name: str  # of its file, for the plan
    plan: Plan | None = None  # that explains it, where it is known
    notes: tuple[str, ...] = ()  # on what is kept beyond what was asked for

    @property
    def frames(self) -> list[tuple[int, int]]:
        """Each stretch as its first frame, and the one after its last."""
        spans_s = [(keep.start_s, keep.end_s) for keep in self.stretches]
        return stretch_frames(spans_s, self.motion.fps, self.motion.n_frames)

    def keeps(self, start_s: float, end_s: float) -> bool:
        """Whether any part of a span is kept."""
        return any(start_s < k.end_s and k.start_s < end_s for k in self.stretches)


def kept_dance(
    motion: Motion, keeps: Sequence[Keep], duration_s: float, *, name: str, plan: Plan | None = None
) -> KeptDance:
    """The stretches of a dance that are kept in another one of `duration_s`.

    What is left at the start or end is kept, too, with a note, if it is shorter than a second. Raises
    `ParameterError` if there is no stretch, one is empty or outside the dance, two overlap, a gap is shorter
    than 2 s, nothing is left to dance, or the motion is not as long as the dance.
    """
    for keep in keeps:
        if not 0 <= keep.start_s < keep.end_s <= duration_s + LENGTH_SLACK_S:
            raise ParameterError(
                f"expected a start before its end of what is kept, within the dance of {duration_s:g} s, got "
                f"{keep}"
            )
    if not keeps:
        raise ParameterError("expected a stretch to keep of the existing dance, got none")
    if abs(motion.duration_s - duration_s) > LENGTH_SLACK_S:
        raise ParameterError(
            f"expected a dance of {duration_s:.1f} s to keep parts of, got one of {motion.duration_s:.1f} s: "
            "is it to another song, or another part of it?"
        )
    stretches, notes = _to_the_ends(sorted(keeps, key=lambda keep: keep.start_s), duration_s)
    borders_s = [0.0, *(at for keep in stretches for at in (keep.start_s, keep.end_s)), duration_s]
    gaps_s = [stop - start for start, stop in zip(borders_s[::2], borders_s[1::2], strict=True)]
    if min(gaps_s) < -_TOUCH_S:
        raise ParameterError(f"expected stretches that do not overlap, got {', '.join(map(str, stretches))}")
    if max(gaps_s) <= _TOUCH_S:
        raise ParameterError("expected a part of the dance that is not kept, got none: it is all kept")
    short = [gap for gap in gaps_s[1:-1] if _TOUCH_S < gap < SHORTEST_GAP_S]
    if short:
        raise ParameterError(
            f"expected gaps of {SHORTEST_GAP_S:g} s or more between what is kept, got one of {short[0]:.2f} "
            "s: keep less, or all of it"
        )
    return KeptDance(motion, tuple(stretches), name, plan, notes)


def _to_the_ends(keeps: Sequence[Keep], duration_s: float) -> tuple[list[Keep], tuple[str, ...]]:
    """Stretches in order, to the very start or end of the dance where too little is left there; and notes."""
    stretches = list(keeps)
    before_s, after_s = keeps[0].start_s, duration_s - keeps[-1].end_s
    if before_s < _SHORTEST_END_S:
        stretches[0] = replace(stretches[0], start_s=0.0)
    if after_s < _SHORTEST_END_S:
        stretches[-1] = replace(stretches[-1], end_s=duration_s)
    too_short = [
        f"the {which} {left_s:.2f} s"
        for which, left_s in (("first", before_s), ("last", after_s))
        if LENGTH_SLACK_S < left_s < _SHORTEST_END_S
    ]
    if not too_short:
        return stretches, ()
    return stretches, (f"{' and '.join(too_short)} of the existing dance are kept, too short to dance anew",)


def check_pins_in_gaps(constraints: Constraints, kept: KeptDance) -> None:
    """Raise `ParameterError` for a pin in a stretch that is kept."""
    for pin in constraints.pins:
        span_s = (pin.at_s, pin.at_s) if isinstance(pin, MotifPin) else (pin.start_s, pin.end_s)
        if kept.keeps(span_s[0] + _TOUCH_S, span_s[1] - _TOUCH_S):
            raise ParameterError(
                f"expected pins where the existing dance is not kept, got {pin}: move it into a gap"
            )
