"""Bodies and uploads: unknown fields are refused, and what was not received whole leaves nothing."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace

import pytest
from pydantic import ValidationError

from choreograph.core.errors import FormatError, ParameterError
from choreograph.studio.dance_routes import AlternativesBody, EditBody, LocksBody, SeamBody
from choreograph.studio.file_routes import received, uploaded
from choreograph.studio.refusals import TooLargeError, UnknownTypeError

# Bodies and uploads: unknown fields are refused, and what was not received whole leaves nothing.


def sent(folder, name, *chunks, most_bytes=10):
    async def stream():
        for chunk in chunks:
            if isinstance(chunk, Exception):
                raise chunk
            yield chunk

    request = SimpleNamespace(headers={"x-filename": name}, stream=stream)
    return asyncio.run(uploaded(request, folder, (".wav",), most_bytes))


@pytest.mark.parametrize(
    ("body", "data"),
    [
        (EditBody, {"kind": "dance"}), (EditBody, {"kind": "swap", "more": 1}),
        (EditBody, {"kind": "swap", "from": -1}),
        (EditBody, {"kind": "swap", "from": float("nan")}), (EditBody, {"kind": "swap", "take": "x" * 301}),
        (LocksBody, {"locks": [[1.0, 2.0]] * 501}), (LocksBody, {"locks": [[1.0]]}),
        (LocksBody, {"locks": [], "revision": -1}), (SeamBody, {"at": 1.0, "counts": 257}),
        (AlternativesBody, {"from": 1.0, "to": 2.0, "n": 25}), (AlternativesBody, {"from": 1.0}),
    ],
)  # fmt: skip
def test_a_field_that_is_not_valid_is_refused(body, data):
    with pytest.raises(ValidationError):
        body.model_validate({"revision": 1} | data)


def test_the_edges_of_fields_are_valid():
    assert EditBody.model_validate({"revision": 0, "kind": "swap", "from": 0, "to": 86_400}).to_s == 86_400
    assert SeamBody.model_validate({"revision": 1, "at": 1, "counts": -256}).counts == -256


def test_a_file_is_received_whole_under_its_name(tmp_path):
    path = sent(tmp_path, "a%20b.wav", b"01234", b"56789")
    assert path.name == "a b.wav" and path.read_bytes() == b"0123456789"
    with received(path):
        assert path.is_file()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "chunks", "error"),
    [
        ("a.wav", (b"0" * 10, b"1"), TooLargeError), ("a.exe", (b"0",), UnknownTypeError),
        ("..%2Fa.wav", (b"0",), ParameterError), ("", (b"0",), ParameterError),
        ("a.wav", (b"0", RuntimeError("gone")), RuntimeError),
    ],
)  # fmt: skip
def test_what_is_refused_leaves_nothing(tmp_path, name, chunks, error):
    with pytest.raises(error):
        sent(tmp_path, name, *chunks)
    assert list(tmp_path.iterdir()) == []


def test_errors_name_a_file_without_its_folder(tmp_path):
    path = sent(tmp_path, "a.wav", b"0")
    with pytest.raises(FormatError, match=r"^a\.wav: expected a song$"), received(path):
        raise FormatError(f"{path}: expected a song")
    assert list(tmp_path.iterdir()) == []


# The addresses of files: what is missing is said, and the latest exports are kept.


def test_without_a_character_there_is_none_to_dance(client):
    assert client.get("/api/character/glb").status_code == 404
    assert client.http.put("/api/character/bones", json={"bones": {}}).status_code == 404


@pytest.mark.parametrize("half", [{"from": 1.0}, {"to": 2.0}])
def test_half_a_span_is_refused(client, half):
    reply = client.post("/api/export", format="bvh", **half)
    assert reply.status_code == 400 and "both from and to" in reply.json()["error"]


def test_the_latest_exports_are_kept(client):
    part = {"format": "npz", "from": 1.0, "to": 2.0}
    ids = [client.wait(client.post("/api/export", **part))["result"]["id"] for _ in range(9)]
    assert [client.get(f"/api/export/{id}").status_code for id in ids] == [404, *[200] * 8]
    assert not (client.service.scratch / ids[0]).exists()


def test_takes_beyond_the_size_of_a_build_are_refused(client):
    assert client.post("/api/build/start", name="mine").status_code == 404
    assert client.send("/api/build", b"12", "a.bvh").status_code == 200
    most = 1 << 32
    with open(client.service.scratch / "takes" / "a.bvh", "r+b") as file:
        file.truncate(most + 1)  # a hole, which takes no room on disk
    assert client.send("/api/build", b"1", "b.bvh").status_code == 413
    assert client.get("/api/build").json() == {"files": [{"name": "a.bvh", "bytes": most + 1}]}


# The addresses of the song: what they say without one, and a song that is opened without a dance.


@pytest.fixture
def empty(open_studio, tmp_path_factory, monkeypatch):
    """A studio without a song."""
    monkeypatch.chdir(tmp_path_factory.mktemp("empty"))
    return open_studio(None)


def test_without_a_song_nothing_is_heard_or_drawn(empty):
    for path in ("/api/song/audio", "/api/song/waveform"):
        assert empty.get(path).status_code == 404


def test_a_song_is_opened_without_a_dance(empty, folder):
    content = (folder / "clicks.wav").read_bytes()
    job = empty.wait(
        empty.http.post("/api/song?dance=false", content=content, headers={"X-Filename": "clicks.wav"})
    )
    state = empty.state()
    assert job["state"] == "done" and state["dance"] is None
    assert state["song"]["name"] == "clicks" and state["song"]["duration_s"] == pytest.approx(12.4, abs=0.1)
    assert len(empty.get("/api/song/waveform?points=7").json()["peaks"]) == 7
    for points in ("0", "20001", "x"):
        assert empty.get(f"/api/song/waveform?points={points}").status_code == 422


def test_a_song_of_the_same_name_and_another_suffix_has_a_project_of_its_own(client, folder):
    content = (folder / "clicks.wav").read_bytes()
    for _ in range(2):
        job = client.wait(
            client.http.post("/api/song?dance=false", content=content, headers={"X-Filename": "clicks.WAV"})
        )
        assert job["state"] == "done", job
        assert client.state()["project"] == {"name": "clicks-new.WAV", "file": "clicks-new.studio.json"}
    names = {path.name for path in folder.iterdir() if path.suffix != ".lock"}
    assert names == {"clicks.wav", "clicks.studio.json", "clicks-new.WAV"}


def test_errors_of_jobs_name_files_without_their_folder(client, folder):
    (folder / "mine.h5").write_bytes(b"1")
    job = client.change("/api/settings", changes={"repertoire": "mine.h5"})
    assert job["state"] == "failed" and "mine.h5" in job["error"] and str(folder) not in job["error"]
