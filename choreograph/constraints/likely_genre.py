"""The genre of the repertoire that a song is nearest to, and the goal of a dance to it."""

from __future__ import annotations

import numpy as np

from choreograph.constraints.resolve import target_goal
from choreograph.constraints.spec import Constraints
from choreograph.features.song_features import SongFeatures
from choreograph.motifs.goals import MotifGoal
from choreograph.motifs.vocabulary import ALL_GENRES
from choreograph.repertoire import Repertoire
from choreograph.selection import take_losses

_NEAREST = "it follows {}, whose takes are nearest to the song in style"
_FALLBACK = {ALL_GENRES: "style does not decide on one, so it follows all takes together"}


def choose_goal(
    song_features: SongFeatures, repertoire: Repertoire, constraints: Constraints
) -> tuple[MotifGoal, tuple[str, ...]]:
    """Signature and motif transitions as requested, or of the genre nearest to the song; and notes.

    Raises `ParameterError` for an unknown genre or a signature of another vocabulary, `RepertoireError` for a
    repertoire without one.
    """
    genre = constraints.genre
    if genre is not None or constraints.signature is not None or constraints.motifs:
        return target_goal(constraints, repertoire, genre), ()
    genre = likely_genre(song_features, repertoire, constraints)
    return target_goal(constraints, repertoire, genre), (genre_note(genre),)


def genre_note(genre: str) -> str:
    """The note that a dance follows the likely genre."""
    return f"no genre given: {_FALLBACK.get(genre, _NEAREST.format(genre))}"


def likely_genre(song_features: SongFeatures, repertoire: Repertoire, constraints: Constraints) -> str:
    """The genre whose best clips have the least style loss over the whole song, of those not banned;
    `ALL_GENRES` without style networks, or if no take has a genre."""
    banned = {ban.genre for ban in constraints.bans}
    of_take = np.array([take.credits.genre for take in repertoire.takes])
    with_clips = set(of_take[np.unique(repertoire.clip_take)])
    genres = [genre for genre in repertoire.vocabulary.genres if genre in with_clips - banned]
    if not genres or "style" not in repertoire.net_names:
        return ALL_GENRES
    losses = take_losses(
        song_features.style, song_features.beat_count, repertoire.clip_style, repertoire.clip_beat_count,
        repertoire.clip_take, n_takes=len(repertoire.takes), beat_weight=repertoire.selection_beat_weight,
    )  # fmt: skip
    best = [losses[:, of_take == genre].min(axis=1).mean() for genre in genres]
    return genres[int(np.argmin(best))]
