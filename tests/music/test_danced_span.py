"""When a song is danced, and where takes may change: songs of clicks with planted silences and bars."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from choreograph.core.counts import NO_COUNTS, make_counts, numbers_in_bar
from choreograph.core.timebase import SAMPLE_RATE_HZ
from choreograph.music.count_grids import (
    FIRST_HOLD_S,
    LAST_HOLD_S,
    REACH_S,
    coming_to_rest_s,
    dance_span_s,
    held_times_s,
    join_times_s,
    setting_off_s,
)
from choreograph.music.mel import log_mel

DURATION_S = 30.0


def clicks_mel(clicks_s, *, loudness=0.6, duration_s: float = DURATION_S) -> np.ndarray:
    """The spectrogram of clicks on a floor of soft noise."""
    samples = 1e-4 * np.random.default_rng(0).normal(size=round(duration_s * SAMPLE_RATE_HZ))
    since_s = np.arange(round(0.1 * SAMPLE_RATE_HZ)) / SAMPLE_RATE_HZ
    click = np.exp(-since_s / 0.02) * np.sin(2 * np.pi * 880 * since_s)
    for at_s, loud in zip(clicks_s, np.broadcast_to(loudness, len(clicks_s)), strict=True):
        first = round(at_s * SAMPLE_RATE_HZ)
        part = samples[first : first + len(click)]
        part += loud * click[: len(part)]
    return log_mel(samples.astype(np.float32))


def tracked(*, first_s: float = 0.25, first: int = 1, metre: int = 4, period_s: float = 0.5):
    """Beats over the whole song, as a tracker continues them through silence."""
    n_beats = int((DURATION_S - first_s) / period_s) + 1
    numbers = numbers_in_bar(n_beats, metre, first=first) if metre else np.zeros(n_beats, int)
    return make_counts(first_s + period_s * np.arange(n_beats), numbers, metre)


@pytest.mark.parametrize("first_sound_s", [8.0, 16.0, 19.0])
def test_silence_at_both_ends_is_not_danced(first_sound_s):
    counts = tracked()
    sounding = counts.times_s[(counts.times_s > first_sound_s) & (counts.times_s < 22.4)]
    opening_s, closing_s = dance_span_s(counts, clicks_mel(sounding), DURATION_S)
    assert (opening_s, closing_s) == (sounding[0], sounding[-1])


@pytest.mark.parametrize("first", [1, 2, 3, 4])
def test_a_song_that_sounds_from_end_to_end_is_danced_from_its_first_count_to_its_last(first):
    counts = tracked(first=first)
    span_s = dance_span_s(counts, clicks_mel(counts.times_s), DURATION_S)
    assert span_s[0] == counts.times_s[counts.times_s >= FIRST_HOLD_S][0]
    assert span_s[1] == counts.times_s[counts.times_s <= DURATION_S - LAST_HOLD_S][-1]


def test_a_dance_closes_on_the_last_strong_downbeat_if_the_beats_after_it_fade():
    counts = tracked()
    last_s = counts.downbeat_times_s[counts.downbeat_times_s < 25.0][-1]
    loudness = np.where(counts.times_s <= last_s, 0.6, 0.002)  # less than half of the strength
    for fades in (True, False):
        clicks = clicks_mel(counts.times_s, loudness=loudness if fades else 0.6)
        _, closing_s = dance_span_s(counts, clicks, DURATION_S)
        assert (closing_s == last_s) == fades


def test_without_bars_a_dance_starts_and_closes_on_beats():
    counts = tracked(metre=0)
    sounding = counts.times_s[(counts.times_s > 5.1) & (counts.times_s < 25.0)]
    assert dance_span_s(counts, clicks_mel(sounding), DURATION_S) == (sounding[0], sounding[-1])


def test_one_bang_in_the_introduction_is_no_start():
    counts = tracked()
    sounding = counts.times_s[counts.times_s > 8.0]
    opening_s, _ = dance_span_s(counts, clicks_mel([counts.times_s[4], *sounding]), DURATION_S)
    assert opening_s > 7.0


def test_soft_beats_do_not_end_a_dance():
    counts = tracked()
    loudness = np.where(counts.times_s < 20.0, 0.6, 0.001)
    _, closing_s = dance_span_s(counts, clicks_mel(counts.times_s, loudness=loudness), DURATION_S)
    assert closing_s == counts.times_s[counts.times_s < 20.0][-1]


@pytest.mark.parametrize("counts", [NO_COUNTS, tracked().within(0.0, 4.0), tracked().within(0.0, 1.0)])
def test_a_song_of_too_few_beats_is_danced_whole(counts):
    assert dance_span_s(counts, clicks_mel(counts.times_s), DURATION_S) == (0.0, DURATION_S)


def test_a_silent_song_with_beats_from_a_file_has_a_span_of_its_beats():
    counts = tracked()
    opening_s, closing_s = dance_span_s(counts, clicks_mel([]), DURATION_S)
    assert 0.0 <= opening_s < closing_s <= DURATION_S


@given(
    st.lists(st.floats(0.25, 1.0), min_size=0, max_size=30),
    st.sampled_from([0, 3, 4]),
    st.floats(0.0, 3.0),
    st.integers(0, 40),
)
def test_joins_are_in_order_and_near_their_seconds(gaps_s, metre, first_s, n_borders):
    times_s = first_s + np.cumsum(gaps_s)
    numbers = numbers_in_bar(len(times_s), metre) if metre else np.zeros(len(times_s), int)
    counts = make_counts(times_s, numbers, metre)
    joins_s = join_times_s(counts, n_borders)
    assert joins_s.shape == (n_borders,) and (np.diff(joins_s) > 0).all()
    assert (np.abs(joins_s - np.arange(n_borders)) <= REACH_S).all()
    allowed = np.concatenate([counts.times_s, np.arange(n_borders)])
    assert np.isin(joins_s, allowed).all()


def test_takes_change_on_downbeats_else_on_beats_else_on_seconds():
    # Downbeats at 0.4, 2.4, 4.4 s; other beats at 0.9, 1.4, 1.9, 2.9, 3.4, 3.9 s; none from 5 s on.
    counts = make_counts(0.4 + 0.5 * np.arange(9), numbers_in_bar(9, 4), 4)
    assert join_times_s(counts, 8) == pytest.approx([0.4, 0.9, 2.4, 2.9, 4.4, 5.0, 6.0, 7.0])
    assert join_times_s(NO_COUNTS, 3).tolist() == [0.0, 1.0, 2.0]


def test_of_two_downbeats_near_a_second_the_nearer_is_taken():
    counts = make_counts([1.6, 2.1, 2.45], [1, 1, 1], 1)
    assert join_times_s(counts, 4).tolist() == [0.0, 1.0, 2.1, 3.0]


@given(st.floats(0.0, 5.0), st.floats(0.01, 5.0))
def test_a_dance_sets_off_and_comes_to_rest_within_its_song_and_one_after_the_other(opening_s, danced_s):
    closing_s = opening_s + danced_s
    sets_off, rests = setting_off_s(opening_s), coming_to_rest_s(opening_s, closing_s)
    assert 0.0 <= sets_off[0] <= sets_off[1] <= opening_s <= rests[0] < closing_s < rests[1]
    assert opening_s - sets_off[1] == pytest.approx(np.clip(opening_s - 0.4, 0.0, 0.5))
    first_s, last_s = held_times_s(opening_s, closing_s)
    assert sets_off[0] <= first_s <= sets_off[1] and rests[0] < last_s < rests[1]
    if opening_s > 0.4 and danced_s > 0.3:
        assert np.ptp(sets_off) == pytest.approx(0.4) and np.ptp(rests) == pytest.approx(0.38)
