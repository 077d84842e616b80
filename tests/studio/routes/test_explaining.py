"""The addresses of explanations and of the palette: limits of what they take."""

from __future__ import annotations

import pytest


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
