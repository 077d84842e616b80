"""The alternatives that were shown for a span of the dance, one of which may be chosen."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from choreograph.choreography.edits import edit_slots
from choreograph.choreography.pieces import PieceRequest
from choreograph.core.errors import NoPathError, ParameterError
from choreograph.library.repertoire import Repertoire
from choreograph.pipeline.alternatives import Alternative, alternatives
from choreograph.pipeline.dancing import Dance
from choreograph.pipeline.editing import Editor, planned_edit
from choreograph.plan.plan import PlannedEdit
from choreograph.studio.facts import motion_data
from choreograph.studio.project import Span
from choreograph.studio.refusals import NotFoundError

_BESIDE_S = 0.5  # of the dance on either side of an alternative
_MOST = 24


@dataclass(frozen=True, eq=False)
class Offer:
    """An alternative that was shown."""

    revision: int  # of the dance that it changes
    edit: PlannedEdit
    why: str


class Offers:
    """The alternatives that were shown last."""

    def __init__(self) -> None:
        self._by_id: dict[str, Offer] = {}

    def found(
        self, dance: Dance, repertoire: Repertoire, revision: int, span: Span, n: int
    ) -> list[dict[str, Any]]:
        """What else could be danced in a span, with the motion of the span and half a second beside it.

        Raises as `Session.alternatives`.
        """
        if not 1 <= n <= _MOST:
            raise ParameterError(f"expected 1 to {_MOST} alternatives, got {n}")
        found = alternatives(dance, repertoire, span, n)
        self._by_id = {
            f"{revision}-{index}": Offer(revision, one.dance.plan.edits[-1], one.why)
            for index, one in enumerate(found)
        }
        return [_shown(id, one) for id, one in zip(self._by_id, found, strict=True)]

    def chosen(self, revision: int, id: str) -> Offer:
        """An alternative that was shown. Raises `NotFoundError` if none of this id is of the revision."""
        offer = self._by_id.get(id)
        if offer is None or offer.revision != revision:
            raise NotFoundError(f"expected an alternative of the dance as it is, got {id[:40]!r}: ask again")
        return offer


def _shown(id: str, one: Alternative) -> dict[str, Any]:
    """An alternative as the page gets it."""
    motion, fps = one.dance.motion, one.dance.motion.fps
    first = max(0, round((one.start_s - _BESIDE_S) * fps))
    part = motion.sliced(first, min(motion.n_frames, round((one.end_s + _BESIDE_S) * fps)))
    words = one.dance.plan.edits[-1].words
    middle = words[len(words) // 2]
    return {
        "id": id, "start_s": one.start_s, "end_s": one.end_s, "from_s": first / fps,
        "cost": round(one.cost, 4), "costs": one.costs, "why": one.why,
        "take": middle.take, "genre": middle.credits.genre,
        **motion_data(part, small=True),
    }  # fmt: skip


def pinned_part(
    dance: Dance, repertoire: Repertoire, span: Span, take: str, source_s: float
) -> tuple[PlannedEdit, str]:
    """The edit that dances a take in a span, from the count nearest to a time of the take, and its request.

    Raises `RepertoireError` for an unknown take, and `NoPathError` if the take cannot be danced there.
    """
    editor = Editor(dance, repertoire, (), 0)
    wanted = PieceRequest((repertoire.take_index(take),), pinned=True)
    slots, found = editor.pieces(edit_slots(*span, editor.bounds_s), wanted)
    if not found:
        raise NoPathError(f"{take} cannot be danced there on counts, at half to twice its speed")
    best = min(found, key=lambda piece: abs(piece.words[slots.before].source_start_s - source_s))
    request = f"pin {span[0]:g}-{span[1]:g}=take:{take}"
    return planned_edit(best, request), request
