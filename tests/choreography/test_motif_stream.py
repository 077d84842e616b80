"""Motifs drawn word by word: seeds, signatures, genres, requests."""

import numpy as np
import pytest

from choreograph.choreography.rollout.streaming import MotifStream
from choreograph.core.counts import make_counts, numbers_in_bar
from choreograph.core.numerics import chi_square_distance
from choreograph.library.repertoire import starter_repertoire
from choreograph.library.vocabulary import ALL_GENRES, signature

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def starter():
    return starter_repertoire()


@pytest.fixture(scope="module")
def counts():
    times_s = np.arange(0.3, 100.0, 0.5)
    return make_counts(times_s, numbers_in_bar(len(times_s), 4), 4)


def danced(stream, n_words):
    return np.array([stream.begin_word().motif for _ in range(n_words)])


def test_words_follow_without_gaps_from_count_to_count_and_beyond(starter, counts):
    stream = MotifStream(counts, starter, genre="house", seed=0)
    danced(stream, 240)
    ends, starts = ([getattr(w, name) for w in stream.words] for name in ("end_s", "start_s"))
    assert ends[:-1] == starts[1:] and np.allclose(np.diff(starts[1:]), 0.5)
    assert set(counts.times_s) <= set(starts) and starts[-1] > 110


def test_a_seed_decides_and_a_genre_is_followed_from_where_it_is_set(starter, counts):
    vocabulary = starter.vocabulary
    streams = [MotifStream(counts, starter, genre="house", seed=seed) for seed in (0, 0, 1)]
    first, again, other = (danced(stream, 90) for stream in streams)
    assert np.array_equal(first, again) and not np.array_equal(first, other)
    streams[1].genre = "hip-hop"
    stayed, changed = danced(streams[0], 90), danced(streams[1], 90)
    wanted = vocabulary.signatures[vocabulary.genre_index("hip-hop")]
    far, near = (
        chi_square_distance(signature(motifs, vocabulary.n_motifs), wanted) for motifs in (stayed, changed)
    )
    assert near < 0.7 * far


def test_a_request_holds_for_its_words_and_a_later_one_replaces_it(starter, counts):
    stream = MotifStream(counts, starter, genre=ALL_GENRES, seed=0)
    stream.request(7, 4)
    assert danced(stream, 2).tolist() == [7, 7]
    stream.request(3, 1)
    assert danced(stream, 4).tolist().count(3) >= 1 and stream.words[2].motif == 3
    assert [word.motif for word in stream.words[3:]] != [7, 7, 7]


def test_drawn_words_are_those_of_takes_and_requested_motifs_have_none(starter, counts):
    stream, vocabulary = MotifStream(counts, starter, genre="house", seed=0), starter.vocabulary
    stream.request(0, n_words=2)
    words = [stream.begin_word() for _ in range(18)]
    assert [word.word for word in words[:2]] == [-1, -1]
    of_takes = [word for word in words if word.word >= 0]
    assert len(of_takes) > 12
    assert all(vocabulary.word_motif[word.word] == word.motif for word in of_takes)
