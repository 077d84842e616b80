"""Frames are sent at their times in the song, and late ones are skipped."""

from __future__ import annotations

import gc
import socket
import threading
import time

import numpy as np
import pytest
from command_line import assert_one_line, run
from synthetic_motions import stepping, swaying
from synthetic_repertoire import write_clicks

from choreograph.formats.register import save_motion
from choreograph.live.sound import silent
from choreograph.live.stream import send_frames
from choreograph.live.vmc import VmcBody, messages_of

FPS = 60.0


class Clock:
    """A clock that sleeping moves on, and a machine that is busy in some calls."""

    def __init__(self, busy_s=()):
        self.now_s, self.busy_s = -0.2, dict(busy_s)

    def __call__(self):
        return self.now_s

    def sleep(self, seconds):
        assert seconds > 0
        self.now_s += seconds


def sent_at(body, clock):
    times = []

    def send(frame, time_s):
        packet = body.packet(frame, time_s)
        [now] = [m.arguments[0] for m in messages_of(packet) if m.address == "/VMC/Ext/T"]
        times.append(now)
        clock.now_s += clock.busy_s.pop(len(times), 0.0)

    return send_frames(len(body), FPS, send, song_s=clock, sleep=clock.sleep), np.array(times)


def test_every_frame_is_sent_at_its_time():
    body = VmcBody.of(swaying(120))
    sent, times_s = sent_at(body, Clock())
    assert (sent.n_frames, sent.n_skipped) == (120, 0)
    np.testing.assert_allclose(times_s, np.arange(120) / FPS, atol=1e-6)


def test_after_a_pause_the_body_is_where_the_song_is():
    body = VmcBody.of(swaying(120))
    sent, times_s = sent_at(body, Clock({30: 0.5}))
    assert sent.n_frames + sent.n_skipped == 120 and 28 <= sent.n_skipped <= 30
    assert sent.latest_s < 1 / FPS
    np.testing.assert_allclose(times_s[-1], 119 / FPS, atol=1e-6)


def test_the_last_frame_is_always_sent():
    sent, times_s = sent_at(VmcBody.of(swaying(30)), Clock({10: 60.0}))
    assert len(times_s) == 11 and sent.n_skipped == 19


def test_the_silent_clock_begins_before_the_song():
    with silent() as song_s:
        first = song_s()
        time.sleep(0.02)
        assert first < 0.0 and song_s() >= first + 0.02


@pytest.fixture
def receiver():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as own:
        own.bind(("127.0.0.1", 0))
        own.settimeout(60.0)
        yield own


def test_the_command_sends_a_motion_to_a_receiver(tmp_path, receiver):
    save_motion(tmp_path / "steps.bvh", stepping(90))  # of which a busy machine skips some
    song, port = write_clicks(tmp_path / "song.wav", duration_s=4.0), receiver.getsockname()[1]
    packets = []

    def receive():
        while len(packets) < 20:
            packets.append(receiver.recv(65535))

    thread = threading.Thread(target=receive)
    thread.start()
    result = run("live", song, "--dance", tmp_path / "steps.bvh", "--port", port, "--silent", "--fps", 30)
    thread.join(timeout=60.0)
    assert result.exit_code == 0, result.output
    assert "frames a second: Ctrl-C ends it" in result.stdout and "ms late" in result.stdout
    assert len(packets) == 20
    names = {m.arguments[0] for m in messages_of(packets[0]) if m.address == "/VMC/Ext/Bone/Pos"}
    assert {"Hips", "LeftUpperLeg", "Head"} <= names


def test_what_cannot_be_sent_is_said(tmp_path):
    song = write_clicks(tmp_path / "song.wav", duration_s=2.0)
    save_motion(tmp_path / "steps.bvh", stepping(30))
    dance = ("--dance", tmp_path / "steps.bvh", "--silent")
    assert_one_line(run("live", song, *dance, "--genre", "house"), says="expected no --genre beside --dance")
    assert_one_line(
        run("live", song, *dance, "--control", "9000"), says="expected no --control beside --dance"
    )
    assert_one_line(run("live", song, *dance, "--host", "no.such.invalid"), says="'no.such.invalid'")
    assert_one_line(run("live", song, *dance, "--host", f"{'a' * 70}.b"), says="not a name of a machine")
    assert_one_line(run("live", tmp_path / "none.mp3", *dance), says="none.mp3")
    assert_one_line(run("live"), says="expected a SONG, or --input")
    assert_one_line(run("live", song, "--pcm", "44100:2:s16"), says="expected no --pcm without --input")
    assert_one_line(run("live", song, "--input", "-"), says="expected no SONG beside --input")
    assert_one_line(run("live", "--input", "-", "--pcm", "mp3"), says="RATE:CHANNELS:ENCODING")


def test_a_collection_between_frames_does_not_look_at_what_was_made_before():
    made, frozen = [[] for _ in range(20_000)], []
    before = gc.get_freeze_count()
    send_frames(3, 1000.0, lambda *_: frozen.append(gc.get_freeze_count()), song_s=lambda: 1.0)
    assert min(frozen) >= before + len(made) and gc.get_freeze_count() == 0


def test_frames_go_on_until_they_are_ended():
    now_s, sent = [0.0], []

    def sleep(seconds):
        now_s[0] += seconds

    made = send_frames(
        None, 10.0, lambda frame, time_s: sent.append(frame), song_s=lambda: now_s[0], sleep=sleep,
        ended=lambda: len(sent) == 25,
    )  # fmt: skip
    assert sent == list(range(25)) and made.n_frames == 25 and made.n_skipped == 0
