"""Requests to the studio: its page, errors in one line, and what is refused before any work."""

from __future__ import annotations

import pytest
from starlette.websockets import WebSocketDisconnect
from studio_client import PORT, Client

from choreograph.studio.safety import COOKIE, HEADERS, MOST_JSON_BYTES, Access


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
