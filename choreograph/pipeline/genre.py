"""Which genre of the repertoire a song is nearest to."""

from __future__ import annotations

import numpy as np

from choreograph.features.music import Music
from choreograph.motifs.vocabulary import ALL_GENRES
from choreograph.repertoire import Repertoire
from choreograph.selection import take_losses


def likely_genre(music: Music, repertoire: Repertoire) -> str:
    """The genre whose best clips have the least style loss over the whole song; `ALL_GENRES` without
    style networks, or if no take has a genre."""
    genres = [genre for genre in repertoire.vocabulary.genres if genre != ALL_GENRES]
    if not genres or "style" not in repertoire.net_names or repertoire.n_clips == 0:
        return ALL_GENRES
    losses = take_losses(
        music.style, music.beat_count, repertoire.clip_style, repertoire.clip_beat_count,
        repertoire.clip_take, n_takes=len(repertoire.takes), beat_weight=repertoire.selection_beat_weight,
    )  # fmt: skip
    of_take = np.array([take.credits.genre for take in repertoire.takes])
    best = [losses[:, of_take == genre].min(axis=1).mean() for genre in genres]
    return genres[int(np.argmin(best))]
