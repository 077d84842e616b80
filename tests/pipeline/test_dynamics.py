"""Dances of every engine follow the dynamics of a song and keep its counts, and plans give the same bytes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import choreograph as cg
from choreograph.core.timebase import SAMPLE_RATE_HZ
from choreograph.evaluation.metrics.counts import counts_within
from choreograph.evaluation.metrics.energy_response import speed_within_m_s
from choreograph.evaluation.metrics.physical import foot_slide_cm_s, jumps_per_minute
from choreograph.evaluation.plan_scores import danced_counts
from choreograph.motion.body import BODY_JOINTS, body_pos_m
from choreograph.music.song import load_song
from content.songs.synthesis.composition import Section
from content.songs.synthesis.song import render_song, write_song

pytestmark = pytest.mark.slow

STARTER = cg.starter_repertoire()
N_BARS, SILENT_BAR, SOFT_BARS = 10, 3, (6, 9)
ANKLES = [BODY_JOINTS.index(f"{side}_ankle") for side in ("left", "right")]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A song of one loudness with a silent bar and a soft part of three bars, and the times of its bars."""
    rendered = render_song("house", n_bars=N_BARS, seed=9801, sections=[Section("chorus", 0, N_BARS, 0.9)])
    path = tmp_path_factory.mktemp("songs") / "house.wav"
    write_song(path, rendered)
    song, bars_s = load_song(path), rendered.bar_times_s
    samples = song.samples.copy()
    for (first, stop), gain in (((SILENT_BAR, SILENT_BAR + 1), 0.0), (SOFT_BARS, 10 ** (-15 / 20))):
        samples[round(bars_s[first] * SAMPLE_RATE_HZ) : round(bars_s[stop] * SAMPLE_RATE_HZ)] *= gain
    return replace(song, samples=samples), bars_s, rendered.beat_times_s


@pytest.fixture(scope="module", params=["graph", "mixer", "rollout"])
def dance(request, made):
    return cg.dance(made[0], engine=request.param, genre="house")


def test_a_dance_stops_in_a_silent_bar_and_is_smaller_in_a_soft_part(dance, made):
    """Beside the same dance without dynamics."""
    song, bars_s, _ = made
    plain = cg.dance(song, engine=dance.plan.engine, genre="house", dynamics=0.0).motion
    body_m, fps = body_pos_m(dance.motion), dance.motion.fps
    ((rests_s, moves_s),) = dance.plan.stops_s
    assert rests_s == pytest.approx(bars_s[SILENT_BAR], abs=0.15)
    assert moves_s == pytest.approx(bars_s[SILENT_BAR + 1], abs=0.15)

    def relative_speed(first, stop):
        span_s = bars_s[first], bars_s[stop]
        return speed_within_m_s(body_m, fps, span_s) / speed_within_m_s(body_pos_m(plain), fps, span_s)

    assert relative_speed(1, SILENT_BAR) == pytest.approx(1.0, abs=0.15)
    assert relative_speed(SILENT_BAR, SILENT_BAR + 1) < 0.45
    assert relative_speed(*SOFT_BARS) < 0.75
    held = body_m[round((rests_s + 0.3) * fps) : round((moves_s - 1.0) * fps)]
    assert np.ptp(held[:, ANKLES], axis=0).max() < 0.02  # both feet stand
    assert np.ptp(held[:, BODY_JOINTS.index("neck")], axis=0).max() > 0.002  # and the body breathes
    assert jumps_per_minute(body_m, fps) == 0.0 and foot_slide_cm_s(body_m, fps) < 15.0


def test_the_counts_after_a_stop_are_those_of_the_song(dance, made):
    if dance.plan.engine != "rollout":
        counts = danced_counts(dance.plan, STARTER)
        assert counts_within(counts.times_s, made[2]) > 0.95


def test_the_plan_renders_to_the_same_bytes_and_can_be_edited(dance, made):
    if dance.plan.engine == "rollout":
        return
    plan = cg.Plan.from_json(dance.plan.to_json())
    again = cg.render(plan, STARTER)
    assert again.root_pos_m.tobytes() == dance.motion.root_pos_m.tobytes()
    assert again.local_quat.tobytes() == dance.motion.local_quat.tobytes()
    edited = body_pos_m(cg.render(replace(plan, stops_s=(), amplitudes=()), STARTER))
    assert speed_within_m_s(edited, plan.fps, plan.stops_s[0]) > 0.15  # m/s
    others = [cg.dance(made[0], engine=plan.engine, genre="house", seed=seed) for seed in (1, 2)]
    resting_m_s = [
        speed_within_m_s(body_pos_m(one.motion), plan.fps, one.plan.stops_s[0]) for one in (dance, *others)
    ]
    assert np.mean(resting_m_s) < 0.15


def test_requested_motifs_and_pinned_takes_keep_their_size(made):
    song, bars_s, _ = made
    span_s = float(bars_s[SOFT_BARS[0]]), float(bars_s[SOFT_BARS[1]])
    pin = cg.TakePin(span_s[0] + 0.5, span_s[1] - 0.5, "house-09")
    plan = cg.dance(song, genre="house", pins=[pin]).plan
    assert set(plan.amplitudes[int(pin.start_s) : int(np.ceil(pin.end_s))]) <= {1.0}
    assert plan.stops_s == ()  # a stop would move the pinned take
