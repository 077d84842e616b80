"""A local web server with one file, which answers requests for a part of it, and can fail as hosts do."""

from __future__ import annotations

import hashlib
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer


@dataclass
class Host:
    """What the server sends, and what it was asked for."""

    content: bytes
    cut_after: list[int] = field(default_factory=list)  # of the next answers: the connection ends there
    status: int = 200  # 206 is a part of which the answer does not say which
    length: str | None = None  # that it states in place of the true one
    ranges: bool = True  # whether it sends parts
    tag: str | None = '"one"'
    url: str = ""
    asked: list[str | None] = field(default_factory=list)  # the part of each request

    @property
    def sum(self) -> str:
        return f"sha256:{hashlib.sha256(self.content).hexdigest()}"


@contextmanager
def hosted(content: bytes) -> Iterator[Host]:
    """A server of a file `set.zip` on this machine, while the block runs."""
    host = Host(content)

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            asked = self.headers.get("Range")
            host.asked.append(asked)
            if host.status not in (200, 206):
                self.send_error(host.status)
                return
            is_same = self.headers.get("If-Range") in (None, host.tag)
            start = int(asked.removeprefix("bytes=").rstrip("-")) if asked and host.ranges and is_same else 0
            if start >= len(host.content):
                self.send_error(416)
                return
            body = host.content[start:]
            self.send_response(206 if start else host.status)
            if start:
                last = len(host.content) - 1
                self.send_header("Content-Range", f"bytes {start}-{last}/{len(host.content)}")
            if host.tag:
                self.send_header("ETag", host.tag)
            self.send_header("Content-Length", str(len(body)) if host.length is None else host.length)
            self.end_headers()
            self.wfile.write(body[: host.cut_after.pop(0)] if host.cut_after else body)

        def log_message(self, *_: object) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    host.url = f"http://127.0.0.1:{server.server_address[1]}/set.zip"
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    try:
        yield host
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
