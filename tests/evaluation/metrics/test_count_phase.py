"""Phase of motion beats within the count: planted phases, the earth mover's distance, chance and halves."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linprog

from choreograph.core.errors import ParameterError
from choreograph.evaluation.metrics.count_phase import evaluate, phase_distance, phase_histogram, phases

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
    assert evaluate(same, experts, songs, rng)["phase_nearness"] > 0.9
    assert evaluate(opposite, experts, songs, rng)["phase_nearness"] < -0.5
    uniform = evaluate(rng.uniform(0, 1, 360), experts, songs, rng)
    assert uniform["phase_nearness"] == pytest.approx(0.0, abs=0.15)
    assert uniform["phase_distance"] == pytest.approx(uniform["phase_distance_chance"], abs=0.03)


def test_what_cannot_be_known_is_nan():
    rng = np.random.default_rng(0)
    one_song = evaluate([0.5], dances(rng, 0.5, 2), ["a", "a"], rng)
    for nothing in (evaluate([], [], [], rng), evaluate([], dances(rng, 0.5), list("abcdef"), rng), one_song):
        assert all(np.isnan(value) for value in nothing.values())
    apart = [*dances(rng, 0.0, 1), *dances(rng, 0.5, 1)]  # halves are farther apart than chance is
    assert np.isnan(evaluate(rng.uniform(0, 1, 300), apart, ["a", "b"], rng)["phase_nearness"])


def test_all_three_distances_are_of_as_many_phases():
    """Experts of no phase at all: their halves are as far apart as chance, however long the dance is."""
    rng = np.random.default_rng(4)
    experts = [rng.uniform(0, 1, 50) for _ in range(8)]
    for n_danced in (20, 200, 2000):
        made = [
            evaluate(rng.uniform(0, 1, n_danced), experts, list("abcdefgh"), rng, rounds=10)
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
    found = evaluate(off_beat, [on_beat] * 4, list("abcd"), rng)
    assert (found["phase_distance"], found["phase_distance_halves"]) == (0.5, 0.0)
    assert found["phase_distance_chance"] == pytest.approx(0.25, abs=0.01)
