"""The slots of a dance as passages, by the bars and phrases of the song."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from choreograph.core.counts import count_numbers
from choreograph.core.numerics import Floats, Indices
from choreograph.music.form import Form

_SAME_TIME_S = 1e-3


@dataclass(frozen=True)
class PassageSlots:
    """The slots of one passage of a dance."""

    start: int
    stop: int  # one after the last
    place: tuple[int, int, int] | None = None  # equal where the song repeats a phrase. None outside phrases
    ends: bool = False  # whether it is the last one of its phrase

    @property
    def slots(self) -> slice:
        """The slots as an index."""
        return slice(self.start, self.stop)

    def halves(self) -> tuple[PassageSlots, PassageSlots]:
        """Two shorter passages without a place."""
        middle = (self.start + self.stop) // 2
        return PassageSlots(self.start, middle), PassageSlots(middle, self.stop)

    def with_end(self, n_counts: int) -> tuple[PassageSlots, PassageSlots]:
        """The passage without its last counts, and these counts as another passage of the same place."""
        middle, place = self.stop - n_counts, self.place
        return (
            PassageSlots(self.start, middle, place and (place[0], place[1], middle - self.start)),
            PassageSlots(middle, self.stop, place and (place[0], -1 - place[1], n_counts), self.ends),
        )


def passage_slots(
    slot_position: Indices, parts: Indices, phrase_counts: int, starts_s: Floats, form: Form
) -> list[PassageSlots]:
    """The slots (N,) of a dance as passages, in order.

    A passage begins where a part of the dance or a phrase of the song (`form`) begins. It ends before the
    start of a bar, if bars are known, as near to `phrase_counts` as possible. The last passage of a phrase
    may be shorter. `slot_position` (N,) is as in `choreography.motif_sequences`, and `starts_s` (N,) are the
    times of the slots.

    Examples
    --------
    >>> import numpy as np
    >>> from choreograph.choreography.passage_slots import passage_slots
    >>> from choreograph.music.form import Form
    >>> bars_of_three = 300 + np.arange(24) % 3 + 1
    >>> found = passage_slots(bars_of_three, np.zeros(24, int), 8, np.arange(24.0), Form.empty())
    >>> [passage.stop - passage.start for passage in found]
    [9, 9, 6]
    """
    n_slots = len(slot_position)
    bars = np.flatnonzero(count_numbers(slot_position) == 1)
    first_slots = np.searchsorted(starts_s, [phrase.start_s - _SAME_TIME_S for phrase in form.phrases])
    on_bar = np.isin(first_slots, bars)
    labels = {int(first_slots[i]): label for i, label in enumerate(form.labels) if on_bar[i]}
    changes = np.flatnonzero(np.diff(parts)) + 1
    borders = np.unique([0, *changes.tolist(), *bars[:1].tolist(), *labels, n_slots])
    passages = []
    for start, stop in pairwise(borders.tolist()):
        first, index = start, 0
        while first < stop:
            last = passage_stop(first, stop, bars, phrase_counts)
            place = (labels[start], index, last - first) if start in labels else None
            passages.append(PassageSlots(first, last, place, ends=last == stop))
            first, index = last, index + 1
    return passages


def passage_stop(start: int, stop: int, bars: Indices, phrase_counts: int) -> int:
    """The slot before which a passage ends that begins at `start`, at most `stop`.

    It is the start of a bar (`bars`, slots) if one is in between, as near to `phrase_counts` as possible.
    """
    inside = bars[(bars > start) & (bars < stop)]
    possible = np.append(inside if len(inside) else np.arange(start + 1, stop), stop)
    return int(possible[np.abs(possible - (start + phrase_counts)).argmin()])
