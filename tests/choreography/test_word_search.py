"""Choosing words: the cheapest way of all, what really followed, and what is forbidden."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from choreograph.choreography.mixer.words import SEARCHES, Candidates, search_words
from choreograph.core.errors import NoPathError, ParameterError


def candidates_of(rng: np.random.Generator, n_words: int, first: int = 0) -> Candidates:
    poses = rng.normal(size=(2, n_words, 3, 21, 3))
    words = first + np.arange(n_words)
    return Candidates(words, words // 8, rng.random(n_words), *poses)


def cost(candidates: list[Candidates], rows: tuple[int, ...], cut_cost_m: float = 0.0) -> float:
    """What a way costs, written down directly."""
    total = sum(here.cost_m[row] for here, row in zip(candidates, rows, strict=True))
    for (a, i), (b, j) in itertools.pairwise(zip(candidates, rows, strict=True)):
        total += np.sqrt(np.mean(np.sum((a.last_m[i] - b.first_m[j]) ** 2, axis=-1)))
        total += 0.15 * (a.words[i] == b.words[j])
        follows = b.words[j] == a.words[i] + 1 and b.takes[j] == a.takes[i]
        total += 0.0 if follows else cut_cost_m
    return total


@settings(max_examples=30)
@given(
    st.integers(0, 10_000),
    st.lists(st.integers(1, 4), min_size=1, max_size=5),
    st.sampled_from([0.0, 0.5]),
    st.sampled_from([0, 6]),
)
def test_the_exact_search_finds_the_cheapest_sequence(seed, sizes, cut_cost_m, first):
    """Words 6 to 9 are of two takes."""
    rng = np.random.default_rng(seed)
    candidates = [candidates_of(rng, size, first) for size in sizes]
    all_rows = itertools.product(*(range(size) for size in sizes))
    ways = {rows: cost(candidates, rows, cut_cost_m) for rows in all_rows}
    found, greedy = (
        tuple((search_words(candidates, search=search, cut_cost_m=cut_cost_m) - first).tolist())
        for search in ("exact", "greedy")
    )
    assert ways[found] == pytest.approx(min(ways.values()))
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
    here = Candidates(np.array([4, 5]), np.zeros(2, int), np.zeros(2), *poses)
    assert search_words([here.without(5), here]).tolist() == [4, 5]
    far = replace(here, first_m=here.first_m * 20)  # 1 m
    assert search_words([far.without(5), far]).tolist() == [4, 4]


@pytest.mark.parametrize("search", SEARCHES)
def test_forbidden_words_are_never_chosen(search):
    rng = np.random.default_rng(1)
    candidates = [candidates_of(rng, 3).without(0).without(2) for _ in range(4)]
    assert search_words(candidates, search=search).tolist() == [1, 1, 1, 1]
    with pytest.raises(NoPathError, match="slot 2"):
        search_words([*candidates[:2], candidates[2].without(1), candidates[3]], search=search)


def test_a_preferred_word_is_kept_unless_another_is_much_better():
    here = Candidates(np.arange(2), np.zeros(2, int), np.array([0.05, 0.0]), *np.zeros((2, 2, 3, 21, 3)))
    assert search_words([here]).tolist() == [1]
    assert search_words([here.preferring(0, 0.1)]).tolist() == [0]
    assert search_words([here.preferring(0, 0.01)]).tolist() == [1]


def test_no_slot_and_an_unknown_search():
    assert len(search_words([])) == 0
    with pytest.raises(ParameterError, match="'best'"):
        search_words([], search="best")
