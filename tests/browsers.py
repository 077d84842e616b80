"""Headless Chromium for page tests: start flags, recording of problems, waiting, what a page shows."""

from __future__ import annotations

import io
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from PIL import Image

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


def until(page, condition: str, *, timeout_s: float = 20.0) -> None:
    """Wait for a condition on the page; its security policy forbids Playwright's `wait_for_function`."""
    end_s = time.monotonic() + timeout_s
    while not page.evaluate(condition):
        assert time.monotonic() < end_s, condition
        page.wait_for_timeout(20)


@contextmanager
def opening_pages(browser, ready: str):
    """Opens pages that are `ready` by a condition; what any of them complains of fails the test at the end.

    Give a page's path, and a context or the options of a new one.
    """
    contexts, complaints = [], []

    def open_page(path: Path, *, context=None, **options):
        if context is None:
            context = browser.new_context(**options)
            contexts.append(context)
        page = context.new_page()
        note_complaints(page, complaints)
        page.goto(path.as_uri())
        until(page, ready, timeout_s=20)
        return page

    yield open_page
    for context in contexts:
        context.close()
    assert complaints == []


def state(page, name: str):
    """A property of the page's `choreograph`."""
    return page.evaluate(f"choreograph.{name}")


def picture(page) -> np.ndarray:
    """Screenshot of the stage (H, W, 3) without the page's text and buttons."""
    page.evaluate(
        "document.querySelectorAll('header, #big-play').forEach((e) => (e.style.visibility = 'hidden'))"
    )
    page.wait_for_timeout(400)
    png = page.locator("#view").screenshot()
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB")).astype(float)


def wait_until_still(page) -> None:
    """Wait until what is shown is what sounds."""
    until(page, "choreograph.audioTime === null || Math.abs(choreograph.time - choreograph.audioTime) < 1e-3")
