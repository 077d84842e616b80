"""What a study asks: about each dance, as in ChoreoGraph, and about pairs, as in Rhythm is a Dancer.

In ChoreoGraph, section 4.4, 20 judges rated 10 dances of 6 s from each of four systems, from 0 to 5, by
variation, naturalness, style match and rhythm alignment. We differ in one point: variation is rated for each
dance, because raters who see mixed, unnamed variants cannot compare the dances of one system with each other.
Without sound, only the first two questions are used; the others are about the music.

In Rhythm is a Dancer, section 5.3, 45 observers saw pairs of clips and chose the one that represents the
genre better, and marked single clips as recorded or generated. Here both are asked about pairs: of two dances
to one song, which is more salsa, and which was made by a computer. A forced choice has a known chance level,
0.5, whatever a rater's readiness to say "real". The paper played no music while it asked about realism: for
that, write the study without sound.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from choreograph.errors import ParameterError

if TYPE_CHECKING:
    from choreograph.evaluation.study import StudyDance

ASKED = ("ratings", "pairs", "both")
_ORDERS_TRIED = 200


@dataclass(frozen=True)
class Question:
    """A question about every dance, answered from 0 to 5."""

    id: str
    title: str
    text: str
    needs_sound: bool


@dataclass(frozen=True)
class PairQuestion:
    """A question about every pair of dances, answered by one of them."""

    id: str
    title: str
    text: str  # with {genre}, it is asked where the genre is known


QUESTIONS = (
    Question("variation", "Variation", "Is the dance varied, without repeating itself?", False),
    Question(
        "naturalness", "Naturalness",
        "Is the motion natural and realistic, as if danced by a person and not a machine?", False,
    ),
    Question(
        "style", "Style match",
        "Does the style of the dance match the style of the music? Ignore the beat here.", True,
    ),
    Question("rhythm", "Rhythm", "Does the dance follow the beat of the music?", True),
)  # fmt: skip
PAIR_QUESTIONS = (
    PairQuestion("genre", "Genre", "Which is more {genre}?"),
    PairQuestion("computer", "Computer", "Which was made by a computer? If both were: which looks more so?"),
)


def pair_questions(genre: str) -> list[dict[str, str]]:
    """The questions about a pair of dances of a genre, as the page shows them; "" is no genre."""
    return [
        {"id": q.id, "title": q.title, "text": q.text.format(genre=genre)}
        for q in PAIR_QUESTIONS
        if genre or "{genre}" not in q.text
    ]


def paired(
    ordered: Sequence[tuple[str, int, StudyDance]], rng: np.random.Generator
) -> list[tuple[tuple[int, int], str]]:
    """Pairs of dances (variant, number, dance) to one song as indices, and their genre, in random order.

    Raises `ParameterError` if no two variants danced to one song.
    """
    by_song: dict[tuple[str, float, int], list[int]] = {}
    for index, (_, number, dance) in enumerate(ordered):
        by_song.setdefault((dance.song_path.name, dance.start_s, number), []).append(index)
    pairs = [
        (song, first, second)
        for (song, _, _), indices in sorted(by_song.items())
        for first, second in combinations(indices, 2)
    ]
    if not pairs:
        raise ParameterError("expected two variants that danced to one song, to compare them: got none")
    mixed = [pairs[i] for i in mixed_order([song for song, _, _ in pairs], rng)]
    sides = rng.permuted(np.array([pair[1:] for pair in mixed]), axis=1)  # (P, 2)
    genres = [ordered[first][2].genre or ordered[second][2].genre for _, first, second in mixed]
    return [((int(a), int(b)), genre) for (a, b), genre in zip(sides, genres, strict=True)]


def mixed_order(songs: Sequence[str], rng: np.random.Generator) -> NDArray[np.int64]:
    """A random order (N,) of items, the one of many in which a song follows itself least often."""
    of_item = np.unique(list(songs), return_inverse=True)[1]  # (N,)
    orders = [rng.permutation(len(songs)) for _ in range(_ORDERS_TRIED)]
    return min(orders, key=lambda order: int((np.diff(of_item[order]) == 0).sum()))
