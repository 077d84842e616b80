"""A studio in a folder of its own."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

pytest.importorskip("fastapi")


@pytest.fixture(scope="module")
def browser(chromium):
    """A headless Chromium that draws in software."""
    from browsers import SWIFTSHADER

    return chromium(SWIFTSHADER)


@pytest.fixture(scope="module")
def danced(browser, song, tmp_path_factory):
    """The address of a studio with a dance. A page dropped the song."""
    from studio_pages import drop, opening, serving, until

    with serving(tmp_path_factory.mktemp("studio")) as address:
        with opening(browser, address) as page:
            assert page.is_visible("#welcome")
            drop(page, song)
            until(page, "studio.playing && studio.time > 0.3")
            assert not page.is_visible("#welcome")
        yield address


@pytest.fixture
def folder(tmp_path, song):
    """A folder with a song of clicks."""
    shutil.copy(song, tmp_path / "clicks.wav")
    return tmp_path


@pytest.fixture
def open_session(repertoire, folder):
    """Opens sessions of a project whose song is read and danced."""
    from choreograph.studio.studio_session import StudioSession

    opened = []

    def open_one():
        opened.append(StudioSession(folder, repertoire))
        opened[-1].open(folder / "clicks.wav")
        opened[-1].load(None, None)
        return opened[-1]

    yield open_one
    for studio in opened:
        studio.close()


@pytest.fixture
def studio(open_session):
    return open_session()


@pytest.fixture
def open_studio(repertoire):
    """Opens a studio on a song, or none. It is closed at the end."""
    from studio_client import Client

    from choreograph.studio.server import start

    opened = []

    def open_one(song: Path | None, **options):
        opened.append(start(song, repertoire, **options))
        return Client(opened[-1])

    yield open_one
    for service in opened:
        service.close()


@pytest.fixture
def client(open_studio, folder):
    """A client of a studio with a dance."""
    return open_studio(folder / "clicks.wav").ready()
