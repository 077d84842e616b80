"""The genre that suits a song, section by section, and the goals of the dance's parts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from choreograph.choreography.constraints import Constraints
from choreograph.choreography.engine import DanceRequest
from choreograph.choreography.motif_sequences import MotifGoal
from choreograph.choreography.selection import genre_distances
from choreograph.choreography.slots import ResolvedConstraints, target_goal
from choreograph.core.numerics import Floats
from choreograph.core.timebase import CLIP_S
from choreograph.library.motifs import ALL_GENRES
from choreograph.library.repertoire import Repertoire
from choreograph.music.count_grids import FEWEST_COUNTS
from choreograph.music.metrical_level import at_changes, change_times_s
from choreograph.music.song_features import SongFeatures
from choreograph.plan import Plan
from choreograph.settings import DanceConfig

_NEAREST = "no genre given: the dance follows {}, whose takes are nearest to the song in style"
_FALLBACK = "no genre given: the style decides on none, and the dance follows all takes together"
_PER_DISTANCE = 0.025  # loss per squared distance. Neighbouring seconds have similar distances
_FAR = 20.0  # limit of squared distance beyond the nearest genre's: a few seconds do not decide for a section
# Loss added to a genre if none of its takes has the metre of a second. It is larger than any loss of style,
# since a dance in another metre does not fit the bars. At 0.3, a rumba at a waltz's tempo was danced as
# waltz.
_OTHER_METRE = 0.6
# The loss that a change of genre must save, summed over seconds.
_CHANGE_OF_TEMPO = 0.3  # where a section begins at another tempo or metre
_CHANGE_AT_SECTION = 3.0
_CHANGE_INSIDE = 6.0
_SEGMENT_S = 4  # seconds that the style of a second describes


def choose_goal(
    song_features: SongFeatures, repertoire: Repertoire, constraints: Constraints
) -> tuple[MotifGoal, tuple[str, ...]]:
    """Signature and motif transitions as requested, or of the genre nearest to the whole song, and notes.

    Raises `ParameterError` for an unknown genre or a signature of another vocabulary, `RepertoireError` for a
    repertoire without one.
    """
    genre = constraints.genre
    if genre is not None or constraints.signature is not None or constraints.motifs:
        return target_goal(constraints, repertoire, genre), ()
    genre = likely_genre(song_features, repertoire, constraints)
    return target_goal(constraints, repertoire, genre), (genre_note([genre]),)


def genre_note(genres: list[str]) -> str:
    """The note that a dance follows the likely genres, one for each part of the song."""
    return _FALLBACK if ALL_GENRES in genres else _NEAREST.format(", then ".join(genres))


def likely_genre(song_features: SongFeatures, repertoire: Repertoire, constraints: Constraints) -> str:
    """The genre nearest in style over the whole song, among those that are not banned.

    It is `ALL_GENRES` without style networks, or if no take has a genre.
    """
    genres, losses = _genre_losses(song_features, repertoire, constraints)
    return genres[int(np.argmin(losses.mean(axis=0)))] if genres else ALL_GENRES


def likely_genres(
    song_features: SongFeatures, repertoire: Repertoire, constraints: Constraints
) -> list[tuple[int, str]]:
    """(first second, genre) of each part of the song that is nearest to one genre, as in `likely_genre`.

    Dynamic programming finds the least sum of losses over all seconds. A change adds the least loss where a
    section begins at another tempo or metre, and the most inside a section.
    """
    genres, losses = _genre_losses(song_features, repertoire, constraints)
    if not genres:
        return [(0, ALL_GENRES)]
    change_loss = _change_losses(song_features)
    reached, parents = losses[0], []
    for of_second, loss in zip(losses[1:], change_loss[1:], strict=True):
        changed = reached.min() + loss
        parents.append(np.where(reached <= changed, np.arange(len(genres)), np.argmin(reached)))
        reached = np.minimum(reached, changed) + of_second
    chosen = [int(np.argmin(reached))]
    for parent in reversed(parents):
        chosen.append(int(parent[chosen[-1]]))
    chosen.reverse()
    firsts = [second for second in range(len(chosen)) if second == 0 or chosen[second] != chosen[second - 1]]
    return [(second, genres[chosen[second]]) for second in firsts]


def _change_losses(song_features: SongFeatures) -> Floats:
    """The loss that a change of genre adds in each second, (S,)."""
    change_loss = np.full(song_features.n_seconds, _CHANGE_INSIDE)
    starts = _section_starts(song_features)
    change_loss[starts] = _CHANGE_AT_SECTION
    change_loss[starts[at_changes(starts, change_times_s(song_features.counts))]] = _CHANGE_OF_TEMPO
    return change_loss


def _section_starts(song_features: SongFeatures) -> NDArray[np.int64]:
    """The seconds (P,) nearest to where sections begin, from 0 on."""
    bounds_s = song_features.sections.bounds_s[1:-1]
    starts = np.unique(np.concatenate([[0], np.round(bounds_s)])).astype(np.int64)
    return starts[starts < song_features.n_seconds]


def _genre_losses(
    song_features: SongFeatures, repertoire: Repertoire, constraints: Constraints
) -> tuple[list[str], Floats]:
    """The genres that may be danced, and the loss of each second and genre (S, G).

    The loss is the distance in style, over the 4 s around the second that are in its section. It is larger
    for genres of another metre than the song has there. There is no genre without style vectors.
    """
    banned = {ban.genre for ban in constraints.bans}
    of_take = np.array([take.credits.genre for take in repertoire.takes])
    with_clips = set(of_take[np.unique(repertoire.clip_take)])
    genres = [genre for genre in repertoire.vocabulary.genres if genre in with_clips - banned]
    if not genres or not song_features.style.any():
        return [], np.zeros((song_features.n_seconds, 0))
    of_clip = np.array([genres.index(g) if g in genres else -1 for g in of_take])[repertoire.clip_take]
    known = of_clip >= 0
    away = genre_distances(song_features.style, repertoire.clip_style[known], of_clip[known])
    away = np.minimum(away - away.min(axis=1, keepdims=True), _FAR)
    return genres, _within_sections(_PER_DISTANCE * away, song_features) + _metre_losses(
        song_features, repertoire, of_take, genres
    )


def _within_sections(losses: Floats, song_features: SongFeatures) -> Floats:
    """Losses (S, G) of the 4 s from each second, or from earlier where these reach into another section."""
    borders = [*_section_starts(song_features)[1:], song_features.n_seconds]
    seconds = np.arange(len(losses))
    starts = [0, *borders[:-1]]
    for start, stop in zip(starts, borders, strict=True):
        seconds[start:stop] = np.minimum(seconds[start:stop], max(start, stop - _SEGMENT_S))
    return losses[seconds]


def _metre_losses(
    song_features: SongFeatures, repertoire: Repertoire, of_take: NDArray[np.str_], genres: list[str]
) -> Floats:
    """The loss (S, G) of genres for the metre of the song."""
    counts = song_features.counts
    added = np.zeros((song_features.n_seconds, len(genres)))
    if not counts.has_bars:
        return added
    metres = np.array([repertoire.counts(take).metre for take in range(len(of_take))])
    metre_at = song_metre_at(song_features)
    for column, genre in enumerate(genres):
        known = metres[(of_take == genre) & (metres > 0)]
        if len(known):
            other = np.array([np.mean(known != metre) if metre else 0.0 for metre in metre_at])
            added[:, column] = _OTHER_METRE * counts.confidence * other
    return added


def song_metre_at(song_features: SongFeatures) -> NDArray[np.int64]:
    """Beats in the bar around the middle of each second (S,), 0 if there is no bar."""
    counts = song_features.counts
    metre = np.zeros(song_features.n_seconds, np.int64)
    downbeats = np.flatnonzero(counts.numbers == 1)
    if len(downbeats) < 2:
        return metre
    length = np.diff(downbeats)  # (bars,)
    bar = np.searchsorted(counts.times_s[downbeats], np.arange(song_features.n_seconds) + 0.5, "right") - 1
    return length[np.clip(bar, 0, len(length) - 1)].astype(np.int64)


# The goals of a dance's parts: signature and motif transitions of the genre that suits the music there.


@dataclass(frozen=True, eq=False)
class SectionGoal:
    """The goal from one second of the song on, to where the next begins."""

    first_second: int
    goal: MotifGoal
    genre: str | None = None  # None for a goal without a genre


def section_goals(request: DanceRequest) -> tuple[list[SectionGoal], tuple[str, ...]]:
    """The goals of the dance as requested, or of the likely genre of each part of the song, and notes.

    There is no goal if the style does not decide on a genre. The mixture of all genres is not used, because a
    waltz would then contain tangos.
    """
    repertoire, constraints = request.repertoire, request.constraints.requested
    if constraints.genre is not None or constraints.signature is not None:
        return [SectionGoal(0, target_goal(constraints, repertoire), constraints.genre)], ()
    if not repertoire.has_vocabulary:
        return [], ()
    parts = likely_genres(request.song_features, repertoire, constraints)
    if parts[0][1] == ALL_GENRES:
        return [], ()
    goals = [
        SectionGoal(second, target_goal(constraints, repertoire, genre), genre) for second, genre in parts
    ]
    return goals, (genre_note([genre for _, genre in parts]),)


# What is missing from a finished plan: takes of a requested genre, and takes without counts.
#
# Engines prefer counted takes of the song's metre, but no cost forbids the others. Only the plan shows it.


Mask = NDArray[np.bool_]

_MOST = 0.5  # share of the requested genre in a dance: a note is made below it
_NAMED = 4  # genres in a note


def missing_from_plan(
    plan: Plan, repertoire: Repertoire, constraints: ResolvedConstraints, config: DanceConfig
) -> tuple[str, ...]:
    """Notes on what is missing from a dance of takes. There is none on the motion of a network."""
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
    return (f"{which} not danced, because other takes have counts{of}",)


def _genre_note(
    genre: str,
    danced_s: Mapping[str, float],
    counted: Mask,
    plan: Plan,
    repertoire: Repertoire,
    take_allowed: Mask,
) -> tuple[str, ...]:
    """A note if less than half of the dance is of the requested genre, with the reason if it is known."""
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
        why = ": they have no counts, and other takes have"
    elif plan.metre and metres and plan.metre not in metres:
        why = f": they are counted in {' or '.join(map(str, metres))}, the song in {plan.metre}"
    return (f"{genre} was requested, but its takes are danced for {genre_s:.0f} of {total_s:.0f} s{why}",)
