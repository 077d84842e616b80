"""The addresses of files: what is missing is said, and the latest exports are kept."""

from __future__ import annotations

import pytest


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
