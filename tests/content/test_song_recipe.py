"""The shipped songs are the ones that the recipe renders."""

from __future__ import annotations

import numpy as np
import pytest
import soundfile

from choreograph.library.builtin import example_songs
from content.starter_songs import render_example_songs

pytestmark = pytest.mark.slow

_MOST_BYTES = 450 * 1024


@pytest.fixture(scope="module")
def songs():
    return render_example_songs()


@pytest.mark.parametrize("name", example_songs())
def test_shipped_songs_are_those_of_the_recipe(name, songs):
    path = example_songs()[name]
    assert path.stat().st_size < _MOST_BYTES
    samples, _ = soundfile.read(path, dtype="float32")
    rendered = songs[name].samples
    assert samples.shape == rendered.shape
    assert 40.0 <= songs[name].duration_s <= 45.0
    assert np.corrcoef(samples.mean(axis=1), rendered.mean(axis=1))[0, 1] > 0.97
    assert np.abs(samples).max() < 1.0, "the codec's overshoot clips"


def test_every_song_of_the_recipe_is_shipped(songs):
    assert set(example_songs()) == set(songs)
