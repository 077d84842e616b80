"""Builds in a process of their own: their log, their failures, and their end when they are cancelled."""

from __future__ import annotations

import sys
import time

import pytest
from synthetic_motions import stepping

from choreograph.core.errors import ChoreographError
from choreograph.formats.register import save_motion
from choreograph.studio import builds
from choreograph.studio.jobs import Jobs


@pytest.fixture
def jobs():
    made = Jobs()
    yield made
    made.close()


def test_takes_are_checked_with_a_row_for_each(client):
    assert client.post("/api/build/check").status_code == 404
    folder = client.service.scratch
    save_motion(folder / "walk.bvh", stepping(6 * 30, seed=1))
    for content, name in (((folder / "walk.bvh").read_bytes(), "walk.bvh"), (b"no take", "bad.bvh")):
        assert client.send("/api/build", content, name).status_code == 200
    assert client.send("/api/build", b"x", "bad.exe").status_code == 415
    assert [file["name"] for file in client.get("/api/build").json()["files"]] == ["bad.bvh", "walk.bvh"]
    job = client.wait(client.post("/api/build/check"))
    log = "\n".join(job["log"])
    assert "walk.bvh" in log and "bad.bvh" in log and str(folder) not in log
    for name in ("../mine", "a/b", ""):
        assert client.post("/api/build/start", name=name).status_code in (400, 415)
    assert client.http.delete("/api/build").json() == {"files": []}


def fake(monkeypatch, code):
    monkeypatch.setattr(builds.subprocess, "Popen", _with(builds.subprocess.Popen, code))


def _with(start, code):
    return lambda command, **options: start([sys.executable, "-u", "-c", code], **options)


def test_a_failed_build_says_its_last_line(jobs, tmp_path, monkeypatch):
    fake(monkeypatch, "print('reading'); print('choreograph: expected takes, got none'); raise SystemExit(2)")
    with pytest.raises(ChoreographError, match=r"^expected takes, got none$"):
        jobs.do("build", lambda job: builds.build(tmp_path / "takes", tmp_path / "a.h5", "tiny", job))


def test_a_cancelled_build_ends_its_process(jobs, tmp_path, monkeypatch):
    code = "import time, os; print(os.getpid())\nwhile True: time.sleep(0.05); print('training')"
    fake(monkeypatch, code)
    job = jobs.start("build", lambda job: builds.build(tmp_path / "takes", tmp_path / "a.h5", "tiny", job))
    while len(job.log) < 2:
        time.sleep(0.01)
    jobs.cancel(job.id)
    while job.state == "running":
        time.sleep(0.01)
    assert job.state == "cancelled"
    from choreograph.core.files import is_running

    assert not is_running(int(job.log[0]))
