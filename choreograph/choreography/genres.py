"""The genre that suits a song, section by section."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from choreograph.choreography.constraints import Constraints
from choreograph.choreography.selection import genre_distances
from choreograph.core.numerics import Floats
from choreograph.library.motifs import ALL_GENRES
from choreograph.library.repertoire import Repertoire
from choreograph.music.metrical_level import at_changes, change_times_s
from choreograph.music.song_features import SongFeatures

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
