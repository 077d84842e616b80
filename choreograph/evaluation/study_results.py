"""Results of a rating study: mean ratings, intervals and differences from its key and the raters' files.

Intervals are percentiles of a bootstrap that draws both raters and songs with replacement and weights a
rating by how often its rater and its song were drawn (Owen 2007, "The pigeonhole bootstrap"). So they cover
other raters and other songs, not only other raters of these songs. With few raters or songs they are too
narrow; counts are reported with them. Differences are between the ratings that one rater gave to two
variants' dances to the same song, so a rater's generosity cancels out. Intervals are not corrected for
multiple comparisons.
"""

from __future__ import annotations

import json
import re
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.errors import FormatError
from choreograph.evaluation.study import KEY_FORMAT, KEY_NAME, QUESTIONS, VERSION

RATING_FORMAT = "choreograph-rating"
MAX_POINTS = 5
_RESAMPLES = 4000
_RATING_KEYS = {"format", "version", "study", "rater_id", "rater_name", "save", "answers"}
_DANCE_KEYS = {"dance", "variant", "song", "number", "start_s"}

Points = NDArray[np.float64]  # (R, N) by rater and dance to a song; nan without a rating


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
class StudyResults:
    """Scores by question and variant, best first, and differences of all pairs of variants."""

    n_raters: int
    n_songs: int
    scores: tuple[Score, ...]
    differences: tuple[Difference, ...]

    def to_dict(self) -> dict[str, Any]:
        """The results as plain numbers and strings, for JSON."""
        return asdict(self)


@dataclass(frozen=True)
class _KeyEntry:
    variant: str
    item: tuple[str, int]  # song, and number among the variant's dances to it


def read_study(folder: str | Path, *, seed: int = 0) -> StudyResults:
    """Means, 95 % intervals and differences of a study from its `key.json` and all other .json files there.

    If a rater saved more than once, the last file counts. `seed` is that of the bootstrap.

    Raises `FormatError` if the key is missing or damaged, there is no rating, or a file is damaged, not a
    rating, or from another study.
    """
    folder = Path(folder)
    study, questions, entries = _read_key(folder / KEY_NAME)
    ratings = _read_ratings(folder, study, questions, entries)
    items = sorted({dance.item for dance in entries.values()})
    songs = np.unique([song for song, _ in items], return_inverse=True)[1]  # (N,)
    points = _points(ratings, entries, questions, items)
    bootstrap = _Bootstrap.from_rng(np.random.default_rng(seed), len(ratings), songs)
    scores, differences = [], []
    variants = sorted({dance.variant for dance in entries.values()})
    for question in questions:
        of_question = []
        for variant in variants:
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
    return StudyResults(len(ratings), len(set(songs)), tuple(scores), tuple(differences))


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


def _points(
    ratings: Mapping[str, Mapping[str, Mapping[str, int]]],
    entries: Mapping[str, _KeyEntry],
    questions: tuple[str, ...],
    items: list[tuple[str, int]],
) -> dict[tuple[str, str], Points]:
    """Points (R, N) of raters and dances to songs, by variant and question."""
    points: dict[tuple[str, str], Points] = defaultdict(lambda: np.full((len(ratings), len(items)), np.nan))
    column = {item: index for index, item in enumerate(items)}
    for row, rater in enumerate(sorted(ratings)):
        for dance, answers in ratings[rater].items():
            for question in set(answers) & set(questions):
                points[entries[dance].variant, question][row, column[entries[dance].item]] = answers[question]
    return points


def _read_json(path: Path, what: str) -> dict[str, Any]:
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise FormatError(f"{path}: expected {what}, could not read it: {error.strerror}") from error
    except (ValueError, RecursionError) as error:
        raise FormatError(f"{path}: expected {what}, got no valid JSON: truncated or another file") from error
    if not isinstance(data, dict):
        raise FormatError(f"{path}: expected {what}, got a JSON {type(data).__name__}")
    return data


def _read_key(path: Path) -> tuple[str, tuple[str, ...], dict[str, _KeyEntry]]:
    """The study's id, its questions, and its dances by id."""
    data = _read_json(path, "the key of a rating study")
    if (data.get("format"), data.get("version")) != (KEY_FORMAT, VERSION):
        raise FormatError(f"{path}: expected a {KEY_FORMAT} of version {VERSION}, got something else")
    questions, dances, study = data.get("questions"), data.get("dances"), data.get("study")
    known = {question.id for question in QUESTIONS}
    if not (isinstance(questions, list) and questions and all(q in known for q in map(str, questions))):
        raise FormatError(f"{path}: expected questions among {', '.join(sorted(known))}")
    if not (isinstance(study, str) and isinstance(dances, list) and dances):
        raise FormatError(f"{path}: expected the id and the dances of a study: the key is damaged")
    entries: dict[str, _KeyEntry] = {}
    for entry in dances:
        if not (isinstance(entry, dict) and set(entry) == _DANCE_KEYS and _is_whole(entry["number"])):
            raise FormatError(
                f"{path}: expected dances with {', '.join(sorted(_DANCE_KEYS))}: the key is damaged"
            )
        entries[str(entry["dance"])] = _KeyEntry(str(entry["variant"]), (str(entry["song"]), entry["number"]))
    if not len(dances) == len(entries) == len(set(entries.values())):
        raise FormatError(f"{path}: expected every dance once: the key is damaged")
    return study, tuple(questions), entries


def _read_ratings(
    folder: Path, study: str, questions: tuple[str, ...], entries: Mapping[str, _KeyEntry]
) -> dict[str, dict[str, dict[str, int]]]:
    """Points by rater, dance and question, from the last save of each rater."""
    last: dict[str, dict[str, Any]] = {}
    for path in sorted(p for p in folder.glob("*.json") if p.name != KEY_NAME):
        rating = _checked_rating(path, study, questions, entries)
        before = last.get(rating["rater_id"])
        if before and before["save"] == rating["save"] and before["answers"] != rating["answers"]:
            raise FormatError(f"{path}: another file of this rater has other answers: one of them was edited")
        if not before or before["save"] < rating["save"]:
            last[rating["rater_id"]] = rating
    if not any(points for rating in last.values() for points in rating["answers"].values()):
        raise FormatError(
            f"{folder}: expected answers in raters' files (rating-….json) next to {KEY_NAME}, got none"
        )
    return {rater: rating["answers"] for rater, rating in last.items()}


def _checked_rating(
    path: Path, study: str, questions: tuple[str, ...], entries: Mapping[str, _KeyEntry]
) -> dict[str, Any]:
    data = _read_json(path, "a rater's file")
    if (data.get("format"), data.get("version")) != (RATING_FORMAT, VERSION):
        raise FormatError(f"{path}: expected a {RATING_FORMAT} of version {VERSION}, got something else")
    if set(data) != _RATING_KEYS:
        wrong = sorted(set(data) ^ _RATING_KEYS)[0]
        raise FormatError(f"{path}: the key {wrong!r} is {'unknown' if wrong in data else 'missing'}")
    if data["study"] != study:
        raise FormatError(f"{path}: expected a rating of study {study}, got one of {data['study']!r}")
    if not (isinstance(data["rater_id"], str) and re.fullmatch(r"[0-9a-f]{16}", data["rater_id"])):
        raise FormatError(f"{path}: expected a rater_id of 16 hexadecimal digits, got {data['rater_id']!r}")
    kinds = _is_whole(data["save"]), isinstance(data["rater_name"], str), isinstance(data["answers"], dict)
    if not all(kinds) or data["save"] < 1:
        raise FormatError(f"{path}: expected a name, answers by dance and a save number of 1 or more")
    for dance, answers in data["answers"].items():
        if dance not in entries or not isinstance(answers, dict):
            raise FormatError(f"{path}: expected answers for dances of the study, got {dance!r}")
        for question, points in answers.items():
            if question not in questions or not (_is_whole(points) and 0 <= points <= MAX_POINTS):
                raise FormatError(
                    f"{path}: dance {dance}: expected 0 to {MAX_POINTS} for a question, "
                    f"got {points!r} for {question!r}"
                )
    return data


def _is_whole(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)
