"""Frames as JSON to WebSocket clients of this machine, and their requests."""

from __future__ import annotations

import json
import socket
import threading
import time

import numpy as np
import pytest
from synthetic_motions import stepping

from choreograph.core.errors import ChoreographError
from choreograph.live.requests import Request
from choreograph.live.vmc import VmcBody
from choreograph.live.websocket import Frames, serving

client = pytest.importorskip("websockets.sync.client")
exceptions = pytest.importorskip("websockets.exceptions")


def free_port() -> int:
    with socket.socket() as own:
        own.bind(("127.0.0.1", 0))
        return own.getsockname()[1]


def test_a_client_receives_frames_and_requests_changes():
    asked, port = [], free_port()
    with serving(port, asked.append) as frames, client.connect(f"ws://127.0.0.1:{port}") as own:
        until = time.monotonic() + 5.0
        while not frames.n_readers and time.monotonic() < until:
            time.sleep(0.01)
        frames.put({"frame": 7})
        assert json.loads(own.recv(timeout=5.0)) == {"frame": 7}
        own.send('{"genre": "salsa"}')
        own.send('{"genre": 4}')
        assert "expected genre salsa" in json.loads(own.recv(timeout=5.0))["error"]
        frames.end()
        with pytest.raises(exceptions.ConnectionClosed):
            own.recv(timeout=5.0)
    assert asked == [Request("genre", "salsa")]


def test_a_dance_that_was_made_before_is_not_changed():
    port = free_port()
    with serving(port, None), client.connect(f"ws://127.0.0.1:{port}") as own:
        own.send('{"genre": "salsa"}')
        assert "cannot be changed" in json.loads(own.recv(timeout=5.0))["error"]


@pytest.mark.parametrize("origin", ["https://example.com", "null", "http://localhost.example.com"])
def test_pages_of_others_are_refused(origin):
    port = free_port()
    with (
        serving(port, None),
        pytest.raises(exceptions.InvalidStatus, match="403"),
        client.connect(f"ws://127.0.0.1:{port}", origin=origin),
    ):
        pass


@pytest.mark.parametrize("origin", ["http://localhost:5173", "http://127.0.0.1:8000"])
def test_pages_of_this_machine_are_served(origin):
    port = free_port()
    with serving(port, None), client.connect(f"ws://127.0.0.1:{port}", origin=origin):
        pass


def test_a_port_in_use_is_said():
    port = free_port()
    with (
        serving(port, None),
        pytest.raises(ChoreographError, match="free port for --websocket"),
        serving(port, None),
    ):
        pass


def test_a_slow_reader_misses_frames_and_delays_nobody():
    frames, seen = Frames(), []

    def read():
        for text in frames:
            seen.append(json.loads(text)["frame"])
            time.sleep(0.05)

    thread = threading.Thread(target=read)
    thread.start()
    while not frames.n_readers:
        time.sleep(0.001)
    began = time.monotonic()
    for frame in range(1000):
        frames.put({"frame": frame})
    assert time.monotonic() - began < 5.0
    time.sleep(0.2)
    frames.end()
    thread.join()
    assert len(seen) < 100 and seen == sorted(seen) and seen[-1] == 999


def test_a_pose_is_in_the_axes_of_vrm():
    motion = stepping(30)
    pose = VmcBody.of(motion).pose(12, 0.2)
    np.testing.assert_allclose(pose["hips_pos_m"], motion.root_pos_m[12], atol=1e-4)
    np.testing.assert_allclose(
        np.array(pose["bones"]["hips"])[[3, 0, 1, 2]], motion.local_quat[12, 0], atol=1e-4
    )
    assert {"hips", "leftUpperLeg", "head"} <= set(pose["bones"]) and pose["frame"] == 12
    assert {f"left{bone}" for bone in ("ThumbMetacarpal", "ThumbProximal", "LittleDistal")} <= set(
        pose["bones"]
    )
    assert not any("ThumbIntermediate" in name for name in pose["bones"])
    assert len(json.dumps(pose)) < 5000
