"""Results of a study: ratings, preferences and intervals from its key and the files of the raters."""

from __future__ import annotations

import re
import reprlib
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.core.errors import FormatError
from choreograph.core.files import read_json
from choreograph.studio.ratings import KEY_FORMAT, KEY_NAME, RATING_FORMAT, VERSION
from research.study.writing import PAIR_QUESTIONS, QUESTIONS, STUDIO_QUESTION

# The files of a study as they come back: its key, and the raters' answers, checked against it.


MAX_POINTS = 5
_RATING_KEYS = {"format", "version", "study", "rater_id", "rater_name", "save", "answers"}
_DANCE_KEYS = {"dance", "variant", "song", "number", "start_s"}
_PAIR_KEYS = {"pair", "dances", "questions"}

# By rater, by dance or pair, and by question: points, or the chosen dance of the pair.
Answers = dict[str, dict[str, dict[str, int | str]]]


@dataclass(frozen=True)
class DanceEntry:
    """The data of a dance that the page does not show."""

    variant: str
    item: tuple[str, int]  # song, and number among the variant's dances to it


@dataclass(frozen=True)
class PairEntry:
    """A pair of dances and its questions."""

    dances: tuple[str, ...]  # two
    questions: tuple[str, ...]


@dataclass(frozen=True)
class StudyKey:
    """The key of a study: dances and pairs by their ids on the page."""

    study: str
    questions: tuple[str, ...]  # about every dance
    dances: dict[str, DanceEntry]
    pairs: dict[str, PairEntry]

    @property
    def variants(self) -> list[str]:
        """All variants, sorted."""
        return sorted({entry.variant for entry in self.dances.values()})


def read_key(path: Path) -> StudyKey:
    """The key of a study. `FormatError` if it is missing or damaged."""
    data = _read_json(path, "the key of a rating study")
    _check_format(path, data, KEY_FORMAT, "make the study again with `python -m research.study write`")
    questions, dances, study = data.get("questions"), data.get("dances"), data.get("study")
    known = {question.id for question in QUESTIONS}
    if not (isinstance(questions, list) and all(q in known for q in map(str, questions))):
        raise FormatError(f"{path}: expected questions among {', '.join(sorted(known))}")
    if not (isinstance(study, str) and isinstance(dances, list) and dances):
        raise FormatError(f"{path}: expected the id and the dances of a study: the key is damaged")
    entries: dict[str, DanceEntry] = {}
    for entry in dances:
        if not (isinstance(entry, dict) and set(entry) == _DANCE_KEYS and _is_whole(entry["number"])):
            raise FormatError(
                f"{path}: expected dances with {', '.join(sorted(_DANCE_KEYS))}: the key is damaged"
            )
        entries[str(entry["dance"])] = DanceEntry(
            str(entry["variant"]), (str(entry["song"]), entry["number"])
        )
    if not len(dances) == len(entries) == len(set(entries.values())):
        raise FormatError(f"{path}: expected every dance once: the key is damaged")
    pairs = _pairs(path, data.get("pairs"), entries)
    if not (questions or pairs):
        raise FormatError(f"{path}: expected questions about dances or pairs of dances: the key is damaged")
    return StudyKey(study, tuple(questions), entries, pairs)


def _check_format(path: Path, data: Mapping[str, Any], expected: str, cure: str) -> None:
    """`FormatError` unless a file is of a format in this version. `cure` is how to make the file again."""
    if data.get("format") != expected:
        raise FormatError(f"{path}: expected a {expected}, got something else")
    version = data.get("version")
    if version != VERSION or isinstance(version, bool):
        got = reprlib.repr(version)
        raise FormatError(f"{path}: expected a {expected} of version {VERSION}, got version {got}: {cure}")


def _pairs(path: Path, pairs: Any, dances: Mapping[str, DanceEntry]) -> dict[str, PairEntry]:
    known = {question.id for question in (*PAIR_QUESTIONS, STUDIO_QUESTION)}
    entries: dict[str, PairEntry] = {}
    for pair in pairs if isinstance(pairs, list) else [None]:
        if not (isinstance(pair, dict) and set(pair) == _PAIR_KEYS and _is_pair(pair["dances"], dances)):
            raise FormatError(f"{path}: expected pairs of two variants' dances to a song: the key is damaged")
        if not (isinstance(pair["questions"], list) and set(map(str, pair["questions"])) <= known):
            raise FormatError(f"{path}: expected questions about pairs among {', '.join(sorted(known))}")
        entries[str(pair["pair"])] = PairEntry(tuple(map(str, pair["dances"])), tuple(pair["questions"]))
    if len(entries) < len(pairs or []) or set(entries) & set(dances):
        raise FormatError(f"{path}: expected every pair once: the key is damaged")
    return entries


def _is_pair(names: Any, dances: Mapping[str, DanceEntry]) -> bool:
    if not (isinstance(names, list) and len(names) == 2 and set(map(str, names)) <= set(dances)):
        return False
    first, second = (dances[str(name)] for name in names)
    return first.item == second.item and first.variant != second.variant


def read_ratings(folder: Path, key: StudyKey) -> Answers:
    """The answers of every rater, from the last file that each saved.

    Raises `FormatError` if there is no answer, or a file is damaged, no rating, or of another study.
    """
    last: dict[str, dict[str, Any]] = {}
    for path in sorted(p for p in folder.glob("*.json") if p.name != KEY_NAME):
        rating = _checked_rating(path, key)
        before = last.get(rating["rater_id"])
        if before and before["save"] == rating["save"] and before["answers"] != rating["answers"]:
            raise FormatError(f"{path}: another file of this rater has other answers: one of them was edited")
        if not before or before["save"] < rating["save"]:
            last[rating["rater_id"]] = rating
    if not any(given for rating in last.values() for given in rating["answers"].values()):
        raise FormatError(
            f"{folder}: expected answers in files of raters (rating-*.json) next to {KEY_NAME}, got none"
        )
    return {rater: rating["answers"] for rater, rating in last.items()}


def _checked_rating(path: Path, key: StudyKey) -> dict[str, Any]:
    data = _read_json(path, "a rater's file")
    _check_format(path, data, RATING_FORMAT, "rate again in a study of `python -m research.study write`")
    if set(data) != _RATING_KEYS:
        wrong = min(set(data) ^ _RATING_KEYS)
        raise FormatError(f"{path}: the key {wrong!r} is {'unknown' if wrong in data else 'missing'}")
    if data["study"] != key.study:
        raise FormatError(f"{path}: expected a rating of study {key.study}, got one of {data['study']!r}")
    if not (isinstance(data["rater_id"], str) and re.fullmatch(r"[0-9a-f]{16}", data["rater_id"])):
        raise FormatError(f"{path}: expected a rater_id of 16 hexadecimal digits, got {data['rater_id']!r}")
    kinds = _is_whole(data["save"]), isinstance(data["rater_name"], str), isinstance(data["answers"], dict)
    if not all(kinds) or data["save"] < 1:
        raise FormatError(f"{path}: expected a name, answers by dance and a save number of 1 or more")
    for item, answers in data["answers"].items():
        if not (item in key.dances or item in key.pairs) or not isinstance(answers, dict):
            raise FormatError(f"{path}: expected answers for dances of the study, got {item!r}")
        for question, answer in answers.items():
            _check_answer(path, key, item, question, answer)
    return data


def _check_answer(path: Path, key: StudyKey, item: str, question: str, answer: Any) -> None:
    if item in key.pairs:
        pair = key.pairs[item]
        if question not in pair.questions or answer not in pair.dances:
            raise FormatError(
                f"{path}: pair {item}: expected {' or '.join(pair.dances)} for a question, "
                f"got {answer!r} for {question!r}"
            )
    elif question not in key.questions or not (_is_whole(answer) and 0 <= answer <= MAX_POINTS):
        raise FormatError(
            f"{path}: dance {item}: expected 0 to {MAX_POINTS} for a question, "
            f"got {answer!r} for {question!r}"
        )


def _read_json(path: Path, what: str) -> dict[str, Any]:
    data = read_json(path, what)
    if not isinstance(data, dict):
        raise FormatError(f"{path}: expected {what}, got a JSON {type(data).__name__}")
    return data


def _is_whole(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


# Results of a study: ratings, preferences, intervals and differences from its key and the raters' files.
#
# Intervals are percentiles of a bootstrap that draws both raters and songs with replacement and weights a
# rating by how often its rater and its song were drawn (Owen 2007, "The pigeonhole bootstrap"). So they
# cover other raters and other songs, not only other raters of these songs. With few raters or songs they
# are too narrow, so counts are reported with them. A preference is the share of the answers about a pair
# that chose one of its variants. It is 0.5 by chance. Differences are between the ratings that one rater
# gave to the dances of two variants to the same song, so the generosity of a rater cancels out. Intervals
# are not corrected for multiple comparisons.


_RESAMPLES = 4000

Points = NDArray[np.float64]  # (R, N) by rater and dance or pair to a song, nan without an answer


@dataclass(frozen=True)
class Score:
    """Mean rating of a variant on a question. There is no interval with fewer than two raters and songs."""

    variant: str  # its name
    question: str  # id of the question
    mean: float  # 0 to 5
    low: float | None  # end of the 95 % interval
    high: float | None  # other end of the interval
    n_ratings: int  # of all raters


@dataclass(frozen=True)
class Difference:
    """Mean rating of `variant` minus that of `other` on a question, over raters and songs that have both."""

    variant: str  # its name
    other: str  # the variant that it is compared with
    question: str  # id of the question
    mean: float  # of the differences, -5 to 5
    low: float | None  # end of the 95 % interval
    high: float | None  # other end of the interval
    n_pairs: int  # pairs of ratings, each by one rater for one song

    @property
    def is_clear(self) -> bool:
        """Whether the interval excludes 0."""
        return self.low is not None and self.high is not None and not self.low <= 0.0 <= self.high


@dataclass(frozen=True)
class Preference:
    """How often `variant` was chosen rather than `other` on a question about pairs."""

    variant: str  # its name
    other: str  # the variant that it is compared with
    question: str  # id of the question
    share: float  # 0 to 1, 0.5 by chance
    low: float | None  # end of the 95 % interval
    high: float | None  # other end of the interval
    n_answers: int  # of all raters

    @property
    def is_clear(self) -> bool:
        """Whether the interval excludes chance."""
        return self.low is not None and self.high is not None and not self.low <= 0.5 <= self.high


@dataclass(frozen=True)
class StudyResults:
    """Scores by question and variant, best first, differences of all pairs of variants, and preferences."""

    n_raters: int  # with answers
    n_songs: int  # with answers
    scores: tuple[Score, ...]  # by question and variant
    differences: tuple[Difference, ...]  # of all pairs of variants
    preferences: tuple[Preference, ...] = ()  # of all pairs of variants

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
        """Draw raters and songs with replacement. `songs` (N,) is the index of the song of each item."""
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
