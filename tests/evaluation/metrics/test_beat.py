"""Beat metrics: perfect, empty and malformed input; values computed by hand; mir_eval as an oracle."""

from __future__ import annotations

import mir_eval
import numpy as np
import pytest
from golden.regenerate import beat_scores, golden, synthetic_dance
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from synthetic_motions import stepping

from choreograph.core.errors import ParameterError
from choreograph.evaluation.metrics import beat
from choreograph.evaluation.metrics.beat import (
    ALIGNMENT_VARIANTS,
    DETECTORS,
    aligned_share,
    alignment_score,
    beat_ratio,
    beats_by_detector,
    chance_level,
    detector_scores,
    evaluate,
    evaluate_chance,
    evaluate_detectors,
    evaluate_detectors_chance,
    evaluate_published,
    f_score,
    published_motion_beats_s,
    squared_distance,
    validate,
)
from choreograph.motion.body import body_pos_at, body_pos_m

NONE = np.zeros(0)


def beat_lists(max_size: int = 15):
    gaps = st.lists(st.floats(0.02, 3.0), max_size=max_size)
    return gaps.map(lambda g: np.cumsum(np.array(g)))


def test_perfect():
    beats = np.arange(0.3, 20, 0.5)
    assert evaluate(beats, beats) == {
        "f_score": 1.0,
        "motion_to_music": 0.0,
        "music_to_motion": 0.0,
        "aligned_share": 1.0,
        "beat_ratio": 1.0,
        "alignment_fact": 1.0,
        "alignment_bailando": 1.0,
        "alignment_lodge": 1.0,
    }


def test_empty():
    beats = np.array([1.0, 2.0])
    assert f_score(NONE, beats) == f_score(beats, NONE) == f_score(NONE, NONE) == 0.0
    assert all(np.isnan(squared_distance(a, b)) for a, b in ((NONE, beats), (beats, NONE)))
    assert np.isnan(aligned_share(NONE, beats)) and aligned_share(beats, NONE) == 0.0
    assert np.isnan(beat_ratio(beats, NONE)) and beat_ratio(NONE, beats) == 0.0


@pytest.mark.parametrize(
    "beats",
    [np.array([1.0, np.nan]), np.array([2.0, 1.0]), np.array([1.0, 1.0]), np.zeros((2, 2)), np.float64(1.0)],
)
def test_malformed(beats):
    good = np.array([0.5, 1.5])
    for pair in ((beats, good), (good, beats)):
        with pytest.raises(ParameterError) as raised:
            evaluate(*pair)
        assert "\n" not in str(raised.value)
    validate(good, NONE)


def test_known_by_hand():
    music = np.array([1.0, 2.0, 3.0, 4.0])
    # 0.05 s late, 0.1 s early, one extra beat halfway: 1 hit of 3 and 4.
    motion = np.array([1.05, 1.9, 2.5])
    assert f_score(motion, music) == pytest.approx(2 * 1 / 7)
    assert squared_distance(motion, music) == pytest.approx((3**2 + 6**2 + 30**2) / 3)
    assert squared_distance(music, motion) == pytest.approx((3**2 + 6**2 + 30**2 + 90**2) / 4)


def test_aligned_within_a_thirtieth_of_a_second():
    music = np.array([1.0, 2.0, 3.0, 4.0])
    motion = np.array([1.03, 1.9, 2.5, 2.97, 3.04])
    assert aligned_share(motion, music) == pytest.approx(2 / 5)
    assert beat_ratio(motion, music) == pytest.approx(5 / 4)


def test_each_beat_is_matched_once():
    assert f_score(np.array([0.97, 1.0, 1.03]), np.array([1.0])) == pytest.approx(2 / 4)


@settings(max_examples=100, deadline=None)
@given(beat_lists(), beat_lists(), st.floats(-5, 5))
def test_laws(motion, music, shift):
    score = f_score(motion, music)
    assert 0 <= score <= 1
    assert score == f_score(music, motion)
    wide = f_score(motion, music, window_s=0.3)
    assert wide >= score
    moved = evaluate(motion + shift, music + shift)
    assert moved["motion_to_music"] == pytest.approx(squared_distance(motion, music), nan_ok=True, abs=1e-6)


@pytest.mark.filterwarnings("ignore:(Reference|Estimated) beats are empty")
@settings(max_examples=200, deadline=None)
@given(beat_lists(30), beat_lists(30), st.floats(0.02, 0.5))
def test_f_score_is_mir_evals_f_measure(motion, music, window_s):
    """The same definition: largest matching within ± the window, 0 without beats.

    `f_measure` itself does not trim; `mir_eval.beat.evaluate` drops the first 5 s before it. A gap that
    equals the window up to rounding may count in one and not in the other.
    """
    gaps_s = np.abs(motion[:, None] - music)
    for window in (0.07, window_s):
        assume(not np.isclose(gaps_s, window, rtol=0.0, atol=1e-9).any())
        expected = mir_eval.beat.f_measure(music, motion, f_measure_threshold=window)
        assert f_score(motion, music, window_s=window) == pytest.approx(expected, abs=1e-12)


def test_mir_evals_evaluate_drops_the_first_five_seconds_and_we_do_not():
    music = np.arange(0.5, 20.0, 0.5)
    motion = music[music >= 5.0]
    assert mir_eval.beat.evaluate(music, motion)["F-measure"] == 1.0
    assert f_score(motion, music) == pytest.approx(mir_eval.beat.f_measure(music, motion))
    assert f_score(motion, music) < 0.9
    trimmed = mir_eval.beat.trim_beats(music)
    assert f_score(motion, trimmed) == 1.0


@settings(max_examples=60, deadline=None)
@given(beat_lists(6), beat_lists(6), st.floats(0.05, 1.0))
def test_the_matching_is_the_largest(motion, music, window_s):
    def largest(i: int, j: int) -> int:
        if i == len(motion) or j == len(music):
            return 0
        take = 1 + largest(i + 1, j + 1) if abs(motion[i] - music[j]) <= window_s else 0
        return max(take, largest(i + 1, j), largest(i, j + 1))

    total = len(motion) + len(music)
    expected = 2 * largest(0, 0) / total if total else 0.0
    assert f_score(motion, music, window_s=window_s) == pytest.approx(expected)


def test_chance_is_the_share_of_time_that_windows_cover():
    rng = np.random.default_rng(0)
    music = np.arange(0.25, 60, 0.5)
    motion = np.sort(rng.uniform(0, 60, 120))
    chance = chance_level(f_score, motion, music, duration_s=60.0, rng=np.random.default_rng(1))
    assert chance == pytest.approx(0.14 / 0.5, abs=0.06)
    assert chance == chance_level(f_score, motion, music, duration_s=60.0, rng=np.random.default_rng(1))
    assert chance < 0.5 * f_score(music, music)


def test_alignment_by_hand():
    music = np.array([1.0, 2.0, 3.0, 4.0])
    motion = np.array([1.05, 1.9, 9.0])
    one, two, far = np.exp(-0.5), np.exp(-2.0), 0.0
    assert alignment_score(motion, music, "fact") == pytest.approx((one + two + far) / 3)
    assert alignment_score(motion, music, "bailando") == pytest.approx((one + two + 2 * far) / 4, abs=1e-9)
    assert alignment_score(motion, music, "lodge") == pytest.approx((np.exp(-1 / 8) + one) / 4, abs=1e-9)
    assert alignment_score(NONE, music) == 0.0 and np.isnan(alignment_score(motion, NONE))
    with pytest.raises(ParameterError, match="fact, bailando, lodge"):
        alignment_score(motion, music, "edge")


def test_more_motion_beats_raise_means_over_music_beats_and_one_is_enough_for_means_over_motion_beats():
    music = np.arange(0.5, 30, 0.5)
    rng = np.random.default_rng(0)
    few, many = (np.sort(rng.uniform(0, 30, n)) for n in (30, 600))
    assert alignment_score(many, music, "bailando") > 2 * alignment_score(few, music, "bailando")
    assert alignment_score(music[:1], music, "fact") == 1.0 > 10 * alignment_score(music[:1], music)


@pytest.mark.parametrize(("name", "expected"), [("bailando", 0.25), ("fact", 0.25), ("lodge", 0.48)])
def test_a_metronome_of_random_phase(name, expected):
    rng = np.random.default_rng(0)
    music = np.arange(0.0, 60, 0.5)
    scores = [alignment_score(music + rng.uniform(0, 0.5), music, name) for _ in range(500)]
    assert np.mean(scores) == pytest.approx(expected, abs=0.02)


@pytest.mark.parametrize("name", ALIGNMENT_VARIANTS)
@pytest.mark.parametrize("fps", [30.0, 60.0, 100.0])
def test_published_motion_beats_of_a_body_that_stops_every_second(name, fps):
    times = np.arange(round(10 * fps) + 1) / fps + 0.003  # the offset avoids ties, which are no minimum
    pos = np.zeros((len(times), 21, 3)) + (times - np.sin(2 * np.pi * times) / (2 * np.pi))[:, None, None]
    found = published_motion_beats_s(pos, fps, name)
    assert len(found) == pytest.approx(9, abs=1)
    assert np.allclose(found + 0.003, np.rint(found), atol=1.01 / ALIGNMENT_VARIANTS[name].fps)
    assert len(published_motion_beats_s(pos[:2], fps, name)) == 0


def test_published_scores_depend_on_neither_position_nor_heading_and_little_on_the_rate():
    dance, music = synthetic_dance(), np.arange(0.3, 12, 0.5)
    wanted = evaluate_published(dance, 60.0, music)
    rotated = dance[..., [2, 1, 0]] * np.array([1.0, 1.0, -1.0]) + np.array([3.0, 0.0, 1.0])
    assert evaluate_published(rotated, 60.0, music) == pytest.approx(wanted)
    assert evaluate_published(body_pos_at(dance, 60.0, 120.0), 120.0, music) == pytest.approx(
        wanted, abs=0.02
    )
    for broken in (np.zeros((5, 20, 3)), np.full((5, 21, 3), np.inf)):
        with pytest.raises(ParameterError, match="body positions"):
            evaluate_published(broken, 60.0, music)


def test_published_scores_with_their_chance_levels():
    dance, music = synthetic_dance(), np.arange(0.3, 12, 0.5)
    scores = evaluate_published(dance, 60.0, music, rng=np.random.default_rng(0), rounds=400)
    for name in ALIGNMENT_VARIANTS:
        motion = published_motion_beats_s(dance, 60.0, name)
        assert scores[f"alignment_{name}_published"] == alignment_score(motion, music, name)
        other = chance_level(
            lambda a, b, name=name: alignment_score(a, b, name),
            motion, music, duration_s=12.0, rng=np.random.default_rng(1), rounds=400,
        )  # fmt: skip
        assert scores[f"alignment_{name}_published_chance"] == pytest.approx(other, abs=0.03)


def test_chance_levels_of_all_metrics():
    music = np.arange(0.25, 30, 0.5)
    motion = music[::2] + 0.01

    def rng():
        return np.random.default_rng(3)

    chance = evaluate_chance(motion, music, duration_s=30.0, rng=rng(), rounds=50)
    assert chance.keys() == evaluate(motion, music).keys()
    for name, score in (
        ("f_score", f_score),
        ("alignment_lodge", lambda a, b: alignment_score(a, b, "lodge")),
    ):
        assert chance[name] == chance_level(score, motion, music, duration_s=30.0, rng=rng(), rounds=50)
        assert chance[name] < 0.8 * score(motion, music)
    assert chance["motion_to_music"] > 10 * squared_distance(motion, music)
    assert chance["beat_ratio"] == 0.5
    with pytest.raises(ParameterError, match="duration"):
        evaluate_chance(motion, music, duration_s=0.0, rng=rng())


def test_golden():
    assert beat_scores() == pytest.approx(golden("beat"), abs=1e-6)


# Motion-beat detectors: planted rests, a body at rest, malformed input, the mean, chance.


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
    assert set(evaluate_detectors(still, FPS, np.array([1.0])).values()) == {0.0}


def test_the_mean_is_over_all_five(pos_m, rests_s):
    scores = evaluate_detectors(pos_m, FPS, rests_s)
    assert list(scores) == [*(f"f_score_{name}" for name in DETECTORS), "f_score_mean"]
    mean = scores.pop("f_score_mean")
    assert mean == pytest.approx(np.mean(list(scores.values())))
    assert detector_scores({"ours": rests_s, "aist": np.zeros(0)}, rests_s)["f_score_mean"] == 0.5


def test_malformed_motion(pos_m, rests_s):
    for bad_pos, beats in ((pos_m[:, :3], rests_s), (pos_m, rests_s[::-1]), (pos_m * np.nan, rests_s)):
        with pytest.raises(ParameterError):
            evaluate_detectors(bad_pos, FPS, beats)


def test_chance_is_that_of_a_shifted_song(pos_m, rests_s):
    found = beats_by_detector(pos_m, FPS)
    levels = evaluate_detectors_chance(
        found, rests_s, duration_s=len(pos_m) / FPS, rng=np.random.default_rng(0), rounds=300
    )
    assert set(levels) == set(detector_scores(found, rests_s))
    # Both have one beat every 0.6 s, so a random phase hits within 70 ms with probability 0.14 / 0.6.
    assert levels["f_score_mean"] == pytest.approx(0.14 / 0.6, abs=0.05)
