"""Dances to music that is still playing."""

from __future__ import annotations

import socket
import subprocess
import sys
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import soundfile
from synthetic_motions import stepping, swaying

from choreograph.core.counts import Counts, Figure
from choreograph.core.errors import ParameterError
from choreograph.core.timebase import SAMPLE_RATE_HZ
from choreograph.library.repertoire import starter_repertoire
from choreograph.live.online_beats import BeatClock
from choreograph.live.requests import Request
from choreograph.live.stream_dance import (
    AHEAD_S,
    FPS,
    KEPT_S,
    NotAgain,
    Part,
    PartPlanner,
    PartRequest,
    PlannedPart,
    StreamBody,
    StreamDance,
    StreamTime,
    clicks,
    expected,
    hear_all,
    standing,
    to_middle,
)
from choreograph.live.vmc import VmcBody, messages_of
from content.songs.synthesis.song import render_song
from content.songs.synthesis.sounds import RATE_HZ

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


CLOCK = replace(BeatClock.steady(0.0, 0.0, 0.5, 1), metre=4)  # count 1 every 2 s
BLOCK_S = 0.1
BLOCK = np.zeros(round(BLOCK_S * SAMPLE_RATE_HZ), np.float32)


def part(motion, from_s=0.0, clock=None, **more):
    return Part(motion, VmcBody.of(motion), from_s, clock, **more)


def of_frames(n_frames, seed=0):
    return swaying(n_frames, fps=FPS, seed=seed)


class Stage:
    """A dance whose music is known, and whose parts take some time to plan."""

    def __init__(self, clock, takes_s=0.5):
        self.clock, self.takes_s, self.asked, self.notes, self.figures = clock, takes_s, [], [], ()
        first = part(of_frames(300), rests=True)
        self.dance = StreamDance(self.listen, self.plan, StreamBody(first), self.notes.append)
        self.waiting = []

    def listen(self, block):
        found = Future()
        found.set_result(self.clock)
        return found

    def plan(self, request):
        future = Future()
        self.asked.append((self.dance.heard_s, request))
        self.waiting.append((self.dance.heard_s + self.takes_s, future, request))
        return future

    def run(self, until_s):
        while self.dance.heard_s < until_s - 1e-6:
            for ready_s, future, request in self.waiting:
                if self.dance.heard_s >= ready_s and not future.done():
                    n_frames = round(len(request.samples) / SAMPLE_RATE_HZ * FPS)
                    motion = of_frames(n_frames, seed=len(self.asked))
                    future.set_result(PlannedPart(motion, self.figures))
            self.dance.hear(BLOCK)


def test_fingers_go_on_from_part_to_part_in_the_shapes_of_the_figures():
    """Each part has a stomp, from a second before the next part until that one begins, in kept motion."""
    stage = Stage(CLOCK)
    stage.figures = (Figure("stomp and turn", KEPT_S + 2.0, KEPT_S + 4.0, 4),)
    before, most_rad, shapes = None, 0.0, set()
    while stage.dance.heard_s < 20.0:
        stage.run(stage.dance.heard_s + BLOCK_S)
        body = stage.dance.body.at(stage.dance.heard_s)
        quat = body.bone_quat[0, body.names.index("LeftIndexProximal")]
        if before is not None:
            most_rad = max(most_rad, 2.0 * np.arccos(min(1.0, abs(float(quat @ before)))))
        before = quat
        shapes.add(round(np.degrees(2.0 * np.arccos(abs(quat[3])))))
    assert {18, 80} <= shapes  # relaxed, and a fist
    assert stage.dance.n_parts > 3 and np.degrees(most_rad) < 62.0 * 2.2 * BLOCK_S / 0.5


def test_nothing_is_planned_before_there_are_beats():
    stage = Stage(None)
    stage.run(5.0)
    assert not stage.asked and stage.dance.body.part.rests


def test_parts_are_planned_ahead_of_their_count_1_and_of_whole_bars():
    stage = Stage(CLOCK)
    stage.run(20.0)
    firsts_s = [heard_s for heard_s, _ in stage.asked]
    assert stage.dance.n_parts >= 4 and stage.dance.n_late == 0
    for _, request in stage.asked:
        assert request.counts.numbers[np.isclose(request.counts.times_s, KEPT_S)].tolist() == [1]
        assert request.until_s == pytest.approx(KEPT_S + 4.0)  # two bars
        assert request.kept.n_frames >= KEPT_S * FPS
    np.testing.assert_allclose(np.diff(firsts_s[1:]), 4.0, atol=0.11)
    assert firsts_s[0] < 1.0 and stage.notes[0].endswith("120 beats a minute, 4 in a bar")


def test_another_tempo_and_another_metre_are_told_and_small_changes_are_not():
    stage = Stage(CLOCK)
    stage.run(3.0)
    stage.clock = replace(CLOCK, period_s=0.51)
    stage.run(6.0)
    assert len(stage.notes) == 1
    stage.clock = replace(CLOCK, metre=3)
    stage.run(9.0)
    assert len(stage.notes) == 2 and stage.notes[1].endswith("120 beats a minute, 3 in a bar")
    stage.clock = replace(stage.clock, period_s=0.6)
    stage.run(12.0)
    assert len(stage.notes) == 3 and stage.notes[2].endswith("100 beats a minute, 3 in a bar")


def test_a_part_that_comes_too_late_is_left_out_and_another_one_is_planned():
    stage = Stage(CLOCK, takes_s=AHEAD_S + 3.0)
    stage.run(12.0)
    assert stage.dance.n_parts == 0 and stage.dance.n_late >= 1 and stage.dance.body.part.rests


def test_other_beats_are_danced_by_a_new_part():
    stage = Stage(CLOCK)
    stage.run(9.0)
    n_asked = len(stage.asked)
    stage.clock = replace(BeatClock.steady(9.0, 30.0, 0.4, 2), metre=4)
    stage.run(10.0)
    assert len(stage.asked) > n_asked
    stage.run(13.0)
    assert stage.dance.body.part.clock.generation == 2
    np.testing.assert_allclose(np.diff(stage.asked[-1][1].counts.times_s), 0.4)


def test_in_silence_the_dance_comes_to_rest_once():
    stage = Stage(CLOCK)
    stage.run(9.0)
    stage.clock = None
    stage.run(25.0)
    assert [request.rests for _, request in stage.asked][-1] and stage.dance.body.part.rests
    assert sum(request.rests for _, request in stage.asked) == 1
    assert any(note.endswith("no beats") for note in stage.notes)


def test_requests_are_those_of_the_next_part():
    stage = Stage(CLOCK)
    for request in (Request("genre", "salsa"), Request("seed", 7), Request("energy", 0.7)):
        stage.dance.requests.put(request)
    stage.run(3.0)
    assert stage.asked[0][1].genre == "salsa" and stage.asked[0][1].seed == 7
    assert any("energy" in note and "expected genre or seed" in note for note in stage.notes)


def test_what_cannot_be_planned_is_noted_and_the_dance_goes_on():
    stage = Stage(CLOCK)
    stage.dance.genre = "polka"
    stage.run(1.0)
    stage.waiting[0][1].set_exception(ParameterError("expected a genre, got 'polka'"))
    stage.run(9.0)
    assert stage.dance.genre is None and stage.dance.n_parts >= 1
    assert any("expected a genre" in note for note in stage.notes)


def test_the_body_follows_a_corrected_clock():
    motion = of_frames(600)
    body = StreamBody(part(motion, from_s=2.0, clock=CLOCK))
    assert body.frames_at(np.array([5.0]))[1][0] == pytest.approx(3.0 * FPS)
    body.follow(CLOCK.followed(4.0, 0.2, 0.5))  # 0.2 beats are 0.1 s
    assert body.frames_at(np.array([6.0]))[1][0] == pytest.approx(4.1 * FPS)
    body.follow(replace(CLOCK, generation=9, period_s=0.1))  # of another part
    assert body.frames_at(np.array([6.0]))[1][0] == pytest.approx(4.1 * FPS)


def test_after_its_end_a_part_goes_back_and_forth_without_a_jump():
    body = StreamBody(part(of_frames(300), from_s=1.0))
    _, frames = body.frames_at(np.arange(0.0, 60.0, 1 / FPS))
    assert frames.min() >= 0 and frames.max() <= 299 and np.abs(np.diff(frames)).max() < 1.001
    late = frames[round(7 * FPS) :]
    assert late.max() > 298 and late.min() == pytest.approx(299 - 180, abs=1.0)


def test_one_frame_of_a_body_is_between_two():
    motion = of_frames(10)
    body = VmcBody.of(motion)
    np.testing.assert_allclose(body.between(3.0).bone_quat[0], body.bone_quat[3])
    half = body.between(3.5)
    np.testing.assert_allclose(half.bone_pos_m[0], body.bone_pos_m[3:5].mean(axis=0))
    np.testing.assert_allclose(np.linalg.norm(half.bone_quat, axis=-1), 1.0)
    assert len(body.between(9.0)) == 1


def test_the_time_of_a_stream_waits_for_a_file_and_follows_a_late_source():
    now_s = [100.0]

    def sleep(seconds):
        now_s[0] += seconds

    stream_s = StreamTime(lambda: now_s[0])
    for index in range(1, 11):  # a file that is there at once
        stream_s.arrived(0.1 * index, sleep)
        assert stream_s() == pytest.approx(0.1 * index, abs=1e-9)
    assert now_s[0] == pytest.approx(100.9, abs=0.01)
    now_s[0] += 3.1  # a gap
    stream_s.arrived(1.1, sleep)
    assert stream_s() == pytest.approx(1.1, abs=1e-3)


def test_after_the_music_silence_is_heard():
    stage = Stage(CLOCK)

    class Now:
        def arrived(self, end_s):
            stage.clock = CLOCK if end_s < 3.0 else None

    hear_all(stage.dance, [BLOCK] * 30, Now())
    assert stage.dance.heard_s == pytest.approx(11.0)


@pytest.mark.slow
def test_a_song_on_standard_input_is_danced(tmp_path):
    """A song in its own time: the body is sent, moves after the first beats are known, and rests."""
    made = render_song("house", bpm=124.0, duration_s=18.0, seed=5)  # a busy machine has time for a part
    soundfile.write(tmp_path / "song.wav", made.samples, RATE_HZ)
    packets = []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as own:
        own.bind(("127.0.0.1", 0))
        own.settimeout(3.0)
        port = own.getsockname()[1]
        command = [sys.executable, "-m", "choreograph", "live", "--input", "-", "--port", port]
        with (
            (tmp_path / "song.wav").open("rb") as song,
            subprocess.Popen(
                map(str, command), stdin=song, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
            ) as run,
        ):
            while run.poll() is None or len(packets) == 0:
                with suppress(TimeoutError):
                    packets.append(own.recv(65535))
            said = run.stdout.read()
    assert run.returncode == 0, said
    assert "beats a minute, 4 in a bar" in said and "part" in said
    hips_m = np.array(
        [
            message.arguments[1:4]
            for packet in packets
            for message in messages_of(packet)
            if message.address == "/VMC/Ext/Bone/Pos" and message.arguments[0] == "Hips"
        ]
    )
    assert len(hips_m) > 16 * 60
    speed_m_s = np.linalg.norm(np.diff(hips_m, axis=0), axis=1) * 60
    assert np.median(speed_m_s[:180]) < 0.2  # it stands
    assert "danced 0 parts" not in said and speed_m_s[400:].max() > 0.4
