"""Loudness is normalised independently of gain and pauses."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from choreograph.core.errors import ParameterError
from choreograph.core.timebase import SAMPLE_RATE_HZ
from choreograph.music.mel import loudness, scaled

NOISE = np.random.default_rng(1).normal(0, 0.1, SAMPLE_RATE_HZ).astype(np.float32)


def at_unit_loudness(samples):
    samples = samples.astype(np.float32)
    return scaled(samples, loudness(samples))


@given(st.floats(1e-2, 1e3))
@settings(max_examples=20, deadline=None)
def test_gain_is_removed(gain):
    np.testing.assert_allclose(at_unit_loudness(NOISE * gain), at_unit_loudness(NOISE), rtol=1e-4, atol=1e-6)
    assert np.sqrt(np.mean(at_unit_loudness(NOISE * gain) ** 2)) == pytest.approx(1.0, abs=1e-4)


@given(st.integers(0, 60), st.integers(0, 60), st.sampled_from([0.0, 1e-6]))
@settings(max_examples=20, deadline=None)
def test_pauses_do_not_count(before, after, hiss):
    """Pauses in blocks of 1/30 s; the hiss is 100 dB below the song."""
    pauses = [np.full(n * 735, hiss, np.float32) for n in (before, after)]
    song = np.concatenate([pauses[0], NOISE, pauses[1]])
    loud = at_unit_loudness(song)[before * 735 :][: len(NOISE)]
    np.testing.assert_allclose(loud, at_unit_loudness(NOISE), rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("samples", [np.zeros(5000), np.full(1, 1e-5), np.tile([9e-5, -9e-5], 400)])
def test_silence_stays_silent(samples):
    np.testing.assert_array_equal(at_unit_loudness(samples), np.zeros(len(samples)))


@pytest.mark.parametrize(
    "samples", [np.zeros(0), np.zeros((100, 2)), np.array([0.1, np.nan]), np.array([0.1, -np.inf])]
)
def test_invalid_samples_are_refused_in_one_line(samples):
    with pytest.raises(ParameterError) as error:
        at_unit_loudness(samples)
    assert "\n" not in str(error.value)
