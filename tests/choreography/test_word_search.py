"""Choosing words: the cheapest way of all, what really followed, and what is forbidden."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from choreograph.choreography.mixer.words import SEARCHES, Candidates, search_words
from choreograph.core.errors import NoPathError, ParameterError


def candidates_of(rng: np.random.Generator, n_words: int, first: int = 0) -> Candidates:
    poses = rng.normal(size=(2, n_words, 3, 21, 3))
    return Candidates(first + np.arange(n_words), rng.random(n_words), *poses)


def cost(candidates: list[Candidates], rows: tuple[int, ...]) -> float:
    """What a way costs, written down directly."""
    total = sum(here.cost_m[row] for here, row in zip(candidates, rows, strict=True))
    for (a, i), (b, j) in itertools.pairwise(zip(candidates, rows, strict=True)):
        total += np.sqrt(np.mean(np.sum((a.last_m[i] - b.first_m[j]) ** 2, axis=-1)))
        total += 0.15 * (a.words[i] == b.words[j])
    return total


@settings(max_examples=30)
@given(st.integers(0, 10_000), st.lists(st.integers(1, 4), min_size=1, max_size=5))
def test_the_exact_search_finds_the_cheapest_sequence(seed, sizes):
    rng = np.random.default_rng(seed)
    candidates = [candidates_of(rng, size) for size in sizes]
    ways = {rows: cost(candidates, rows) for rows in itertools.product(*(range(size) for size in sizes))}
    found = tuple(int(word) for word in search_words(candidates))  # words are rows here
    assert ways[found] == pytest.approx(min(ways.values()))
    greedy = tuple(int(word) for word in search_words(candidates, search="greedy"))
    assert ways[greedy] >= ways[found] - 1e-9


@pytest.mark.parametrize("search", SEARCHES)
def test_the_word_that_really_followed_is_taken(search):
    rng = np.random.default_rng(0)
    first, second = candidates_of(rng, 1), candidates_of(rng, 9, first=10)
    second.cost_m[:] = 0.0
    second.first_m[6] = first.last_m[0]
    assert search_words([first, second], search=search).tolist() == [0, 16]


def test_the_same_word_again_only_if_nothing_else_is_near():
    poses = np.zeros((2, 2, 3, 21, 3))
    poses[0, 1] += 0.05 / np.sqrt(3)  # the other word begins 5 cm away
    here = Candidates(np.array([4, 5]), np.zeros(2), *poses)
    assert search_words([here.without(5), here]).tolist() == [4, 5]
    far = Candidates(here.words, here.cost_m, here.first_m * 20, here.last_m)  # 1 m
    assert search_words([far.without(5), far]).tolist() == [4, 4]


@pytest.mark.parametrize("search", SEARCHES)
def test_forbidden_words_are_never_chosen(search):
    rng = np.random.default_rng(1)
    candidates = [candidates_of(rng, 3).without(0).without(2) for _ in range(4)]
    assert search_words(candidates, search=search).tolist() == [1, 1, 1, 1]
    with pytest.raises(NoPathError, match="slot 2"):
        search_words([*candidates[:2], candidates[2].without(1), candidates[3]], search=search)


def test_a_preferred_word_is_kept_unless_another_is_much_better():
    here = Candidates(np.arange(2), np.array([0.05, 0.0]), *np.zeros((2, 2, 3, 21, 3)))
    assert search_words([here]).tolist() == [1]
    assert search_words([here.preferring(0, 0.1)]).tolist() == [0]
    assert search_words([here.preferring(0, 0.01)]).tolist() == [1]


def test_no_slot_and_an_unknown_search():
    assert len(search_words([])) == 0
    with pytest.raises(ParameterError, match="'best'"):
        search_words([], search="best")
