"""Selection at random: at least half suits the music, and a take that is drawn stays drawn to its end."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from choreograph.choreography.selection import ClipPriorities, draw_clips
from choreograph.core.errors import ParameterError


def take_of_clip(clips_of_takes):
    return np.repeat(np.arange(len(clips_of_takes)), clips_of_takes)


def draw(clip_take, *, n_seconds=5, candidates=4, rank=None, suits=None, seed=0):
    every = np.zeros(len(clip_take), int)
    return draw_clips(
        ClipPriorities(clip_take, n_seconds, np.random.default_rng(seed)),
        n_seconds,
        candidates=candidates,
        rank=lambda _: every if rank is None else rank,
        suits=None if suits is None else lambda _: suits,
    )


@settings(max_examples=50, deadline=None)
@given(
    st.lists(st.integers(1, 12), min_size=1, max_size=6), st.integers(1, 30), st.integers(0, 2**32 - 1),
)  # fmt: skip
def test_each_clip_is_drawn_once_and_half_of_them_suit(clips_of_takes, candidates, seed):
    clip_take = take_of_clip(clips_of_takes)
    suits = clip_take == 0
    chosen = draw(clip_take, candidates=candidates, suits=suits, seed=seed)
    k = min(candidates, len(clip_take))
    assert chosen.shape == (5, k)
    for clips in chosen:
        assert len(set(clips)) == k
        assert suits[clips].sum() >= min(round(k / 2), suits.sum())


def test_a_rare_genre_is_among_few_candidates():
    clip_take = take_of_clip([990, 10])
    suits = clip_take == 1
    drawn = suits[draw(clip_take, candidates=16, suits=suits)].sum(axis=1)
    assert drawn.min() >= 8  # of 1,000 clips 16 would hold one in six seconds
    assert suits[draw(clip_take, candidates=16)].sum(axis=1).max() < 8


def test_a_frequent_genre_is_drawn_as_often_as_it_comes():
    clip_take = take_of_clip([800, 200])
    chosen = [draw(clip_take, candidates=100, suits=clip_take == 0, seed=seed) for seed in range(20)]
    assert np.mean(clip_take[np.array(chosen)] == 0) == pytest.approx(0.8, abs=0.03)


def test_a_take_that_is_drawn_is_drawn_to_its_end():
    clip_take = take_of_clip([30] * 40)
    chosen = draw(clip_take, n_seconds=20, candidates=64)
    follow = []
    for before, after in pairwise(chosen):
        goes_on = (before + 1 < len(clip_take)) & (
            clip_take[np.minimum(before + 1, 1199)] == clip_take[before]
        )
        follow.append(np.isin(before[goes_on] + 1, after).mean())
    assert np.mean(follow) > 0.9  # 64 of 1,200 drawn anew: 0.05


def test_clips_of_higher_ranks_come_last():
    clip_take = take_of_clip([5, 5])
    chosen = draw(clip_take, candidates=5, rank=1 - clip_take)
    assert (clip_take[chosen] == 1).all()
    suits = clip_take == 0
    chosen = draw(clip_take, candidates=5, rank=1 - clip_take, suits=suits)
    assert (clip_take[chosen] == 1).all()


def test_too_few_clips_of_a_rank_are_filled_from_the_next_one():
    clip_take = take_of_clip([3, 4, 50])
    chosen = draw(clip_take, candidates=10, rank=clip_take)
    for clips in chosen:
        assert np.bincount(clip_take[clips]).tolist() == [3, 4, 3]
    chosen = draw(clip_take, candidates=10, rank=clip_take, suits=clip_take < 2)
    for clips in chosen:
        assert np.bincount(clip_take[clips]).tolist() == [3, 4, 3]


def test_another_seed_draws_other_clips():
    clip_take = take_of_clip([50, 50])
    same = [draw(clip_take, candidates=10, seed=seed).tolist() for seed in (1, 1, 2)]
    assert same[0] == same[1] != same[2]


def test_no_candidate_and_no_clip_are_errors():
    with pytest.raises(ParameterError, match="expected clips"):
        draw(np.zeros(0, int))
    with pytest.raises(ParameterError, match="at least 1 candidate, got 0"):
        draw(take_of_clip([3]), candidates=0)
