"""Dances with known moves: words of the same move are neighbours across dances, and share motifs."""

import numpy as np
import pytest
from sklearn.metrics import adjusted_mutual_info_score

from choreograph.core.numerics import chi_square_distance
from choreograph.library.vocabulary import find_motifs, segment_words, signature
from choreograph.motion.body import body_pos_m
from choreograph.nets.configs import word_config
from choreograph.nets.words import WordTake, train_word_net
from content.moves.genres import GENRES
from content.moves.sequencer import render_take

pytestmark = pytest.mark.slow

FPS = 30.0
# Figures are drawn by seeds, and what a tiny network learns varies with them: three sets of eight dances.
SETS = [
    [("salsa", seed + i, 100.0 + 4 * i) for i in range(4)]
    + [("waltz", seed + 4 + i, 90.0 + 3 * i) for i in range(4)]
    for seed in (0, 8, 16)
]
GENRE = np.array([genre for genre, *_ in SETS[0]])  # of the dances of a set


@pytest.fixture(scope="module")
def sets():
    """Of each set the embeddings of its words by a tiny network, the dance and the move of each word."""
    return [embedded(dances) for dances in SETS]


def embedded(danced):
    words, moves, dances, takes = [], [], [], []
    for number, (genre, seed, bpm) in enumerate(danced):
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
    net = train_word_net(takes, word_config("tiny", steps=120), seed=0)
    embeddings = net.embed(np.concatenate(words))
    return embeddings, np.array(dances), np.unique(moves, return_inverse=True)[1]


def test_the_nearest_word_in_another_dance_is_mostly_of_the_same_move(sets):
    found, chance = [], []
    for embeddings, dances, moves in sets:
        apart = ((embeddings[:, None] - embeddings[None]) ** 2).sum(-1)
        apart[dances[:, None] == dances[None]] = np.inf
        nearest = apart.argmin(axis=1)
        assert np.mean(GENRE[dances[nearest]] == GENRE[dances]) > 0.65  # 3 of 7 by chance
        # Dances of a genre share only some moves: only words of shared moves can be found.
        shared = np.array([np.any((moves == m) & (dances != d)) for m, d in zip(moves, dances, strict=True)])
        found.append(np.mean((moves[nearest] == moves)[shared]))
        by_chance = np.random.default_rng(0).permutation(nearest)
        chance.append(np.mean((moves[by_chance] == moves)[shared]))
    assert np.mean(found) > 0.45 > 4 * max(chance)  # a figure is danced differently each time


def test_motifs_separate_moves_and_signatures_separate_genres(sets):
    for embeddings, dances, moves in sets:
        motifs, labels = find_motifs(embeddings, n_motifs=30)
        shuffled = np.random.default_rng(0).permutation(labels)
        assert adjusted_mutual_info_score(moves, labels) > 0.15  # 0 by chance; a move is several words
        assert abs(adjusted_mutual_info_score(moves, shuffled)) < 0.05
        signatures = [signature(labels[dances == d], len(motifs)) for d in range(len(GENRE))]
        apart = np.array([[chi_square_distance(one, other) for other in signatures] for one in signatures])
        is_own = GENRE[:, None] == GENRE
        assert apart[is_own].max() + 0.2 < apart[~is_own].min()
