"""A client of a studio, which sends requests as its page does."""

from __future__ import annotations

import time

from fastapi.testclient import TestClient

from choreograph.studio.server import Access, make_app

PORT = 8000


class Client:
    """What a page asks of a studio."""

    def __init__(self, service, access=None, base_url=f"http://127.0.0.1:{PORT}"):
        self.service = service
        self.http = TestClient(make_app(service, access or Access(PORT)), base_url=base_url)

    def get(self, path, **options):
        return self.http.get(path, **options)

    def state(self):
        return self.get("/api/state").json()

    @property
    def revision(self):
        return self.state()["revision"]

    def post(self, path, **body):
        return self.http.post(path, json=body)

    def wait(self, reply):
        """The job of a reply, when it has ended."""
        assert reply.status_code == 202, reply.text
        while (job := self.get(f"/api/jobs/{reply.json()['job']}").json())["state"] == "running":
            time.sleep(0.01)
        return job

    def change(self, path, **body):
        """A change of the newest state, when it has been made."""
        return self.wait(self.post(path, revision=self.revision, **body))

    def send(self, path, content, name):
        """Send a file."""
        return self.http.post(path, content=content, headers={"X-Filename": name})

    def ready(self):
        """This client, when there is a dance."""
        while self.state()["dance"] is None:
            time.sleep(0.01)
        return self
