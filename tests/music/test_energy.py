"""Energy follows the level, not the gain."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from choreograph.core.timebase import SAMPLE_RATE_HZ
from choreograph.music.song_features import energy_per_second


def noise(levels_db: list[float], seconds_each: int = 10) -> np.ndarray:
    rng = np.random.default_rng(0)
    return np.concatenate(
        [10 ** (db / 20) * rng.normal(size=seconds_each * SAMPLE_RATE_HZ) for db in levels_db]
    )


def test_soft_and_loud_parts():
    energy = energy_per_second(noise([-20, -3, 0, -40]), 40)
    assert energy.shape == (40,) and energy.dtype == np.float32
    assert (energy[:7] == 0).all() and (energy[33:] == 0).all()
    np.testing.assert_allclose(energy[13:17], 0.5, atol=0.1)
    np.testing.assert_allclose(energy[23:27], 1.0, atol=0.05)


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
