"""The API as it is described, asked with many values that the description allows."""

from __future__ import annotations

import time

import pytest
from hypothesis import HealthCheck, Phase, given, settings

schemathesis = pytest.importorskip("schemathesis")

_MOST_CPU_S = 25.0  # of all requests
_EXAMPLES = 40  # of each address


@pytest.mark.slow
def test_no_request_breaks_the_studio(client):
    """Each reply is JSON or a file, each refusal one line, and the dance is still whole at the end."""
    schema = schemathesis.openapi.from_dict(client.get("/api/openapi.json").json())
    began, asked = time.process_time(), 0
    for found in schema.get_all_operations():
        operation = found.ok()

        @settings(
            max_examples=_EXAMPLES, derandomize=True, database=None, deadline=None,
            phases=[Phase.generate], suppress_health_check=list(HealthCheck),
        )  # fmt: skip
        @given(case=operation.as_strategy())
        def ask(case):
            nonlocal asked
            if time.process_time() - began > _MOST_CPU_S:
                return
            asked += 1
            sent = case.as_transport_kwargs(base_url=str(client.http.base_url))
            known = {"method", "url", "params", "json", "data", "headers"}
            reply = client.http.request(**{name: value for name, value in sent.items() if name in known})
            assert reply.status_code < 500, (sent, reply.text)
            if reply.status_code >= 400:
                assert "\n" not in reply.json()["error"], (sent, reply.text)

        ask()
    assert asked > 300
    client.service.jobs.do("wait", lambda job: None)
    assert client.change("/api/edit", kind="swap", **{"from": 4, "to": 6})["state"] == "done"
