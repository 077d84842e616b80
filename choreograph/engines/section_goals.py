"""The goals of a dance's parts: signature and motif transitions of the genre that suits the music there."""

from __future__ import annotations

from dataclasses import dataclass

from choreograph.constraints.likely_genre import genre_note, likely_genres
from choreograph.constraints.resolve import target_goal
from choreograph.engines.base import DanceRequest
from choreograph.motifs.goals import MotifGoal
from choreograph.motifs.vocabulary import ALL_GENRES


@dataclass(frozen=True, eq=False)
class SectionGoal:
    """The goal from one second of the song on, to where the next begins."""

    first_second: int
    goal: MotifGoal
    genre: str | None = None  # None: the goal is of no genre


def section_goals(request: DanceRequest) -> tuple[list[SectionGoal], tuple[str, ...]]:
    """The goals of the dance as requested, or of the likely genre of each part of the song; and notes.

    None where style does not decide on a genre: a mixture of all genres is no goal, since a waltz of a mixed
    library would hold a share of its tangos.
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
