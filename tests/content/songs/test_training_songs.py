"""Songs with true counts of every kind."""

from __future__ import annotations

import numpy as np
import pytest

from choreograph.core.errors import ParameterError
from content.songs.synthesis.sounds import RATE_HZ
from content.songs.training_songs import KINDS, counted_song, drawn_song, style_of


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_has_true_counts(kind):
    song = counted_song("rumba", kind, seed=3, duration_s=16.0)
    counts = song.counts
    assert counts.metre == (3 if kind in ("three", "six") else 4)
    assert (np.diff(counts.times_s) > 0.2).all() and counts.times_s[-1] < len(song.samples) / RATE_HZ
    assert (np.diff(counts.numbers) % counts.metre == 1).all()
    assert (counts.numbers[0] == 1) == (kind != "pick-up")
    intervals_s = np.diff(counts.times_s)
    assert (np.ptp(intervals_s) > 0.01) == (kind in ("ramp", "wandering", "rubato introduction"))
    level = [np.abs(song.samples[round(t * RATE_HZ) :][:4000]).max() for t in counts.times_s]
    assert (min(level[4:-8]) < 0.05) == (kind == "break")


@pytest.mark.slow
def test_a_seed_makes_the_same_song_again():
    one, same = (drawn_song(11, duration_s=10.0) for _ in range(2))
    np.testing.assert_array_equal(one.samples, same.samples)
    assert (one.genre, one.kind) == (same.genre, same.kind)


def test_drums_come_only_from_the_genres_allowed():
    for seed in range(30):
        assert style_of("house", "steady", seed=seed, others=()).name == "house"
    names = {style_of("house", "steady", seed=seed).name for seed in range(60)}
    assert len(names) > 5


@pytest.mark.parametrize(("genre", "kind"), [("polka", "steady"), ("house", "slow")])
def test_unknown_genres_and_kinds_are_refused(genre, kind):
    with pytest.raises(ParameterError, match="expected a genre"):
        counted_song(genre, kind, seed=1)
