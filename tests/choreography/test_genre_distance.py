"""Genres planted as clouds of clips: what varies within them all does not tell them apart."""

import numpy as np
import pytest

from choreograph.choreography.selection import genre_distances


def clouds(rng, *, n: int = 200):
    """Two genres that differ a little along the first axis, and vary much along the second."""
    genre = np.arange(n) % 2
    styles = rng.normal(size=(n, 4)) * (0.02, 0.5, 0.02, 0.02)
    styles[:, 0] += np.where(genre == 0, -0.05, 0.05)
    return styles, genre


def test_the_axis_that_tells_genres_apart_decides():
    rng = np.random.default_rng(0)
    styles, genre = clouds(rng)
    music = np.array([[-0.04, 0.9, 0.0, 0.0], [0.04, -0.9, 0.0, 0.0], [0.04, 0.9, 0.0, 0.0]])
    distances = genre_distances(music, styles, genre)
    assert distances.shape == (3, 2)
    assert distances.argmin(axis=1).tolist() == [0, 1, 1]


def test_distances_do_not_depend_on_the_order_of_clips_or_a_shift_of_all():
    rng = np.random.default_rng(1)
    styles, genre = clouds(rng)
    music, order = rng.normal(size=(5, 4)), rng.permutation(len(genre))
    distances = genre_distances(music, styles, genre)
    np.testing.assert_allclose(genre_distances(music, styles[order], genre[order]), distances)
    np.testing.assert_allclose(genre_distances(music + 3.0, styles + 3.0, genre), distances)


@pytest.mark.parametrize("n_clips", [1, 5])
def test_genres_of_equal_clips_are_told_by_plain_distance(n_clips):
    styles, genre = np.repeat(np.eye(3), n_clips, axis=0), np.repeat(np.arange(3), n_clips)
    distances = genre_distances(np.eye(3), styles, genre)
    assert np.allclose(np.diag(distances), 0.0)
    off = distances[~np.eye(3, dtype=bool)]
    assert np.allclose(off, off[0]) and off[0] > 1.0
