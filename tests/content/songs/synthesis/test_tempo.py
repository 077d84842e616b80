"""Tempo maps against counted beats; swing leaves beats in place."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from choreograph.core.errors import ParameterError
from content.songs.synthesis.song import TempoMap, apply_swing, beats_within

pytestmark = pytest.mark.slow

bpms = st.floats(40.0, 220.0)


def test_a_steady_tempo_is_even():
    assert TempoMap.steady(120.0).seconds([0, 1, 2, 7.5]) == pytest.approx([0.0, 0.5, 1.0, 3.75])


def test_a_ramp_gains_the_same_bpm_each_second():
    ramp = TempoMap.ramp(90.0, 140.0, 115.0)  # mean 115 BPM: exactly a minute
    assert ramp.seconds([115.0])[0] == pytest.approx(60.0)
    beats = np.linspace(0.0, 115.0, 400)
    assert ramp.bpm_at(beats) == pytest.approx(90.0 + 50.0 * ramp.seconds(beats) / 60.0)


@given(bpms, bpms, st.floats(4.0, 300.0))
def test_beats_pass_at_the_tempo_of_the_map(from_bpm, to_bpm, n_beats):
    ramp = TempoMap.ramp(from_bpm, to_bpm, n_beats)
    parts = (-5.0, 0.0, 500), (0.0, n_beats, 2000), (n_beats, n_beats + 5.0, 500)
    beats = np.unique(np.concatenate([np.linspace(*part) for part in parts]))  # those of the points as well
    times_s = ramp.seconds(beats)
    assert (np.diff(times_s) > 0).all()
    bpm = ramp.bpm_at(beats)  # linear in time between two points, so that the mean is that of both ends
    mean_bpm = 60.0 * np.diff(beats) / np.diff(times_s)
    np.testing.assert_allclose(mean_bpm, 0.5 * (bpm[1:] + bpm[:-1]), rtol=1e-8)
    assert ramp.seconds([0.0])[0] == 0.0


def test_pieces_of_a_map_are_contiguous():
    tempo = TempoMap(((0.0, 100.0), (32.0, 100.0), (64.0, 150.0), (96.0, 75.0)))
    assert tempo.seconds([32.0])[0] == pytest.approx(19.2)
    assert tempo.seconds([64.0])[0] == pytest.approx(19.2 + 32 * 60 / 125)
    assert tempo.seconds([97.0])[0] - tempo.seconds([96.0])[0] == pytest.approx(0.8)
    assert beats_within(tempo, float(tempo.seconds([71.3])[0])) == pytest.approx(71.3)


@given(st.floats(0.0, 1.0), st.sampled_from([0.25, 0.5]))
def test_swing_keeps_the_beats_and_the_order(swing, unit):
    beats = np.arange(0.0, 16.0, 0.125)
    late = apply_swing(beats, swing, unit)
    assert late[::8] == pytest.approx(beats[::8])
    assert (np.diff(late) > 0).all()
    assert (late >= beats - 1e-9).all()


def test_full_swing_is_triplets():
    assert apply_swing([0.5, 1.5], 1.0) == pytest.approx([2 / 3, 5 / 3])
    assert apply_swing([0.25, 0.75], 1.0, 0.25) == pytest.approx([1 / 3, 0.5 + 1 / 3])


@pytest.mark.parametrize("points", [(), ((0.0, 10.0),), ((0.0, 100.0), (0.0, 120.0)), ((0.0, float("nan")),)])
def test_maps_that_cannot_be_played_are_named(points):
    with pytest.raises(ParameterError, match="expected a"):
        TempoMap(points)
