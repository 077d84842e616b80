"""Motifs of spans: those of the words segmented there, embedded once."""

from __future__ import annotations

import numpy as np
import pytest

from choreograph.library.motifs import SpanMotifLookup, find_motifs
from choreograph.library.words import poses_at, segment_words


def body_of(seed: int, n_frames: int = 600) -> np.ndarray:
    """A body (T, 21, 3) whose joints sway slowly and independently."""
    rng = np.random.default_rng(seed)
    times = np.arange(n_frames) / 20
    phase, rate = rng.uniform(0, 6, (1, 21, 3)), rng.uniform(0.5, 2.0, (1, 21, 3))
    base = np.random.default_rng(99).normal(size=(1, 21, 3))
    return base + 0.3 * np.sin(rate * times[:, None, None] + phase)


def embed(words: np.ndarray) -> np.ndarray:
    return words.reshape(len(words), -1).astype(np.float32)


@pytest.fixture
def labelled_takes():
    takes = [body_of(0), body_of(1)]
    words = [segment_words(take, 20.0, np.arange(0, 29, 0.5)).body_pos_m for take in takes]
    motifs, labels = find_motifs(embed(np.concatenate(words)), n_motifs=12)
    return takes, motifs, labels


def poses_of(takes):
    """Poses of takes (N,) at times (N, T)."""
    return lambda take, times_s: np.stack(
        [poses_at(takes[one], 20.0, times) for one, times in zip(take.tolist(), times_s, strict=True)]
    )


def test_spans_have_the_motifs_of_the_words_segmented_there(labelled_takes):
    takes, motifs, labels = labelled_takes
    spans = SpanMotifLookup(poses_of(takes), embed, motifs)
    start_s = np.tile(np.arange(0, 28.5, 0.5), 2)
    take = np.repeat([0, 1], 57)
    found = spans.motifs_of(take, start_s, start_s + 0.5)
    assert np.mean(found == labels[: len(found)]) > 0.9
    shifted = spans.motifs_of(take, start_s + 0.25, start_s + 0.75)
    assert np.mean(shifted == labels[: len(found)]) < 0.9


def test_a_span_is_embedded_only_once(labelled_takes):
    takes, motifs, _ = labelled_takes
    embedded = []

    def counting(words):
        embedded.append(len(words))
        return embed(words)

    spans = SpanMotifLookup(poses_of(takes), counting, motifs)
    take = np.array([0, 1, 0, 1])
    first = spans.motifs_of(take, np.array([3.0, 3.0, 3.0, 9.0]), np.array([3.5, 3.5, 3.5, 9.7]))
    assert len(embedded) == 1  # a batch of a fixed size
    again = spans.motifs_of(take[::-1], np.array([9.0, 3.0, 3.0, 3.0]), np.array([9.7, 3.5, 3.5, 3.5]))
    assert len(embedded) == 1
    assert np.array_equal(first, again[::-1])
    both = spans.motifs_of(take[:2], np.array([5.0, 3.0]), np.array([5.5, 3.5]))
    assert len(embedded) == 2
    assert both[1] == first[1]


def test_any_shape_and_spans_beyond_the_ends(labelled_takes):
    takes, motifs, _ = labelled_takes
    spans = SpanMotifLookup(poses_of(takes), embed, motifs)
    start_s = np.array([[-3.0, 29.9], [40.0, 12.0]])
    found = spans.motifs_of(np.array([[0, 1], [1, 0]]), start_s, start_s + 0.6)
    assert found.shape == (2, 2)
    assert (found >= 0).all() and (found < len(motifs)).all()
    assert spans.motifs_of(np.zeros(0, int), np.zeros(0), np.zeros(0)).shape == (0,)
