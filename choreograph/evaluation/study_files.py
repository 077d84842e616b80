"""The files of a study as they come back: its key, and the raters' answers, checked against it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from choreograph.errors import FormatError
from choreograph.evaluation.study import KEY_FORMAT, KEY_NAME, VERSION
from choreograph.evaluation.study_questions import PAIR_QUESTIONS, QUESTIONS
from choreograph.files import read_json

RATING_FORMAT = "choreograph-rating"
MAX_POINTS = 5
_VERSIONS = range(1, VERSION + 1)
_RATING_KEYS = {"format", "version", "study", "rater_id", "rater_name", "save", "answers"}
_DANCE_KEYS = {"dance", "variant", "song", "number", "start_s"}
_PAIR_KEYS = {"pair", "dances", "questions"}

# By rater, by dance or pair, and by question: points, or the chosen dance of the pair.
Answers = dict[str, dict[str, dict[str, int | str]]]


@dataclass(frozen=True)
class DanceEntry:
    """What the raters were not told of a dance."""

    variant: str
    item: tuple[str, int]  # song, and number among the variant's dances to it


@dataclass(frozen=True)
class PairEntry:
    """A pair of dances, and what was asked about it."""

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
    """The key of a study; `FormatError` if it is missing or damaged."""
    data = _read_json(path, "the key of a rating study")
    if data.get("format") != KEY_FORMAT or data.get("version") not in _VERSIONS:
        raise FormatError(f"{path}: expected a {KEY_FORMAT} of version {VERSION}, got something else")
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
    pairs = _pairs(path, data.get("pairs", []), entries)
    if not (questions or pairs):
        raise FormatError(f"{path}: expected questions about dances or pairs of dances: the key is damaged")
    return StudyKey(study, tuple(questions), entries, pairs)


def _pairs(path: Path, pairs: Any, dances: Mapping[str, DanceEntry]) -> dict[str, PairEntry]:
    known = {question.id for question in PAIR_QUESTIONS}
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
            f"{folder}: expected answers in raters' files (rating-….json) next to {KEY_NAME}, got none"
        )
    return {rater: rating["answers"] for rater, rating in last.items()}


def _checked_rating(path: Path, key: StudyKey) -> dict[str, Any]:
    data = _read_json(path, "a rater's file")
    if data.get("format") != RATING_FORMAT or data.get("version") not in _VERSIONS:
        raise FormatError(f"{path}: expected a {RATING_FORMAT} of version {VERSION}, got something else")
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
