"""Constraints and kept parts, checked against a repertoire and a song, with one slot for each word."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from choreograph.choreography.constraints import Ban, Constraints, Keep, MotifPin, TakePin, excludes
from choreograph.choreography.material import Material
from choreograph.choreography.motif_sequences import shares_on_count
from choreograph.core.counts import UNKNOWN, Counts, bar_positions
from choreograph.core.errors import ParameterError
from choreograph.core.timebase import seconds_to_frames
from choreograph.library.repertoire import Repertoire
from choreograph.library.vocabulary import Vocabulary, dance_bounds_s
from choreograph.motion.motion import Motion
from choreograph.plan.plan import LENGTH_SLACK_S, Plan

# A dance with parts that are kept in another one.


_FEWEST_GIVEN = 8  # motifs of which the counts are compared
_LATEST_SLOT = 8  # before which a given sequence of motifs begins: a bar, or two of four counts
SHORTEST_GAP_S = 2.0  # two transitions of half a second, and a second between them
_SHORTEST_END_S = 1.0  # before or after all kept parts: one transition, and half a second beside it
_TOUCH_S = 1e-6


@dataclass(frozen=True, eq=False)
class KeptDance:
    """A dance of which some parts are kept. The gaps between them are planned again."""

    motion: Motion  # (T frames) the whole dance, at the rate of the new one
    duration_s: float  # of the new dance, which may be a few frames shorter or longer
    spans: tuple[Keep, ...]  # in order, disjoint
    name: str  # of its file, for the plan
    plan: Plan | None = None  # of the whole dance, if it is known
    notes: tuple[str, ...] = ()  # on what is kept beyond the request

    @property
    def frames(self) -> list[tuple[int, int]]:
        """Each span as its first frame, and the one after its last."""
        fps, n_frames = self.motion.fps, self.motion.n_frames
        return [
            (seconds_to_frames(keep.start_s, fps), min(seconds_to_frames(keep.end_s, fps), n_frames))
            for keep in self.spans
        ]

    @property
    def gaps_s(self) -> list[tuple[float, float]]:
        """The spans that are planned again, in order."""
        borders_s = [s for keep in self.spans for s in (keep.start_s, keep.end_s)]
        times_s = [0.0, *(min(s, self.duration_s) for s in borders_s), self.duration_s]
        pairs = zip(times_s[::2], times_s[1::2], strict=True)
        return [(start_s, end_s) for start_s, end_s in pairs if end_s - start_s > _TOUCH_S]

    def keeps(self, start_s: float, end_s: float) -> bool:
        """Whether any part of a span is kept."""
        return any(start_s < k.end_s and k.start_s < end_s for k in self.spans)


def kept_dance(
    motion: Motion, keeps: Sequence[Keep], duration_s: float, *, name: str, plan: Plan | None = None
) -> KeptDance:
    """A dance with the parts that are kept in another dance of `duration_s`.

    A rest at the start or end that is shorter than a second is kept as well, with a note. Raises
    `ParameterError` if there is no part to keep, one is empty or outside the dance, two overlap, a gap is
    shorter than 2 s, nothing is left to dance, or the motion is not as long as the dance.
    """
    for keep in keeps:
        if not 0 <= keep.start_s < keep.end_s <= duration_s + LENGTH_SLACK_S:
            raise ParameterError(
                f"expected a part to keep with a start before its end, within the dance of "
                f"{duration_s:g} s, got {keep}"
            )
    if not keeps:
        raise ParameterError("expected a part to keep of the existing dance, got none")
    if abs(motion.duration_s - duration_s) > LENGTH_SLACK_S:
        raise ParameterError(
            f"expected a dance of {duration_s:.1f} s to keep parts of, got one of {motion.duration_s:.1f} s: "
            "is it to another song, or to another part of it?"
        )
    spans, notes = _to_the_ends(sorted(keeps, key=lambda keep: keep.start_s), duration_s)
    borders_s = [0.0, *(at for keep in spans for at in (keep.start_s, keep.end_s)), duration_s]
    gaps_s = [stop - start for start, stop in zip(borders_s[::2], borders_s[1::2], strict=True)]
    if min(gaps_s) < -_TOUCH_S:
        raise ParameterError(f"expected parts that do not overlap, got {', '.join(map(str, spans))}")
    if max(gaps_s) <= _TOUCH_S:
        raise ParameterError("expected a part of the dance that is not kept, got none: all of it is kept")
    short = [gap for gap in gaps_s[1:-1] if _TOUCH_S < gap < SHORTEST_GAP_S]
    if short:
        raise ParameterError(
            f"expected gaps of {SHORTEST_GAP_S:g} s or more between what is kept, got one of {short[0]:.2f} "
            "s: keep less, or all of it"
        )
    return KeptDance(motion, duration_s, tuple(spans), name, plan, notes)


def _to_the_ends(keeps: Sequence[Keep], duration_s: float) -> tuple[list[Keep], tuple[str, ...]]:
    """The parts in order, extended to the start or end of the dance if little is left there, and notes."""
    spans = list(keeps)
    before_s, after_s = keeps[0].start_s, duration_s - keeps[-1].end_s
    if before_s < _SHORTEST_END_S:
        spans[0] = replace(spans[0], start_s=0.0)
    if after_s < _SHORTEST_END_S:
        spans[-1] = replace(spans[-1], end_s=duration_s)
    too_short = [
        f"the {which} {left_s:.2f} s"
        for which, left_s in (("first", before_s), ("last", after_s))
        if LENGTH_SLACK_S < left_s < _SHORTEST_END_S
    ]
    if not too_short:
        return spans, ()
    return spans, (
        f"{' and '.join(too_short)} of the existing dance are kept: too short to be planned again",
    )


def check_pins_in_gaps(constraints: Constraints, kept: KeptDance) -> None:
    """Raise `ParameterError` for a pin in a part that is kept."""
    for pin in constraints.pins:
        span_s = (pin.at_s, pin.at_s) if isinstance(pin, MotifPin) else (pin.start_s, pin.end_s)
        if kept.keeps(span_s[0] + _TOUCH_S, span_s[1] - _TOUCH_S):
            raise ParameterError(
                f"expected pins where the existing dance is not kept, got {pin}: move it into a gap"
            )


# Constraints checked against a repertoire and a song: one slot for each word, and no contradictions.


@dataclass(frozen=True, eq=False)
class ResolvedConstraints:
    """The constraints on each word of one dance. Slots are the indices of the words."""

    requested: Constraints
    counts: Counts  # what words begin on: see `choreography.material`
    bounds_s: NDArray[np.float64]  # (N + 1,) times at which words begin and end
    motifs: dict[int, int]  # slot -> motif that must be danced there
    takes: dict[int, int]  # slot -> take that must be danced there
    pinned: frozenset[int]  # slots with a pinned motif
    take_allowed: NDArray[np.bool_]  # (takes,) that are not banned
    take_wanted: NDArray[np.bool_]  # (N, takes) those of them that words are chosen from, if these have any
    motif_banned: NDArray[np.bool_]  # (K,), empty without a vocabulary
    first_given: int = 0  # slot of the first motif of a given sequence

    @property
    def n_words(self) -> int:
        """Number of words N."""
        return len(self.bounds_s) - 1

    @property
    def constrains_motifs(self) -> bool:
        """Whether a motif is required or banned."""
        return bool(self.motifs) or bool(self.motif_banned.any())


def resolve(
    constraints: Constraints, repertoire: Repertoire, material: Material, duration_s: float
) -> ResolvedConstraints:
    """The constraints on each word of a dance of `duration_s`, made of `material`.

    Raises
    ------
    ParameterError    if a motif, genre or take is unknown, a pin is outside the dance, pins or bans
                      contradict each other, or a signature is of another vocabulary
    RepertoireError   if motifs are requested of a repertoire without motifs
    """
    bounds_s = dance_bounds_s(material.counts.times_s, duration_s)
    n_motifs = repertoire.vocabulary.n_motifs if constraints.need_motifs or repertoire.has_vocabulary else 0
    if constraints.genre is not None:
        repertoire.vocabulary.genre_index(constraints.genre)
    take_allowed, motif_banned = resolve_bans(constraints, repertoire, n_motifs)
    take_wanted = material.takes_at(bounds_s[:-1], take_allowed)
    given = [_checked_motif(motif, n_motifs) for motif in constraints.motifs]
    first_given = _first_slot(given, repertoire, bar_positions(bounds_s[:-1], material.counts), take_wanted)
    motifs = dict(zip(range(first_given, len(bounds_s) - 1), given, strict=False))
    pinned: dict[int, MotifPin] = {}
    takes: dict[int, tuple[int, TakePin]] = {}
    for pin in constraints.pins:
        if isinstance(pin, MotifPin):
            slot = _slot_of(pin, bounds_s, duration_s)
            _checked_motif(pin.motif, n_motifs)
            other = pinned.setdefault(slot, pin)
            if other.motif != pin.motif:
                raise ParameterError(f"expected one motif in one beat, got {other} and {pin}: remove one")
            motifs[slot] = pin.motif
        else:
            index = _allowed_take(pin, repertoire, take_allowed)
            for slot in _slots_of(pin, bounds_s, duration_s):
                _, first = takes.setdefault(slot, (index, pin))
                if first.take != pin.take:
                    raise ParameterError(
                        f"expected pins of takes that do not overlap, got {first} and {pin}: remove one, or "
                        "shorten it"
                    )
    resolved = ResolvedConstraints(
        constraints, material.counts, bounds_s, motifs, {slot: index for slot, (index, _) in takes.items()},
        frozenset(pinned), take_allowed, take_wanted, motif_banned,
        first_given,
    )  # fmt: skip
    if motifs:
        _check_words_exist(resolved, repertoire)
    return resolved


def _first_slot(
    motifs: Sequence[int],
    repertoire: Repertoire,
    slot_position: NDArray[np.int64],
    take_wanted: NDArray[np.bool_],
) -> int:
    """The first slot at which a given sequence of motifs begins on the counts on which its words are danced.

    A song may begin within a bar. The sequence then begins up to a bar later: on the count on which a take
    dances it, or else where its motifs are danced on the counts of their slots (N,) by most of their words,
    since many motifs have a word on every count. It begins with the first slot if there are no counts, and if
    it has less than two bars of four.
    """
    if not motifs or not (slot_position != UNKNOWN).any():
        return 0
    vocabulary = repertoire.vocabulary
    positions = repertoire.word_positions
    n_compared = min(len(motifs), len(slot_position) - (_LATEST_SLOT - 1))
    if n_compared < _FEWEST_GIVEN:
        return 0
    danced = _position_in_takes(motifs, vocabulary, positions)
    on_it = np.flatnonzero(slot_position[:_LATEST_SLOT] == danced)
    if danced != UNKNOWN and len(on_it):
        return int(on_it[0])
    shares = shares_on_count(slot_position, positions, take_wanted, vocabulary)  # (N, K)
    slots = np.arange(_LATEST_SLOT)[:, None] + np.arange(n_compared)
    compared = shares[slots, np.array(motifs[:n_compared])]  # (first slots, motifs)
    known = np.isfinite(compared).all(axis=0)
    return int(np.argmax(compared[:, known].sum(axis=1)))


def _position_in_takes(motifs: Sequence[int], vocabulary: Vocabulary, positions: NDArray[np.int64]) -> int:
    """Where in the bar takes begin this sequence, or `UNKNOWN` if none has it or they begin it differently.

    `positions` (W,) are those of the words.
    """
    n = len(motifs)
    if n > len(vocabulary.word_motif):
        return UNKNOWN
    runs = np.lib.stride_tricks.sliding_window_view(vocabulary.word_motif, n)  # (W - n + 1, n)
    in_one_take = vocabulary.word_take[: len(runs)] == vocabulary.word_take[n - 1 :]
    found = np.unique(positions[: len(runs)][in_one_take & (runs == np.array(motifs)).all(axis=1)])
    return int(found[0]) if len(found) == 1 else UNKNOWN


_LISTED = 20  # names in an error


def resolve_bans(
    constraints: Constraints, repertoire: Repertoire, n_motifs: int
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Takes that may be danced, and motifs that may not."""
    take_allowed, motif_banned = np.ones(len(repertoire.takes), bool), np.zeros(n_motifs, bool)
    for ban in constraints.bans:
        if ban.take is not None:
            take_allowed[_take_index(ban.take, repertoire)] = False
        elif ban.motif is not None:
            motif_banned[_checked_motif(ban.motif, n_motifs)] = True
        else:
            excluded = np.array([excludes(ban, take.name, take.credits) for take in repertoire.takes])
            if not excluded.any():
                raise _unknown_in_credits(ban, repertoire)
            take_allowed[excluded] = False
    if not take_allowed.any():
        given = ", ".join(map(str, constraints.bans))
        raise ParameterError(f"expected bans that leave a take, got {given}: every take is banned")
    return take_allowed, motif_banned


def _unknown_in_credits(ban: Ban, repertoire: Repertoire) -> ParameterError:
    """The error for a ban of a genre, performer or licence that no take has."""
    kind, _, name = str(ban).partition(":")
    known = sorted({getattr(take.credits, kind) for take in repertoire.takes} - {""})
    among = ", ".join(known[:_LISTED]) + (f" and {len(known) - _LISTED} more" if len(known) > _LISTED else "")
    return ParameterError(f"expected a ban of a {kind} among {among or 'none'}, got {name!r}")


def _take_index(name: str, repertoire: Repertoire) -> int:
    names = [take.name for take in repertoire.takes]
    if name not in names:
        raise ParameterError(
            f"expected a take of {repertoire.path.name}, which has {len(names)}, got {name!r}"
        )
    return names.index(name)


def _allowed_take(pin: TakePin, repertoire: Repertoire, take_allowed: NDArray[np.bool_]) -> int:
    index = _take_index(pin.take, repertoire)
    if not take_allowed[index]:
        raise ParameterError(
            f"expected pins of takes that are not banned, got {pin}: remove the pin or the ban"
        )
    return index


def _checked_motif(motif: int, n_motifs: int) -> int:
    if not 0 <= motif < n_motifs:
        raise ParameterError(f"expected motifs 0 to {n_motifs - 1}, got motif {motif}")
    return motif


def _slot_of(pin: MotifPin, bounds_s: NDArray[np.float64], duration_s: float) -> int:
    if not 0 <= pin.at_s < duration_s:
        raise ParameterError(f"expected a pin within the dance, which lasts {duration_s:g} s, got {pin}")
    return int(np.clip(np.searchsorted(bounds_s, pin.at_s, side="right") - 1, 0, len(bounds_s) - 2))


def _slots_of(pin: TakePin, bounds_s: NDArray[np.float64], duration_s: float) -> range:
    if not 0 <= pin.start_s < pin.end_s <= duration_s + _TOUCH_S:
        raise ParameterError(
            f"expected a pin with a start before its end, within the dance of {duration_s:g} s, got {pin}"
        )
    first = np.searchsorted(bounds_s, pin.start_s + _TOUCH_S, side="right") - 1
    last = np.searchsorted(bounds_s, pin.end_s - _TOUCH_S, side="right") - 1
    return range(max(0, int(first)), min(int(last), len(bounds_s) - 2) + 1)


def _check_words_exist(resolved: ResolvedConstraints, repertoire: Repertoire) -> None:
    """Raise `ParameterError` if the constraints leave no word to dance in a slot."""
    vocabulary = repertoire.vocabulary
    for slot, motif in resolved.motifs.items():
        at = f"{resolved.bounds_s[slot]:.1f} s"
        if resolved.motif_banned[motif]:
            raise ParameterError(
                f"expected motifs that are not banned, got motif {motif} at {at}: remove the motif or the ban"
            )
        takes = vocabulary.word_take[vocabulary.words_of_motif(motif)]
        if not resolved.take_allowed[takes].any():
            raise ParameterError(
                f"expected motifs that a take has, got motif {motif} at {at}, whose takes are all banned"
            )
        if slot in resolved.takes and not (takes == resolved.takes[slot]).any():
            name = repertoire.takes[resolved.takes[slot]].name
            raise ParameterError(
                f"expected motifs of {name}, which is pinned at {at}, got motif {motif}: the take has none"
            )
