"""A rating study read back: its key and the raters' files, to means, intervals and differences.

Intervals are percentiles of a bootstrap that draws raters and songs, both with replacement, and weights a
rating by how often its rater and its song were drawn (Owen 2007, "The pigeonhole bootstrap"): they say
what other raters and other songs would have given, not only other raters of these ten songs. With few of
both they are too narrow; the counts stand beside them. Differences are of ratings that one rater gave to
two variants' dances to one song, so how generous a rater is cancels out. Intervals are not corrected for
how many are looked at.
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

Points = NDArray[np.float64]  # (R, N) of rater and dance to a song, nan where there is none


@dataclass(frozen=True)
class Score:
    """What a variant got on a question; without two raters or songs there is no interval."""

    variant: str
    question: str
    mean: float  # 0 to 5
    low: float | None  # of the 95 % interval
    high: float | None
    n_ratings: int


@dataclass(frozen=True)
class Difference:
    """By how much `variant` got more than `other` on a question, where one rater rated both to one song."""

    variant: str
    other: str
    question: str
    mean: float
    low: float | None
    high: float | None
    n_pairs: int

    @property
    def is_clear(self) -> bool:
        """Whether 0 is outside the interval."""
        return self.low is not None and self.high is not None and not self.low <= 0.0 <= self.high


@dataclass(frozen=True)
class StudyResults:
    """Scores by question and variant, best first, and every pair of variants compared."""

    n_raters: int
    n_songs: int
    scores: tuple[Score, ...]
    differences: tuple[Difference, ...]

    def to_dict(self) -> dict[str, Any]:
        """The same as plain numbers and texts, for JSON."""
        return asdict(self)


@dataclass(frozen=True)
class _Shown:
    variant: str
    item: tuple[str, int]  # song, and the how many-th dance of the variant to it


def read_study(folder: str | Path, *, seed: int = 0) -> StudyResults:
    """Means, 95 % intervals and differences of a study from `key.json` and all other .json files beside it.

    A rater who saved more than once counts with the last file. `seed` is the bootstrap's.

    Raises `FormatError`, in a line, if the key is missing or damaged, there is no rating, or a file is no
    rating, damaged, or of another study.
    """
    folder = Path(folder)
    study, questions, shown = _read_key(folder / KEY_NAME)
    ratings = _read_ratings(folder, study, questions, shown)
    items = sorted({dance.item for dance in shown.values()})
    songs = np.unique([song for song, _ in items], return_inverse=True)[1]  # (N,)
    points = _points(ratings, shown, questions, items)
    drawn = _Drawn.from_rng(np.random.default_rng(seed), len(ratings), songs)
    scores, differences = [], []
    variants = sorted({dance.variant for dance in shown.values()})
    for question in questions:
        of_question = []
        for variant in variants:
            given = points[variant, question]
            if n_ratings := int(np.isfinite(given).sum()):
                mean, low, high = drawn.interval(given)
                of_question.append(Score(variant, question, mean, low, high, n_ratings))
        of_question.sort(key=lambda score: (-score.mean, score.variant))
        scores += of_question
        for first, second in combinations([score.variant for score in of_question], 2):
            apart = points[first, question] - points[second, question]
            if n_pairs := int(np.isfinite(apart).sum()):
                differences.append(Difference(first, second, question, *drawn.interval(apart), n_pairs))
    return StudyResults(len(ratings), len(set(songs)), tuple(scores), tuple(differences))


@dataclass(frozen=True, eq=False)
class _Drawn:
    """How often each rater and each song's dances were drawn, the first row as they are."""

    raters: NDArray[np.float64]  # (B, R)
    items: NDArray[np.float64]  # (B, N)

    @classmethod
    def from_rng(cls, rng: np.random.Generator, n_raters: int, songs: NDArray[np.integer]) -> _Drawn:
        """Raters and songs drawn with replacement; `songs` (N,) says which song each item is of."""
        n_songs = int(songs.max()) + 1
        raters = rng.multinomial(n_raters, np.full(n_raters, 1 / n_raters), size=_RESAMPLES)
        drawn_songs = rng.multinomial(n_songs, np.full(n_songs, 1 / n_songs), size=_RESAMPLES)
        return cls(raters.astype(np.float64), drawn_songs[:, songs].astype(np.float64))

    def interval(self, points: Points) -> tuple[float, float | None, float | None]:
        """Mean of all points, and the 95 % interval of it if more than one rater or item gave any."""
        given = np.isfinite(points)
        mean = float(points[given].mean())
        if not (given.any(axis=1).sum() > 1 or given.any(axis=0).sum() > 1):
            return mean, None, None
        sums = ((self.raters @ np.where(given, points, 0.0)) * self.items).sum(axis=1)
        counts = ((self.raters @ given.astype(np.float64)) * self.items).sum(axis=1)
        low, high = np.percentile(sums[counts > 0] / counts[counts > 0], [2.5, 97.5])
        return mean, float(low), float(high)


def _points(
    ratings: Mapping[str, Mapping[str, Mapping[str, int]]],
    shown: Mapping[str, _Shown],
    questions: tuple[str, ...],
    items: list[tuple[str, int]],
) -> dict[tuple[str, str], Points]:
    """By variant and question, (R, N) points of raters and dances to songs."""
    points: dict[tuple[str, str], Points] = defaultdict(lambda: np.full((len(ratings), len(items)), np.nan))
    column = {item: index for index, item in enumerate(items)}
    for row, rater in enumerate(sorted(ratings)):
        for dance, answers in ratings[rater].items():
            for question in set(answers) & set(questions):
                points[shown[dance].variant, question][row, column[shown[dance].item]] = answers[question]
    return points


def _read_json(path: Path, what: str) -> dict[str, Any]:
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise FormatError(f"{path}: expected {what}, could not read it: {error.strerror}") from error
    except (ValueError, RecursionError) as error:
        raise FormatError(f"{path}: expected {what}, got no JSON: cut off or foreign") from error
    if not isinstance(data, dict):
        raise FormatError(f"{path}: expected {what}, got a JSON {type(data).__name__}")
    return data


def _read_key(path: Path) -> tuple[str, tuple[str, ...], dict[str, _Shown]]:
    """The study's id, its questions, and every dance by its id."""
    data = _read_json(path, "the key of a rating study")
    if (data.get("format"), data.get("version")) != (KEY_FORMAT, VERSION):
        raise FormatError(f"{path}: expected a {KEY_FORMAT} of version {VERSION}, got something else")
    questions, dances, study = data.get("questions"), data.get("dances"), data.get("study")
    known = {question.id for question in QUESTIONS}
    if not (isinstance(questions, list) and questions and all(q in known for q in map(str, questions))):
        raise FormatError(f"{path}: expected questions among {', '.join(sorted(known))}")
    if not (isinstance(study, str) and isinstance(dances, list) and dances):
        raise FormatError(f"{path}: expected a study's id and its dances: the key is damaged")
    shown: dict[str, _Shown] = {}
    for entry in dances:
        if not (isinstance(entry, dict) and set(entry) == _DANCE_KEYS and _is_whole(entry["number"])):
            raise FormatError(f"{path}: expected dances with {', '.join(sorted(_DANCE_KEYS))}: damaged")
        shown[str(entry["dance"])] = _Shown(str(entry["variant"]), (str(entry["song"]), entry["number"]))
    if not len(dances) == len(shown) == len(set(shown.values())):
        raise FormatError(f"{path}: expected every dance once: the key is damaged")
    return study, tuple(questions), shown


def _read_ratings(
    folder: Path, study: str, questions: tuple[str, ...], shown: Mapping[str, _Shown]
) -> dict[str, dict[str, dict[str, int]]]:
    """Points by rater, dance and question: of each rater the last save."""
    last: dict[str, dict[str, Any]] = {}
    for path in sorted(p for p in folder.glob("*.json") if p.name != KEY_NAME):
        rating = _checked_rating(path, study, questions, shown)
        before = last.get(rating["rater_id"])
        if before and before["save"] == rating["save"] and before["answers"] != rating["answers"]:
            raise FormatError(f"{path}: another file of this rater says otherwise: one of them was edited")
        if not before or before["save"] < rating["save"]:
            last[rating["rater_id"]] = rating
    if not any(points for rating in last.values() for points in rating["answers"].values()):
        raise FormatError(
            f"{folder}: expected answers in raters' files (rating-….json) beside {KEY_NAME}, got no answer"
        )
    return {rater: rating["answers"] for rater, rating in last.items()}


def _checked_rating(
    path: Path, study: str, questions: tuple[str, ...], shown: Mapping[str, _Shown]
) -> dict[str, Any]:
    data = _read_json(path, "a rater's file")
    if (data.get("format"), data.get("version")) != (RATING_FORMAT, VERSION):
        raise FormatError(f"{path}: expected a {RATING_FORMAT} of version {VERSION}, got something else")
    if set(data) != _RATING_KEYS:
        odd = sorted(set(data) ^ _RATING_KEYS)[0]
        raise FormatError(f"{path}: the key {odd!r} is {'unknown' if odd in data else 'missing'}")
    if data["study"] != study:
        raise FormatError(f"{path}: expected a rating of study {study}, got one of {data['study']!r}")
    if not (isinstance(data["rater_id"], str) and re.fullmatch(r"[0-9a-f]{16}", data["rater_id"])):
        raise FormatError(f"{path}: expected a rater_id of 16 hexadecimal digits, got {data['rater_id']!r}")
    kinds = _is_whole(data["save"]), isinstance(data["rater_name"], str), isinstance(data["answers"], dict)
    if not all(kinds) or data["save"] < 1:
        raise FormatError(f"{path}: expected a name, answers by dance and the number of their save")
    for dance, answers in data["answers"].items():
        if dance not in shown or not isinstance(answers, dict):
            raise FormatError(f"{path}: expected answers about dances of the study, got {dance!r}")
        for question, points in answers.items():
            if question not in questions or not (_is_whole(points) and 0 <= points <= MAX_POINTS):
                raise FormatError(
                    f"{path}: dance {dance}: expected 0 to {MAX_POINTS} for a question, "
                    f"got {points!r} for {question!r}"
                )
    return data


def _is_whole(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)
