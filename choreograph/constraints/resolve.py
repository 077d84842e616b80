"""Constraints held against a repertoire and a song: one slot per word of the dance, and no contradictions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from choreograph.constraints.spec import Constraints, MotifPin, TakePin
from choreograph.errors import ParameterError
from choreograph.motifs.goals import MotifGoal, motif_goal
from choreograph.repertoire import Repertoire

_TOUCH_S = 1e-6


@dataclass(frozen=True, eq=False)
class ResolvedConstraints:
    """What each word of one dance may be; slots count the words from 0."""

    requested: Constraints
    bounds_s: NDArray[np.float64]  # (N + 1,) times at which words begin and end
    motifs: dict[int, int]  # slot -> motif that must be danced there
    takes: dict[int, int]  # slot -> take that must be danced there
    pinned: frozenset[int]  # slots with a pinned motif
    take_allowed: NDArray[np.bool_]  # (takes,)
    motif_banned: NDArray[np.bool_]  # (K,); empty without a vocabulary

    @property
    def n_words(self) -> int:
        """Number of words N."""
        return len(self.bounds_s) - 1

    @property
    def constrains_motifs(self) -> bool:
        """Whether some motif must be danced, or must not."""
        return bool(self.motifs) or bool(self.motif_banned.any())


def resolve(
    constraints: Constraints, repertoire: Repertoire, bounds_s: NDArray[np.float64], duration_s: float
) -> ResolvedConstraints:
    """The constraints on each word of a dance whose words begin and end at `bounds_s` (N + 1,).

    Raises
    ------
    ParameterError    an unknown motif, genre or take; a pin outside the dance; pins or bans that contradict
                      each other; a signature of another vocabulary
    RepertoireError   motifs are requested of a repertoire without motifs
    """
    n_motifs = repertoire.vocabulary.n_motifs if constraints.need_motifs or repertoire.has_vocabulary else 0
    if constraints.genre is not None:
        repertoire.vocabulary.genre_index(constraints.genre)
    take_allowed, motif_banned = _bans(constraints, repertoire, n_motifs)
    motifs = {
        slot: _checked_motif(motif, n_motifs)
        for slot, motif in enumerate(constraints.motifs[: len(bounds_s) - 1])
    }
    pinned: dict[int, MotifPin] = {}
    takes: dict[int, tuple[int, TakePin]] = {}
    for pin in constraints.pins:
        if isinstance(pin, MotifPin):
            slot = _slot_of(pin, bounds_s, duration_s)
            _checked_motif(pin.motif, n_motifs)
            other = pinned.setdefault(slot, pin)
            if other.motif != pin.motif:
                raise ParameterError(f"expected one motif in one beat, got {other} and {pin}: give up one")
            motifs[slot] = pin.motif
        else:
            index = _allowed_take(pin, repertoire, take_allowed)
            for slot in _slots_of(pin, bounds_s, duration_s):
                _, first = takes.setdefault(slot, (index, pin))
                if first.take != pin.take:
                    raise ParameterError(
                        f"expected pins of takes that do not overlap, got {first} and {pin}: give up one or "
                        "shorten it"
                    )
    resolved = ResolvedConstraints(
        constraints, bounds_s, motifs, {slot: index for slot, (index, _) in takes.items()},
        frozenset(pinned), take_allowed, motif_banned,
    )  # fmt: skip
    if motifs:
        _check_words_exist(resolved, repertoire)
    return resolved


def target_goal(constraints: Constraints, repertoire: Repertoire, genre: str | None = None) -> MotifGoal:
    """Signature and motif transitions as requested, or else of a genre, or else of all takes.

    Raises `ParameterError` for an unknown genre or a signature of another vocabulary.
    """
    shares = None if constraints.signature is None else np.array(constraints.signature)
    n_motifs = repertoire.vocabulary.n_motifs
    if shares is not None and len(shares) != n_motifs:
        raise ParameterError(
            f"expected a signature of this repertoire's {n_motifs} motifs, got {len(shares)} shares: it may "
            "be of another repertoire"
        )
    return motif_goal(repertoire.vocabulary, genre=constraints.genre or genre, signature=shares)


def _bans(
    constraints: Constraints, repertoire: Repertoire, n_motifs: int
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Takes that may be danced, and motifs that may not."""
    take_allowed, motif_banned = np.ones(len(repertoire.takes), bool), np.zeros(n_motifs, bool)
    genres = [take.credits.genre for take in repertoire.takes]
    for ban in constraints.bans:
        if ban.take is not None:
            take_allowed[_take_index(ban.take, repertoire)] = False
        elif ban.genre is not None:
            if ban.genre not in genres:
                known = ", ".join(sorted({genre for genre in genres if genre}))
                raise ParameterError(f"expected a ban of a genre among {known}, got {ban.genre!r}")
            take_allowed[[genre == ban.genre for genre in genres]] = False
        elif ban.motif is not None:
            motif_banned[_checked_motif(ban.motif, n_motifs)] = True
    if not take_allowed.any():
        given = ", ".join(map(str, constraints.bans))
        raise ParameterError(f"expected bans that leave a take, got {given}: every take is banned")
    return take_allowed, motif_banned


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
        raise ParameterError(f"expected pins of takes that are not banned, got {pin}: give up one")
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
    """Raise `ParameterError` where the constraints leave no word to dance."""
    vocabulary = repertoire.vocabulary
    for slot, motif in resolved.motifs.items():
        at = f"{resolved.bounds_s[slot]:.1f} s"
        if resolved.motif_banned[motif]:
            raise ParameterError(
                f"expected motifs that are not banned, got motif {motif} at {at}: give up one"
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
