"""What a repertoire file says about its takes: names, credits, ranges in the arrays, counts and figures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from choreograph.counts import Counts, Figure
from choreograph.repertoire.checks import check_counts, check_parts
from choreograph.repertoire.store import RepertoireFile
from choreograph.takes import Credits

_TEXT = ("name", "song_name", "genre", "performer", "licence", "source", "notes")
_PARTS = {"motion": ("motion/root_pos_m", 1), "body": ("body/pos_m", 1), "beat": ("beats/motion_s", 0)}
_RANGES = tuple(f"{part}_{end}" for part in _PARTS for end in ("start", "stop"))


@dataclass(frozen=True)
class TakeInfo:
    """A take of a repertoire; ranges are into the file's flat arrays."""

    name: str
    song_name: str
    credits: Credits
    fps: float
    motion: tuple[int, int]
    body: tuple[int, int]
    beats: tuple[int, int]
    notes: str

    @property
    def duration_s(self) -> float:
        """Length of the take's motion in seconds."""
        return (self.motion[1] - self.motion[0]) / self.fps


def takes_from(file: RepertoireFile) -> tuple[TakeInfo, ...]:
    """All takes, in the order of the file; `RepertoireError` if there is none or their rows overlap."""
    columns = {name: file.read(f"takes/{name}") for name in (*_TEXT, "fps", *_RANGES)}
    for part, (array, shortest) in _PARTS.items():
        start, stop = columns[f"{part}_start"], columns[f"{part}_stop"]
        check_parts(part, start, stop, file.shapes[array][0], shortest=shortest)
    return tuple(
        TakeInfo(
            name=str(columns["name"][i]),
            song_name=str(columns["song_name"][i]),
            credits=Credits(*(str(columns[c][i]) for c in ("genre", "performer", "licence", "source"))),
            fps=float(columns["fps"][i]),
            motion=(int(columns["motion_start"][i]), int(columns["motion_stop"][i])),
            body=(int(columns["body_start"][i]), int(columns["body_stop"][i])),
            beats=(int(columns["beat_start"][i]), int(columns["beat_stop"][i])),
            notes=str(columns["notes"][i]),
        )
        for i in range(len(columns["name"]))
    )


def counts_from(file: RepertoireFile, takes: Sequence[TakeInfo]) -> tuple[Counts, ...]:
    """Each take's counts, of a file that has counts; `RepertoireError` if they are not in order."""
    columns = ("count_start", "count_stop", "metre", "counts_source", "counts_confidence")
    times_s, numbers = file.read("counts/time_s"), file.read("counts/number")
    doubt = file.read("counts/doubt").astype(np.float64) if file.has_doubt else np.zeros(0)
    start, stop, *about = (file.read(f"takes/{column}") for column in columns)
    check_parts("count", start, stop, len(times_s), shortest=0)
    counts = tuple(
        Counts(times_s[i:j], numbers[i:j], int(metre), str(source), float(confidence), doubt[i:j])
        for i, j, metre, source, confidence in zip(start, stop, *about, strict=True)
    )
    for take, own in zip(takes, counts, strict=True):
        check_counts(take.name, own.times_s, own.numbers, own.metre)
    return counts


def figures_from(read: Callable[[str], NDArray]) -> dict[int, tuple[Figure, ...]]:
    """The figures in order by take, of a file that has counts; takes without figures are left out."""
    names = ("take", "name", "start_s", "end_s", "n_counts")
    figures: dict[int, list[Figure]] = {}
    for take, name, start_s, end_s, n_counts in zip(*(read(f"figures/{c}") for c in names), strict=True):
        figure = Figure(str(name), float(start_s), float(end_s), int(n_counts))
        figures.setdefault(int(take), []).append(figure)
    return {take: tuple(own) for take, own in figures.items()}
