"""Takes the picture of the studio for the documentation: `python docs/studio_picture.py`. It needs Chromium.

The picture shows a song of the program, danced with the built-in repertoire, with one part selected.
"""

from __future__ import annotations

import io
import shutil
import sys
import tempfile
from pathlib import Path

from PIL import Image
from playwright.sync_api import sync_playwright

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))

from browsers import SWIFTSHADER  # noqa: E402
from studio_pages import WIDE, select, serving, shown, until  # noqa: E402

import choreograph as cg  # noqa: E402

PICTURE = ROOT / "docs" / "_static" / "studio.png"
SHOWN_S = 18.2  # a time at which the dancer is well seen
SPAN_S = (17.0, 20.0)  # begins beside a join of takes, which a pointer would drag


def main() -> None:
    """Write `PICTURE`."""
    with tempfile.TemporaryDirectory() as name, sync_playwright() as playwright:
        song = Path(name) / "house.ogg"
        shutil.copy(cg.example_songs()["house"], song)
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=SWIFTSHADER)
        page = browser.new_page(viewport={"width": WIDE[0], "height": WIDE[1]}, color_scheme="dark")
        with serving(Path(name), song) as address:
            page.goto(address)
            until(page, "window.studio !== undefined")
            shown(page)
            select(page, *SPAN_S)
            until(page, "document.querySelectorAll('#alternatives button').length > 3")
            page.evaluate(f"studio.seek({SHOWN_S})")
            page.mouse.move(600, 20)
            page.wait_for_timeout(2000)
            shot = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
        browser.close()
    shot.save(PICTURE, optimize=True)
    print(f"{PICTURE}: {PICTURE.stat().st_size} bytes")


if __name__ == "__main__":
    main()
