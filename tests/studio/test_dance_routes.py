"""The addresses of the dance and of jobs: revisions, half a span, and jobs that are waited for."""

from __future__ import annotations

import threading
from types import SimpleNamespace

import numpy as np
import pytest

from choreograph.choreography.constraints import MotifPin, TakePin, parse_ban
from choreograph.choreography.edits import Hold, Repeat, Swap, Vary
from choreograph.core.errors import ParameterError
from choreograph.studio.dance_routes import EditBody, _named, edit_request
from choreograph.studio.project import Settings

# The addresses of the dance and of jobs: revisions, half a span, and jobs that are waited for.


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


# Edits of bodies: each kind is the edit that it names, and says which value it lacks.


SONG = SimpleNamespace(sections=SimpleNamespace(bounds_s=np.array([0.0, 8.0, 12.0])))
SPAN = {"from": 2.0, "to": 4.0}


def edit(kind, features=None, **values):
    return edit_request(EditBody.model_validate({"revision": 1, "kind": kind, **values}), features)


@pytest.mark.parametrize(
    ("kind", "values", "expected"),
    [
        ("swap", SPAN, Swap(2.0, 4.0)), ("vary", SPAN, Vary(2.0, 4.0)), ("hold", SPAN, Hold(2.0, 4.0)),
        ("repeat", SPAN | {"at": 6.0, "mirrored": True}, Repeat(2.0, 4.0, 6.0, True)),
        ("pin_take", SPAN | {"take": "a"}, TakePin(2.0, 4.0, "a")),
        ("pin_motif", {"from": 2.0, "motif": 3}, MotifPin(2.0, 3)),
        ("pin_motif", {"from": 2.0, "at": 5.0, "motif": 3}, MotifPin(5.0, 3)),
        ("ban", {"ban": "genre:tango"}, parse_ban("genre:tango")),
        ("ban", {"take": "a"}, parse_ban("take:a")),
        ("ban", {"motif": 0}, parse_ban("motif:0")),
    ],
)  # fmt: skip
def test_a_kind_is_the_edit_that_it_names(kind, values, expected):
    assert edit(kind, **values) == expected


@pytest.mark.parametrize(
    ("kind", "values", "lacking"),
    [
        ("swap", {"from": 2.0}, "to"), ("vary", {"to": 2.0}, "from"), ("repeat", SPAN, "at"),
        ("pin_take", SPAN, "take"), ("pin_motif", {"motif": 1}, "at"), ("pin_motif", {"at": 1.0}, "motif"),
        ("cut", SPAN, "section"),
    ],
)  # fmt: skip
def test_a_value_that_is_lacking_is_named(kind, values, lacking):
    with pytest.raises(ParameterError, match=f"expected {lacking} beside the kind {kind}"):
        edit(kind, **values)


def test_a_part_is_cut_to_a_section_and_not_beyond_it():
    assert edit("cut", SONG, section=0, **SPAN) == Repeat(0.0, 2.0, 2.0)
    assert edit("cut", SONG, section=1, **{"from": 0.0, "to": 7.0}) == Repeat(8.0, 12.0, 0.0)


@pytest.mark.parametrize(("features", "section", "from_s"), [(None, 0, 2.0), (SONG, 2, 2.0), (SONG, 1, 8.05)])
def test_a_section_that_is_none_or_the_same_is_refused(features, section, from_s):
    with pytest.raises(ParameterError, match="section"):
        edit("cut", features, section=section, **{"from": from_s, "to": 10.0})


# Versions and ratings: what is missing is said, and a version has its settings in its name.


@pytest.mark.parametrize(
    ("changes", "n_edits", "expected"),
    [
        ({}, 0, "graph, seed 0"),
        ({"seed": 3, "genre": "tango"}, 2, "graph, seed 3, tango, 2 edits"),
        ({"weights": {"pace": 2.0}}, 0, "graph, seed 0, pace=2"),
        ({"dancers": 2, "relation": ["mirror"]}, 0, "graph, seed 0, 2 dancers, v mirror"),
    ],
)
def test_a_version_is_named_by_its_settings(changes, n_edits, expected):
    step = SimpleNamespace(settings=Settings().changed(changes), edits=[None] * n_edits)
    assert _named(step) == expected


def test_versions_that_are_missing_are_not_rated(client, folder):
    assert client.post("/api/rating", better="A").status_code == 404
    client.post("/api/versions", slot="A")
    reply = client.post("/api/rating", better="same")
    assert reply.status_code == 404 and "keep both" in reply.json()["error"]
    assert client.get("/api/versions/B/motion").status_code == 404
    assert client.get("/api/versions/C/facts").status_code == 422
    assert not list(folder.glob("*.study"))


# The addresses of explanations and of the palette: limits of what they take.


@pytest.mark.parametrize(
    "path",
    [
        "/api/explain", "/api/explain?at=nan", "/api/explain?at=inf", "/api/explain?at=x",
        "/api/palette?limit=0", "/api/palette?limit=201", "/api/palette?offset=-1",
        f"/api/palette?text={'x' * 201}",
        "/api/palette/motion?take=a&from=0", "/api/palette/motion?take=a&from=nan&to=1",
    ],
)  # fmt: skip
def test_values_beyond_their_limits_are_refused_in_one_line(client, path):
    reply = client.get(path)
    assert reply.status_code == 422 and "\n" not in reply.json()["error"]


def test_a_page_of_the_palette_has_as_many_parts_as_asked(client):
    found = client.get("/api/palette?limit=2&offset=1").json()
    everything = client.get("/api/palette?limit=200").json()
    assert found["takes"] == everything["takes"][1:3] and found["total"] == everything["total"] > 2
