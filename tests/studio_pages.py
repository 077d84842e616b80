"""The studio in headless Chromium: a server in this process, pages of it, and what tests do with them."""

from __future__ import annotations

import base64
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import browsers

from choreograph.library.repertoire import as_repertoire
from choreograph.studio.server import Access, _listening, make_server, start

PATIENCE_S = 300  # work may take long where many tests run beside it
WIDE, PHONE = (1280, 800), (390, 844)


def until(page, condition: str) -> None:
    """Wait for a condition on the page. What the page says is in the message of a failure."""
    try:
        browsers.until(page, condition, timeout_s=PATIENCE_S)
    except AssertionError as error:
        raise AssertionError(f"{error}; the page says {page.inner_text('#status')!r}") from None


@contextmanager
def serving(folder: Path, song: Path | None = None, repertoire=None) -> Iterator[str]:
    """The address of a studio in a folder, whose song a page sends, or one of a song."""
    service = start(song, as_repertoire(repertoire))
    if song is None:
        service.studio.folder = folder
    listening = _listening("127.0.0.1", 0)
    access = Access.of("127.0.0.1", listening.getsockname()[1])
    server = make_server(service, access)
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listening]}, daemon=True)
    thread.start()
    try:
        yield access.address
    finally:
        server.should_exit = True
        thread.join(10)
        service.close()


@contextmanager
def opening(browser, address: str, size=WIDE, **options) -> Iterator:
    """A page of a studio. What it complains of in the console fails the test at the end."""
    context = browser.new_context(viewport={"width": size[0], "height": size[1]}, **options)
    context.set_default_timeout(1000 * PATIENCE_S)
    page = context.new_page()
    complaints: list[str] = []
    page.on("console", lambda message: complaints.append(message.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("request", lambda request: None if request.url.startswith((address, "blob:", "data:"))
            else complaints.append(request.url))  # fmt: skip
    page.goto(address)
    until(page, "window.studio !== undefined")
    yield page
    context.close()
    assert complaints == [], complaints


def shown(page, condition: str = "true") -> None:
    """Wait until the newest dance is on the stage, nothing is running, and a condition holds."""
    until(
        page,
        f"studio.dance && !studio.busy && studio.shownRevision === studio.revision && ({condition})",
    )


def drop(page, path: Path) -> None:
    """Drop a file on the page."""
    page.set_input_files("#song-file", [])
    data = page.evaluate_handle(
        """([name, bytes]) => {
             const transfer = new DataTransfer();
             transfer.items.add(new File([Uint8Array.from(atob(bytes), (c) => c.charCodeAt(0))], name));
             return transfer;
           }""",
        [path.name, _base64(path)],
    )
    for name in ("dragenter", "dragover", "drop"):
        page.dispatch_event("#stage", name, {"dataTransfer": data})


def _base64(path: Path) -> str:
    return base64.b64encode(path.read_bytes()).decode("ascii")


def select(page, from_s: float, to_s: float) -> None:
    """Drag over a span of the timeline."""
    box = page.locator("#timeline").bounding_box()
    per_s = box["width"] / page.evaluate("studio.dance.duration_s")
    y = box["y"] + 100
    page.mouse.move(box["x"] + from_s * per_s, y)
    page.mouse.down()
    page.mouse.move(box["x"] + to_s * per_s, y, steps=4)
    page.mouse.up()


def outside(page, from_s: float, to_s: float) -> list:
    """What is danced more than two counts outside of a span: takes and their times."""
    return page.evaluate(
        """([from, to]) => studio.dance.blocks
             .filter(({ start_s, end_s }) => end_s <= from || start_s >= to)
             .map(({ take, from_s, start_s }) => [studio.dance.takes[take].name, from_s, start_s])""",
        [from_s, to_s],
    )
