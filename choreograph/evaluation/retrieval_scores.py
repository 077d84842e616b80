"""Scores of the style retrieval: whether clips near a song in style are of its genre."""

from __future__ import annotations

import numpy as np

from choreograph.audio.song import Song
from choreograph.evaluation.scores import Scores, split_chance
from choreograph.metrics import retrieval
from choreograph.repertoire import Repertoire
from choreograph.song_analysis import analyse_song

RETRIEVED = 50  # clips per second of the song


def retrieval_scores(song: Song, genre: str, repertoire: Repertoire) -> Scores:
    """Precision, recall and reciprocal rank of the genre among the clips nearest in style to each second.

    Empty if the repertoire has no style networks, or no clip of the genre.
    """
    genres = np.array([take.credits.genre for take in repertoire.takes])[repertoire.clip_take]
    of_genre = genres == genre
    if not genre or "style" not in repertoire.net_names or not of_genre.any():
        return Scores({})
    song_features, _ = analyse_song(song, repertoire)
    distances = np.linalg.norm(song_features.style[:, None] - repertoire.clip_style, axis=2)  # (S, N)
    relevant = of_genre[np.argsort(distances, axis=1, kind="stable")]
    k = min(RETRIEVED, repertoire.n_clips)
    metrics = retrieval.evaluate(relevant, k)
    return split_chance({name.replace(f"_at_{k}", ""): value for name, value in metrics.items()})
