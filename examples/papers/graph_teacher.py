"""Dances of the graph engine for the rollout network to learn from, on the count, to as many songs as wanted.

`train_rollout_ablations.py --networks graph-dances-too` uses them: every song of the takes, and synthesised
songs of their genres, danced with the takes themselves.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

import choreograph as cg
from choreograph.building.importing import measure_take
from choreograph.building.segmentation import SegmentedTake, segment_takes
from choreograph.building.song_cache import SongCache
from choreograph.counts import make_counts
from choreograph.motifs.vocabulary import Vocabulary
from choreograph.nets.words.model import WordNet
from choreograph.repertoire.contents import MeasuredTake
from choreograph.synthesis.songs import STYLES, render_song, write_song
from choreograph.takes import Credits, Take

SONG_S = 60.0
SONGS_PER_GENRE = 8  # synthesised, spread over the tempi of the genre
_SEEDS_FROM = 70_000  # beyond all other songs'


def synthesised_songs(genres: Sequence[str], folder: Path) -> Iterator[tuple[Path, str]]:
    """Songs of those genres that the synthesiser knows, written to `folder`, and their genres."""
    folder.mkdir(parents=True, exist_ok=True)
    for genre in sorted(set(genres) & set(STYLES)):
        for i, bpm in enumerate(np.linspace(*STYLES[genre].bpm, SONGS_PER_GENRE)):
            path = folder / f"{genre}-{i}.flac"
            if not path.exists():
                write_song(path, render_song(genre, bpm=bpm, duration_s=SONG_S, seed=_SEEDS_FROM + i))
            yield path, genre


def graph_dances(
    repertoire: cg.Repertoire, takes: Sequence[Take], folder: Path, seed: int
) -> list[MeasuredTake]:
    """The graph engine's dances to the songs of `takes` and to synthesised ones, counted by their music."""
    songs = dict((t.song_path, t.credits.genre) for t in takes if t.song_path is not None)
    songs |= dict(synthesised_songs([t.credits.genre for t in takes], folder))
    dances = []
    for path, genre in songs.items():
        dance = cg.dance(path, repertoire, genre=genre or None, seed=seed)
        plan = dance.plan
        times_s = np.array(plan.music_beats_s)
        danced = (times_s >= plan.opening_s) & (times_s <= dance.motion.duration_s)
        numbers = np.array(plan.music_beat_numbers or [0] * len(times_s))
        counts = make_counts(times_s[danced], numbers[danced], plan.metre)
        name = f"graph dance {len(dances)} to {path.name}"
        taken = Take(name, dance.motion, Credits(genre=genre), path, song_name=path.stem, counts=counts)
        dances.append(measure_take(taken))
        print(name, flush=True)
    return dances


def with_motifs(
    dances: Sequence[MeasuredTake], vocabulary: Vocabulary, words: WordNet, songs: SongCache
) -> tuple[list[SegmentedTake], Vocabulary]:
    """The words of dances, and the vocabulary with these words in place of the takes'."""
    segmented, _ = segment_takes(dances, songs)
    n_words = [len(take.words) for take in segmented]
    motif = vocabulary.motifs.nearest(words.embed(np.concatenate([t.words.body_pos_m for t in segmented])))
    of_dances = replace(
        vocabulary,
        word_take=np.repeat(np.arange(len(segmented)), n_words),
        word_start_s=np.concatenate([take.words.start_s for take in segmented]),
        word_end_s=np.concatenate([take.words.end_s for take in segmented]),
        word_motif=motif,
    )
    return segmented, of_dances
