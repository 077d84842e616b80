"""Motion-beat detectors: planted rests, a body at rest, malformed input, the mean, chance."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic_motions import stepping

from choreograph.core.errors import ParameterError
from choreograph.evaluation.metrics import beat
from choreograph.evaluation.metrics.motion_beat_detectors import (
    DETECTORS,
    beats_by_detector,
    evaluate,
    evaluate_chance,
    scores_of,
)
from choreograph.motion.body import body_pos_at, body_pos_m

FPS = 60.0


@pytest.fixture(scope="module")
def pos_m():
    """20 s that come to rest every 0.6 s."""
    motion = stepping(20 * 30, period_s=0.6, seed=0)
    return body_pos_at(body_pos_m(motion), motion.fps, FPS)


@pytest.fixture(scope="module")
def rests_s(pos_m):
    return np.arange(0.6, len(pos_m) / FPS - 0.3, 0.6)


@pytest.mark.parametrize("name", DETECTORS)
def test_every_detector_finds_planted_rests(name, pos_m, rests_s):
    found = DETECTORS[name](pos_m, FPS)
    beat.validate(found, rests_s)
    apart = np.abs(found[:, None] - rests_s).min(axis=0)
    assert apart.max() < 0.05
    assert beat.f_score(found, rests_s) > 0.9


@pytest.mark.parametrize("name", DETECTORS)
def test_other_frame_rates_find_the_same(name, pos_m):
    fast, slow = DETECTORS[name](pos_m, FPS), DETECTORS[name](pos_m[::2], FPS / 2)
    assert beat.f_score(fast, slow) > 0.9


@pytest.mark.parametrize("n_frames", [1, 2, 5, 200])
def test_a_body_at_rest_has_no_beats(n_frames, pos_m):
    still = np.repeat(pos_m[:1], n_frames, axis=0)
    assert all(len(beats) == 0 for beats in beats_by_detector(still, FPS).values())
    assert set(evaluate(still, FPS, np.array([1.0])).values()) == {0.0}


def test_the_mean_is_over_all_five(pos_m, rests_s):
    scores = evaluate(pos_m, FPS, rests_s)
    assert list(scores) == [*(f"f_score_{name}" for name in DETECTORS), "f_score_mean"]
    mean = scores.pop("f_score_mean")
    assert mean == pytest.approx(np.mean(list(scores.values())))
    assert scores_of({"ours": rests_s, "aist": np.zeros(0)}, rests_s)["f_score_mean"] == 0.5


def test_malformed(pos_m, rests_s):
    for bad_pos, beats in ((pos_m[:, :3], rests_s), (pos_m, rests_s[::-1]), (pos_m * np.nan, rests_s)):
        with pytest.raises(ParameterError):
            evaluate(bad_pos, FPS, beats)


def test_chance_is_that_of_a_shifted_song(pos_m, rests_s):
    found = beats_by_detector(pos_m, FPS)
    levels = evaluate_chance(
        found, rests_s, duration_s=len(pos_m) / FPS, rng=np.random.default_rng(0), rounds=300
    )
    assert set(levels) == set(scores_of(found, rests_s))
    # Both have one beat every 0.6 s, so a random phase hits within 70 ms with probability 0.14 / 0.6.
    assert levels["f_score_mean"] == pytest.approx(0.14 / 0.6, abs=0.05)
