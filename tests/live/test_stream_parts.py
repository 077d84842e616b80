"""Parts of a dance to music that is still playing: the music that is expected, and the motion of a part."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from synthetic_motions import stepping

from choreograph.core.counts import Counts
from choreograph.core.timebase import SAMPLE_RATE_HZ
from choreograph.library.repertoire import starter_repertoire
from choreograph.live.stream_parts import (
    FPS,
    KEPT_S,
    NotAgain,
    PartPlanner,
    PartRequest,
    clicks,
    expected,
    standing,
    to_middle,
)

BAR_S = 2.0


def ramp(duration_s):
    return np.arange(round(duration_s * SAMPLE_RATE_HZ), dtype=np.float64)


def test_the_latest_bars_are_repeated_after_what_was_heard():
    recent = ramp(10.0)  # from 30 s on, until 40 s
    samples = expected(recent, 30.0, 38.0, 46.0, BAR_S)
    bars = round(2 * BAR_S * SAMPLE_RATE_HZ)
    from_6_s, from_8_s = (round(time_s * SAMPLE_RATE_HZ) for time_s in (6.0, 8.0))
    np.testing.assert_array_equal(samples[:bars], np.append(recent[from_8_s:], recent[from_6_s:from_8_s]))
    np.testing.assert_array_equal(samples[bars:], samples[:bars])


def test_before_what_was_heard_there_is_silence_and_one_bar_is_repeated_if_there_is_no_more():
    recent = 1.0 + ramp(3.0)
    samples = expected(recent, 1.0, 0.0, 6.0, BAR_S)
    assert not samples[:SAMPLE_RATE_HZ].any() and samples[SAMPLE_RATE_HZ:].all()
    bar = round(BAR_S * SAMPLE_RATE_HZ)
    np.testing.assert_array_equal(samples[4 * SAMPLE_RATE_HZ :], recent[-bar:])
    assert not expected(np.zeros(0), 0.0, 0.0, 1.0, BAR_S).any()


def test_clicks_are_on_the_counts():
    counts = Counts(np.array([0.5, 1.0, 1.99]), np.array([1, 2, 3]), 4)
    samples = clicks(counts, 2.0)
    assert len(samples) == 2 * SAMPLE_RATE_HZ
    loud = np.flatnonzero(samples > 0) / SAMPLE_RATE_HZ
    assert loud.min() == pytest.approx(0.5, abs=1e-3) and not ((loud > 0.52) & (loud < 1.0)).any()


def test_what_was_danced_lately_costs_more():
    layer = SimpleNamespace(
        n_nodes=4, take_names=np.array(["a", "a", "a", "b"]),
        take_frames=np.array([[100], [200], [400], [200]]),  # at 20 fps
    )  # fmt: skip
    cost = NotAgain([[("a", 5.0, 12.0)], []]).node(layer, None)
    assert cost.tolist() == [1.0, 1.0, 0.0, 0.0]


def test_a_part_leads_to_the_middle_of_the_stage_without_a_jump():
    motion = stepping(600)
    motion.root_pos_m[:, 0] += 3.0
    led = to_middle(motion, 240, 480)
    np.testing.assert_array_equal(led.root_pos_m[:240], motion.root_pos_m[:240])
    assert led.root_pos_m[480:, 0].max() < motion.root_pos_m[480:, 0].min() - 0.4
    steps_m, usual_m = (np.abs(np.diff(each.joint_pos_m(), axis=0)).max() for each in (led, motion))
    assert steps_m < 1.5 * usual_m
    motion.root_pos_m[:, 0] -= 3.0
    near = to_middle(motion, 240, 480)
    assert near is motion or np.abs(near.root_pos_m - motion.root_pos_m).max() < 0.7


@pytest.mark.slow
def test_a_part_keeps_the_dance_before_it_and_goes_on_from_its_last_pose():
    planner = PartPlanner(starter_repertoire())
    stands = planner.plan(standing(6.0)).motion
    still = stands.sliced(0, 300)
    assert np.abs(np.diff(still.joint_pos_m(), axis=0)).max() < 0.01  # it breathes
    times_s = np.arange(0.0, 10.0, 0.5)
    counts = Counts(times_s, np.arange(len(times_s)) % 4 + 1, 4)
    request = PartRequest(clicks(counts, 10.5), counts, still, 8.0, "house", 0)
    part = planner.plan(request)
    motion = part.motion
    assert part.figures and all(figure.end_s <= 10.6 for figure in part.figures)
    kept = round(KEPT_S * FPS)
    np.testing.assert_allclose(motion.root_pos_m[:kept], still.root_pos_m[:kept], atol=1e-5)
    assert motion.duration_s == pytest.approx(10.5)
    steps_m = np.abs(np.diff(motion.joint_pos_m(), axis=0)).max(axis=(1, 2))
    assert steps_m[kept - 2 : kept + 2].max() < 0.08 and steps_m[kept:].max() > 0.02  # it dances
    ending = PartRequest(clicks(counts, 10.0), counts, motion, 6.0, None, 0, rests=True)
    rests = planner.plan(ending).motion
    assert np.abs(np.diff(rests.joint_pos_m()[-120:], axis=0)).max() < 0.01
