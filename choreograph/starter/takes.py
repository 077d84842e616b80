"""The starter's takes: every genre danced to songs of its own over its tempi, written as any library is.

Each take is a song of the synthesiser and a dance to its true beats. They go to a folder as BVH with
FLAC and a manifest, plus the truth (beats, bars, sections, moves) as JSON, and from there through the
ordinary importer: the starter is built as everybody's own library is.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from choreograph.exporters import save_motion
from choreograph.files import atomic_path
from choreograph.progress import ProgressReport
from choreograph.synthesis.moves.genres import GENRES
from choreograph.synthesis.moves.sequencer import Rendered, render_take
from choreograph.synthesis.songs import STYLES, SynthSong, render_song, write_song

TAKES_PER_GENRE = 16  # many short ones: a dance of three minutes can stay in its genre and still vary
DURATION_S = 20.0
FPS = 30.0  # stored; between the frames playing back turns evenly
CREDITS = {"performer": "choreograph", "licence": "CC0-1.0", "source": "choreograph starter"}
_MANIFEST = ("name", "genre", "performer", "licence", "source")


@dataclass(frozen=True)
class TakePlan:
    """What a take is made from."""

    name: str
    genre: str
    bpm: float
    seed: int  # of song and dance; the starter's own are below `synth.testbed.FIRST_SEED`
    duration_s: float = DURATION_S


def take_plans() -> Iterator[TakePlan]:
    """All takes: the genres in turn, their tempi evenly over the range their songs have."""
    for number, genre in enumerate(sorted(GENRES)):
        low, high = STYLES[genre].bpm
        for i, bpm in enumerate(np.linspace(low, high, TAKES_PER_GENRE)):
            yield TakePlan(f"{genre}-{i + 1:02d}", genre, round(float(bpm), 1), 100 * number + i)


def rendered(plan: TakePlan) -> tuple[SynthSong, Rendered]:
    """The song of a take and the dance to it, from the song's first sample on."""
    song = render_song(plan.genre, bpm=plan.bpm, duration_s=plan.duration_s, seed=plan.seed)
    dance = render_take(
        GENRES[plan.genre], song.beat_times_s, energy=beat_energies(song), seed=plan.seed, fps=FPS
    )
    return song, dance


def beat_energies(song: SynthSong) -> NDArray[np.float64]:
    """The energy of the section that each beat lies in, (Q,)."""
    energy = np.full(len(song.beat_times_s), song.sections[-1].energy)
    for section in song.sections:
        beats = slice(
            section.first_bar * song.beats_per_bar, (section.first_bar + section.bars) * song.beats_per_bar
        )
        energy[beats] = section.energy
    return energy


def truth(song: SynthSong, dance: Rendered) -> dict:
    """What is known exactly about a take, ready for JSON."""
    moves = [
        {
            "name": placed.move.name,
            "start_s": float(dance.count_times_s[min(placed.start, len(dance.count_times_s) - 1)]),
        }
        for placed in dance.placed
    ]
    return {**song.truth(), "moves": moves}


def write_takes(folder: Path, plans: Iterable[TakePlan], *, report: ProgressReport | None = None) -> None:
    """Render takes into `folder`, made if missing: BVH, FLAC, truth (JSON) and the manifest."""
    folder.mkdir(parents=True, exist_ok=True)
    plans = list(plans)
    for done, plan in enumerate(plans):
        song, dance = rendered(plan)
        save_motion(folder / f"{plan.name}.bvh", dance.motion)
        write_song(folder / f"{plan.name}.flac", song)
        with atomic_path(folder / f"{plan.name}.truth.json") as temporary:
            temporary.write_text(json.dumps(truth(song, dance), indent=1) + "\n", encoding="utf-8")
        if report is not None:
            report("rendering takes", done + 1, len(plans))
    with (
        atomic_path(folder / "manifest.csv") as temporary,
        open(temporary, "w", newline="", encoding="utf-8") as file,
    ):
        rows = csv.DictWriter(file, _MANIFEST)
        rows.writeheader()
        rows.writerows({"name": plan.name, "genre": plan.genre, **CREDITS} for plan in plans)
