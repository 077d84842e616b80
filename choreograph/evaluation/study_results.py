"""Results of a study: ratings, preferences, intervals and differences from its key and the raters' files.

Intervals are percentiles of a bootstrap that draws both raters and songs with replacement and weights a
rating by how often its rater and its song were drawn (Owen 2007, "The pigeonhole bootstrap"). So they cover
other raters and other songs, not only other raters of these songs. With few raters or songs they are too
narrow; counts are reported with them. A preference is the share of a pair's answers that chose one of its
variants; by chance, half. Differences are between the ratings that one rater gave to two
variants' dances to the same song, so a rater's generosity cancels out. Intervals are not corrected for
multiple comparisons.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.evaluation.study import KEY_NAME
from choreograph.evaluation.study_files import Answers, StudyKey, read_key, read_ratings

_RESAMPLES = 4000

Points = NDArray[np.float64]  # (R, N) by rater and dance or pair to a song; nan without an answer


@dataclass(frozen=True)
class Score:
    """A variant's mean rating on a question; no interval with fewer than two raters and songs."""

    variant: str
    question: str
    mean: float  # 0 to 5
    low: float | None  # end of the 95 % interval
    high: float | None
    n_ratings: int


@dataclass(frozen=True)
class Difference:
    """Mean rating of `variant` minus that of `other` on a question, over raters and songs that have both."""

    variant: str
    other: str
    question: str
    mean: float
    low: float | None
    high: float | None
    n_pairs: int

    @property
    def is_clear(self) -> bool:
        """Whether the interval excludes 0."""
        return self.low is not None and self.high is not None and not self.low <= 0.0 <= self.high


@dataclass(frozen=True)
class Preference:
    """How often `variant` was chosen rather than `other` on a question about pairs."""

    variant: str
    other: str
    question: str
    share: float  # 0 to 1; 0.5 by chance
    low: float | None  # end of the 95 % interval
    high: float | None
    n_answers: int

    @property
    def is_clear(self) -> bool:
        """Whether the interval excludes chance."""
        return self.low is not None and self.high is not None and not self.low <= 0.5 <= self.high


@dataclass(frozen=True)
class StudyResults:
    """Scores by question and variant, best first, differences of all pairs of variants, and preferences."""

    n_raters: int
    n_songs: int
    scores: tuple[Score, ...]
    differences: tuple[Difference, ...]
    preferences: tuple[Preference, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """The results as plain numbers and strings, for JSON."""
        return asdict(self)


def read_study(folder: str | Path, *, seed: int = 0) -> StudyResults:
    """Means, 95 % intervals and differences of a study from its `key.json` and all other .json files there.

    If a rater saved more than once, the last file counts. `seed` is that of the bootstrap.

    Raises `FormatError` if the key is missing or damaged, there is no rating, or a file is damaged, not a
    rating, or from another study.
    """
    folder = Path(folder)
    key = read_key(folder / KEY_NAME)
    answers = read_ratings(folder, key)
    items = sorted({entry.item for entry in key.dances.values()})
    songs = np.unique([song for song, _ in items], return_inverse=True)[1]  # (N,)
    bootstrap = _Bootstrap.from_rng(np.random.default_rng(seed), len(answers), songs)
    scores, differences = _rated(_points(answers, key, items), key, bootstrap)
    return StudyResults(
        len(answers), len(set(songs)), scores, differences, _preferences(answers, key, items, bootstrap)
    )


def _rated(
    points: Mapping[tuple[str, str], Points], key: StudyKey, bootstrap: _Bootstrap
) -> tuple[tuple[Score, ...], tuple[Difference, ...]]:
    """Means of the variants by question, best first, and their differences."""
    scores, differences = [], []
    for question in key.questions:
        of_question = []
        for variant in key.variants:
            of_variant = points[variant, question]
            if n_ratings := int(np.isfinite(of_variant).sum()):
                mean, low, high = bootstrap.interval(of_variant)
                of_question.append(Score(variant, question, mean, low, high, n_ratings))
        of_question.sort(key=lambda score: (-score.mean, score.variant))
        scores += of_question
        for first, second in combinations([score.variant for score in of_question], 2):
            difference = points[first, question] - points[second, question]
            if n_pairs := int(np.isfinite(difference).sum()):
                interval = bootstrap.interval(difference)
                differences.append(Difference(first, second, question, *interval, n_pairs))
    return tuple(scores), tuple(differences)


def _preferences(
    answers: Answers, key: StudyKey, items: list[tuple[str, int]], bootstrap: _Bootstrap
) -> tuple[Preference, ...]:
    """How often each variant was chosen over each other, by question, those chosen most often first."""
    chosen: dict[tuple[str, str, str], Points] = defaultdict(
        lambda: np.full((len(answers), len(items)), np.nan)
    )
    for row, rater in enumerate(sorted(answers)):
        for pair in set(answers[rater]) & set(key.pairs):
            entries = sorted((key.dances[d] for d in key.pairs[pair].dances), key=lambda e: e.variant)
            column = items.index(entries[0].item)
            for question, dance in answers[rater][pair].items():
                of_pair = chosen[question, entries[0].variant, entries[1].variant]
                of_pair[row, column] = key.dances[str(dance)] == entries[0]
    preferences = []
    for (question, first, second), of_pair in chosen.items():
        if np.nanmean(of_pair) < 0.5:
            first, second, of_pair = second, first, 1.0 - of_pair
        n_answers = int(np.isfinite(of_pair).sum())
        preferences.append(Preference(first, second, question, *bootstrap.interval(of_pair), n_answers))
    return tuple(sorted(preferences, key=lambda p: (p.question, -p.share, p.variant, p.other)))


@dataclass(frozen=True, eq=False)
class _Bootstrap:
    """How often each rater and each song's dances were drawn, in B resamples."""

    raters: NDArray[np.float64]  # (B, R)
    items: NDArray[np.float64]  # (B, N)

    @classmethod
    def from_rng(cls, rng: np.random.Generator, n_raters: int, songs: NDArray[np.integer]) -> _Bootstrap:
        """Draw raters and songs with replacement; `songs` (N,) is the index of each item's song."""
        n_songs = int(songs.max()) + 1
        raters = rng.multinomial(n_raters, np.full(n_raters, 1 / n_raters), size=_RESAMPLES)
        drawn_songs = rng.multinomial(n_songs, np.full(n_songs, 1 / n_songs), size=_RESAMPLES)
        return cls(raters.astype(np.float64), drawn_songs[:, songs].astype(np.float64))

    def interval(self, points: Points) -> tuple[float, float | None, float | None]:
        """Mean of all points, and its 95 % interval if there is more than one rater or item."""
        rated = np.isfinite(points)
        mean = float(points[rated].mean())
        if not (rated.any(axis=1).sum() > 1 or rated.any(axis=0).sum() > 1):
            return mean, None, None
        sums = ((self.raters @ np.where(rated, points, 0.0)) * self.items).sum(axis=1)
        counts = ((self.raters @ rated.astype(np.float64)) * self.items).sum(axis=1)
        low, high = np.percentile(sums[counts > 0] / counts[counts > 0], [2.5, 97.5])
        return mean, float(low), float(high)


def _points(answers: Answers, key: StudyKey, items: list[tuple[str, int]]) -> dict[tuple[str, str], Points]:
    """Points (R, N) of raters and dances to songs, by variant and question."""
    points: dict[tuple[str, str], Points] = defaultdict(lambda: np.full((len(answers), len(items)), np.nan))
    column = {item: index for index, item in enumerate(items)}
    for row, rater in enumerate(sorted(answers)):
        for dance in set(answers[rater]) & set(key.dances):
            entry = key.dances[dance]
            for question, given in answers[rater][dance].items():
                points[entry.variant, question][row, column[entry.item]] = given
    return points
