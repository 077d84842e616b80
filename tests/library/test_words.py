"""Motion words: where a dance is segmented, and what a word preserves and discards."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic_motions import stepping, swaying

from choreograph.core.errors import ParameterError
from choreograph.library.words import (
    DEFAULT_WORD_S,
    MAX_WORD_S,
    MIN_WORD_S,
    dance_bounds_s,
    poses_at,
    segment_words,
    word_bounds_s,
    word_distance_m,
)
from choreograph.motion import rotations as rot
from choreograph.motion.body import body_pos_m, ground_pos_m, heading_rad

FPS = 30.0
BODY = body_pos_m(swaying(300, fps=FPS, seed=1))  # 10 s
BEATS = np.arange(0.25, 10, 0.5)


def test_words_are_the_dance_between_beats():
    words = segment_words(BODY, FPS, BEATS)
    np.testing.assert_allclose(words.start_s, BEATS[:-1])
    np.testing.assert_allclose(words.end_s, BEATS[1:])
    assert words.body_pos_m.shape == (19, 13, 21, 3)
    # Distances between joints do not depend on the frame of reference; frame 6 is the middle of a word.
    middle = BODY[15]  # 0.5 s
    wanted = np.linalg.norm(middle[:, None] - middle[None], axis=-1)
    got = words.body_pos_m[0, 6]
    np.testing.assert_allclose(np.linalg.norm(got[:, None] - got[None], axis=-1), wanted, atol=1e-9)


def test_a_word_is_in_its_root_frame_and_keeps_its_travel():
    words = segment_words(BODY, FPS, BEATS).body_pos_m
    np.testing.assert_allclose(heading_rad(words[:, 6]), 0.0, atol=1e-9)
    np.testing.assert_allclose(ground_pos_m(words).mean(axis=1), 0.0, atol=1e-9)
    travel = np.linalg.norm(words[:, -1, 0] - words[:, 0, 0], axis=-1)
    first, last = BODY[7] * 0.5 + BODY[8] * 0.5, BODY[22] * 0.5 + BODY[23] * 0.5  # 0.25 and 0.75 s
    assert travel[0] == pytest.approx(np.linalg.norm(last[0] - first[0]), abs=1e-9)


@settings(max_examples=30, deadline=None)
@given(st.floats(-3, 3), st.floats(-4, 4), st.floats(-4, 4))
def test_words_do_not_depend_on_the_position_on_the_floor(yaw, x, z):
    moved = rot.rotate(rot.about_y(yaw), BODY) + np.array([x, 0.0, z])
    np.testing.assert_allclose(
        segment_words(moved, FPS, BEATS).body_pos_m, segment_words(BODY, FPS, BEATS).body_pos_m, atol=1e-9
    )


def test_a_word_danced_twice_as_fast_is_the_same_word():
    slow = segment_words(body_pos_m(stepping(301, fps=60, period_s=1.0, seed=2)), 60, np.arange(5.0))
    fast = segment_words(body_pos_m(stepping(301, fps=60, period_s=0.5, seed=2)), 60, np.arange(5.0) / 2)
    assert word_distance_m(slow.body_pos_m, fast.body_pos_m).max() < 0.002
    assert word_distance_m(slow.body_pos_m[0], slow.body_pos_m[1]) > 0.02  # there and back differ


@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(-2, 14), max_size=40))
def test_words_tile_the_time_between_the_beats(beats):
    words = segment_words(BODY, FPS, np.array(beats))
    assert np.isfinite(words.body_pos_m).all()
    np.testing.assert_array_equal(words.start_s[1:], words.end_s[:-1])
    lengths = words.end_s - words.start_s
    assert np.all(lengths >= MIN_WORD_S - 1e-9) and np.all(lengths <= MAX_WORD_S + 1e-9)
    assert np.all(words.start_s >= 0) and np.all(words.end_s <= 299 / FPS)


def test_beats_too_close_are_dropped_and_gaps_are_divided():
    np.testing.assert_allclose(word_bounds_s(np.array([1.0, 1.1, 1.5]), 9.0), [1.0, 1.5])
    np.testing.assert_allclose(word_bounds_s(np.array([4.0, 1.0]), 9.0), [1.0, 2.5, 4.0])
    for beats in ([], [2.0], [-1.0, 3.0, 20.0]):
        assert len(segment_words(BODY, FPS, np.array(beats))) == 0


@pytest.mark.parametrize(
    ("body", "fps", "beats"),
    [
        (BODY[:, :5], FPS, BEATS),
        (np.full_like(BODY, np.nan), FPS, BEATS),
        (BODY, 0.0, BEATS),
        (BODY, FPS, np.array([0.0, np.nan])),
        (BODY, FPS, BEATS[:, None]),
    ],
)
def test_malformed_input_is_refused(body, fps, beats):
    with pytest.raises(ParameterError):
        segment_words(body, fps, beats)


def test_one_frame_has_no_word():
    assert len(segment_words(BODY[:1], FPS, BEATS)) == 0


@settings(max_examples=100)
@given(st.lists(st.floats(0, 40), max_size=60), st.floats(0.01, 45), st.sampled_from([0.35, 0.5, 0.71, None]))
def test_words_cover_the_whole_dance_and_include_those_between_beats(beats, duration_s, period_s):
    beats = np.array(beats) if period_s is None else np.arange(1.3, 40, period_s)
    bounds = dance_bounds_s(beats, duration_s)
    assert len(bounds) >= 2 and (np.diff(bounds) > 0).all()
    assert bounds[0] >= -1e-9 and bounds[-1] <= duration_s + 1e-9
    inner = word_bounds_s(beats, duration_s)
    if len(inner) > 1:
        assert set(inner.tolist()) <= set(bounds.tolist())
        assert np.diff(bounds).min() >= MIN_WORD_S - 1e-9 and np.diff(bounds).max() <= 2 * MAX_WORD_S
        gaps = np.diff(inner)
        assert bounds[0] <= np.median(gaps[:8]) / 2 + MIN_WORD_S
        assert duration_s - bounds[-1] <= np.median(gaps[-8:]) / 2 + MIN_WORD_S


def test_words_before_the_first_beat_are_as_long_as_beats():
    bounds = dance_bounds_s(np.arange(1.6, 8.1, 0.5), 9.2)
    np.testing.assert_allclose(np.diff(bounds[:4]), 1.6 / 3)
    np.testing.assert_allclose(bounds[-4:], [7.6, 8.1 + 1 / 30, 8.2 + 14 / 30, 9.2])
    assert (
        dance_bounds_s(np.arange(0.1, 9, 0.5), 9.2)[0] == 0.1
    )  # a tenth of a second is too short for a word
    np.testing.assert_allclose(dance_bounds_s(np.zeros(0), 2.0), np.arange(0, 2.1, DEFAULT_WORD_S))
    np.testing.assert_allclose(dance_bounds_s(np.zeros(0), 0.1), [0.0, 0.1])


def test_poses_between_frames_and_beyond_the_ends():
    np.testing.assert_allclose(poses_at(BODY, FPS, np.array([1.05])), (BODY[31:32] + BODY[32:33]) / 2)
    np.testing.assert_array_equal(poses_at(BODY, FPS, np.array([[-1.0, 99.0]])), BODY[None, [0, -1]])
