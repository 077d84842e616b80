"""Takes: deterministic, on stage, on the beat through tempo changes, continuous, and faster with energy."""

from __future__ import annotations

import itertools
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from choreograph.core.errors import ParameterError
from choreograph.evaluation.metrics.beat import f_score
from choreograph.evaluation.metrics.physical import jerk_ratio_at
from choreograph.motion import rotations as rot
from choreograph.motion.body import body_pos_m, mirrored
from choreograph.motion.motion import Motion
from choreograph.motion.motion_beats import mean_joint_speed_m_s, motion_beat_times_s
from content.moves.genres import GENRES
from content.moves.sequencer import RenderedTake, render, render_take, sequence_moves

pytestmark = pytest.mark.slow

QUICK_STEPS = ("cha-cha", "jive")  # between the counts, which are stops as well
LOW_FPS = 10.0  # enough for positions, mean speeds and sequences of moves
every_genre = pytest.mark.parametrize("genre", GENRES.values(), ids=lambda genre: genre.name)
BEATS_S = 1.0 + np.arange(96) * 0.5
MANY_BEATS_S = 1.0 + np.arange(200) * 0.5


@cache
def coarse(genre: str, seed: int) -> RenderedTake:
    """A take that several tests look at."""
    return render_take(GENRES[genre], BEATS_S, seed=seed, fps=LOW_FPS)


@cache
def lively_take(genre: str, seed: int) -> RenderedTake:
    """A long take of the most energy."""
    return render_take(GENRES[genre], MANY_BEATS_S, seed=seed, energy=1.0, fps=LOW_FPS)


def lively(genre: str, seed: int) -> Motion:
    """Its motion."""
    return lively_take(genre, seed).motion


@every_genre
def test_the_same_seed_gives_the_same_take(genre) -> None:
    a, c = (coarse(genre.name, seed) for seed in (2, 5))
    b = render_take(genre, BEATS_S, seed=2, fps=LOW_FPS)
    assert np.array_equal(a.motion.local_quat, b.motion.local_quat) and a.placed == b.placed
    assert not np.array_equal(a.motion.local_quat, c.motion.local_quat)


@every_genre
def test_moves_follow_one_another_without_a_gap(genre) -> None:
    rendered = coarse(genre.name, 2)
    placed = rendered.placed
    for before, after in itertools.pairwise(placed):
        assert after.start == before.start + before.move.counts
        assert (after.origin_m, after.yaw_rad) == before.end()
        assert None in (before.move.free_foot, after.move.first_foot) or (
            before.move.free_foot == after.move.first_foot
        )
    assert placed[-1].start + placed[-1].move.counts >= len(rendered.count_times_s) - 1
    assert len({p.move.name for p in placed}) >= 4


@every_genre
def test_two_bars_are_danced_again_on_the_other_side_if_the_feet_allow_it(genre) -> None:
    returns = 0
    for seed in range(4):
        placed = lively_take(genre.name, seed).placed
        by_start = {p.start: p for p in placed}
        for start, first in by_start.items():
            again = by_start.get(start + 2 * genre.bar)
            if start % (4 * genre.bar) or again is None or again.move.name != first.move.name:
                continue
            returns += 1
            free = next(p for p in placed if p.start + p.move.counts == again.start).move.free_foot
            assert None in (free, again.move.first_foot) or again.move.first_foot == free
    assert returns > 0


@every_genre
def test_the_dancer_stays_on_stage(genre) -> None:
    for seed in range(4):
        root = lively(genre.name, seed).root_pos_m
        assert np.hypot(root[:, 0], root[:, 2]).max() < genre.stage_m + 0.8


@every_genre
def test_on_the_beat_through_a_ramp_of_tempo(genre) -> None:
    beats = 1.0 + np.cumsum(60.0 / np.linspace(90.0, 140.0, 80))
    motion = render_take(genre, beats, seed=1).motion
    found = motion_beat_times_s(body_pos_m(motion), motion.fps)
    inside = beats[1:-2]
    found = found[(found > inside[0] - 0.25) & (found < inside[-1] + 0.25)]
    assert f_score(found, inside) >= (0.8 if genre.name in QUICK_STEPS else 0.85)


@every_genre
def test_half_time_takes_two_beats_a_count(genre) -> None:
    beats = 1.0 + np.arange(120) * 60.0 / 175.0

    def danced(from_bpm: float):
        return render_take(
            replace(genre, half_time_from_bpm=from_bpm), beats, seed=1, energy=0.6, first_downbeat=2
        )

    half, full = danced(170.0), danced(180.0)
    assert np.array_equal(half.count_times_s, beats[2::2])
    assert np.array_equal(full.count_times_s, beats[2:])
    assert half.motion.n_frames == full.motion.n_frames
    last = half.placed[-1]
    assert last.start + last.move.counts >= len(half.count_times_s) - 1
    inside = half.count_times_s[1:-2]
    found = motion_beat_times_s(body_pos_m(half.motion), half.motion.fps)
    found = found[(found > inside[0] - 0.3) & (found < inside[-1] + 0.3)]
    assert f_score(found, inside) >= 0.75
    slow, quick = (np.median(mean_joint_speed_m_s(body_pos_m(r.motion), 60.0)) for r in (half, full))
    assert slow < 0.85 * quick


@every_genre
def test_no_jerk_where_moves_meet(genre) -> None:
    rendered = render_take(genre, BEATS_S, seed=3)
    counts_s = rendered.count_times_s
    borders = [counts_s[p.start] for p in rendered.placed if 0 < p.start < len(counts_s)]
    assert jerk_ratio_at(body_pos_m(rendered.motion), 60.0, borders) < 1.4


@every_genre
def test_energy_makes_it_livelier(genre) -> None:
    def speed(motions: list[Motion]) -> float:
        return np.mean([np.median(mean_joint_speed_m_s(body_pos_m(m), LOW_FPS)) for m in motions])

    soft = [render_take(genre, BEATS_S, energy=0.0, seed=seed, fps=LOW_FPS).motion for seed in range(4)]
    assert speed([lively(genre.name, seed) for seed in range(4)]) > 1.2 * speed(soft)


@every_genre
def test_a_body_is_never_still_nor_rushed(genre) -> None:
    """Real takes: median joint speed 0.55 to 0.8 m/s, a tenth of the time below 0.14 to 0.3."""
    speed = mean_joint_speed_m_s(body_pos_m(render_take(genre, BEATS_S, energy=0.7, seed=1).motion), 60.0)
    low, middle = np.percentile(speed[60:-120], [10, 50])
    assert low > 0.05 and 0.2 < middle < 1.1


@every_genre
def test_the_mirrored_moves_are_the_motion_in_a_mirror(genre) -> None:
    for move in genre.moves:
        counts_s = BEATS_S[: move.counts]
        one, other = (render(sequence_moves([m]), counts_s, rng=None).motion for m in (move, move.mirrored()))
        np.testing.assert_allclose(body_pos_m(other), mirrored(body_pos_m(one)), atol=1e-6)


def test_fast_swing_leaves_the_triples_out() -> None:
    def names(bpm: float) -> set[str]:
        beats_s = 1.0 + np.arange(64) * 60.0 / bpm
        takes = [render_take(GENRES["swing"], beats_s, seed=seed, fps=LOW_FPS) for seed in range(16)]
        return {p.move.name for take in takes for p in take.placed}

    slow, fast = names(140.0), names(176.0)
    triples = {"triple step basic", "tuck turn", "lindy circle"}
    assert triples <= slow and not triples & fast


def test_size_scales_steps_but_not_home() -> None:
    move = GENRES["disco"].moves[0]
    small, big = (render(sequence_moves([move], size=s), BEATS_S[:4], rng=None) for s in (0.6, 1.2))
    reach = [np.ptp(foot.ball_m[foot.planted, 0]) for foot in (small.feet["left"], big.feet["left"])]
    assert reach[1] == pytest.approx(2 * reach[0], rel=1e-6)
    np.testing.assert_allclose(small.feet["left"].ball_m[0], big.feet["left"].ball_m[0], atol=1e-9)


def test_rotations_stay_continuous_over_a_take() -> None:
    quat = render_take(GENRES["disco"], BEATS_S, seed=4, energy=1.0).motion.local_quat
    step = np.linalg.norm(rot.to_rotvec(rot.multiply(rot.invert(quat[:-1]), quat[1:])), axis=-1)
    assert step.max() < 0.6


def test_one_energy_per_beat() -> None:
    with pytest.raises(ParameterError, match="one energy per beat"):
        render_take(GENRES["disco"], BEATS_S, energy=np.ones(3))
