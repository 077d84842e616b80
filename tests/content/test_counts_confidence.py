"""The confidence of counts: fitted to planted shares, and what it reads from curves."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic_counts import counted

from choreograph.core.errors import ParameterError
from choreograph.music.bar_pointer import DecodedCounts, PhaseCurves, decode_counts
from choreograph.nets.motion_counts import N_CONFIDENCE, confidence_features, confidence_of
from content.motion_counting import fit_confidence


def test_a_planted_relation_is_found():
    rng = np.random.default_rng(0)
    facts = np.column_stack([np.ones(2000), rng.uniform(0, 1, (2000, N_CONFIDENCE - 1))])
    share = 1 / (1 + np.exp(-facts @ np.array([-3.0, 4.0, 2.0, 0.0, 0.0])))
    weights = fit_confidence(facts, (rng.random(2000) < share).astype(float))
    found = np.array([confidence_of(row, weights) for row in facts])
    assert np.abs(found - share).mean() < 0.06
    assert np.corrcoef(found, share)[0, 1] > 0.95


def test_clear_curves_speak_for_their_counts_more_than_noise():
    angle = 2 * np.pi * np.arange(600) / 10
    rng = np.random.default_rng(0)

    def facts(noise_rad: float) -> np.ndarray:
        turned = [angle / m + noise_rad * rng.standard_normal(600) for m in (1, 3, 4)]
        vectors = 3.0 * np.stack([np.stack([np.cos(a), np.sin(a)], axis=1) for a in turned], axis=1)
        vectors[:, 1] *= 0.1
        curves = PhaseCurves(vectors[:, 0], vectors[:, 1:], 20.0)
        return confidence_features(curves, decode_counts(curves))

    clear, noisy = facts(0.1), facts(2.0)
    assert (clear[1:3] > 0.9).all() and (noisy[1:3] < 0.6).all()
    assert clear[4] > 0.9 and noisy[4] < 0.5
    assert clear[0] == 1.0 and len(clear) == N_CONFIDENCE


def test_a_phase_that_curves_keep_is_steady_though_the_counts_have_another():
    """Counts of half a second, and curves that lead by a quarter of a beat, or by more and more."""
    frames, counts = np.arange(600), counted(0.5)
    nothing = np.zeros(600)

    def facts(lead_beats: np.ndarray) -> np.ndarray:
        angle = 2 * np.pi * (frames / 10 + lead_beats)
        beat = 2.0 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        curves = PhaseCurves(beat, np.zeros((600, 2, 2)), 20.0)
        return confidence_features(curves, DecodedCounts(counts, np.cos(2 * np.pi * lead_beats), nothing))

    late, drifting = facts(np.full(600, 0.25)), facts(frames / 100)
    np.testing.assert_allclose(late, [1.0, 0.0, 0.0, np.log(3.0), 1.0], atol=1e-6)
    assert drifting[4] < 0.05  # a whole beat in five seconds


def test_no_frames_have_facts():
    curves = PhaseCurves(np.zeros((0, 2)), np.zeros((0, 2, 2)), 20.0)
    assert confidence_features(curves, decode_counts(curves)).tolist() == [1.0, 0.0, 0.0, 0.0, 0.0]


def test_takes_are_needed():
    with pytest.raises(ParameterError, match="expected"):
        fit_confidence([], [])
