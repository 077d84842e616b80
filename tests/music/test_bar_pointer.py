"""Counts from curves of phase with planted answers: noise, ramps, missing stretches, breaks, any rate."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from choreograph.core.counts import Counts
from choreograph.core.errors import ParameterError
from choreograph.evaluation.metrics.counts import beat_positions
from choreograph.music.bar_pointer import (
    DecodedCounts,
    PhaseCurves,
    PointerConfig,
    count_uncertainty,
    decode_counts,
)

CONCENTRATION = 3.0


def curves_of(
    position_beats: np.ndarray, metre: int, fps: float, *, noise_rad: float = 0.0, seed: int = 0
) -> PhaseCurves:
    """Curves of a position in beats from a count 1 at each frame, (T,); the other metre is weak."""
    rng = np.random.default_rng(seed)

    def vectors(turns: np.ndarray, concentration: float) -> np.ndarray:
        angle = 2 * np.pi * turns + noise_rad * rng.standard_normal(len(turns))
        return concentration * np.stack([np.cos(angle), np.sin(angle)], axis=1)

    bar = [vectors(position_beats / m, CONCENTRATION if m == metre else 0.3) for m in (3, 4)]
    return PhaseCurves(vectors(position_beats, CONCENTRATION), np.stack(bar, axis=1), fps)


def positions(bpm: np.ndarray | float, duration_s: float, fps: float, first: float = 0.0) -> np.ndarray:
    bpm = np.broadcast_to(bpm, round(duration_s * fps))
    return first + np.concatenate([[0.0], np.cumsum(bpm[:-1] / 60.0 / fps)])


def assert_counted(counts, position: np.ndarray, metre: int, fps: float, *, within: float = 0.1) -> None:
    # A count may lie between the last frame and the end: the position goes on for a frame.
    until_end = np.append(position, 2 * position[-1] - position[-2])
    at = np.interp(counts.times_s, np.arange(len(until_end)) / fps, until_end)
    assert np.abs(at - np.round(at)).max() < within
    assert (np.diff(np.round(at)) == 1).all()
    # All that are due inside, and none beyond; one due at an end may be found on either side of it.
    first, last, a_frame = position[0], position[-1], position[-1] - position[-2]
    assert np.round(at[0]) <= np.ceil(first + within) and np.round(at[-1]) >= np.floor(last - within)
    assert np.round(at[0]) >= first - within and np.round(at[-1]) <= last + a_frame + within
    assert (counts.numbers == np.round(at) % metre + 1).all()
    assert counts.metre == metre


@pytest.mark.parametrize("missing_s", [(4.0, 4.0), (6.0, 13.0), (0.0, 40.0)])
def test_the_shared_beginning_of_paths_is_that_of_all_frames_at_once(missing_s):
    """Paths are traced back every few frames; without evidence, they stay apart for long."""
    rng = np.random.default_rng(3)
    bpm = 120.0 + np.cumsum(rng.normal(0.0, 0.15, 2400))
    curves = curves_of(positions(bpm, 40.0, 60.0), 4, 60.0, noise_rad=0.2)
    gone = slice(*(round(60 * at_s) for at_s in missing_s))
    curves.beat[gone], curves.bar[gone] = 0.0, 0.0
    found, peaks = [], []
    for frames_at_once in (100_000, 137):
        tracemalloc.start()
        found.append(decode_counts(curves, PointerConfig(frames_at_once=frames_at_once)).counts)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert found[0].times_s.tolist() == found[1].times_s.tolist()
    assert found[0].numbers.tolist() == found[1].numbers.tolist()
    if missing_s[1] == missing_s[0]:  # 40 s are 4,800 frames of the grid
        assert peaks[1] < 0.5 * peaks[0]


@settings(max_examples=25, deadline=None)
@given(
    bpm=st.floats(55, 210),
    metre=st.sampled_from([3, 4]),
    fps=st.sampled_from([20.0, 25.0, 60.0, 86.1]),
    first=st.floats(0, 4),
    noise_rad=st.floats(0, 0.8),
)
@example(bpm=184.0, metre=3, fps=20.0, first=0.0, noise_rad=0.0)  # the last count is due at the very end
def test_steady_counts_are_found_at_any_rate(bpm, metre, fps, first, noise_rad):
    position = positions(bpm, 15.0, fps, first)
    found = decode_counts(curves_of(position, metre, fps, noise_rad=noise_rad), source="planted")
    assert_counted(found.counts, position, metre, fps, within=0.15)
    assert found.counts.source == "planted"


def test_a_ramp_is_followed():
    position = positions(np.linspace(80.0, 150.0, 1200), 60.0, 20.0)
    assert_counted(decode_counts(curves_of(position, 4, 20.0, noise_rad=0.5)).counts, position, 4, 20.0)


def test_counting_goes_on_through_a_stretch_that_says_nothing():
    position = positions(118.0, 40.0, 20.0, first=2.3)
    curves = curves_of(position, 3, 20.0, noise_rad=0.3)
    curves.beat[300:500] = 0.0
    curves.bar[300:500] = 0.0
    assert_counted(decode_counts(curves).counts, position, 3, 20.0)


def test_the_bar_decides_the_number_where_the_beat_is_silent():
    position = positions(90.0, 30.0, 20.0)
    curves = curves_of(position, 4, 20.0)
    curves.beat[:] = 0.0
    assert_counted(decode_counts(curves).counts, position, 4, 20.0)


def test_another_tempo_and_metre_after_a_break():
    first, second = positions(80.0, 20.0, 20.0), positions(140.0, 20.0, 20.0)
    parts = curves_of(first, 3, 20.0), curves_of(second, 4, 20.0)
    joined = (np.concatenate([getattr(c, name) for c in parts]) for name in ("beat", "bar"))
    found = decode_counts(PhaseCurves(*joined, 20.0)).counts
    assert found.metre == 4  # of most counts
    assert_counted(replace(found.within(0.0, 18.0), metre=3), first[:360], 3, 20.0)
    late = found.times_s >= 22.0
    at = beat_positions(found.times_s[late], 20.0 + np.arange(47) * 60 / 140)
    assert np.abs(at - np.round(at)).max() < 0.1
    assert (found.numbers[late] == np.round(at) % 4 + 1).all()
    assert set(found.numbers[found.times_s < 18.0]) == {1, 2, 3}


def test_a_tempo_outside_the_range_is_not_found():
    position = positions(160.0, 20.0, 20.0)
    found = decode_counts(curves_of(position, 4, 20.0), PointerConfig(bpm=(50.0, 100.0))).counts
    assert np.diff(found.times_s).min() > 0.58


def test_curves_that_agree_are_told_from_noise():
    position = positions(118.0, 40.0, 20.0)
    clear = decode_counts(curves_of(position, 4, 20.0, noise_rad=0.2))
    rng = np.random.default_rng(0)
    angle = rng.uniform(0, 2 * np.pi, (800, 3))
    vectors = CONCENTRATION * np.stack([np.cos(angle), np.sin(angle)], axis=2)  # (800, 3, 2)
    noise = decode_counts(PhaseCurves(vectors[:, 0], vectors[:, 1:], 20.0))
    assert clear.beat_agreement.mean() > 0.95 and clear.bar_agreement.mean() > 0.95
    assert noise.beat_agreement.mean() < 0.5
    assert len(clear.beat_agreement) == 800 and np.abs(noise.bar_agreement).max() <= 1.0 + 1e-9


@settings(max_examples=25, deadline=None)
@given(fps=st.sampled_from([20.0, 60.0]), beat=st.floats(-1, 1), bar=st.floats(-1, 1))
def test_doubt_is_where_curves_disagree_with_the_counts(fps, beat, bar):
    """Agreement is 1 but for 20 to 35 s of a minute: uncertainty there, half of it at the border."""
    frames_s = np.arange(round(60 * fps)) / fps
    there = (frames_s >= 20) & (frames_s < 35)
    counts = Counts(np.arange(0.0, 60.0, 0.5), np.arange(120) % 4 + 1, 4)
    agreements = (np.where(there, value, 1.0) for value in (beat, bar))
    uncertainty = count_uncertainty(DecodedCounts(counts, *agreements), fps)
    wanted = 0.5 - 0.25 * (beat + bar)
    times_s = counts.times_s
    assert uncertainty.shape == times_s.shape
    assert np.allclose(uncertainty[(times_s >= 24) & (times_s <= 31)], wanted, atol=1e-6)
    assert np.allclose(uncertainty[(times_s <= 16) | (times_s >= 39)], 0.0, atol=1e-6)
    assert uncertainty[times_s == 20] == pytest.approx(wanted / 2, abs=0.01)


def test_curves_that_change_their_phase_leave_doubt():
    """Half a beat more from the middle on: a pointer that must keep its tempo is uncertain there."""
    position = positions(120.0, 60.0, 20.0)
    position[600:] += 0.5
    steady = PointerConfig(tempo_std=1e-4, break_cost=1e6)
    uncertainty = count_uncertainty(decode_counts(curves_of(position, 4, 20.0), steady), 20.0)
    assert uncertainty.max() > 0.15 and uncertainty.min() < 0.05
    assert (
        count_uncertainty(decode_counts(curves_of(positions(120.0, 60.0, 20.0), 4, 20.0)), 20.0).max() < 0.01
    )


def test_no_frame_has_no_count():
    decoded = decode_counts(PhaseCurves(np.zeros((0, 2)), np.zeros((0, 2, 2)), 20.0))
    assert len(decoded.counts) == 0 and len(count_uncertainty(decoded, 20.0)) == 0


def test_other_metres():
    position = positions(150.0, 20.0, 20.0)
    angle = 2 * np.pi * position[:, None] / np.array([1, 6])
    vectors = CONCENTRATION * np.stack([np.cos(angle), np.sin(angle)], axis=2)
    found = decode_counts(PhaseCurves(vectors[:, 0], vectors[:, 1:], 20.0, metres=(6,)))
    assert_counted(found.counts, position, 6, 20.0)


@pytest.mark.parametrize(
    ("beat", "bar", "fps"),
    [
        (np.zeros((5, 3)), np.zeros((5, 2, 2)), 20.0),
        (np.zeros((5, 2)), np.zeros((4, 2, 2)), 20.0),
        (np.full((5, 2), np.nan), np.zeros((5, 2, 2)), 20.0),
        (np.zeros((5, 2)), np.zeros((5, 2, 2)), 0.0),
    ],
)
def test_malformed_curves(beat, bar, fps):
    with pytest.raises(ParameterError, match="expected"):
        PhaseCurves(beat, bar, fps)


@pytest.mark.parametrize("given_", [{"bpm": (200.0, 100.0)}, {"tempo_std": 0.0}, {"break_cost": -1.0}])
def test_malformed_settings(given_):
    with pytest.raises(ParameterError, match="expected"):
        PointerConfig(**given_)
