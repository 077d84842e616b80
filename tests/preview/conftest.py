"""Pages of a dance in headless Chromium."""

from __future__ import annotations

from pathlib import Path

import pytest
from browsers import SWIFTSHADER, note_complaints, until
from synthetic_pages import write_pages


@pytest.fixture(scope="module")
def browser(chromium):
    return chromium(SWIFTSHADER)


@pytest.fixture(scope="session")
def pages(tmp_path_factory):
    """The same dance with its song, without a song, and with a broken song: see `write_pages`."""
    return write_pages(tmp_path_factory.mktemp("pages"))


@pytest.fixture
def opened(browser, pages):
    """Open one of the pages; console messages, errors and network requests fail the test at its end."""
    contexts, complaints = [], []

    def open_page(name: str = "song.html", *, folder: Path = pages, **options):
        context = browser.new_context(
            viewport=options.pop("viewport", {"width": 900, "height": 640}), **options
        )
        contexts.append(context)
        page = context.new_page()
        note_complaints(page, complaints)
        page.goto((folder / name).as_uri())
        until(page, "window.choreograph !== undefined", timeout_s=20)
        return page

    yield open_page
    for context in contexts:
        context.close()
    assert complaints == []
