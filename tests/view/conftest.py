"""Pages of a dance in headless Chromium."""

from __future__ import annotations

from pathlib import Path

import pytest
from browsers import SWIFTSHADER, opening_pages
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
    with opening_pages(browser, "window.choreograph !== undefined") as open_page:

        def opened_page(name: str = "song.html", *, folder: Path = pages, **options):
            return open_page(folder / name, **{"viewport": {"width": 900, "height": 640}, **options})

        yield opened_page
