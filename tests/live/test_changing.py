"""What is requested while a dance runs is danced from the next phrase on, and not a frame before."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic_motions import stepping, swaying

import choreograph as cg
from choreograph.core.errors import ParameterError
from choreograph.live.changing import Changes, ChangingBody, Wanted, changing, phrases_s, sized
from choreograph.live.requests import Request
from choreograph.live.vmc import VmcBody

FPS = 30.0
STARTS_S = (0.0, 4.0, 8.0, 12.0)


@pytest.fixture
def of_16_s():
    motion = swaying(480)
    return VmcBody.of(motion), VmcBody.of(
        cg.Motion(motion.skeleton, motion.root_pos_m + 1.0, motion.local_quat, FPS)
    )


class Planner:
    """Plans the other body, and takes some time for it."""

    def __init__(self, body, takes_s=0.0):
        self.body, self.takes_s, self.now_s, self.calls = body, takes_s, 0.0, []

    def __call__(self, before, number, until_s, wanted, fps):
        self.calls.append((before, number, until_s, wanted))
        self.now_s += self.takes_s
        return self.body, ("not all",)

    def song_s(self):
        return self.now_s


def changes(body, planner, notes=None):
    given = [] if notes is None else notes
    return Changes(
        body, STARTS_S, FPS, Wanted({"seed": 0}), planner, song_s=planner.song_s, note=given.append
    )


def test_frames_change_from_the_phrase_on(of_16_s):
    first, other = of_16_s
    body, planner = ChangingBody(first), Planner(other)
    planner.now_s = 1.0
    change = changes(body, planner).handle(Request("genre", "salsa"))
    assert change.from_s == 4.0 and change.unmet == ("not all",)
    assert [body.packet(frame, 0.0) == first.packet(frame, 0.0) for frame in (0, 119, 120, 479)] == [
        True, True, False, False,
    ]  # fmt: skip
    assert body.packet(120, 0.0) == other.packet(120, 0.0)


def test_a_phrase_that_begins_too_soon_is_left_out(of_16_s):
    planner = Planner(of_16_s[1])
    planner.now_s = 2.0
    assert changes(ChangingBody(of_16_s[0]), planner).handle(Request("seed", 2)).from_s == 8.0


def test_a_dance_that_comes_too_late_is_planned_for_the_next_phrase(of_16_s):
    planner = Planner(of_16_s[1], takes_s=5.0)
    made = changes(ChangingBody(of_16_s[0]), planner)
    assert made.handle(Request("seed", 2)) is None  # at 5, 10 and 15 s
    assert [until_s for _, _, until_s, _ in planner.calls] == [4.0, 8.0]
    planner = Planner(of_16_s[1], takes_s=3.0)
    planner.now_s = 1.4
    made = changes(ChangingBody(of_16_s[0]), planner)
    assert made.handle(Request("seed", 2)).from_s == 8.0
    assert made.handle(Request("seed", 3)).from_s == 12.0
    assert made.handle(Request("seed", 4)) is None
    assert [before for before, *_ in planner.calls] == [0, 0, 2]  # each continues what is danced


def test_requests_add_up_and_a_pin_is_of_one_phrase():
    wanted = Wanted({"engine": "graph", "seed": 0})
    for request in (
        Request("genre", "salsa"),
        Request("pin", "take:a"),
        Request("seed", 4),
        Request("energy", 0.5),
    ):
        wanted = wanted.changed(request, 4.0, 8.0)
    assert wanted.arguments == {"engine": "graph", "seed": 4, "genre": "salsa"}
    assert wanted.sizes == ((4.0, 0.5),)
    assert wanted.changed(Request("pin", "take:a"), 4.0, 8.0).arguments["pins"] == [cg.TakePin(4.0, 8.0, "a")]
    assert wanted.changed(Request("genre", ""), 4.0, 8.0).arguments["genre"] is None
    assert wanted.changed(Request("seed", 0), 4.0, 8.0).arguments["seed"] == 0


def test_what_cannot_be_planned_is_noted_and_the_dance_goes_on(of_16_s):
    def refuse(*given):
        raise ParameterError("expected a genre of the repertoire, got 'polka'")

    notes = []
    body = ChangingBody(of_16_s[0])
    made = Changes(
        body, STARTS_S, FPS, Wanted({}), refuse, song_s=lambda: 0.0, note=notes.append
    )  # fmt: skip
    made.request(Request("genre", "polka"))
    made.end()
    made.run()
    assert notes == ["genre polka: expected a genre of the repertoire, got 'polka'"]
    assert body.packet(479, 0.0) == of_16_s[0].packet(479, 0.0)


def test_a_smaller_dance_does_not_change_before_its_time():
    motion = stepping(600)
    smaller = sized(motion, [(10.0, 0.5)])
    first = int(10.0 * motion.fps)
    joints_m, before_m = smaller.joint_pos_m(), motion.joint_pos_m()
    np.testing.assert_array_equal(joints_m[:first], before_m[:first])
    fastest_m, usual_m = (np.abs(np.diff(each, axis=0)).max() for each in (joints_m, before_m))
    assert fastest_m < 1.2 * usual_m
    late = slice(first + int(5 * motion.fps), None)
    assert np.ptp(joints_m[late, :, 1], axis=0).max() < np.ptp(before_m[late, :, 1], axis=0).max()
    assert sized(motion, []) is motion


@pytest.mark.slow
def test_a_dance_is_planned_again_in_another_process():
    """Of a built-in song: all frames before the phrase are those of the dance, and no joint jumps."""
    song, fps = cg.example_songs()["house"], 60.0
    dance = cg.dance(song, engine="mixer")
    body, now_s, notes = ChangingBody(VmcBody.of(dance.motion)), [0.0], []
    first = VmcBody.of(dance.motion)
    starts_s = phrases_s(song, (), dance.motion.duration_s)
    arguments = {"engine": "mixer", "seed": 0, "genre": None}
    with changing(song, (), dance, body, fps, arguments, song_s=lambda: now_s[0], note=notes.append) as made:
        made.request(Request("genre", "no such genre"))
        made.request(Request("seed", 5))
    border_s = min(start_s for start_s in starts_s if start_s >= 2.5)
    assert notes[0].startswith("genre no such genre: expected a genre")
    assert notes[1] == f"seed 5: from {border_s:.1f} s on"
    border = round(border_s * fps)
    same = [body.packet(frame, 0.0) == first.packet(frame, 0.0) for frame in range(len(body))]
    assert all(same[:border]) and not all(same[border:])
    hips_m = np.array([body.pose(frame, 0.0)["hips_pos_m"] for frame in range(len(body))])
    usual_m = np.array([first.pose(frame, 0.0)["hips_pos_m"] for frame in range(len(body))])
    steps_m, usual_steps_m = (np.linalg.norm(np.diff(each, axis=0), axis=1) for each in (hips_m, usual_m))
    assert steps_m[border - 2 : border + 60].max() < 1.5 * usual_steps_m.max()
