"""Energy follows level, bass and onsets, not the gain. Silences of whole bars are stops."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from choreograph.core.counts import NO_COUNTS, Counts
from choreograph.core.timebase import SAMPLE_RATE_HZ
from choreograph.music.song_features import energy_per_second, stops_s


def noise(levels_db: list[float], seconds_each: int = 10) -> np.ndarray:
    rng = np.random.default_rng(0)
    return np.concatenate(
        [10 ** (db / 20) * rng.normal(size=seconds_each * SAMPLE_RATE_HZ) for db in levels_db]
    )


def test_soft_and_loud_parts():
    energy = energy_per_second(noise([-20, -3, 0, -40]), 40)
    assert energy.shape == (40,) and energy.dtype == np.float32
    np.testing.assert_allclose(energy[[5, 15, 25, 35]], [1 - 20 / 24, 1 - 3 / 24, 1.0, 0.0], atol=0.06)


def test_a_rise_of_24_db_does_not_saturate():
    energy = energy_per_second(noise([-24, -18, -12, -6, 0], 8), 40)
    np.testing.assert_allclose(energy[4::8], [0.0, 0.25, 0.5, 0.75, 1.0], atol=0.06)


def test_a_part_15_db_softer_is_soft_in_a_song_that_fades_in_from_near_silence():
    energy = energy_per_second(noise([-60, 0, -15, 0], 10), 40)
    assert energy[25] < 0.45 and energy[15] > 0.95


def test_small_differences_of_level_remain_small():
    energy = energy_per_second(noise([0, -0.6, 0, -0.6], 8), 32)
    assert energy.min() > 0.85


def test_a_part_without_bass_and_onsets_has_less_energy_at_the_same_level():
    times_s = np.arange(30 * SAMPLE_RATE_HZ) / SAMPLE_RATE_HZ
    bass, melody = np.sin(2 * np.pi * 60 * times_s), np.sin(2 * np.pi * 440 * times_s)
    soft = (times_s > 10) & (times_s < 20)
    samples = np.where(soft, melody, (bass + melody) / np.sqrt(2))
    onsets = np.where((np.arange(30 * 60) // 60 % 30 > 9) & (np.arange(30 * 60) // 60 < 20), 0.1, 1.0)
    without = energy_per_second(samples, 30)
    energy = energy_per_second(samples, 30, onsets)
    assert without[15] < 0.85 * without[5] and without[5] > 0.95
    assert energy[15] < without[15] and energy[5] > 0.95


COUNTS = Counts(0.5 * np.arange(80), np.arange(80) % 4 + 1, 4)


@pytest.mark.parametrize("n_bars", [1, 2])
@pytest.mark.parametrize("hit_s", [0.0, 0.3])
def test_a_silence_of_whole_bars_is_a_stop_from_a_count_1_to_another(n_bars, hit_s):
    samples = noise([0], 40)
    begins, ends = (round(time_s * SAMPLE_RATE_HZ) for time_s in (12.0 + hit_s, 12.0 + 2.0 * n_bars))
    samples[begins:ends] = 0.0
    ((rests_s, moves_s),) = stops_s(samples, COUNTS)
    assert moves_s - rests_s == pytest.approx(2.0 * n_bars)  # whole bars, so that counts remain counts
    assert rests_s == pytest.approx(12.1 if hit_s else 11.95)  # just after the last sound


def test_short_silences_soft_parts_and_the_ends_are_no_stops():
    samples = noise([0], 40)
    samples[: 3 * SAMPLE_RATE_HZ] = samples[-3 * SAMPLE_RATE_HZ :] = 0.0
    samples[12 * SAMPLE_RATE_HZ : round(12.6 * SAMPLE_RATE_HZ)] = 0.0
    samples[20 * SAMPLE_RATE_HZ : 24 * SAMPLE_RATE_HZ] *= 0.05
    assert stops_s(samples, COUNTS) == ()
    assert stops_s(np.zeros(SAMPLE_RATE_HZ), COUNTS) == ()
    samples[12 * SAMPLE_RATE_HZ : 16 * SAMPLE_RATE_HZ] = 0.0
    assert len(stops_s(samples, COUNTS)) == 1 and stops_s(samples, NO_COUNTS) == ()


@given(st.floats(-40, 20))
@settings(max_examples=10)
def test_gain_does_not_matter(gain_db):
    samples = noise([-5, 0], 5)
    louder = energy_per_second(10 ** (gain_db / 20) * samples, 10)
    np.testing.assert_allclose(louder, energy_per_second(samples, 10), atol=1e-5)


def test_a_last_second_that_is_not_full_is_as_loud():
    samples = noise([0])[: round(9.3 * SAMPLE_RATE_HZ)]
    energy = energy_per_second(samples, 10)
    assert energy.min() > 0.9


def test_silence_has_no_energy():
    assert not energy_per_second(np.zeros(3 * SAMPLE_RATE_HZ), 3).any()


def test_one_bang_does_not_soften_the_rest():
    samples = noise([0], 20)
    samples[10 * SAMPLE_RATE_HZ : 10 * SAMPLE_RATE_HZ + 2000] *= 10
    energy = energy_per_second(samples, 20)
    assert energy.min() > 0.9


def test_silence_does_not_make_everything_loud():
    samples = np.concatenate([np.zeros(25 * SAMPLE_RATE_HZ), noise([0], 6), np.zeros(25 * SAMPLE_RATE_HZ)])
    energy = energy_per_second(samples, 56)
    assert (energy[28:30] > 0.9).all()
    assert not energy[:20].any() and not energy[40:].any()
