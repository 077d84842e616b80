"""What every test may ask for."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from hypothesis import settings

# A loaded machine is no failure: laws are held to what they say, not to how long it takes.
settings.register_profile("choreograph", deadline=None)
settings.load_profile("choreograph")


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Real data beside the checkout; tests that need it skip where it is absent."""
    data = Path(__file__).resolve().parents[1].parent / "shared" / "data"
    if not data.is_dir():
        pytest.skip(f"no real data at {data}")
    return data


@pytest.fixture(scope="module")
def chromium():
    """Starts Chromium with the given flags; all are closed at the end. Without one, tests of pages skip."""
    sync_api = pytest.importorskip("playwright.sync_api")
    names = ("chromium", "chromium-browser", "google-chrome")
    found = next((path for name in names if (path := shutil.which(name))), None)
    if found is None:
        pytest.skip("no Chromium on this machine: pages are not tried in a browser")
    started = []
    with sync_api.sync_playwright() as playwright:

        def start(flags):
            started.append(playwright.chromium.launch(executable_path=found, args=flags))
            return started[-1]

        yield start
        for browser in started:
            browser.close()
