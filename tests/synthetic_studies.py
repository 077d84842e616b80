"""A small rating study, and synthetic raters with given preferences."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from synthetic_motions import swaying
from synthetic_pages import write_seconds

from research.study.writing import StudyDance, write_study

VARIANTS = ("zebra-xvariant", "quagga-xvariant", "okapi-xvariant")


def small_study(folder: Path, *, n_songs: int = 3, duration_s: float = 1.5, seed: int = 3, **options) -> Path:
    """Dances of three variants to a few songs, in a folder of its own."""
    songs = [folder / f"tune-{number}.wav" for number in range(n_songs)]
    for number, song in enumerate(songs):
        if not song.exists():
            write_seconds(song, duration_s=duration_s + number, rate_hz=8000)
    fps = {VARIANTS[0]: 60.0, VARIANTS[1]: 30.0, VARIANTS[2]: 60.0}
    dances = {
        variant: [
            StudyDance(
                swaying(round(duration_s * fps[variant]), fps=fps[variant], seed=number), song,
                genre="waltz" if number == 0 else "",
            )
            for number, song in enumerate(songs)
        ]
        for variant in VARIANTS
    }  # fmt: skip
    study = folder / f"study-{seed}"
    write_study(dances, study, seed=seed, **options)
    return study


def read_key(study: Path) -> dict:
    return json.loads((study / "key.json").read_text(encoding="utf-8"))


def rating(key: Mapping, answers: Mapping, *, rater: int = 1, save: int = 1, **changed) -> dict:
    """A rater's file, as the page saves it."""
    return {
        "format": "choreograph-rating", "version": 1, "study": key["study"], "rater_id": f"{rater:016x}",
        "rater_name": "", "save": save, "answers": answers, **changed,
    }  # fmt: skip


def write_rating(study: Path, data: object, name: str | None = None) -> Path:
    if name is None:
        assert isinstance(data, dict)
        name = f"rating-{data['rater_id']}.json"
    path = study / name
    path.write_text(data if isinstance(data, str) else json.dumps(data), encoding="utf-8")
    return path


def rate_all(
    study: Path, means: Mapping[str, float], *, n_raters: int, seed: int = 0, generous: float = 0.5
) -> None:
    """Write ratings with given means: raters differ in generosity, songs in ease, and there is noise."""
    rng = np.random.default_rng(seed)
    key = read_key(study)
    ease = {song: rng.normal(0, 0.3) for song in sorted({dance["song"] for dance in key["dances"]})}
    for rater in range(1, n_raters + 1):
        bias = rng.normal(0, generous)
        answers = {
            dance["dance"]: {
                question: int(np.clip(round(means[dance["variant"]] + bias + ease[dance["song"]]
                                            + rng.normal(0, 0.5)), 0, 5))
                for question in key["questions"]
            }
            for dance in key["dances"]
        }  # fmt: skip
        write_rating(study, rating(key, answers, rater=rater))


def choose_all(study: Path, favour: Mapping[str, float], *, n_raters: int, seed: int = 0) -> None:
    """Write answers about pairs: the odds of two variants are as their numbers in `favour`."""
    rng = np.random.default_rng(seed)
    key = read_key(study)
    variant = {dance["dance"]: dance["variant"] for dance in key["dances"]}
    for rater in range(1, n_raters + 1):
        answers: dict[str, dict[str, str]] = {}
        for pair in key["pairs"]:
            weights = np.array([favour[variant[dance]] for dance in pair["dances"]])
            for question in pair["questions"]:
                chosen = rng.choice(pair["dances"], p=weights / weights.sum())
                answers.setdefault(pair["pair"], {})[question] = str(chosen)
        write_rating(study, rating(key, answers, rater=rater))
