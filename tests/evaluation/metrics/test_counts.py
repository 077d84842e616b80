"""Count metrics: perfect, empty and malformed input, planted offsets and drifts, chance."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from choreograph.core.counts import numbers_in_bar
from choreograph.core.errors import ParameterError
from choreograph.evaluation.metrics.counts import (
    beat_positions,
    count_drift,
    count_error_beats,
    count_error_s,
    counts_per_beat,
    counts_within,
    downbeat_nearest,
    downbeat_share,
    evaluate,
    evaluate_chance,
    uniform_chance,
)

NONE = np.zeros(0)
BEATS_S = 0.3 + 0.5 * np.arange(80)
NUMBERS = numbers_in_bar(80, 4)
RAMP_S = np.cumsum(np.linspace(0.7, 0.4, 80))


@pytest.mark.parametrize("beats_s", [BEATS_S, RAMP_S])
def test_perfect(beats_s):
    assert evaluate(beats_s, NUMBERS, beats_s, NUMBERS) == {
        "count_error_s": 0.0, "count_error_beats": 0.0, "counts_within": 1.0, "downbeat_share": 1.0,
        "downbeat_nearest": 1.0, "counts_per_beat": pytest.approx(1.0), "count_drift": pytest.approx(0.0),
    }  # fmt: skip


@pytest.mark.parametrize("danced_s", [NONE, BEATS_S])
@pytest.mark.parametrize("beats_s", [NONE, BEATS_S[:1]])
def test_without_beats_nothing_is_known(danced_s, beats_s):
    scores = evaluate(danced_s, NUMBERS[: len(danced_s)], beats_s, NUMBERS[: len(beats_s)])
    assert all(np.isnan(value) for value in scores.values())


def test_without_counts_nothing_is_known():
    assert all(np.isnan(value) for value in evaluate(NONE, NONE, BEATS_S, NUMBERS).values())


def test_bars_that_are_not_known_are_not_scored():
    for danced, music in ((np.zeros(80), NUMBERS), (NUMBERS, np.zeros(80))):
        scores = evaluate(BEATS_S, danced, BEATS_S, music)
        assert np.isnan(scores["downbeat_share"]) and np.isnan(scores["downbeat_nearest"])
        assert scores["counts_within"] == 1.0


@pytest.mark.parametrize(
    "given_",
    [
        (BEATS_S[::-1], NUMBERS, BEATS_S, NUMBERS),
        (BEATS_S, NUMBERS, np.append(BEATS_S, np.nan), np.append(NUMBERS, 1)),
        (BEATS_S, NUMBERS[:5], BEATS_S, NUMBERS),
        (BEATS_S, NUMBERS, BEATS_S, NUMBERS - 2),
        (BEATS_S, NUMBERS, BEATS_S, NUMBERS + 0.5),
        (BEATS_S.reshape(8, 10), NUMBERS, BEATS_S, NUMBERS),
    ],
)
def test_malformed(given_):
    with pytest.raises(ParameterError) as raised:
        evaluate(*given_)
    assert "\n" not in str(raised.value)


def test_known_by_hand():
    beats = np.array([1.0, 2.0, 3.0, 5.0])
    # 0.1 beat late, 0.2 early, and 0.3 s = 0.15 beat late where beats are 2 s apart.
    danced = np.array([1.1, 1.8, 3.3])
    assert count_error_s(danced, beats) == pytest.approx((0.1 + 0.2 + 0.3) / 3)
    assert count_error_beats(danced, beats) == pytest.approx((0.1 + 0.2 + 0.15) / 3)
    assert counts_within(danced, beats) == pytest.approx(2 / 3)
    numbers = np.array([1, 2, 1, 2])
    assert downbeat_share(danced, [1, 1, 1], beats, numbers) == pytest.approx(2 / 3)
    assert downbeat_nearest(danced, [1, 1, 1], beats, numbers) == pytest.approx(2 / 3)
    assert downbeat_share(danced, [2, 2, 1], beats, numbers) == 1.0


def test_counts_outside_the_beats_are_left_out():
    far = np.array([-5.0, 0.2, *BEATS_S[1:], 90.0])
    assert counts_within(far, BEATS_S) == counts_within(far[1:-1], BEATS_S) == pytest.approx(79 / 80)


def test_bars_a_beat_off_keep_the_counts_and_lose_the_downbeats():
    off = numbers_in_bar(80, 4, first=2)
    scores = evaluate(BEATS_S, NUMBERS, BEATS_S, off)
    assert (scores["counts_within"], scores["downbeat_share"], scores["downbeat_nearest"]) == (1.0, 0.0, 0.0)


@pytest.mark.parametrize("per_beat", [0.5, 1.0, 2.0])
def test_half_and_double_tempo_are_seen(per_beat):
    danced = BEATS_S[0] + np.arange(0, 39, 0.5 / per_beat)
    assert counts_per_beat(danced, BEATS_S) == pytest.approx(per_beat)


@pytest.mark.parametrize("beats_per_minute", [-3.0, 0.4, 2.0])
def test_drift_is_followed_through_half_a_beat(beats_per_minute):
    true_s = BEATS_S[4:-4]
    danced = true_s + 0.5 * beats_per_minute * true_s / 60.0
    in_its_own_time = beats_per_minute / (1 + beats_per_minute / 120)
    assert count_drift(danced, BEATS_S) == pytest.approx(abs(in_its_own_time))
    assert np.isnan(count_drift(danced[:5], BEATS_S))


@given(st.floats(-0.49, 0.49), st.floats(0.2, 2.0), st.floats(0, 100))
def test_a_constant_offset_is_its_error(offset_beats, period_s, start_s):
    beats = start_s + period_s * np.arange(30)
    danced = beats[2:-2] + offset_beats * period_s
    assert count_error_beats(danced, beats) == pytest.approx(abs(offset_beats), abs=1e-6)
    assert count_error_s(danced, beats) == pytest.approx(abs(offset_beats) * period_s, abs=1e-6)


@given(st.lists(st.floats(0.1, 3.0), min_size=2, max_size=40))
def test_positions_of_the_beats_are_whole(gaps):
    beats = np.cumsum(gaps)
    assert beat_positions(beats, beats) == pytest.approx(np.arange(len(beats)))


@pytest.mark.parametrize("metre", [3, 4])
def test_chance_by_shift_and_by_uniform_phase_agree(metre):
    numbers = numbers_in_bar(80, metre)
    exact = uniform_chance(metre)
    rng = np.random.default_rng(0)
    shifted = evaluate_chance(BEATS_S, numbers, BEATS_S, numbers, duration_s=40.3, rng=rng, rounds=600)
    assert exact["counts_within"] == pytest.approx(0.30)
    for name, level in exact.items():
        assert shifted[name] == pytest.approx(level, abs=0.04)
    random_s = np.unique(rng.uniform(1.0, 39.0, 4000))
    random = evaluate(random_s, np.ones(len(random_s)), BEATS_S, numbers)
    for name, level in exact.items():
        assert random[name] == pytest.approx(level, abs=0.02)


def test_chance_of_impossible_arguments():
    for settings in ({"duration_s": 0.0}, {"duration_s": 10.0, "rounds": 0}):
        with pytest.raises(ParameterError):
            evaluate_chance(BEATS_S, NUMBERS, BEATS_S, NUMBERS, rng=np.random.default_rng(0), **settings)
    with pytest.raises(ParameterError):
        uniform_chance(0)
