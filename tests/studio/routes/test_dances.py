"""The addresses of the dance and of jobs: revisions, half a span, and jobs that are waited for."""

from __future__ import annotations

import threading


def test_the_motion_is_of_the_newest_revision(client):
    shown = client.get("/api/motion?revision=1").json()
    assert shown["revision"] == 1 and shown == client.get("/api/motion").json()
    assert client.get("/api/motion?revision=2").status_code == 409
    assert client.get("/api/motion?revision=-1").status_code == 422


def test_locks_of_an_old_revision_change_nothing(client):
    assert client.post("/api/locks", revision=1, locks=[[1.0, 2.0]]).json()["locks"] == [[1.0, 2.0]]
    assert client.post("/api/locks", revision=1, locks=[]).status_code == 409
    assert client.state()["locks"] == [[1.0, 2.0]]
    assert client.post("/api/redo", revision=client.revision).status_code == 400


def test_half_a_span_of_settings_is_refused(client):
    for half in ({"from": 1.0}, {"to": 2.0}):
        reply = client.post("/api/settings", revision=1, changes={"seed": 2}, **half)
        assert reply.status_code == 400 and "both from and to" in reply.json()["error"]
    assert client.revision == 1


def test_a_job_is_waited_for_and_cancelled(client):
    go_on = threading.Event()

    def work(job):
        go_on.wait(10)
        job.report("working", 0, 1)

    job = client.service.jobs.start("work", work)
    assert client.get(f"/api/jobs/{job.id}?wait=0.01").json()["state"] == "running"
    assert client.http.delete(f"/api/jobs/{job.id}").status_code == 200
    go_on.set()
    assert client.get(f"/api/jobs/{job.id}?wait=1").json()["state"] == "cancelled"
    for wait in ("2", "-1", "nan", "x"):
        assert client.get(f"/api/jobs/{job.id}?wait={wait}").status_code == 422
    assert client.http.delete("/api/jobs/none").status_code == 404


def test_what_is_danced_from_the_playhead_on_comes_first(client):
    reply = client.post("/api/settings", revision=1, changes={"seed": 2}, at=3.0)
    job = client.get(f"/api/jobs/{reply.json()['job']}?wait=1&first=true").json()
    while job["state"] == "running" and "first" not in job:
        job = client.get(f"/api/jobs/{job['job']}?wait=1&first=true").json()
    first = job["first"]
    assert first["revision"] == 2 and first["from_s"] == 3.0 and first["facts"]["fps"] == 60
    assert first["facts"]["frames"] == 300 and first["motion"]
    ended = client.wait(reply)
    assert ended["state"] == "done" and ended["result"] == {"revision": 2} and "first" not in ended
    assert "first" not in client.get(f"/api/jobs/{job['job']}?wait=1").json()


def test_nothing_comes_first_where_parts_are_kept_or_the_dance_has_ended(client):
    for more in ({"at": 1e4}, {"at": 1.0, "from": 4.0, "to": 6.0}):
        reply = client.post("/api/settings", revision=client.revision, changes={"seed": 3}, **more)
        assert client.wait(reply)["state"] == "done"
        job = client.get(f"/api/jobs/{reply.json()['job']}?wait=1&first=true").json()
        assert job["state"] == "done" and "first" not in job
    assert client.post("/api/settings", revision=3, changes={}, at=-1.0).status_code == 422
