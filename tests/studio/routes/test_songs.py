"""The addresses of the song: what they say without one, and a song that is opened without a dance."""

from __future__ import annotations

import pytest


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
