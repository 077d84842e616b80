"""Dances of the graph engine for the rollout network to learn from: to songs, on the count.

The songs are the takes' own, and synthesised ones of their genres. The network learns from takes as well. But
those keep to their counts as dancers do, and are brought into step with their songs as a whole; a graph dance
has every count on a beat, bars on downbeats.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from choreograph.blending.rendering import render
from choreograph.build_pipeline.synthesised_songs import synthesised_songs
from choreograph.counts import make_counts
from choreograph.files import atomic_path
from choreograph.pipeline.dancing import dance
from choreograph.plan import Plan
from choreograph.progress import ProgressReport
from choreograph.repertoire import Repertoire
from choreograph.takes import Credits, Take

LONGEST_S = 180.0  # of each song


def teach_rollout(
    repertoire: Repertoire,
    takes: Sequence[Take],
    folder: Path,
    *,
    beats: str,
    seed: int,
    report: ProgressReport | None = None,
) -> list[Take]:
    """Dances to the songs of `takes` and to synthesised ones of their genres, as takes with counts.

    None if the repertoire has no clips. `folder` keeps the synthesised songs, and what `graph_dances` keeps.
    Raises `FormatError` if a song cannot be read.
    """
    if repertoire.n_clips == 0:
        return []
    songs = songs_of(takes)
    songs |= synthesised_songs(songs.values(), folder / "songs", report)
    return graph_dances(repertoire, songs, folder, beats=beats, seed=seed, report=report)


def songs_of(takes: Sequence[Take]) -> dict[Path, str]:
    """The songs of `takes`, and the genre of the first take to each."""
    genres: dict[Path, str] = {}
    for take in takes:
        if take.song_path is not None:
            genres.setdefault(take.song_path, take.credits.genre)
    return genres


def graph_dances(
    repertoire: Repertoire,
    songs: Mapping[Path, str],
    folder: Path,
    *,
    beats: str,
    seed: int,
    report: ProgressReport | None = None,
) -> list[Take]:
    """A dance of the graph engine to each song, of the genre given with it, as takes with counts.

    `folder` keeps the plan of every dance, so that a call after a stop goes on where it was: it must be one
    of this repertoire, these songs and settings alone. Raises `FormatError` if a song cannot be read.
    """
    folder.mkdir(parents=True, exist_ok=True)
    dances = []
    for index, (song, genre) in enumerate(songs.items()):
        kept = folder / f"{index}.json"
        if not kept.exists():
            made = dance(
                song,
                repertoire,
                engine="graph",
                genre=genre or None,
                beats=beats,
                seed=seed,
                duration_s=LONGEST_S,
            )
            with atomic_path(kept) as temporary:
                temporary.write_text(made.plan.to_json(), encoding="utf-8")
        dances.append(_as_take(Plan.read(kept), repertoire, song, genre, f"graph dance {index}"))
        if report is not None:
            report("dancing for the rollout network to learn from", index + 1, len(songs))
    return dances


def _as_take(plan: Plan, repertoire: Repertoire, song: Path, genre: str, name: str) -> Take:
    """The rendered plan, counted by the beats it was danced on."""
    motion = render(plan, repertoire)
    times_s = np.array(plan.music_beats_s)
    numbers = np.array(plan.music_beat_numbers or [0] * len(times_s))
    danced = (times_s >= plan.opening_s) & (times_s <= min(plan.danced_until_s, motion.duration_s))
    counts = make_counts(times_s[danced], numbers[danced], plan.metre)
    return Take(name, motion, Credits(genre=genre), song, song_name=song.stem, counts=counts)
