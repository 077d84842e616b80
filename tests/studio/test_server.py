"""Requests to the studio: its page, errors in one line, and what is refused before any work."""

from __future__ import annotations

import json
import logging
import logging.handlers
import os
import queue
import signal
import socket
import subprocess
import sys
import threading
import time
from http.client import HTTPException
from pathlib import Path
from urllib.parse import urlsplit
from urllib.request import Request, urlopen

import pytest
from command_line import run
from starlette.websockets import WebSocketDisconnect
from studio_client import PORT, Client

from choreograph.core.errors import ChoreographError, FormatError, ParameterError
from choreograph.studio import server as server_module
from choreograph.studio.project import ProjectFile, project_from_json
from choreograph.studio.refusals import ForbiddenError
from choreograph.studio.server import (
    COOKIE,
    HEADERS,
    MOST_JSON_BYTES,
    Access,
    _listening,
    is_loopback,
    make_server,
    serve,
    start,
)

# Requests to the studio: its page, errors in one line, and what is refused before any work.


@pytest.mark.parametrize(
    ("path", "kind"),
    [("/", "text/html"), ("/page/player.js", "text/javascript"), ("/studio/main.js", "text/javascript")],
)  # fmt: skip
def test_the_page_and_what_it_shares_are_served(client, path, kind):
    reply = client.get(path)
    assert reply.status_code == 200 and reply.headers["content-type"].startswith(kind)
    assert all(reply.headers[name] for name in HEADERS)


@pytest.mark.parametrize(
    "path",
    [
        "/nothing", "/page/", "/page/nothing.js", "/page/../page.py", "/page/%2e%2e/page.py",
        "/studio/../app.py", "/page//etc/passwd", "/studio/%2Fetc%2Fpasswd", "/page/three", "/docs",
        "/redoc", "/openapi.json",
        "/api/export/..%2F..%2Fetc%2Fpasswd", "/api/jobs/none", "/api/versions/A/facts",
    ],
)  # fmt: skip
def test_other_paths_are_not_found_in_one_line(client, path):
    reply = client.get(path)
    assert reply.status_code == 404 and "\n" not in reply.json()["error"]


def test_errors_are_one_line(client):
    for path, body, status in (
        ("/api/edit", {"kind": "swap"}, 422), ("/api/edit", {"revision": 1, "kind": "swap"}, 400),
        ("/api/edit", {"revision": 1, "kind": "dance"}, 422),
        ("/api/locks", {"revision": 1, "locks": [[3, 2]]}, 400),
        ("/api/locks", {"revision": 1, "locks": "all"}, 422), ("/api/undo", {"revision": 1}, 400),
        ("/api/undo", {"revision": 1, "more": 2}, 422),
        ("/api/settings", {"revision": 1, "changes": {"a": 1}}, 400),
        ("/api/settings", {"revision": 1, "changes": {}, "from": 3}, 400),
        ("/api/versions", {"slot": "C"}, 422), ("/api/rating", {"better": "A"}, 404),
        ("/api/export", {"format": "exe"}, 400), ("/api/choose", {"revision": 1, "id": "1-0"}, 404),
    ):  # fmt: skip
        reply = client.post(path, **body)
        assert reply.status_code == status, (path, body, reply.text)
        assert "\n" not in reply.json()["error"]
    for content in (b"", b"{", b"[1]", b"\xff\xfe", b"null", b'{"revision": NaN}'):
        assert client.http.post("/api/undo", content=content).status_code == 422


def test_an_old_revision_gets_the_newest_state(client):
    assert client.change("/api/edit", kind="swap", **{"from": 4, "to": 6})["state"] == "done"
    reply = client.post("/api/locks", revision=1, locks=[])
    assert reply.status_code == 409 and reply.json()["state"]["revision"] == 2
    assert client.get("/api/motion?revision=1").status_code == 409


@pytest.mark.parametrize("host", ["evil.com", f"evil.com:{PORT}", "127.0.0.1:1", "", f"0.0.0.0:{PORT}"])
def test_another_host_is_refused(client, host):
    for path in ("/", "/api/state", "/page/player.js"):
        reply = client.get(path, headers={"Host": host})
        assert reply.status_code == 403 and "dance" not in reply.text


@pytest.mark.parametrize(
    "headers",
    [{"Origin": "http://evil.com"}, {"Origin": "null"}, {"Sec-Fetch-Site": "cross-site"},
     {"Origin": f"http://127.0.0.1:{PORT + 1}"}, {"Sec-Fetch-Site": "same-site"}],
)  # fmt: skip
def test_a_page_of_another_site_changes_and_reads_nothing(client, headers):
    body = {"revision": 1, "changes": {"seed": 5}}
    assert client.http.post("/api/settings", json=body, headers=headers).status_code == 403
    assert client.get("/api/state", headers=headers).status_code == 403
    assert client.revision == 1


def test_the_own_page_may(client):
    headers = {"Origin": f"http://127.0.0.1:{PORT}", "Sec-Fetch-Site": "same-origin"}
    assert (
        client.http.post("/api/locks", json={"revision": 1, "locks": []}, headers=headers).status_code == 200
    )


def test_an_open_studio_needs_its_token(client):
    access = Access(PORT, "0.0.0.0", "secret")
    other = Client(client.service, access, f"http://192.168.1.5:{PORT}")
    for path in ("/", "/api/state", "/page/player.js", "/?token=wrong", "/?token="):
        assert other.get(path).status_code == 403
    reply = other.get("/?token=secret")
    assert reply.status_code == 200
    cookie = reply.headers["set-cookie"]
    assert cookie.startswith(f"{COOKIE}=secret") and "HttpOnly" in cookie and "SameSite=Strict" in cookie
    assert other.get("/api/state").status_code == 200  # with the cookie
    other.http.cookies.clear()
    assert other.get("/api/state").status_code == 403
    assert other.get("/api/state", headers={"Cookie": f"{COOKIE}=other"}).status_code == 403


def test_a_large_body_is_refused_before_it_is_read(client):
    for path, length in (("/api/undo", MOST_JSON_BYTES + 1), ("/api/song", 1 << 40), ("/api/edit", -1)):
        reply = client.http.post(path, content=b"1", headers={"Content-Length": str(length)})
        assert reply.status_code == 413, path


@pytest.mark.parametrize("length", ["9" * 5000, "²", "", "+1", "1_0"])
def test_a_length_that_is_none_is_refused(client, length):
    reply = client.http.post("/api/undo", content=b"1", headers={"Content-Length": length.encode("latin-1")})
    assert reply.status_code == 413


def test_a_request_that_reads_has_no_body(client):
    reply = client.http.request("GET", "/api/state", content=b"1")
    assert reply.status_code == 413 and client.http.request("GET", "/api/state").status_code == 200


def test_a_web_socket_is_refused(client):
    with pytest.raises(WebSocketDisconnect), client.http.websocket_connect("/api/events"):
        pass
    assert client.get("/api/state", headers={"Upgrade": "websocket"}).status_code == 403


def test_a_method_that_is_not_allowed_is_refused_with_those_that_are(client):
    reply = client.http.put("/api/undo", json={})
    assert reply.status_code == 405 and reply.headers["allow"] == "POST"


@pytest.mark.parametrize("cookie", ["[]", '{"a": 1}', "a", "=", "é=ü", "a=b=c", '"'])
def test_cookies_of_other_programs_do_not_matter(client, cookie):
    other = Client(client.service, Access(PORT, "0.0.0.0", "secret"), f"http://192.168.1.5:{PORT}")
    for cookies in (f"{cookie}; {COOKIE}=secret", f"{COOKIE}=secret;{cookie}"):
        assert other.get("/api/state", headers={"Cookie": cookies.encode()}).status_code == 200
    assert other.get("/api/state", headers={"Cookie": cookie.encode()}).status_code == 403


def test_a_token_that_is_not_needed_is_not_kept(client):
    for token in ("%0d%0aSet-Cookie:%20a", "%00", "x"):
        reply = client.get(f"/?token={token}")
        assert reply.status_code == 200 and "set-cookie" not in reply.headers


def test_a_body_without_a_length_is_refused(client):
    for path in ("/api/undo", "/api/song"):
        reply = client.http.post(path, content=iter([b"x" * 100]), headers={"X-Filename": "a.wav"})
        assert reply.status_code == 413 and "length" in reply.json()["error"]


def test_the_api_is_described(client):
    described = client.get("/api/openapi.json").json()
    assert {"/api/state", "/api/edit", "/api/song", "/api/export"} <= set(described["paths"])
    for path, methods in described["paths"].items():
        for one in methods.values():
            assert one["description"] or one["summary"], path


# Who may use the studio: this machine and its own page, others only with the token.


LOCAL, OPEN = Access(8000), Access(8000, "0.0.0.0", "secret")


@pytest.mark.parametrize(
    "host",
    ["127.0.0.1:8000", "127.0.0.2:8000", "127.255.255.254:8000", "localhost:8000", "[::1]:8000",
     "[0:0:0:0:0:0:0:1]:8000", "LOCALHOST:8000"],
)  # fmt: skip
def test_names_of_this_machine_are_taken(host):
    LOCAL.check_host(host)


@pytest.mark.parametrize(
    "host",
    [
        "", "evil.com", "evil.com:8000", "127.0.0.1", "127.0.0.1:80", "127.0.0.1:8001",
        "127.0.0.1.evil.com:8000", "localhost.evil.com:8000", "evil.com#127.0.0.1:8000",
        "192.168.1.5:8000", "0.0.0.0:8000",
        "127.0.0.1:8000:1", "user@127.0.0.1:8000", "127.0.0.1:08000", "[", "]", "[]", "[:8000", "[::1",
        "\xff:8000", "::8000", "127.0.0.1:", "127.0.0.1:²", ":8000", "127.0.0.1:" + "9" * 5000,
    ],
)  # fmt: skip
def test_other_hosts_are_refused(host):
    with pytest.raises(ForbiddenError):
        LOCAL.check_host(host)


def test_an_open_studio_takes_addresses_but_no_other_names():
    OPEN.check_host("192.168.1.5:8000")
    with pytest.raises(ForbiddenError):
        OPEN.check_host("evil.com:8000")


@pytest.mark.parametrize(
    "host", ["127.0.0.1", "127.0.0.2", "::1", "localhost", "0.0.0.0", "::", "192.168.1.5", "Studio.local"]
)
def test_the_address_that_is_printed_is_served(host):
    access = Access.of(host, 8000)
    shown = urlsplit(access.address).netloc
    access.check_host(shown)
    access.check_host(shown.lower())  # as browsers send it


@pytest.mark.parametrize("origin", ["http://127.0.0.1:8000", None])
def test_the_own_page_and_programs_are_taken(origin):
    LOCAL.check_origin(origin, "127.0.0.1:8000")


@pytest.mark.parametrize(
    "origin",
    ["null", "", "http://evil.com", "http://127.0.0.1:8001", "https://127.0.0.1:8000", "http://localhost:8000",
     "http://127.0.0.1:8000.evil.com", "file://", "http://[", "http://]", "[", "\xff", "http://127.0.0.1:8000/"],
)  # fmt: skip
def test_pages_of_other_sites_are_refused(origin):
    with pytest.raises(ForbiddenError):
        LOCAL.check_origin(origin, "127.0.0.1:8000")


@pytest.mark.parametrize("host", ["127.0.0.1", "127.0.0.5", "::1", "localhost"])
def test_this_machine_alone_needs_no_token(host):
    assert is_loopback(host) and Access.of(host, 1).token == ""


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.168.1.5", "example.org"])
def test_other_addresses_have_a_random_token(host):
    one, other = Access.of(host, 1), Access.of(host, 1)
    assert len(one.token) >= 32 and one.token != other.token
    assert one.address.endswith(f"?token={one.token}")


def test_the_token_is_checked():
    LOCAL.check_token(None)
    OPEN.check_token("secret")
    for token in (None, "", "Secret", "secret ", "sécret"):
        with pytest.raises(ForbiddenError):
            OPEN.check_token(token)


# Requests that never end: their connections are closed, and what was sent of them is removed.


LIMIT_S = 0.3


@pytest.fixture(scope="module")
def live(repertoire, tmp_path_factory):
    """A served studio without a song, in an empty folder, which waits only for a moment."""
    patch = pytest.MonkeyPatch()
    patch.chdir(tmp_path_factory.mktemp("live"))
    patch.setattr(server_module, "HEAD_S", LIMIT_S)
    patch.setattr(server_module, "BODY_S", LIMIT_S)
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
    assert not list(service.scratch.glob("sent-*")) and os.listdir(service.studio.folder) == []


def test_a_slow_body_is_waited_for(live, monkeypatch):
    port = live[1]
    monkeypatch.setattr(server_module, "SLOWEST_BYTES_PER_S", 10)
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
        assert os.listdir(service.studio.folder) == []
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


# The command: a real server, which is killed while it saves, and what it says if something is missing.


def ask(address, path, body=None):
    data = None if body is None else json.dumps(body).encode()
    with urlopen(Request(address + path, data, {"Content-Type": "application/json"})) as reply:
        return json.loads(reply.read())


def started(song, repertoire, *options):
    command = [sys.executable, "-m", "choreograph", "studio", str(song), "--no-browser", "--db"]
    process = subprocess.Popen([*command, str(repertoire.path), *options], stdout=subprocess.PIPE, text=True)
    return process, process.stdout.readline().split()[-1].rstrip("/")


@pytest.mark.slow
def test_a_server_that_is_killed_while_it_saves_loses_no_saved_change(folder, repertoire):
    song, path = folder / "clicks.wav", folder / "clicks.studio.json"
    revision = 0
    for wait_s in (0.0, 0.02, 0.1):
        process, address = started(song, repertoire)
        while ask(address, "/api/state")["dance"] is None:
            time.sleep(0.05)
        state = ask(address, "/api/state")
        assert state["revision"] >= max(revision, 1)
        seen = [state["revision"]]
        thread = threading.Thread(target=_change_until_killed, args=(address, seen))
        thread.start()
        while seen[-1] < state["revision"] + 5:
            time.sleep(0.005)
        time.sleep(wait_s)
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
        thread.join()
        revision = seen[-1]  # what the page has seen as saved
        assert project_from_json(path.read_text(), "p").revision >= revision
    left = [name for name in os.listdir(folder) if name.startswith(".") and not name.endswith(".lock")]
    assert len(left) <= 1  # a temporary file of the last kill, which the next save removes
    file = ProjectFile(path)
    file.write(file.read())
    file.close()
    assert [name for name in os.listdir(folder) if name.startswith(".")] == []


def _change_until_killed(address, seen):
    """Lock and unlock a part until the server is gone, and note each revision that it has confirmed."""
    locks = [[[1.0, 2.0]], [[1.0, 3.0]]]
    try:
        while True:
            body = {"revision": seen[-1], "locks": locks[seen[-1] % 2]}
            seen.append(ask(address, "/api/locks", body)["revision"])
    except (OSError, ValueError, HTTPException):
        return


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_the_command_serves_news_and_ends_when_stopped(number, folder, repertoire, tmp_path, monkeypatch):
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    monkeypatch.setenv("TMPDIR", str(scratch))
    process, address = started(folder / "clicks.wav", repertoire, "--port", "0")
    stream = urlopen(address + "/api/events")
    assert stream.headers["content-type"].startswith("text/event-stream")
    while ask(address, "/api/state")["dance"] is None:
        time.sleep(0.05)
    ask(address, "/api/locks", {"revision": 1, "locks": [[1.0, 2.0]]})
    news: list[dict] = []
    while not any(one.get("state") == 2 for one in news):
        line = stream.readline().decode()
        news += [json.loads(line.removeprefix("data: "))] if line.startswith("data: ") else []
    assert any("job" in one for one in news)
    second = subprocess.run(
        [sys.executable, "-m", "choreograph", "studio", str(folder / "clicks.wav"), "--no-browser"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert second.returncode == 2 and "works on clicks.studio.json" in second.stderr
    assert list(scratch.glob("choreograph-studio-*"))
    process.send_signal(number)
    assert process.wait(timeout=20) in (0, 128 + number, -signal.SIGINT)
    assert not list(folder.glob(".*lock")) and not list(scratch.glob("choreograph-studio-*"))


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["missing.mp3"], "missing.mp3"), (["--project", "missing.json"], "missing.json"),
        (["--port", "99999"], "99999"), (["a.wav", "--project", "other/b.json"], "beside its song"),
        (["--character", "missing.glb"], "missing.glb"), (["--db", "missing.h5"], "missing.h5"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_in_one_line(arguments, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.wav").write_bytes(b"x")
    result = run("studio", "--no-browser", *arguments)
    assert result.exit_code == 2 and said in result.output
    assert len(result.output.strip().splitlines()[-1]) < 300


def test_without_the_extra_the_cure_is_said_in_one_line(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    for name in [name for name in sys.modules if name.startswith("choreograph.studio.server")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "uvicorn", None)
    result = run("studio", "--no-browser")
    assert result.exit_code == 2 and "choreograph[studio]" in result.output
    assert len(result.output.strip().splitlines()) == 1


def test_a_port_in_use_is_said_in_one_line(tmp_path, monkeypatch):
    import socket

    monkeypatch.chdir(tmp_path)
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        result = run("studio", "--no-browser", "--port", str(taken.getsockname()[1]))
    assert result.exit_code == 2 and "--port" in result.output
    assert Path("clicks.studio.json").exists() is False


def test_a_studio_without_a_song_works_in_the_working_folder(repertoire, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    service = start(None, repertoire)
    service.close()
    assert service.studio.folder == tmp_path and service.state()["song"] is None
    assert list(tmp_path.iterdir()) == []


def test_a_project_opens_its_song(open_studio, folder):
    open_studio(folder / "clicks.wav").ready().service.close()
    again = open_studio(None, project=folder / "clicks.studio.json").ready()
    assert again.service.studio.folder == folder
    assert again.state()["project"] == {"name": "clicks.wav", "file": "clicks.studio.json"}
    assert again.revision == 1  # the dance was not made a second time


def test_links_to_a_project_and_to_a_song_stay_links(open_studio, folder, tmp_path_factory):
    elsewhere = tmp_path_factory.mktemp("links")
    song, project = elsewhere / "linked.wav", elsewhere / "mine.studio.json"
    song.symlink_to(folder / "clicks.wav")
    project.symlink_to(folder / "clicks.studio.json")
    first = open_studio(folder / "clicks.wav").ready()
    with pytest.raises(ChoreographError, match="works on clicks"):
        open_studio(None, project=project)
    first.service.close()
    again = open_studio(None, project=project).ready()  # the song is beside the file that the link leads to
    assert again.post("/api/locks", revision=1, locks=[[1.0, 2.0]]).status_code == 200
    again.service.close()
    assert project.is_symlink() and project_from_json(project.read_text(), "p").revision == 2
    open_studio(song).ready()  # a link is a song with a project of its own
    assert song.is_symlink()
    names = {name for name in os.listdir(elsewhere) if not name.endswith(".lock")}
    assert names == {"linked.wav", "linked.studio.json", "mine.studio.json"}


def test_a_studio_that_cannot_start_leaves_nothing(repertoire, folder, tmp_path_factory, monkeypatch):
    scratch = tmp_path_factory.mktemp("scratch")
    monkeypatch.setattr("tempfile.tempdir", str(scratch))
    (folder / "clicks.studio.json").write_text("{")
    with pytest.raises(FormatError) as refused:  # which would keep the studio alive
        start(folder / "clicks.wav", repertoire)
    assert list(scratch.iterdir()) == [] and refused.value


@pytest.mark.parametrize(
    "content",
    [b"", b"{", b"[]", b"\xff\xfe", b'{"song": "clicks.wav"}', b'{"song": "../clicks.wav", "steps": []}'],
)
def test_a_damaged_project_is_refused_and_released(repertoire, folder, content):
    path = folder / "clicks.studio.json"
    path.write_bytes(content)
    for _ in range(2):  # the second time would find a lock that was left
        with pytest.raises((FormatError, ParameterError), match=r"clicks\.studio\.json") as refused:
            start(None, repertoire, project=path)
        assert "\n" not in str(refused.value)
    assert path.read_bytes() == content


def test_a_project_of_a_song_elsewhere_is_refused(open_studio, repertoire, folder):
    open_studio(folder / "clicks.wav").ready().service.close()
    path = folder / "clicks.studio.json"
    data = json.loads(path.read_text())
    for song in ("../clicks.wav", "/etc/passwd", ""):
        path.write_text(json.dumps(data | {"song": song}))
        with pytest.raises((FormatError, ParameterError)):
            start(None, repertoire, project=path)


def test_a_port_is_free_or_its_user_is_told():
    with _listening("127.0.0.1", 0) as taken:
        port = taken.getsockname()[1]
        assert port > 0
        with pytest.raises(ChoreographError, match=f"expected port {port} of 127.0.0.1 to be free"):
            _listening("127.0.0.1", port)
    for host, other, said in (
        ("no.such.invalid", 0, "host"), ("a" * 300, 0, "host"), ("127.0.0.1", 70_000, "0 to 65535"),
    ):  # fmt: skip
        with pytest.raises(ParameterError, match=said):
            _listening(host, other)


def test_a_studio_that_cannot_be_served_is_closed(repertoire, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    service, addresses = start(None, repertoire), []
    with pytest.raises(ParameterError):
        serve(service, "127.0.0.1", 70_000, opened=False, ready=addresses.append)
    assert addresses == [] and not service.scratch.exists()
