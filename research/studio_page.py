"""The studio in headless Chromium: times until a change plays on the page, and what a frame costs.

`research/studio.py --page` starts it. Chromium renders in software here, so that frames a second say little
about a machine with a graphics card. Therefore, what the page itself does in a frame is measured apart from
the rasterising, in CPU time of the process that does it.
"""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from playwright.sync_api import Page, sync_playwright

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from browsers import SWIFTSHADER, until

SIZE = 1280, 800
_PATIENCE_S = 120.0
_SETTLED_S = 1.0  # before a change, so that nothing of the one before is measured
_TICKS_PER_S = os.sysconf("SC_CLK_TCK")


@contextmanager
def open_page(address: str, *, scheme: str = "dark") -> Iterator[Page]:
    """A page of a studio with a dance."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=SWIFTSHADER)
        page = browser.new_page(viewport={"width": SIZE[0], "height": SIZE[1]}, color_scheme=scheme)
        page.set_default_timeout(1000 * _PATIENCE_S)
        page.add_init_script(path=Path(__file__).with_suffix(".js"))
        page.goto(address)
        until(page, "window.studio !== undefined", timeout_s=_PATIENCE_S)
        _shown(page)
        yield page
        browser.close()


def _shown(page: Page) -> None:
    ready = "studio.dance && !studio.busy && studio.shownRevision === studio.revision"
    until(page, ready, timeout_s=_PATIENCE_S)


def page_times(studio: Any, rng: np.random.Generator, n: int) -> None:
    """Print the times until a chosen alternative and a moved weight play on the page, each `n` times."""
    with open_page(studio.address) as page:
        page.keyboard.press("Space")
        until(page, "studio.playing && studio.time > 0.2", timeout_s=_PATIENCE_S)
        _print(studio, "a weight moved, until it plays on the page", [_weight(page, rng) for _ in range(n)])
        page.click("#tab-change")
        _print(studio, "an alternative chosen, until it plays", [_choice(page, rng) for _ in range(n)])


def _weight(page: Page, rng: np.random.Generator) -> dict[str, Any]:
    """Press on the slider of a weight, at a random place."""
    page.click("#tab-settings")
    slider = page.locator(
        "[data-weight=" + str(rng.choice(["transition", "pace", "energy", "variety"])) + "]"
    )
    slider.scroll_into_view_if_needed()
    page.wait_for_timeout(1000 * _SETTLED_S)
    page.evaluate("watch('pointerup')")
    box = slider.bounding_box()
    assert box is not None
    before = slider.input_value()
    page.mouse.click(box["x"] + float(rng.uniform(0.1, 0.9)) * box["width"], box["y"] + box["height"] / 2)
    return _weight(page, rng) if slider.input_value() == before else _measured(page)


def _choice(page: Page, rng: np.random.Generator) -> dict[str, Any]:
    """Select a span of four seconds, and press one of its alternatives."""
    page.evaluate("studio.seek(0)")
    box = page.locator("#timeline").bounding_box()
    assert box is not None
    x, y = (
        box["x"] + float(rng.uniform(0.05, 0.8)) * box["width"],
        box["y"] + 40,
    )  # the wave, where no join is
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 80, y, steps=4)  # four seconds of a song that is longer than the window
    page.mouse.up()
    until(page, "document.getElementById('alternatives-note').innerText", timeout_s=_PATIENCE_S)
    until(page, "document.getElementById('alternatives').ariaBusy !== 'true'", timeout_s=_PATIENCE_S)
    n_found = page.locator("#alternatives button").count()
    if n_found == 0:  # nothing else fits there
        return _choice(page, rng)
    page.locator("#alternatives button").nth(int(rng.integers(n_found))).hover()
    page.wait_for_timeout(1000 * _SETTLED_S)
    page.evaluate("watch('click')")
    page.mouse.down()
    page.mouse.up()
    return _measured(page)


def _measured(page: Page) -> dict[str, Any]:
    found: dict[str, Any] = page.evaluate("window.measured")
    _shown(page)
    return found


def _print(studio: Any, what: str, found: list[dict[str, Any]]) -> None:
    plays_s = np.array([one["plays"] for one in found]) / 1000
    answered_s = np.array([max(end for *_, end, _ in one["requests"]) for one in found]) / 1000
    sent_kb = [sum(size for *_, size in one["requests"]) / 1000 for one in found]
    print(
        f"  {what}: median {np.median(plays_s):.2f} s, longest {plays_s.max():.2f} s, and the server has "
        f"sent what plays, {np.median(sent_kb):.0f} kB, after {np.median(answered_s):.2f} s",
        flush=True,
    )


def frames(studio: Any, seconds: float = 6.0) -> None:
    """Print frames a second, and CPU time in a frame: of the page's own work, and of rasterising."""
    with open_page(studio.address) as page:
        page.keyboard.press("Space")
        until(page, "studio.playing && studio.time > 0.2", timeout_s=_PATIENCE_S)
        page.wait_for_timeout(4000)  # until the resolution has settled
        _print_frames(page, "all is drawn", seconds)
        page.evaluate("count()")
        before = page.evaluate("studio.framesDrawn")
        page.wait_for_timeout(1000)
        counted = page.evaluate("counted")
        n = max(page.evaluate("studio.framesDrawn") - before, 1)
        print("  of a frame: " + ", ".join(f"{round(value / n)} {name}" for name, value in counted.items()))
        page.evaluate("drawNothing()")
        _print_frames(page, "nothing is drawn in WebGL", seconds)


def _print_frames(page: Page, what: str, seconds: float) -> None:
    metrics = page.context.new_cdp_session(page)
    metrics.send("Performance.enable", {"timeDomain": "threadTicks"})

    def reading() -> dict[str, float]:
        found = {one["name"]: one["value"] for one in metrics.send("Performance.getMetrics")["metrics"]}
        drawn = page.evaluate("[studio.framesDrawn, performance.now() / 1000]")
        return {**found, "frames": drawn[0], "at_s": drawn[1], "gpu_s": _gpu_process_s()}

    before = reading()
    page.wait_for_timeout(1000 * seconds)
    after = reading()
    spent = {name: after[name] - before[name] for name in before}
    n = max(spent["frames"], 1)
    size = page.evaluate("(({ width, height }) => [width, height])(document.getElementById('view'))")
    names = "ScriptDuration", "LayoutDuration", "RecalcStyleDuration", "TaskDuration", "gpu_s"
    scripts, layout, style, whole, rasterising = (1000 * spent[name] / n for name in names)
    print(
        f"  {what}, {size[0]} x {size[1]} pixels: {n / spent['at_s']:.1f} frames a second. In a frame, the "
        f"main thread of the page needs {whole:.2f} ms, of which scripts {scripts:.2f} ms, style and layout "
        f"{layout + style:.2f} ms, and the process that rasterises {rasterising:.1f} ms",
        flush=True,
    )


def _gpu_process_s() -> float:
    """CPU time of the process of this Chromium that rasterises in place of a graphics card."""
    parent, command, ticks = {}, {}, {}
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            line = (folder / "cmdline").read_bytes()
            fields = (folder / "stat").read_text().rpartition(")")[2].split()
        except OSError:  # it has ended
            continue
        pid = int(folder.name)
        parent[pid], command[pid], ticks[pid] = int(fields[1]), line, int(fields[11]) + int(fields[12])

    def is_ours(pid: int) -> bool:
        return pid == os.getpid() or (pid in parent and is_ours(parent[pid]))

    found = [pid for pid in parent if b"--type=gpu-process" in command[pid] and is_ours(pid)]
    return sum(ticks[pid] for pid in found) / _TICKS_PER_S
