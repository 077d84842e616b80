"""What a finished plan leaves out: a requested genre whose takes it hardly dances, and takes without counts.

Judged by the plan: engines prefer counted takes of the song's metre, but no cost forbids the others.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from choreograph.config import DanceConfig
from choreograph.constraints.resolve import ResolvedConstraints
from choreograph.plan import Plan
from choreograph.repertoire import Repertoire
from choreograph.timebase import CLIP_S
from choreograph.warping import FEWEST_COUNTS

Mask = NDArray[np.bool_]

_MOST = 0.5  # of a dance is of the genre that was asked for, or a note says that it is not
_NAMED = 4  # genres in a note


def left_out_notes(
    plan: Plan, repertoire: Repertoire, constraints: ResolvedConstraints, config: DanceConfig
) -> tuple[str, ...]:
    """Notes on what a dance of takes leaves out; none on a network's motion."""
    names = [take.name for take in repertoire.takes]
    danced_s = {source: time_s for source, time_s in plan.takes_s().items() if source in names}
    if not danced_s:
        return ()
    counted = np.array([len(repertoire.counts(take)) >= FEWEST_COUNTS for take in range(len(names))])
    genre = constraints.requested.genre
    if genre is not None:
        return _genre_note(genre, danced_s, counted, plan, repertoire, constraints.take_allowed)
    by_counts = config.warping == "counts" and len(plan.music_beats_s) >= FEWEST_COUNTS
    without = np.flatnonzero(constraints.take_allowed & ~counted)
    if not by_counts or len(without) == 0 or any(name in danced_s for name in np.array(names)[~counted]):
        return ()
    genres = sorted({repertoire.takes[take].credits.genre for take in without} - {""})
    more = f" and {len(genres) - _NAMED} more" if len(genres) > _NAMED else ""
    of = f" ({', '.join(genres[:_NAMED])}{more})" if genres else ""
    which = "1 take without counts is" if len(without) == 1 else f"{len(without)} takes without counts are"
    return (f"{which} left out beside counted ones{of}",)


def _genre_note(
    genre: str,
    danced_s: Mapping[str, float],
    counted: Mask,
    plan: Plan,
    repertoire: Repertoire,
    take_allowed: Mask,
) -> tuple[str, ...]:
    """A note if less than half of what is danced is of the genre asked for, and why if its takes say so."""
    of_genre = [index for index, take in enumerate(repertoire.takes) if take.credits.genre == genre]
    total_s = sum(danced_s.values())
    genre_s = sum(danced_s.get(repertoire.takes[take].name, 0.0) for take in of_genre)
    if genre_s >= _MOST * total_s:
        return ()
    metres = sorted({repertoire.counts(take).metre for take in of_genre if counted[take]} - {0})
    why = ""
    if not take_allowed[of_genre].any():
        why = ": they are banned"
    elif plan.seconds and not np.isin(repertoire.clip_take, of_genre).any():
        why = f": they are shorter than {CLIP_S} s"
    elif counted.any() and not counted[of_genre].any():
        why = ": they have no counts, others have"
    elif plan.metre and metres and plan.metre not in metres:
        why = f": they are counted in {' or '.join(map(str, metres))}, the song in {plan.metre}"
    return (f"{genre} was asked for, but its takes dance {genre_s:.0f} of {total_s:.0f} s{why}",)
