"""Headless Chromium for page tests: start flags, recording of problems, waiting."""

from __future__ import annotations

import time

QUIET = [
    "--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--autoplay-policy=no-user-gesture-required",
]  # fmt: skip
SWIFTSHADER = [*QUIET, "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
# Software compositing as well as rendering.
NO_COMPOSITING = [*QUIET, "--disable-gpu-compositing", "--enable-unsafe-swiftshader"]


def note_complaints(page, complaints: list[str]) -> None:
    """Add console messages, errors and external requests of the page to `complaints`."""
    page.on("console", lambda message: complaints.append(message.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("request", lambda request: None if request.url.startswith(("file://", "blob:", "data:"))
            else complaints.append(request.url))  # fmt: skip


def until(page, condition: str, *, timeout_s: float = 8.0) -> None:
    """Wait for a condition on the page; its security policy forbids Playwright's `wait_for_function`."""
    end_s = time.monotonic() + timeout_s
    while not page.evaluate(condition):
        assert time.monotonic() < end_s, condition
        page.wait_for_timeout(20)
