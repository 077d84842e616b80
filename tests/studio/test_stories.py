"""Whole stories through the API: what a person does, reloaded and reopened in between."""

from __future__ import annotations

import io
import json

import numpy as np
import pytest
from synthetic_characters import CHARACTERS, write_character

import choreograph as cg


def motion_of(client):
    job = client.wait(client.post("/api/export", format="npz"))
    with np.load(io.BytesIO(client.get(f"/api/export/{job['result']['id']}").content)) as arrays:
        return arrays["root_pos_m"].tobytes() + arrays["local_quat"].tobytes()


def test_a_song_is_dropped_changed_closed_and_opened_to_the_same_bytes(open_studio, folder, tmp_path_factory):
    here = tmp_path_factory.mktemp("empty")
    content = (folder / "clicks.wav").read_bytes()
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(here)
        client = open_studio(None)
    assert client.state()["song"] is None and client.get("/api/motion").status_code == 404
    assert client.wait(client.send("/api/song", content, "clicks.wav"))["state"] == "done"
    for start_s in (2, 5, 8):
        job = client.change("/api/edit", kind="swap", **{"from": start_s, "to": start_s + 2})
        assert job["state"] == "done", job
    assert (
        client.change("/api/settings", changes={"weights": {"pace": 2.0}, "dynamics": 0.5})["state"] == "done"
    )
    client.post("/api/undo", revision=client.revision)
    state, motion = client.state(), motion_of(client)
    assert len(state["dance"]["edits"]) == 3 and state["can_redo"] and state["changed"]
    client.service.close()
    again = open_studio(here / "clicks.wav").ready()
    assert motion_of(again) == motion
    assert {**again.state(), "changed": [], "notes": []} == {**state, "changed": [], "notes": []}
    assert {path.name for path in here.iterdir()} >= {"clicks.wav", "clicks.studio.json"}


def test_the_same_song_dropped_again_opens_its_project(client, folder):
    client.change("/api/edit", kind="vary", **{"from": 4, "to": 6})
    content = (folder / "clicks.wav").read_bytes()
    assert client.wait(client.send("/api/song", content, "clicks.wav"))["state"] == "done"
    assert client.revision == 2 and client.state()["can_undo"]
    other = client.wait(client.send("/api/song", content + b"\0\0", "clicks.wav"))
    assert other["state"] == "done" and client.state()["project"]["name"] == "clicks-new.wav"


def test_a_file_that_is_no_song_changes_nothing(client, folder):
    before = sorted(path.name for path in folder.iterdir())
    job = client.wait(client.send("/api/song", b"no song", "bad.wav"))
    assert job["state"] == "failed" and "bad.wav" in job["error"] and str(folder) not in job["error"]
    assert client.send("/api/song", b"x", "bad.exe").status_code == 415
    assert client.send("/api/song", b"x", "../bad.wav").status_code == 400
    assert client.state()["dance"] and sorted(path.name for path in folder.iterdir()) == before


def test_alternatives_are_shown_and_one_is_chosen(client):
    job = client.change("/api/alternatives", **{"from": 4, "to": 6}, n=2)
    assert job["state"] == "done" and all(one["why"] for one in job["result"])
    for one in job["result"][:1]:
        assert client.post("/api/choose", revision=1, id=one["id"]).json()["dance"]["edits"]


def test_all_kinds_of_edits(client):
    take = client.state()["dance"]["takes"][0]["name"]
    for body in (
        {"kind": "vary", "from": 2, "to": 4},
        {"kind": "repeat", "from": 2, "to": 4, "at": 6, "mirrored": True},
        {"kind": "pin_take", "from": 8, "to": 10, "take": take}, {"kind": "ban", "take": take},
    ):  # fmt: skip
        job = client.change("/api/edit", **body)
        assert job["state"] == "done", (body, job)
    assert client.state()["settings"]["bans"] == [f"take:{take}"]


def test_two_pages_do_not_corrupt_a_project(client):
    replies = [client.post("/api/edit", revision=1, kind="swap", **{"from": 4, "to": 6}) for _ in range(2)]
    jobs = [client.wait(reply) for reply in replies if reply.status_code == 202]
    assert sorted(job["state"] for job in jobs) in (["done"], ["done", "failed"])
    assert all(job["status"] == 409 for job in jobs if job["state"] == "failed")
    assert client.revision == 2 and len(client.state()["dance"]["edits"]) == 1


def test_versions_are_compared_and_rated(client, folder):
    client.post("/api/versions", slot="A")
    client.change("/api/settings", changes={"seed": 1})
    assert client.post("/api/versions", slot="B").json()["versions"] == {"A": 1, "B": 2}
    for slot in "AB":
        assert client.get(f"/api/versions/{slot}/facts").json()["blocks"]
        assert client.get(f"/api/versions/{slot}/motion").json()["motion"]
    for better in ("A", "same", "A"):
        assert client.post("/api/rating", better=better).status_code == 200
    from research.study.results import read_study

    [preference] = read_study(folder / "clicks.studio.study").preferences
    assert preference.n_answers == 2 and preference.share in (0.0, 1.0)


def test_a_character_dances_is_mapped_written_and_remembered(client, open_studio, folder, tmp_path_factory):
    path = tmp_path_factory.mktemp("characters") / "hero.glb"
    write_character(path, CHARACTERS["mixamo"])
    reply = client.send("/api/character", path.read_bytes(), "hero.glb")
    assert reply.status_code == 200 and reply.json()["character"]["bones"]["head"]
    bones = reply.json()["character"]["bones"]
    assert client.http.put("/api/character/bones", json={"bones": bones}).status_code == 200
    assert client.http.put("/api/character/bones", json={"bones": {"head": "none"}}).status_code == 400
    assert client.get("/api/character/glb").content[:4] == b"glTF"
    job = client.wait(client.post("/api/export", format="glb", character=True, **{"from": 2, "to": 4}))
    exported = client.get(f"/api/export/{job['result']['id']}")
    assert exported.headers["content-disposition"] == 'attachment; filename="clicks.glb"'
    (folder / "out.glb").write_bytes(exported.content)
    assert cg.load_motion(folder / "out.glb").duration_s == pytest.approx(2.0, abs=0.05)
    for content, name, status in ((b"no", "a.glb", 400), (path.read_bytes(), "a.png", 415)):
        assert client.send("/api/character", content, name).status_code == status
    client.service.close()
    assert open_studio(folder / "clicks.wav").ready().state()["character"]["name"] == "hero.glb"


@pytest.mark.parametrize("format", ["bvh", "json", "html"])
def test_files_are_those_of_the_command(client, folder, format):
    job = client.wait(client.post("/api/export", format=format))
    content = client.get(f"/api/export/{job['result']['id']}").content
    dance = client.service.studio.state.dance
    dance.save(folder / f"other.{format}")
    assert content == (folder / f"other.{format}").read_bytes()


def test_the_song_is_heard_and_drawn(client):
    sound = client.get("/api/song/audio", headers={"Range": "bytes=0-99"})
    assert sound.status_code == 206 and len(sound.content) == 100
    drawn = client.get("/api/song/waveform?points=50").json()
    assert len(drawn["peaks"]) == 50 and max(drawn["peaks"]) == 1.0 and drawn["levels"]


def test_what_is_danced_is_explained(client):
    found = client.get("/api/explain?at=5").json()
    assert found["start_s"] <= 5 < found["end_s"] and found["take"] and found["stretched"] > 0
    assert sum(reason["share"] for reason in found["reasons"]) == pytest.approx(1.0, abs=1e-3)
    assert all(reason["sentence"].endswith(".") for reason in found["reasons"])
    assert found["next_best"] is None or found["next_best"]["why"]
    assert client.get("/api/explain?at=500").status_code == 400
    assert client.get("/api/explain?at=-1").status_code == 422


def test_the_palette_is_searched_and_its_figures_move(client):
    everything = client.get("/api/palette?limit=200").json()
    assert everything["total"] == len(everything["takes"]) > 0
    thirds = [
        client.get(f"/api/palette?energy={third}").json()["total"] for third in ("low", "middle", "high")
    ]
    assert sum(thirds) == everything["total"]
    part = everything["takes"][0]
    named = client.get("/api/palette", params={"text": part["take"].upper()}).json()
    assert 0 < named["total"] <= everything["total"]
    where = {"take": part["take"], "from": part["from_s"], "to": part["to_s"]}
    assert client.get("/api/palette/motion", params=where).json()["facts"]["fps"] == 20
    for wrong in ({"take": "none"}, {"from": 5000, "to": 5001}, {"from": 3, "to": 2}):
        assert client.get("/api/palette/motion", params={**where, **wrong}).status_code == 400
    assert client.get("/api/palette?energy=much").status_code == 400


def test_another_repertoire_is_danced_with_and_undone(client, folder, repertoire):
    (folder / "mine.h5").write_bytes(repertoire.path.read_bytes())
    assert "mine.h5" in client.state()["repertoire"]["names"]
    assert client.change("/api/repertoire", name="mine.h5")["state"] == "done"
    assert client.state()["repertoire"]["name"] == "mine.h5"
    state = client.post("/api/undo", revision=client.revision).json()
    assert state["repertoire"]["name"] == repertoire.path.name
    for name in ("../mine.h5", "none.h5", "clicks.wav", "/etc/passwd"):
        assert client.post("/api/repertoire", revision=client.revision, name=name).status_code == 404


def test_a_long_job_is_cancelled(client):
    job = client.post("/api/settings", revision=1, changes={"seed": 4}).json()["job"]
    client.http.delete(f"/api/jobs/{job}")
    while (facts := client.get(f"/api/jobs/{job}").json())["state"] == "running":
        pass
    assert facts["state"] in ("cancelled", "done")
    assert client.change("/api/settings", changes={"seed": 5})["state"] == "done"


def test_the_project_is_text_that_a_person_can_read(client, folder):
    client.change("/api/edit", kind="swap", **{"from": 4, "to": 6})
    data = json.loads((folder / "clicks.studio.json").read_text())
    assert data["song"] == "clicks.wav" and [step["request"] for step in data["steps"]] == [
        "dance",
        "swap 4-6",
    ]


def test_a_pose_is_held_a_span_is_cut_to_a_section_and_undone(client):
    before = motion_of(client)
    job = client.change("/api/edit", kind="hold", **{"from": 4, "to": 6})
    assert job["state"] == "done", job
    state = client.state()
    assert any(block["speed"] == 0 for block in state["dance"]["blocks"])
    assert state["dance"]["edits"][0]["request"] == "hold 4-6" and motion_of(client) != before
    sections = state["dance"]["sections"]
    for section in range(len(sections)):
        job = client.change("/api/edit", kind="cut", section=section, **{"from": 8, "to": 9.5})
        if abs(sections[section]["start_s"] - 8) > 0.1:
            assert job["state"] == "done", job
            assert client.state()["dance"]["edits"][-1]["request"].startswith("repeat ")
            client.post("/api/undo", revision=client.revision)
    for more in ({}, {"section": 99}, {"section": -1}):
        reply = client.post("/api/edit", revision=client.revision, kind="cut", **{"from": 8, "to": 9, **more})
        assert reply.status_code in (400, 422), more
    client.post("/api/undo", revision=client.revision)
    assert motion_of(client) == before


def test_a_join_is_moved_by_counts_and_undone(client):
    take = client.state()["dance"]["takes"][0]["name"]
    other = next(t["take"] for t in client.get("/api/palette?limit=200").json()["takes"] if t["take"] != take)
    for name, span in ((take, (2, 5)), (other, (5, 9))):
        assert client.change("/api/edit", kind="pin_take", take=name, **{"from": span[0], "to": span[1]})
    before, joins = motion_of(client), client.state()["dance"]["joins"]
    at = min(joins, key=lambda join: abs(join - 5))
    job = client.change("/api/seam", at=at, counts=1)
    assert job["state"] == "done", job
    state = client.state()
    [moved] = set(state["dance"]["joins"]) - set(joins)
    assert 0.3 < moved - at < 0.7 and state["dance"]["edits"][-1]["request"].startswith("move join")
    assert client.post("/api/undo", revision=client.revision).json()["dance"]["joins"] == joins
    assert motion_of(client) == before
    client.post("/api/locks", revision=client.revision, locks=[[4, 6]])
    job = client.change("/api/seam", at=at, counts=1)
    assert job["state"] == "failed" and "locked" in job["error"]
    for wrong in ({"at": at, "counts": 0}, {"at": -1, "counts": 1}, {"at": at, "counts": 0.5}):
        assert client.post("/api/seam", revision=client.revision, **wrong).status_code in (400, 422)
    assert client.post("/api/seam", revision=1, at=at, counts=1).status_code == 409
