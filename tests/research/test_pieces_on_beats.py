"""Pieces aligned with beats: takes that rest on their counts rest on the beats of the song."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic_motions import stepping

from choreograph.core.counts import NO_COUNTS, make_counts, numbers_in_bar
from choreograph.core.errors import ParameterError
from choreograph.evaluation.metrics.transitions import closing_speed_m_s, opening_speed_m_s
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion_beats import motion_beat_times_s
from research.pieces_on_beats import Piece, place_pieces

FPS = 60.0
PERIODS_S = {"a": 0.6, "b": 0.45}
TAKES = {
    name: stepping(30 * 20, period_s=period_s, seed=seed)
    for seed, (name, period_s) in enumerate(PERIODS_S.items())
}
N_BEATS = 40
DURATION_S = 22.0


def song_counts(n_beats: int = N_BEATS):
    """Beats every 0.5 s, from 0.25 s on, and slower towards the end."""
    times_s = 0.25 + np.cumsum(np.linspace(0.5, 0.56, n_beats)) - 0.5
    return make_counts(times_s, numbers_in_bar(n_beats, 4), 4)


def read(take, start_s, stop_s):
    return TAKES[take], 0.0


def piece(take: str, first_count: int, n_counts: int) -> Piece:
    period_s = PERIODS_S[take]
    return Piece(take, first_count * period_s, (first_count + n_counts) * period_s, n_counts)


def laid(pieces, *, first_beat: int = 4, counts=None, duration_s: float = DURATION_S):
    counts = song_counts() if counts is None else counts
    return place_pieces(pieces, counts, first_beat, read, duration_s=duration_s, fps=FPS)


def rests_s(motion) -> np.ndarray:
    return motion_beat_times_s(body_pos_m(motion), motion.fps)


def test_counts_of_all_pieces_lie_on_beats():
    beats_s = song_counts().times_s
    motion = laid([piece("a", 0, 8), piece("b", 8, 8), piece("a", 16, 8)])
    assert motion.duration_s == pytest.approx(DURATION_S, abs=1 / FPS)
    rests = rests_s(motion)
    rests = rests[(rests > beats_s[4] + 0.1) & (rests < beats_s[28] - 0.1)]
    off_s = np.abs(rests[:, None] - beats_s).min(axis=1)
    assert len(rests) >= 20 and np.median(off_s) < 0.02 and np.mean(off_s < 0.07) >= 0.9


def test_a_first_beat_that_jitters_does_not_move_the_others():
    counts = song_counts()
    late_s = np.array(counts.times_s)
    late_s[4] += 0.04
    late = laid([piece("a", 0, 16)], counts=make_counts(late_s, counts.numbers, 4))
    rests = rests_s(late)
    rests = rests[(rests > counts.times_s[4] + 0.1) & (rests < counts.times_s[20] - 0.1)]
    assert np.median(np.abs(rests[:, None] - counts.times_s).min(axis=1)) < 0.02


def test_one_take_played_on_needs_no_transition():
    """Figures that follow one another in their take are one run: the same as one long figure."""
    parts, whole = laid([piece("a", 0, 8), piece("a", 8, 4)]), laid([piece("a", 0, 12)])
    assert parts.root_pos_m == pytest.approx(whole.root_pos_m, abs=1e-3)


def test_poses_are_held_before_the_first_count_and_after_the_last():
    beats_s = song_counts().times_s
    motion = laid([piece("a", 0, 8), piece("b", 8, 8)])
    body = body_pos_m(motion)
    assert opening_speed_m_s(body, FPS) < 0.15 and closing_speed_m_s(body, FPS) < 0.15
    after = body[round((beats_s[20] + 0.15) * FPS) :]
    assert np.abs(np.diff(after, axis=0)).max() * FPS < 0.3


def test_pieces_that_the_song_is_too_short_for_are_left_out():
    beats = song_counts()
    fitting = [piece("a", 0, 8), piece("b", 8, 8), piece("a", 16, 8), piece("b", 20, 8)]
    enough, too_many = laid(fitting), laid([*fitting, *[piece("a", 3, 8), piece("b", 1, 8)] * 4])
    assert too_many.n_frames == enough.n_frames
    until = round((beats.times_s[36] - 1.5) * FPS)
    assert too_many.root_pos_m[:until] == pytest.approx(enough.root_pos_m[:until], abs=0.02)


@pytest.mark.parametrize(
    "wrong",
    [
        {"pieces": []},
        {"counts": NO_COUNTS},
        {"counts": song_counts(3), "first_beat": 0},
        {"first_beat": -1},
        {"first_beat": N_BEATS - 1},
        {"first_beat": N_BEATS - 3, "duration_s": 20.5},  # less than a second remains
    ],
)
def test_pieces_that_cannot_be_laid_are_reported_in_one_line(wrong):
    with pytest.raises(ParameterError, match="expected pieces, and beats") as raised:
        laid(**{"pieces": [piece("a", 0, 8)], **wrong})
    assert "\n" not in str(raised.value)
