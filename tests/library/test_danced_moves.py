"""Dances with known moves: words of the same move are neighbours across dances, and share motifs."""

import numpy as np
import pytest
from sklearn.metrics import adjusted_mutual_info_score

from choreograph.core.numerics import chi_square_distance
from choreograph.library.motifs import find_motifs
from choreograph.library.words import segment_words, signature
from choreograph.motion.body import body_pos_m
from choreograph.nets.configs import word_config
from choreograph.nets.words import WordTake, train_word_net
from content.moves.genres import GENRES
from content.moves.sequencer import render_take

pytestmark = pytest.mark.slow

FPS = 30.0
DANCES = [("salsa", 0, 100.0), ("salsa", 1, 108.0), ("waltz", 2, 90.0), ("waltz", 3, 96.0)]


@pytest.fixture(scope="module")
def danced():
    """Embeddings of words by a tiny network, the dance and the move of each."""
    words, moves, dances, takes = [], [], [], []
    for number, (genre, seed, bpm) in enumerate(DANCES):
        beats = np.arange(64) * 60 / bpm + 0.2
        take = render_take(GENRES[genre], beats, seed=seed, fps=FPS)
        body = body_pos_m(take.motion)
        cut = segment_words(body, FPS, beats)
        starts = take.count_times_s[[p.start for p in take.placed if p.start < len(take.count_times_s)]]
        index = np.searchsorted(starts, cut.start_s + 0.05, side="right") - 1
        words.append(cut.body_pos_m)
        moves += [f"{genre} {take.placed[i].move.name}" for i in index]
        dances += [number] * len(cut)
        takes.append(WordTake(str(number), body, FPS, cut.start_s, cut.end_s))
    net = train_word_net(takes, word_config("tiny", steps=60), seed=0)
    embeddings = net.embed(np.concatenate(words))
    return embeddings, np.array(dances), np.unique(moves, return_inverse=True)[1]


def test_the_nearest_word_in_another_dance_is_mostly_of_the_same_move(danced):
    embeddings, dances, moves = danced
    apart = ((embeddings[:, None] - embeddings[None]) ** 2).sum(-1)
    apart[dances[:, None] == dances[None]] = np.inf
    genres = np.array([genre for genre, *_ in DANCES])[dances]
    nearest = apart.argmin(axis=1)
    assert np.mean(genres[nearest] == genres) > 0.65  # a third by chance
    # Two dances of a genre share only some moves: only words of shared moves can be found.
    shared = np.array([np.any((moves == m) & (dances != d)) for m, d in zip(moves, dances, strict=True)])
    found = np.mean((moves[nearest] == moves)[shared])
    chance = np.mean((moves[np.random.default_rng(0).permutation(nearest)] == moves)[shared])
    assert found > 0.45 > 4 * chance  # a figure is danced differently each time


def test_motifs_separate_moves_and_signatures_separate_genres(danced):
    embeddings, dances, moves = danced
    motifs, labels = find_motifs(embeddings, n_motifs=30)
    shuffled = np.random.default_rng(0).permutation(labels)
    assert adjusted_mutual_info_score(moves, labels) > 0.15  # 0 by chance; a move is several words
    assert abs(adjusted_mutual_info_score(moves, shuffled)) < 0.05
    signatures = [signature(labels[dances == d], len(motifs)) for d in range(len(DANCES))]
    own = [chi_square_distance(signatures[i], signatures[i + 1]) for i in (0, 2)]
    others = [chi_square_distance(signatures[i], signatures[j]) for i in (0, 1) for j in (2, 3)]
    assert max(own) + 0.2 < min(others)
