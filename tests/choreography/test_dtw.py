"""Subsequence DTW: librosa's cost, the slope limits, synthetic matches, and bad input."""

from __future__ import annotations

import librosa
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from choreograph.choreography.graph.warping import subsequence_dtw
from choreograph.core.errors import ParameterError
from choreograph.core.timebase import MAX_SLOPE, MIN_SLOPE

finite = st.floats(-4, 4, width=32)
queries = arrays(np.float32, st.integers(2, 40), elements=finite)


def librosa_cost(query, target) -> float:
    table = librosa.sequence.dtw(
        X=query[None], Y=target[None], metric="sqeuclidean", subseq=True, backtrack=False,
        step_sizes_sigma=np.array([[1, 1], [1, 2], [2, 1]]), weights_mul=np.array([1.0, 1.0, 2.0]),
        weights_add=np.zeros(3),
    )  # fmt: skip
    return table[-1].min() / len(query)


@pytest.mark.parametrize("seed", range(10))
def test_costs_are_librosas(seed):
    rng = np.random.default_rng(seed)
    query = rng.normal(size=80).astype(np.float32)
    targets = rng.normal(size=(3, 160)).astype(np.float32)
    _, costs = subsequence_dtw(query, targets)
    assert costs == pytest.approx([librosa_cost(query, target) for target in targets], rel=1e-5)


@settings(max_examples=60, deadline=None)
@given(queries, st.integers(0, 60), st.integers(0, 2**32 - 1))
def test_laws_of_the_path(query, longer, seed):
    target = np.random.default_rng(seed).normal(size=len(query) // 2 + 2 + longer).astype(np.float32)
    frames, cost = subsequence_dtw(query, target)
    assert frames.shape == query.shape
    assert frames[0] >= 0
    assert frames[-1] <= len(target) - 1
    slopes = np.diff(frames)
    assert (slopes >= MIN_SLOPE).all()
    assert (slopes <= MAX_SLOPE).all()
    assert 0 <= cost <= (np.abs(query).max() + np.abs(target).max()) ** 2


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_a_longer_target_never_costs_more_and_a_common_offset_changes_nothing(seed):
    rng = np.random.default_rng(seed)
    query, target = rng.normal(size=30), rng.normal(size=50)
    _, cost = subsequence_dtw(query, target)
    _, longer = subsequence_dtw(query, np.concatenate([target, rng.normal(size=20)]))
    assert longer <= cost  # more to choose from is never worse
    frames, shifted = subsequence_dtw(query + 1.0, target + 1.0)
    assert shifted == pytest.approx(cost, abs=1e-5)
    assert len(frames) == 30


@pytest.mark.parametrize("start", [0, 13, 80])
def test_an_excerpt_is_found_where_it_was_taken(start):
    target = np.random.default_rng(3).normal(size=160)
    frames, cost = subsequence_dtw(target[start : start + 80], target)
    assert cost == 0
    assert np.array_equal(frames, np.arange(start, start + 80))


@pytest.mark.parametrize("speed", [0.6, 1.5])
def test_a_synthetic_tempo_is_found(speed):
    curve = np.cumsum(np.random.default_rng(5).normal(size=160))  # smooth enough for a unique match
    where = 10 + speed * np.arange(60)
    frames, _ = subsequence_dtw(np.interp(where, np.arange(160), curve), curve)
    assert np.abs(frames - where).max() <= 2.0  # the path has steps of a frame or two only


def test_batches_match_single_calls():
    rng = np.random.default_rng(0)
    many, targets = rng.normal(size=(5, 40)), rng.normal(size=(5, 70))
    frames, costs = subsequence_dtw(many, targets)
    for i in range(5):
        alone, cost = subsequence_dtw(many[i], targets[i])
        assert np.array_equal(alone, frames[i])
        assert cost == costs[i]
    assert subsequence_dtw(many[0], targets)[0].shape == (5, 40)
    assert subsequence_dtw(many, targets[0])[0].shape == (5, 40)


@pytest.mark.parametrize(
    ("query", "targets"),
    [
        (np.zeros((2, 8)), np.zeros((3, 20))),  # neither as many nor one
        (np.zeros(40), np.zeros(20)),  # 39 frames do not fit in 19 at half speed
        (np.zeros(1), np.zeros(20)),
        (np.zeros(0), np.zeros(0)),
        (np.array([0.0, np.nan]), np.zeros(20)),
        (np.zeros(8), np.full(20, np.inf)),
        (np.zeros((1, 1, 8)), np.zeros(20)),
        (np.float64(3.0), np.zeros(20)),
    ],
)
def test_malformed_input_is_refused_in_one_line(query, targets):
    with pytest.raises(ParameterError) as error:
        subsequence_dtw(query, targets)
    assert "\n" not in str(error.value)


def test_the_shortest_target_for_a_query():
    frames, _ = subsequence_dtw(np.arange(41.0), np.arange(21.0))
    assert frames[0] == 0
    assert frames[-1] == 20
