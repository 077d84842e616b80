"""Requests that never end: their connections are closed, and what was sent of them is removed."""

from __future__ import annotations

import logging
import logging.handlers
import os
import queue
import socket
import threading
import time

import pytest

from choreograph.studio import patience
from choreograph.studio.safety import Access
from choreograph.studio.serve import make_server, start

LIMIT_S = 0.3


@pytest.fixture(scope="module")
def live(repertoire, tmp_path_factory):
    """A served studio without a song, in an empty folder, which waits only for a moment."""
    patch = pytest.MonkeyPatch()
    patch.chdir(tmp_path_factory.mktemp("live"))
    patch.setattr(patience, "HEAD_S", LIMIT_S)
    patch.setattr(patience, "BODY_S", LIMIT_S)
    service = start(None, repertoire)
    listening = socket.create_server(("127.0.0.1", 0))
    access = Access.of("127.0.0.1", listening.getsockname()[1])
    server = make_server(service, access)
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listening]}, daemon=True)
    thread.start()
    yield service, access.port
    server.should_exit = True
    thread.join(10)
    service.close()
    patch.undo()


@pytest.fixture
def complaints():
    """What the server writes to the terminal."""
    handler = logging.handlers.QueueHandler(queue.SimpleQueue())
    logging.getLogger("uvicorn.error").addHandler(handler)
    yield handler.queue
    logging.getLogger("uvicorn.error").removeHandler(handler)


def sent(port, data, drip=b""):
    """What a server answers to data, and how long it kept the connection. `drip` is sent byte by byte."""
    with socket.create_connection(("127.0.0.1", port), timeout=20 * LIMIT_S) as connection:
        connection.sendall(data)
        began_s = time.monotonic()
        answer = b""
        try:
            for one in drip:
                time.sleep(LIMIT_S / 10)
                connection.sendall(bytes([one]))
            while part := connection.recv(1 << 16):
                answer += part
        except TimeoutError:
            raise AssertionError(f"the connection is still open, with the answer {answer!r}") from None
        except OSError:  # it was closed while something was on its way
            pass
        return answer, time.monotonic() - began_s


def head(port, method, path, *lines):
    host = f"Host: 127.0.0.1:{port}"
    return "\r\n".join([f"{method} {path} HTTP/1.1", host, *lines, "", ""]).encode()


@pytest.mark.parametrize(
    ("data", "drip"), [(b"", b""), (b"GET / HT", b""), (b"GET / HTTP/1.1\r\nX: ", b"a" * 100)]
)
def test_a_head_that_does_not_end_is_not_waited_for(live, data, drip):
    answer, waited_s = sent(live[1], data, drip)
    assert answer == b"" and waited_s < 5 * LIMIT_S


def test_a_second_head_is_not_waited_for_either(live):
    first = head(live[1], "GET", "/api/jobs/none")
    _, waited_s = sent(live[1], first, b"GET / HTTP/1.1\r\nX: " + b"a" * 100)
    assert waited_s < 10 * LIMIT_S


@pytest.mark.parametrize("drip", [b"", b"a" * 200])
@pytest.mark.parametrize(
    ("path", "lines"),
    [("/api/undo", ["Content-Type: application/json"]), ("/api/song", ["X-Filename: a.wav"])],
)
def test_a_body_that_does_not_arrive_is_refused(live, path, lines, drip):
    service, port = live
    answer, waited_s = sent(port, head(port, "POST", path, *lines, "Content-Length: 1000"), drip)
    assert waited_s < 5 * LIMIT_S and (drip or answer.startswith(b"HTTP/1.1 408"))
    assert not list(service.scratch.glob("sent-*")) and os.listdir(service.desk.folder) == []


def test_a_slow_body_is_waited_for(live, monkeypatch):
    port = live[1]
    monkeypatch.setattr(patience, "SLOWEST_BYTES_PER_S", 10)
    body = b'{"revision": 1}'
    request = head(port, "POST", "/api/undo", f"Content-Length: {len(body)}", "Connection: close")
    answer, _ = sent(port, request, body)
    assert not answer.startswith(b"HTTP/1.1 408") and b"HTTP/1.1 4" in answer


@pytest.mark.parametrize(
    ("lines", "status"),
    [
        (["Origin: http://evil.com"], b"403"), (["Origin: http://["], b"403"),
        (["Upgrade: websocket", "Connection: Upgrade", "Sec-WebSocket-Version: 13",
          "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ=="], b"403"),
        (["Upgrade: h2c", "Connection: Upgrade"], b"413"),
    ],
)  # fmt: skip
def test_what_is_refused_is_refused_before_its_body(live, lines, status, complaints):
    port = live[1]
    with socket.create_connection(("127.0.0.1", port), timeout=10) as connection:
        connection.sendall(head(port, "POST", "/api/song", *lines, "Content-Length: 999999999999"))
        assert connection.recv(100)[9:12] == status
        began_s = time.monotonic()
        try:  # the body is not read for ever
            while time.monotonic() - began_s < 10 * LIMIT_S:
                connection.sendall(b"a")
                time.sleep(LIMIT_S / 10)
        except OSError:
            pass
    assert time.monotonic() - began_s < 5 * LIMIT_S
    assert complaints.empty()


def test_a_web_socket_is_refused_without_a_complaint(live, complaints):
    port = live[1]
    lines = ["Upgrade: websocket", "Connection: Upgrade", "Sec-WebSocket-Version: 13"]
    lines += ["Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==", "Connection: close"]
    for path in ("/", "/api/state", "/api/events", "/ws"):
        answer, _ = sent(port, head(port, "GET", path, *lines))
        assert answer.startswith(b"HTTP/1.1 403")
    assert complaints.empty()


def test_a_page_that_leaves_while_it_sends_leaves_nothing(live, complaints):
    service, port = live
    with socket.create_connection(("127.0.0.1", port)) as connection:
        request = head(port, "POST", "/api/song", "X-Filename: a.wav", "Content-Length: 1000")
        connection.sendall(request + b"a" * 100)
        while not list(service.scratch.glob("sent-*")):
            time.sleep(0.01)
        assert os.listdir(service.desk.folder) == []
    while list(service.scratch.glob("sent-*")):
        time.sleep(0.01)
    time.sleep(0.05)
    assert complaints.empty()


def test_news_and_idle_pages_are_not_cut_off(live):
    port = live[1]
    with socket.create_connection(("127.0.0.1", port), timeout=10) as connection:
        connection.sendall(head(port, "GET", "/api/events"))
        time.sleep(3 * LIMIT_S)
        assert b"welcome" in connection.recv(1 << 16)
        live[0].news.tell({"state": 7})
        assert b'{"state": 7}' in connection.recv(1 << 16)
