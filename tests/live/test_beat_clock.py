"""The clock of beats is continuous, increases, and corrects an error in two beats."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from choreograph.live.beat_clock import CORRECTION_BEATS, BeatClock

STEADY = replace(BeatClock.steady(10.0, 4.25, 0.5, 1), metre=4, first_number=2)


@pytest.mark.parametrize("error", [-0.3, 0.0, 0.3])
@pytest.mark.parametrize("period_s", [0.45, 0.5, 0.56])
def test_positions_are_continuous_and_times_are_their_inverse(error, period_s):
    clock = STEADY.followed(11.3, error, period_s)
    times_s = np.linspace(5.0, 30.0, 2501)
    beats = clock.beat_at(times_s)
    assert (np.diff(beats) > 0).all()
    assert np.diff(beats).max() < 1.3 * 0.01 / 0.45
    np.testing.assert_allclose(clock.time_at(beats), times_s, atol=1e-9)
    assert clock.beat_at(11.3) == pytest.approx(STEADY.beat_at(11.3))


def test_an_error_is_corrected_after_two_beats_and_the_tempo_is_the_new_one():
    clock = STEADY.followed(11.0, 0.2, 0.4)
    later_s = 11.0 + CORRECTION_BEATS * 0.4
    assert clock.beat_at(later_s) == pytest.approx(STEADY.beat_at(11.0) + CORRECTION_BEATS + 0.2)
    assert clock.beat_at(later_s + 4.0) - clock.beat_at(later_s) == pytest.approx(10.0)
    assert (clock.metre, clock.first_number, clock.generation) == (4, 2, 1)


def test_counts_are_the_beats_between_two_times_with_their_numbers():
    counts = STEADY.counts(10.1, 12.4)  # beats 5 to 9, from 10.375 s on
    np.testing.assert_allclose(counts.times_s, 0.275 + 0.5 * np.arange(5))
    assert counts.numbers.tolist() == [4, 1, 2, 3, 4] and counts.metre == 4
    assert len(STEADY.counts(10.4, 10.6)) == 0
    without = BeatClock.steady(0.0, 0.0, 0.5, 0).counts(0.0, 2.0)
    assert without.metre == 0 and not without.numbers.any()


def test_beats_before_the_stream_have_numbers_as_well():
    assert STEADY.number_of(np.array([-3, -2, -1, 0])).tolist() == [4, 1, 2, 3]
