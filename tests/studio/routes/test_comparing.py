"""Versions and ratings: what is missing is said, and a version has its settings in its name."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from choreograph.studio.routes.comparing import _named
from choreograph.studio.settings import Settings


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
