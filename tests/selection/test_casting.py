"""Casting: phrases as long as phrases are, the fitting takes in turn, the same for the same seed."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from choreograph.selection import cast_takes, phrase_of_seconds, take_losses


@settings(deadline=None)
@given(st.floats(0.2, 1.5), st.floats(0, 1), st.integers(1, 200))
def test_phrases_last_from_6_to_12_seconds_and_have_no_gap(period_s, first_s, n_seconds):
    phrase = phrase_of_seconds(first_s + period_s * np.arange(400), n_seconds)
    assert phrase[0] == 0
    assert set(np.diff(phrase)) <= {0, 1}
    whole = np.bincount(phrase)[1:-1]
    assert ((whole >= 5) & (whole <= 13)).all()


@pytest.mark.parametrize("beats", [[], [3.0]])
def test_without_beats_a_phrase_is_8_s(beats):
    assert np.bincount(phrase_of_seconds(np.array(beats), 32)).tolist() == [8] * 4


def test_who_danced_lately_stands_back():
    phrase = np.repeat(np.arange(20), 8)
    loss = np.random.default_rng(0).uniform(0, 1, (1, 40)).repeat(160, axis=0)
    cast = cast_takes(loss, phrase, rng=np.random.default_rng(0))
    assert (cast.sum(axis=1) == 6).all()
    assert all((cast[phrase == p] == cast[phrase == p][0]).all() for p in range(20))
    assert cast.any(axis=0).mean() > 0.8  # in time nearly everybody dances
    assert (cast[8:] & cast[:-8]).any(axis=1).mean() < 0.5  # seldom twice running


def test_takes_of_another_style_stay_out():
    phrase = np.repeat(np.arange(6), 8)
    loss = np.where(np.arange(40) < 20, 0.5, 5.0)[None].repeat(48, axis=0)
    cast = cast_takes(loss, phrase, rng=np.random.default_rng(0))
    assert cast[:, :20].sum() > 4 * cast[:, 20:].sum()


def test_a_seed_is_a_cast():
    phrase = np.repeat(np.arange(6), 8)
    loss = np.random.default_rng(1).uniform(size=(48, 30))
    first, same, other = (cast_takes(loss, phrase, rng=np.random.default_rng(s)) for s in (0, 0, 1))
    assert np.array_equal(first, same)
    assert not np.array_equal(first, other)


@pytest.mark.parametrize("n_takes", [1, 2, 3])
def test_of_few_takes_all_are_cast_but_those_without_clips(n_takes):
    loss = np.ones((8, n_takes + 1))
    loss[:, -1] = np.inf
    cast = cast_takes(loss, np.zeros(8, int), rng=np.random.default_rng(0))
    assert cast[:, :-1].all()
    assert not cast[:, -1].any()


def test_a_takes_loss_is_its_best_clips():
    rng = np.random.default_rng(0)
    music, clips, take = (
        rng.normal(size=(5, 8)),
        rng.normal(size=(9, 8)),
        np.array([0, 0, 2, 2, 2, 0, 2, 0, 0]),
    )
    loss = take_losses(music, np.zeros(5), clips, np.zeros(9), take, n_takes=3, beat_weight=0.0)
    distance = np.linalg.norm(music[:, None] - clips[None], axis=2)
    np.testing.assert_allclose(loss[:, 0], distance[:, take == 0].min(axis=1), rtol=1e-5)
    np.testing.assert_allclose(loss[:, 2], distance[:, take == 2].min(axis=1), rtol=1e-5)
    assert np.isinf(loss[:, 1]).all()
