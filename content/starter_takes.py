"""Writes the takes of the built-in repertoire, every genre over the range of its tempi, as a library folder.

Each take is a synthesised song and a dance rendered to its true beats. They are written to a folder as BVH
and FLAC with a manifest, with counts and figures as NAME.counts.csv and the ground truth (beats, bars,
sections, moves) as JSON. The folder is then imported like the library of any user.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from choreograph.core.counts import ANNOTATED, Counts, Figure, make_counts, numbers_in_bar
from choreograph.core.files import atomic_path
from choreograph.core.progress import ProgressReport
from choreograph.formats.manifest import COUNTS_SUFFIX, write_counts
from choreograph.formats.register import save_motion
from content.moves.genres import GENRES
from content.moves.sequencer import RenderedTake, render_take
from content.moves.stylings import Part, Way, finish, pause, ready, styled
from content.songs.danced_styles import DANCED
from content.songs.synthesis.song import SyntheticSong, render_song, write_song

DURATION_S = 17.5
SHORT_S = 10.0  # of takes that begin, end or pause
WAYS = (
    Way("hers"), Way("his", 1.1, 0.2), Way("hers", 0.9, -0.3), Way("his"), Way("hers", 1.1, 0.3),
    Way("his", 0.85, -0.2),
)  # fmt: skip
PARTS_OF_GENRE: tuple[Part, ...] = (
    *("whole",) * 12, "beginning", "beginning", "ending", "ending", "break", "break", *("whole",) * 5,
)  # fmt: skip
TAKES_PER_GENRE = len(PARTS_OF_GENRE)  # short ones: a dance of three minutes stays in its genre and varies
FPS = 25.0  # as stored, playback interpolates
CREDITS = {"performer": "choreograph", "licence": "CC0-1.0", "source": "choreograph starter"}
_MANIFEST = ("name", "genre", "performer", "licence", "source")


@dataclass(frozen=True)
class TakeSpec:
    """Parameters of a take."""

    name: str
    genre: str
    bpm: float
    seed: int  # of song and dance, below `benchmark_songs.FIRST_SEED`
    duration_s: float = DURATION_S
    way: Way = WAYS[0]
    part: Part = "whole"


def take_specs() -> Iterator[TakeSpec]:
    """The specs of all takes: for each genre, tempi spread evenly over the range of its songs."""
    for number, genre in enumerate(sorted(GENRES)):
        low, high = DANCED[genre].bpm
        for i, (part, share) in enumerate(zip(PARTS_OF_GENRE, _tempo_shares(), strict=True)):
            bpm = round(float(low + share * (high - low)), 1)
            length_s = DURATION_S if part == "whole" else SHORT_S
            yield TakeSpec(
                f"{genre.replace(' ', '-').lower()}-{i + 1:02d}", genre, bpm, 60 * number + i, length_s,
                WAYS[i % len(WAYS)], part,
            )  # fmt: skip


def _tempo_shares() -> list[float]:
    """Where the tempi of the takes of a genre lie in its range, from 0 to 1.

    Each run of whole takes is spread evenly, the first from slow to fast and the next one from fast to slow,
    so that each way of dancing has several tempi. Short takes have some tempi of the first run.
    """
    shares: list[float] = []
    first: list[float] = []
    for is_whole, run in groupby(PARTS_OF_GENRE, lambda part: part == "whole"):
        n, start = len(list(run)), len(shares)
        spread = [(k + 0.5) / n for k in range(n)]
        if is_whole:
            shares += reversed(spread) if first else spread
            first = first or spread
        else:
            shares += [first[7 * i % len(first)] for i in range(start, start + n)]
    return shares


def render_spec(spec: TakeSpec) -> tuple[SyntheticSong, RenderedTake]:
    """Render a take: its song, and the dance from the song's first sample on."""
    song = render_song(DANCED[spec.genre], bpm=spec.bpm, duration_s=spec.duration_s, seed=spec.seed)
    genre = styled(GENRES[spec.genre], spec.way)
    energy = np.clip(beat_energies(song) + spec.way.energy, 0.0, 1.0)
    dance = render_take(
        genre, song.beat_times_s, energy=energy, seed=spec.seed, fps=FPS,
        first=ready(genre) if spec.part == "beginning" else None,
        middle=pause(genre) if spec.part == "break" else None,
        last=finish(genre) if spec.part == "ending" else None,
    )  # fmt: skip
    return song, dance


def beat_energies(song: SyntheticSong) -> NDArray[np.float64]:
    """Energy (Q,) of the section of each beat."""
    energy = np.full(len(song.beat_times_s), song.sections[-1].energy)
    for section in song.sections:
        beats = slice(
            section.first_bar * song.beats_per_bar, (section.first_bar + section.bars) * song.beats_per_bar
        )
        energy[beats] = section.energy
    return energy


def truth(song: SyntheticSong, dance: RenderedTake) -> dict:
    """Ground truth of a take, JSON-serialisable."""
    moves = [
        {
            "name": placed.move.name,
            "start_s": float(dance.count_times_s[min(placed.start, len(dance.count_times_s) - 1)]),
        }
        for placed in dance.placed
    ]
    return {**song.truth(), "moves": moves}


def true_counts(song: SyntheticSong, dance: RenderedTake) -> tuple[Counts, tuple[Figure, ...]]:
    """The song's beats as counts, in half time as well, and the moves that are danced to their end."""
    beats_s, counts_s = song.beat_times_s, dance.count_times_s
    spans = [(placed.move.name, placed.start, placed.start + placed.move.counts) for placed in dance.placed]
    figures = []
    for name, start, end in spans:
        if end < len(counts_s):
            first, last = np.searchsorted(beats_s, counts_s[[start, end]])
            figures.append(Figure(name, float(beats_s[first]), float(beats_s[last]), int(last - first)))
    numbers = numbers_in_bar(len(beats_s), song.beats_per_bar)
    return make_counts(beats_s, numbers, song.beats_per_bar, source=ANNOTATED), tuple(figures)


def write_takes(folder: Path, specs: Iterable[TakeSpec], *, report: ProgressReport | None = None) -> None:
    """Render takes into `folder`, created if missing: BVH, FLAC, counts, ground truth (JSON), a manifest."""
    folder.mkdir(parents=True, exist_ok=True)
    specs = list(specs)
    for done, spec in enumerate(specs):
        song, dance = render_spec(spec)
        save_motion(folder / f"{spec.name}.bvh", dance.motion)
        write_song(folder / f"{spec.name}.flac", song)
        write_counts(folder / f"{spec.name}{COUNTS_SUFFIX}", *true_counts(song, dance))
        with atomic_path(folder / f"{spec.name}.truth.json") as temporary:
            temporary.write_text(json.dumps(truth(song, dance), indent=1) + "\n", encoding="utf-8")
        if report is not None:
            report("rendering takes", done + 1, len(specs))
    with (
        atomic_path(folder / "manifest.csv") as temporary,
        open(temporary, "w", newline="", encoding="utf-8") as file,
    ):
        rows = csv.DictWriter(file, _MANIFEST)
        rows.writeheader()
        rows.writerows({"name": spec.name, "genre": spec.genre, **CREDITS} for spec in specs)
