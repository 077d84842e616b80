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
