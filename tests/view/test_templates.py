"""Distances of takes to their genre's template, on vocabularies small enough to compute by hand."""

import numpy as np
import pytest

from choreograph.core.errors import ParameterError
from choreograph.library.vocabulary import Motifs, make_vocabulary
from choreograph.view.strip import dances_of, distance_over_time, distances_to_template

GENRES = ("polka", "polka", "", "polka")  # the last take has no words


@pytest.fixture(scope="module")
def vocabulary():
    dances = ([0, 0, 1, 1], [0, 0, 0, 0], [2, 2])
    motif = np.concatenate(dances)
    take = np.repeat([0, 1, 2], [4, 4, 2])
    start_s = np.concatenate([10.0 + 0.5 * np.arange(len(d)) for d in dances])
    motifs = Motifs(np.eye(3, dtype=np.float32), np.array([0, 2, 8]), np.bincount(motif))
    return make_vocabulary(motifs, motif, take, start_s, start_s + 0.5, GENRES)


def test_dances_of_a_genre_are_those_with_words(vocabulary):
    assert dances_of(vocabulary, GENRES, "polka") == [0, 1]
    assert dances_of(vocabulary, GENRES, "all") == [0, 1, 2]
    assert dances_of(vocabulary, GENRES, "waltz") == []


def test_distances_by_hand(vocabulary):
    # Template (3/4, 1/4); (1/2, 1/2) is at (1/16 / 5/4 + 1/16 / 3/4) / 2, (1, 0) at (1/16 / 7/4 + 1/4) / 2.
    expected = [(1 / 20 + 1 / 12) / 2, (1 / 28 + 1 / 4) / 2]
    np.testing.assert_allclose(distances_to_template(vocabulary, "polka", [0, 1]), expected)
    assert len(distances_to_template(vocabulary, "polka", [])) == 0
    with pytest.raises(ParameterError, match="waltz"):
        distances_to_template(vocabulary, "waltz", [0])
    with pytest.raises(ParameterError, match="none"):
        distances_to_template(vocabulary, "polka", [3])


def test_distance_over_time_is_that_of_the_dance_so_far(vocabulary):
    seconds, distance = distance_over_time(vocabulary, "polka", 0)
    np.testing.assert_allclose(seconds, [0.5, 1.0, 1.5, 2.0])
    assert distance[0] == distance[1] == pytest.approx((1 / 28 + 1 / 4) / 2)  # only motif 0 until then
    assert distance[-1] == distances_to_template(vocabulary, "polka", [0])[0]
    assert all(len(part) == 0 for part in distance_over_time(vocabulary, "polka", 3))
