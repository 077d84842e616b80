"""Ratings of two versions of a dance, in the files of a study, which `python -m research.study show` reads.

Each comparison is a pair of a study that grows. Its key says which dance is of which version, and one file
has the answers of this person (`data_schema/rating.schema.json`).
"""

from __future__ import annotations

import json
import secrets
from pathlib import Path
from typing import Any

from choreograph.core.errors import FormatError
from choreograph.core.files import atomic_path, read_json

KEY_NAME = "key.json"
KEY_FORMAT = "choreograph-study-key"
RATING_FORMAT = "choreograph-rating"
VERSION = 1  # of key and ratings
BETTER = "better"  # id of the question which of two versions is better
SUFFIX = ".study"
_RATING_NAME = "rating-studio.json"
_NOTE = "Which dance of a comparison in the studio is of which version."
_CURE = "move the folder away to begin another"


def rate(folder: Path, song: str, names: tuple[str, str], better: int | None) -> Path:
    """Add a comparison of two versions, of which the first or the second is better, or None for neither.

    `names` are what the versions are called, and `folder` is where the study is. Returns the file with the
    answers. Raises `FormatError` if the folder has another study or a damaged one, and `ChoreographError` if
    it cannot be written.
    """
    folder.mkdir(exist_ok=True)
    key, rating = _key(folder / KEY_NAME), _rating(folder / _RATING_NAME)
    number = len(key["pairs"])
    ids = [str(2 * number + 1), str(2 * number + 2)]
    called = names if names[0] != names[1] else (f"{names[0]} (A)", f"{names[1]} (B)")
    key["dances"] += [
        {"dance": id, "variant": name, "song": song, "number": number, "start_s": 0.0}
        for id, name in zip(ids, called, strict=True)
    ]
    key["pairs"].append({"pair": f"p{number + 1}", "dances": ids, "questions": [BETTER]})
    answers = {} if better is None else {BETTER: ids[better]}
    rating["study"], rating["save"] = key["study"], rating["save"] + 1
    rating["answers"][f"p{number + 1}"] = answers
    for name, data in ((KEY_NAME, key), (_RATING_NAME, rating)):
        with atomic_path(folder / name) as temporary:
            temporary.write_text(json.dumps(data, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    return folder / _RATING_NAME


def _key(path: Path) -> dict[str, Any]:
    if path.exists():
        data: dict[str, Any] = read_json(path, "the key of a study")
        if not (isinstance(data, dict) and _is_key(data)):
            raise FormatError(f"{path}: expected the key of a study, got another file: {_CURE}")
        return data
    return {
        "format": KEY_FORMAT, "version": VERSION, "note": _NOTE, "study": secrets.token_hex(8), "seed": 0,
        "questions": [], "dances": [], "pairs": [],
    }  # fmt: skip


def _is_key(data: dict[str, Any]) -> bool:
    kinds = isinstance(data.get("study"), str), *(isinstance(data.get(n), list) for n in ("dances", "pairs"))
    return (data.get("format"), data.get("version")) == (KEY_FORMAT, VERSION) and all(kinds)


def _rating(path: Path) -> dict[str, Any]:
    if not path.exists():
        return {
            "format": RATING_FORMAT, "version": VERSION, "study": "", "rater_id": secrets.token_hex(8),
            "rater_name": "", "save": 0, "answers": {},
        }  # fmt: skip
    data: dict[str, Any] = read_json(path, "the answers of a rater")
    if not (
        isinstance(data, dict) and isinstance(data.get("answers"), dict) and isinstance(data.get("save"), int)
    ):
        raise FormatError(f"{path}: expected the answers of a rater, got another file: {_CURE}")
    return data
