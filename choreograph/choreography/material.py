"""The material of each part of a dance: the takes of its genre, their counts on the song's, and its goal."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from choreograph.choreography.constraints import Constraints, excludes
from choreograph.choreography.genres import genre_note, likely_genres
from choreograph.choreography.motif_sequences import MotifGoal, motif_goal
from choreograph.core.counts import Counts, make_counts
from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats
from choreograph.core.timebase import CLIP_S, MAX_SLOPE, MIN_SLOPE
from choreograph.library.repertoire import Repertoire
from choreograph.library.vocabulary import ALL_GENRES, Vocabulary
from choreograph.music.bars import tempo_bpm
from choreograph.music.count_grids import FEWEST_COUNTS
from choreograph.music.song_features import SongFeatures
from choreograph.plan.plan import Plan
from choreograph.settings import DanceConfig

Mask = NDArray[np.bool_]

# A take suits a signature if their overlap is at least this share of the best take's. Takes of one genre have
# 0.3 to 0.6 of their words in common with its signature, those of another genre rarely more than 0.1.
_SUITS = 0.25


@dataclass(frozen=True, eq=False)
class SectionGoal:
    """The goal of a part of the song, from one second to the next goal, and the takes that dance it."""

    first_second: int
    goal: MotifGoal
    takes: Mask  # (takes,) of the genre or that suit the signature, or all of them
    genre: str | None = None  # None for a goal without a genre
    requested: bool = False

    def takes_among(self, allowed: Mask) -> Mask:
        """The takes (takes,) among those `allowed`, or all of these if there is none."""
        both: Mask = self.takes & allowed
        return both if both.any() else allowed


@dataclass(frozen=True, eq=False)
class Material:
    """The material of a dance to one song.

    A dance is danced on `counts`. They are the beats of the song. If all takes of a requested genre, or all
    that may be danced, are in other metres, they are the counts of these on the bars of the song
    (`counts_on_bars`).
    """

    goals: tuple[SectionGoal, ...]  # in order, the first from second 0 on. None without motifs
    counts: Counts
    notes: tuple[str, ...] = ()  # on genres that were not requested
    metre_notes: tuple[str, ...] = ()  # on counts that are not the song's

    @property
    def is_requested(self) -> bool:
        """Whether a genre or a signature is requested."""
        return any(goal.requested for goal in self.goals)

    def parts_at(self, times_s: Floats) -> NDArray[np.int64]:
        """The index (N,) of the goal at each time in the song."""
        firsts = [goal.first_second for goal in self.goals]
        at: NDArray[np.int64] = np.searchsorted(firsts, times_s, side="right") - 1
        return at.clip(min=0)

    def takes_at(self, times_s: Floats, allowed: Mask) -> Mask:
        """The takes (N, takes) of the goal at each time, among those `allowed` (takes,)."""
        if not self.goals:
            return np.tile(allowed, (len(times_s), 1))
        among: Mask = np.stack([goal.takes_among(allowed) for goal in self.goals])
        return among[self.parts_at(times_s)]


def choose_material(
    song_features: SongFeatures, repertoire: Repertoire, constraints: Constraints
) -> Material:
    """The material as requested, or else of the likely genre of each part of the song.

    Raises `ParameterError` for an unknown genre or a signature of another vocabulary, `RepertoireError` if
    one of these is requested of a repertoire without motifs.
    """
    if constraints.genre is None and constraints.signature is None:
        goals, notes = _likely_goals(song_features, repertoire, constraints)
        bans = constraints.bans
        takes = np.array(
            [not any(excludes(ban, t.name, t.credits) for ban in bans) for t in repertoire.takes]
        )
        if goals:
            takes = np.any([goal.takes_among(takes) for goal in goals], axis=0)
        counts, metre_notes = _counts_of_takes(
            song_features.counts, repertoire, takes, "all that may be danced"
        )
        return Material(tuple(goals), counts, notes, metre_notes)
    goal = _requested_goal(repertoire, constraints)
    counts, metre_notes = _counts_of_takes(
        song_features.counts, repertoire, goal.takes, goal.genre or "the signature"
    )
    return Material((goal,), counts, metre_notes=metre_notes)


def _requested_goal(repertoire: Repertoire, constraints: Constraints) -> SectionGoal:
    genre, goal = constraints.genre, target_goal(constraints, repertoire)
    if genre is not None and genre != ALL_GENRES:
        takes = takes_of_genre(repertoire, genre)
    elif constraints.signature is not None:
        takes = takes_of_signature(repertoire.vocabulary, goal.signature, len(repertoire.takes))
    else:
        takes = np.ones(len(repertoire.takes), bool)
    return SectionGoal(0, goal, takes, genre, requested=True)


def _likely_goals(
    song_features: SongFeatures, repertoire: Repertoire, constraints: Constraints
) -> tuple[list[SectionGoal], tuple[str, ...]]:
    """The goals of the likely genre of each part of the song, and a note. There may be none."""
    if not repertoire.has_vocabulary:
        return [], ()
    every = np.ones(len(repertoire.takes), bool)
    if constraints.motifs:
        return [SectionGoal(0, target_goal(constraints, repertoire), every)], ()
    parts = likely_genres(song_features, repertoire, constraints)
    goals = []
    stops = [*(part.first_second for part in parts[1:]), song_features.n_seconds]
    for part, stop in zip(parts, stops, strict=True):
        second, genre = part.first_second, part.genre
        of_genre = every if genre == ALL_GENRES else takes_of_genre(repertoire, genre)
        lengths_s = (repertoire.takes[take].duration_s for take in np.flatnonzero(of_genre))
        long_enough = sum(lengths_s) >= stop - second
        goal = target_goal(constraints, repertoire, genre)
        goals.append(SectionGoal(second, goal, of_genre if long_enough else every, genre))
    return goals, (genre_note(parts),)


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


def takes_of_genre(repertoire: Repertoire, genre: str) -> Mask:
    """Which takes (takes,) are of a genre. All takes are of `ALL_GENRES`."""
    return np.array([genre in (take.credits.genre, ALL_GENRES) for take in repertoire.takes])


def takes_of_signature(vocabulary: Vocabulary, signature: Floats, n_takes: int) -> Mask:
    """Which takes (takes,) have motifs of a signature (K,), by the overlap of their own with it."""
    overlap = np.zeros(n_takes)
    for take in np.unique(vocabulary.word_take).tolist():
        motifs = vocabulary.word_motif[vocabulary.words_of_take(int(take))]
        own = np.bincount(motifs, minlength=vocabulary.n_motifs) / len(motifs)
        overlap[take] = np.minimum(own, signature).sum()
    suits: Mask = overlap >= _SUITS * overlap.max()
    return suits


# The counts of a genre in another metre than the song, aligned with the bars of the song as dancers do.
#
# A bar of the genre lasts one bar of the song, or half of one, or two of them. If it has fewer counts than
# there are beats, each count is on a beat, and the first counts are the long ones. A waltz on a bar of four
# is danced slow, quick, quick. If it has more counts, each beat has one, and the last beats have two. Both
# halves of a bar of six begin with a count if possible, so two bars of waltz are danced on it.


_BARS_IN_BARS = ((1, 1), (2, 1), (1, 2))  # bars of the genre in bars of the song
_OTHER_BARS = 0.5  # penalty, in octaves of tempo, of bars that do not last one bar of the song
_OFF_MIDDLE = 2.0  # the same, of bars of six (6/8) whose second half does not begin with a count
_TOO_FAR = 10.0  # distance of a take that would have to be danced at over double or under half its speed


def counts_on_bars(counts: Counts, metre: int, bpm: ArrayLike) -> Counts:
    """The counts of a dance in another metre on the bars of a song.

    `counts` are those of the song, `metre` the counts in a bar of the dance, and `bpm` (X,) the tempi of its
    takes, which determine how many bars a bar lasts. The nearest quarter of the takes decides, since these
    will be danced. Bars of the song that are in the dance's metre keep their beats as counts.
    """
    downbeats = np.flatnonzero(counts.numbers == 1)
    if counts.metre == metre or len(downbeats) < 2:
        return counts
    count_beats = tempo_bpm(counts) / np.atleast_1d(bpm)[:, None]  # (X, 1) length of a count of the takes

    def penalty(way: tuple[int, int]) -> float:
        """The distance of a way of counting from the tempi of the takes, in octaves, plus other faults."""
        n_beats = way[1] * counts.metre
        on = _beats_of_counts(way[0] * metre, n_beats)
        away = np.abs(np.log2(count_beats / np.diff(on).mean())[:, 0])
        speeds = count_beats / np.diff(on)  # (X, counts)
        away[(speeds.min(axis=1) < MIN_SLOPE) | (speeds.max(axis=1) > MAX_SLOPE)] = _TOO_FAR
        off_middle = not np.isin(np.arange(3, n_beats if counts.metre == 6 else 0, 6), on).all()
        faults = _OTHER_BARS * (way != _BARS_IN_BARS[0]) + _OFF_MIDDLE * off_middle
        return float(np.percentile(away, 25, method="lower") + faults)

    of_dance, of_song = min(_BARS_IN_BARS, key=penalty)
    starts = [*downbeats.tolist(), int(downbeats[-1]) + counts.metre]
    beats, numbers = [], []
    for first in range(0, len(starts) - 1, of_song):
        start, stop = starts[first], starts[min(first + of_song, len(starts) - 1)]
        n_counts = metre if stop - start == metre else of_dance * metre
        beats.append(start + _beats_of_counts(n_counts, stop - start)[:-1])
        numbers.append(np.arange(n_counts) % metre + 1)
    at = np.concatenate(beats)
    inside = at <= len(counts) - 1
    times_s = np.interp(at[inside], np.arange(len(counts)), counts.times_s)
    return make_counts(
        times_s, np.concatenate(numbers)[inside], metre, source=counts.source, confidence=counts.confidence
    )


def _beats_of_counts(n_counts: int, n_beats: int) -> Floats:
    """The beats (n_counts + 1,), from 0 and fractional, of the counts of a bar and of its end."""
    counts, beats = np.arange(n_counts + 1), np.arange(n_beats + 1)
    if n_counts <= n_beats:
        return -(-(counts * n_beats) // n_counts).astype(np.float64)
    return np.interp(counts, beats * n_counts // n_beats, beats)


def counts_of_genre(counts: Counts, repertoire: Repertoire, genre: str) -> tuple[Counts, tuple[str, ...]]:
    """The counts on which a genre is danced to a song, and a note if these are not those of the song."""
    return _counts_of_takes(counts, repertoire, takes_of_genre(repertoire, genre), genre)


def _counts_of_takes(
    counts: Counts, repertoire: Repertoire, takes: Mask, name: str
) -> tuple[Counts, tuple[str, ...]]:
    """The counts on which takes are danced, and a note if these are not those of the song."""
    tempi = repertoire.take_tempi
    in_bars = takes & (tempi.metre > 0) & (tempi.n_counts > 1)
    metres = tempi.metre[in_bars]
    if not counts.has_bars or len(metres) == 0 or counts.metre in metres:
        return counts, ()
    metre = int(np.bincount(metres).argmax())
    laid = counts_on_bars(counts, metre, tempi.bpm[in_bars & (tempi.metre == metre)])
    if laid is counts:
        return counts, ()
    return laid, (f"the bars of takes in {metre} ({name}) are danced on bars in {counts.metre}",)


# What is missing from a finished plan: takes of a requested genre, and takes without counts.


_MOST = 0.95  # share of what was requested in a dance: a note is made below it
_NAMED = 4  # genres in a note


def missing_from_plan(
    plan: Plan,
    repertoire: Repertoire,
    material: Material,
    requested: Constraints,
    take_allowed: Mask,
    config: DanceConfig,
) -> tuple[str, ...]:
    """Notes on what is missing from a dance of takes. There is none on the motion of a network."""
    names = [take.name for take in repertoire.takes]
    danced_s = {source: time_s for source, time_s in plan.takes_s().items() if source in names}
    if not danced_s:
        return ()
    counted = repertoire.take_tempi.n_counts >= FEWEST_COUNTS
    if material.is_requested:
        (goal,) = material.goals
        return _request_note(goal, danced_s, plan, repertoire, requested, take_allowed)
    by_counts = config.warping == "counts" and len(plan.music_beats_s) >= FEWEST_COUNTS
    without = np.flatnonzero(take_allowed & ~counted)
    if not by_counts or len(without) == 0 or any(name in danced_s for name in np.array(names)[~counted]):
        return ()
    genres = sorted({repertoire.takes[take].credits.genre for take in without} - {""})
    more = f" and {len(genres) - _NAMED} more" if len(genres) > _NAMED else ""
    of = f" ({', '.join(genres[:_NAMED])}{more})" if genres else ""
    which = "1 take without counts is" if len(without) == 1 else f"{len(without)} takes without counts are"
    return (f"{which} not danced, because other takes have counts{of}",)


def _request_note(
    goal: SectionGoal,
    danced_s: Mapping[str, float],
    plan: Plan,
    repertoire: Repertoire,
    requested: Constraints,
    take_allowed: Mask,
) -> tuple[str, ...]:
    """A note if the takes that were requested are not nearly all of the dance, with the reason if known."""
    wanted = np.flatnonzero(goal.takes)
    total_s = sum(danced_s.values())
    wanted_s = sum(danced_s.get(repertoire.takes[take].name, 0.0) for take in wanted)
    if wanted_s >= _MOST * total_s:
        return ()
    why = ""
    if not take_allowed[wanted].any():
        why = ": they are banned"
    elif plan.seconds and not np.isin(repertoire.clip_take, wanted).any():
        why = f": they are shorter than {CLIP_S} s"
    elif requested.pins:
        why = ": others are pinned"
    what = goal.genre or "a signature"
    return (f"{what} was requested, but its takes are danced for {wanted_s:.0f} of {total_s:.0f} s{why}",)
