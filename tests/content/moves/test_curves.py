"""Curves pass through their keyframes and rest there; counts and seconds are inverse."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from choreograph.core.errors import ParameterError
from content.moves.curves import Keyframe, Tempo, ease, evaluate, spring_follow, spring_lag_s

gaps = st.lists(st.floats(0.25, 1.5), min_size=2, max_size=20)


@given(gaps)
def test_counts_and_seconds_are_inverse_on_beats(gaps_s: list[float]) -> None:
    beats = np.cumsum(gaps_s)
    tempo = Tempo(beats)
    np.testing.assert_allclose(tempo.counts(beats), np.arange(len(beats)), atol=1e-9)
    np.testing.assert_allclose(tempo.times_s(np.arange(len(beats))), beats, atol=1e-9)


@given(gaps)
def test_counts_increase(gaps_s: list[float]) -> None:
    beats = np.cumsum(gaps_s)
    times = np.linspace(beats[0] - 3.0, beats[-1] + 3.0, 400)
    assert (np.diff(Tempo(beats).counts(times)) > 0).all()


@pytest.mark.parametrize("beats", [[1.0], [1.0, 1.0], [2.0, 1.0], [0.0, np.nan]])
def test_beats_that_do_not_increase_are_refused(beats: list[float]) -> None:
    with pytest.raises(ParameterError, match="increasing beat times"):
        Tempo(np.array(beats))


@given(st.lists(st.floats(-2, 2), min_size=3, max_size=8), st.floats(0, 0.5), st.floats(0, 1))
def test_a_curve_goes_through_its_keyframes(values: list[float], hold: float, flow: float) -> None:
    keys = [Keyframe(float(i), (v,), flow, hold) for i, v in enumerate(values)]
    np.testing.assert_allclose(evaluate(keys, np.arange(len(values), dtype=float))[:, 0], values, atol=1e-9)


def test_a_curve_is_at_rest_on_its_keyframes_and_only_there() -> None:
    keys = [Keyframe(float(i), (float(i % 2),)) for i in range(6)]
    counts = np.arange(0.0, 5.0, 0.001)
    speed = np.abs(np.gradient(evaluate(keys, counts)[:, 0], counts))
    assert speed[np.abs(counts - np.round(counts)) < 0.01].max() < 0.01
    assert speed[np.abs(counts % 1.0 - 0.5) < 0.1].min() > 1.5


def test_flow_passes_through() -> None:
    keys = [Keyframe(0.0, (0.0,)), Keyframe(1.0, (1.0,), flow=1.0), Keyframe(2.0, (2.0,))]
    value = evaluate(keys, np.array([0.999, 1.001]))[:, 0]
    assert np.diff(value)[0] / 0.002 == pytest.approx(1.0, rel=0.02)


def test_hold_waits_then_goes_faster() -> None:
    late = evaluate([Keyframe(0.0, (0.0,)), Keyframe(1.0, (1.0,), hold=0.4)], np.array([0.39, 0.7]))[:, 0]
    assert late[0] == 0.0 and late[1] == pytest.approx(0.5)


def test_later_written_of_two_keys_on_one_count_wins() -> None:
    assert evaluate([Keyframe(1.0, (1.0,)), Keyframe(1.0, (2.0,))], np.array([1.0]))[0, 0] == 2.0


@given(st.floats(0, 1))
def test_ease_is_symmetric(u: float) -> None:
    assert ease(np.array(u)) + ease(np.array(1 - u)) == pytest.approx(1.0, abs=1e-9)


def test_spring_follow_settles_overshoots_and_lags() -> None:
    step = np.repeat([0.0, 1.0], 120)[:, None]
    after = spring_follow(step, 60.0, frequency_hz=4.0, damping=0.72)[:, 0]
    assert after[-1] == pytest.approx(1.0, abs=1e-3)
    assert 1.01 < after.max() < 1.08
    ramp = np.arange(240.0)[:, None] / 60.0
    lag = (ramp - spring_follow(ramp, 60.0, frequency_hz=4.0, damping=0.72))[-1, 0]
    assert lag == pytest.approx(spring_lag_s(4.0, 0.72), abs=1e-3)
