"""Count metrics: perfect, empty and malformed input, planted offsets and drifts, chance."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linprog

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
    evaluate_phases,
    phase_distance,
    phase_histogram,
    phases,
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


# Phase of motion beats within the count: planted phases, the earth mover's distance, chance and halves.


UNIFORM = np.full(8, 1 / 8)


def at_bin(*bins: int) -> np.ndarray:
    return np.bincount(bins, minlength=8) / len(bins)


def histograms():
    counts = st.lists(st.integers(0, 9), min_size=8, max_size=8).filter(any)
    return counts.map(lambda c: np.array(c) / sum(c))


def dances(rng, centre: float, n: int = 6, beats: int = 60) -> list[np.ndarray]:
    return [rng.normal(centre, 0.06, beats) % 1.0 for _ in range(n)]


def test_phases_are_from_beat_to_beat():
    beats = np.array([1.0, 2.0, 4.0])
    found = phases([0.5, 1.0, 1.25, 2.5, 3.9, 4.5], beats)
    assert found == pytest.approx([0.0, 0.25, 0.25, 0.95])
    assert len(phases([0.5], np.array([1.0]))) == len(phases([], beats)) == 0


def test_the_first_bin_is_around_the_beat():
    assert phase_histogram([0.95, 0.0, 0.06, 0.1, 1.0]) == pytest.approx(at_bin(0, 0, 0, 1, 0))
    assert np.isnan(phase_histogram([])).all()


def test_known_distances():
    assert phase_distance(at_bin(0), at_bin(0)) == 0.0
    assert phase_distance(at_bin(0), at_bin(7)) == pytest.approx(1 / 8)  # round the circle
    assert phase_distance(at_bin(1), at_bin(5)) == pytest.approx(1 / 2)
    assert phase_distance(at_bin(3), UNIFORM) == pytest.approx(1 / 4)
    assert np.isnan(phase_distance(at_bin(0), np.full(8, np.nan)))


def test_the_distance_is_the_least_that_must_be_moved():
    rng = np.random.default_rng(0)
    apart = np.abs(np.arange(8)[:, None] - np.arange(8))
    cost = np.minimum(apart, 8 - apart) / 8
    leaving, arriving = np.kron(np.eye(8), np.ones(8)), np.kron(np.ones(8), np.eye(8))
    for a, b in rng.dirichlet(np.ones(8), (20, 2)):
        best = linprog(cost.ravel(), A_eq=np.vstack([leaving, arriving]), b_eq=np.r_[a, b])
        assert phase_distance(a, b) == pytest.approx(best.fun, abs=1e-7)


@given(histograms(), histograms(), histograms(), st.integers(0, 7))
def test_laws(a, b, c, turn):
    assert 0 <= phase_distance(a, b) <= 0.5 + 1e-9
    assert phase_distance(a, b) == pytest.approx(phase_distance(b, a), abs=1e-9)
    assert phase_distance(a, b) <= phase_distance(a, c) + phase_distance(c, b) + 1e-9
    assert phase_distance(np.roll(a, turn), np.roll(b, turn)) == pytest.approx(phase_distance(a, b), abs=1e-9)


@pytest.mark.parametrize(
    ("a", "b"), [(UNIFORM, UNIFORM[:4]), (UNIFORM, 8 * UNIFORM), (UNIFORM, np.eye(8)), (-UNIFORM, UNIFORM)]
)
def test_malformed_histograms(a, b):
    with pytest.raises(ParameterError):
        phase_distance(a, b)


@pytest.mark.parametrize("given_", [[0.5, np.nan], [-0.1], [1.1], [[0.5]]])
def test_malformed_phases(given_):
    with pytest.raises(ParameterError):
        phase_histogram(given_)


def test_nearness_from_chance_to_the_experts_themselves():
    rng = np.random.default_rng(1)
    experts, songs = dances(rng, 0.8), ["a", "b", "c", "d", "e", "e"]
    same, opposite = (np.concatenate(dances(rng, centre)) for centre in (0.8, 0.3))
    assert evaluate_phases(same, experts, songs, rng)["phase_nearness"] > 0.9
    assert evaluate_phases(opposite, experts, songs, rng)["phase_nearness"] < -0.5
    uniform = evaluate_phases(rng.uniform(0, 1, 360), experts, songs, rng)
    assert uniform["phase_nearness"] == pytest.approx(0.0, abs=0.15)
    assert uniform["phase_distance"] == pytest.approx(uniform["phase_distance_chance"], abs=0.03)


def test_what_cannot_be_known_is_nan():
    rng = np.random.default_rng(0)
    one_song = evaluate_phases([0.5], dances(rng, 0.5, 2), ["a", "a"], rng)
    for nothing in (
        evaluate_phases([], [], [], rng),
        evaluate_phases([], dances(rng, 0.5), list("abcdef"), rng),
        one_song,
    ):
        assert all(np.isnan(value) for value in nothing.values())
    apart = [*dances(rng, 0.0, 1), *dances(rng, 0.5, 1)]  # halves are farther apart than chance is
    assert np.isnan(evaluate_phases(rng.uniform(0, 1, 300), apart, ["a", "b"], rng)["phase_nearness"])


def test_all_three_distances_are_of_as_many_phases():
    """Experts of no phase at all: their halves are as far apart as chance, however long the dance is."""
    rng = np.random.default_rng(4)
    experts = [rng.uniform(0, 1, 50) for _ in range(8)]
    for n_danced in (20, 200, 2000):
        made = [
            evaluate_phases(rng.uniform(0, 1, n_danced), experts, list("abcdefgh"), rng, rounds=10)
            for _ in range(30)
        ]
        distance, chance, halved = (
            np.mean([found[f"phase_distance{name}"] for found in made]) for name in ("", "_chance", "_halves")
        )
        assert halved == pytest.approx(chance, rel=0.25)
        assert distance == pytest.approx(chance, rel=0.25)


def test_far_from_chance_the_distance_is_that_of_the_histograms():
    rng = np.random.default_rng(5)
    on_beat, off_beat = np.zeros(100), np.full(100, 0.5)
    found = evaluate_phases(off_beat, [on_beat] * 4, list("abcd"), rng)
    assert (found["phase_distance"], found["phase_distance_halves"]) == (0.5, 0.0)
    assert found["phase_distance_chance"] == pytest.approx(0.25, abs=0.01)
