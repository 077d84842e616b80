"""Transitions are put where the dance keeps the beat: synthetic dances whose rests are known."""

from dataclasses import replace

import numpy as np
import pytest
from choreograph.blending.transition_search import REACH_S, search_transitions
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic_motions import stepping

from choreograph.blending import transition_search
from choreograph.blending.assembly import assemble
from choreograph.blending.foot_locking import DANCE_SHIFT_S, lock_feet
from choreograph.blending.runs import to_runs, with_transitions
from choreograph.config import TRANSITION_LENGTHS_S
from choreograph.features.motion_beats import motion_beat_times_s
from choreograph.metrics import beat
from choreograph.motion.body import body_pos_m

pytestmark = pytest.mark.slow

FPS = 60.0
PERIOD_S = 0.6
TAKES = {name: stepping(24 * 30, period_s=PERIOD_S, seed=seed) for seed, name in enumerate("abc")}
LENGTHS_S = {name: motion.duration_s for name, motion in TAKES.items()}
BEATS_S = PERIOD_S * np.arange(40)


def read(take, start_s, stop_s):
    return TAKES[take], 0.0


def on_the_beat(takes):
    """Runs of seconds; a take that others follow in goes on where the song is, so that it keeps time."""
    return to_runs(list(takes), [np.linspace(second, second + 1.0, 21) for second in range(len(takes))])


def searched(runs, beats_s=BEATS_S, lengths_s=LENGTHS_S, **options):
    return search_transitions(
        runs, beats_s, lengths_s, read, **{"fps": FPS, "blending": "inertial"} | options
    )


def score(runs, *, locked):
    made, _ = assemble(runs, read, fps=FPS, duration_s=runs[-1].stop_s, blending="inertial")
    body_m = body_pos_m(lock_feet(made, shift_s=DANCE_SHIFT_S) if locked else made)
    return beat.evaluate(motion_beat_times_s(body_m, FPS), BEATS_S[runs[-1].stop_s > BEATS_S])


@pytest.mark.parametrize("locked", [True, False])
def test_transitions_of_dances_that_rest_on_beats_are_put_on_beats(locked, monkeypatch):
    monkeypatch.setitem(
        TRANSITION_LENGTHS_S, "inertial", TRANSITION_LENGTHS_S["inertial"][:1]
    )  # others keep time between beats, too
    if not locked:  # a locked foot may come to rest elsewhere, and with it a transition
        monkeypatch.setattr(transition_search, "lock_feet", lambda motion, **_: motion)
    runs = on_the_beat("ababcbcabcbacbabcacb")
    transitions = searched(runs)
    starts_s = np.array([timing.start_s for timing in transitions])
    before, after = score(runs, locked=locked), score(with_transitions(runs, transitions), locked=locked)
    off_beat_s = np.abs(starts_s - PERIOD_S * np.round(starts_s / PERIOD_S))
    assert (off_beat_s < 1e-5).mean() >= (0.95 if locked else 1.0)
    assert before["aligned_share"] < 0.95 and after["aligned_share"] == 1.0
    assert after["motion_to_music"] < 0.1 * before["motion_to_music"]


def test_transitions_are_scored_with_locked_feet(monkeypatch):
    """Where foot locking changes the motion, transitions move."""
    runs = on_the_beat("ababcbcabcb")

    def stiff(motion, **_):
        return replace(motion, root_pos_m=np.broadcast_to(motion.root_pos_m[:1], motion.root_pos_m.shape))

    as_held = searched(runs)
    monkeypatch.setattr(transition_search, "lock_feet", stiff)
    assert searched(runs) != as_held


def test_the_length_that_keeps_the_beat_better_is_taken(monkeypatch):
    runs = on_the_beat("ababcbcabcbacbabcacb")
    free = searched(runs)
    monkeypatch.setitem(TRANSITION_LENGTHS_S, "inertial", TRANSITION_LENGTHS_S["inertial"][:1])
    usual = searched(runs)
    assert (
        len({timing.transition_s for timing in free[1:]})
        > 1
        == len({timing.transition_s for timing in usual[1:]})
    )
    freely, usually = (score(with_transitions(runs, found), locked=True) for found in (free, usual))
    assert freely["aligned_share"] == 1.0
    assert freely["motion_to_music"] < usually["motion_to_music"]


@given(st.text("abc", min_size=1, max_size=8), st.sampled_from(["inertial", "linear"]))
@settings(max_examples=15, deadline=None)
def test_transitions_stay_near_in_order_and_repeatable(takes, blending):
    runs = on_the_beat(takes)
    transitions = searched(runs, blending=blending)
    starts_s = [timing.start_s for timing in transitions]
    assert starts_s[0] == 0.0 and len(starts_s) == len(runs)
    assert all(timing.transition_s in TRANSITION_LENGTHS_S[blending] for timing in transitions[1:])
    assert np.abs(np.array(starts_s) - [run.start_s for run in runs]).max() <= REACH_S + 1 / FPS
    assert (np.diff([*starts_s, runs[-1].stop_s]) >= 0.5).all()
    assert transitions == searched(runs, blending=blending)


def test_a_take_is_not_played_beyond_its_ends():
    runs = to_runs("ab", [np.linspace(4.0, 5.0, 21), np.linspace(0.0, 1.0, 21)])
    assert searched(runs, lengths_s=LENGTHS_S | {"a": 5.0})[1].start_s == pytest.approx(1.0)


def test_fixed_runs_start_on_time():
    runs = on_the_beat("ababcb")
    free = searched(runs)
    locked = [run.start_s % 2 == 1 for run in runs]
    transitions = searched(runs, fixed=locked)
    on_time = [timing.start_s == run.start_s for timing, run in zip(transitions, runs, strict=True)]
    assert all(stays for stays, is_held in zip(on_time, locked, strict=True) if is_held)
    assert free != transitions and not all(on_time)


def test_without_beats_transitions_stay():
    runs = on_the_beat("abcab")
    starts_s = [timing.start_s for timing in searched(runs, beats_s=np.zeros(0))]
    assert np.abs(np.array(starts_s) - [run.start_s for run in runs]).max() <= REACH_S


class NumpyWhereEmptyIs:
    """numpy, but what nobody has written yet is `filler`."""

    def __init__(self, filler):
        self.empty = lambda shape: np.full(shape, filler)

    def __getattr__(self, name):
        return getattr(np, name)


@pytest.mark.parametrize("fps", [24.0, 25.0, 29.97, 60.0])
def test_only_sampled_frames_are_scored(fps, monkeypatch):
    runs, found = on_the_beat("aaabbccaabbcc"), []
    for filler in (np.nan, 1e200):
        monkeypatch.setattr(transition_search, "np", NumpyWhereEmptyIs(filler))
        with np.errstate(all="raise"):
            found.append(searched(runs, fps=fps))
    assert found[0] == found[1]
