"""The part of a changed dance near the playhead plays before the rest is there, or is taken back."""

from __future__ import annotations

import json

import pytest
from studio_pages import opening, shown, until

pytestmark = pytest.mark.slow


def playing(page) -> int:
    """Play from 1 s on with the settings open. Returns the revision."""
    shown(page)
    page.evaluate("studio.seek(1)")
    page.keyboard.press("Space")
    until(page, "studio.playing && studio.time > 1.1")
    page.click("#tab-settings")
    return page.evaluate("studio.revision")


def test_the_part_plays_before_the_motion_and_the_state(danced, browser):
    with opening(browser, danced) as page:
        revision = playing(page)
        waiting = []
        page.route("**/api/motion?*", lambda route: waiting.append(route))
        before = page.evaluate("studio.playedSince")
        page.evaluate("studio.seek(1)")
        page.click("#roll")
        until(page, "studio.part !== null")
        part = page.evaluate("studio.part")
        assert part["from"] >= 1.0 and 0.5 < part["to"] - part["from"] <= 5.0
        page.evaluate(f"studio.seek({part['from'] + 0.2})")
        until(page, f"studio.playedSince > {before}")
        played = page.evaluate("studio.playedSince")
        assert page.evaluate("studio.revision") == revision  # the page does not know the new state yet
        while not waiting:
            page.wait_for_timeout(20)
        waiting.pop().continue_()
        shown(page, f"studio.revision === {revision + 1} && studio.part === null")
        assert page.evaluate("studio.playedSince") == played  # it is the same dance
        assert page.evaluate("performance.getEntriesByType('resource')"
                             ".filter((e) => /motion.revision/.test(e.name)).length") <= 2  # fmt: skip
        page.unroute("**/api/motion?*")
        page.click("#undo")
        shown(page, f"studio.revision === {revision + 2}")


def test_a_part_of_a_dance_that_is_not_made_is_taken_back(danced, browser):
    with opening(browser, danced) as page:
        revision = playing(page)

        seen = []

        def cancelled(route) -> None:
            answer = route.fetch()
            found = answer.json()
            if seen:
                found["state"] = "cancelled"
            seen.extend([found["first"]] if "first" in found else [])
            route.fulfill(response=answer, body=json.dumps(found))

        page.route("**/api/jobs/*", cancelled)
        page.evaluate(
            "window.parts = []; setInterval(() => { if (studio.part) parts.push(studio.part); }, 1)"
        )
        slider = page.locator("[data-weight=energy]")
        slider.focus()
        for key in ("End", "Home") * 4:  # a busy machine may ask only when all of the dance is made
            page.evaluate("studio.seek(1)")
            slider.press(key)
            taken_back = "parts.length && studio.part === null"
            until(page, f"!studio.busy && (({taken_back}) || studio.shownRevision > {revision})")
            if seen:
                break
            revision = page.evaluate("studio.revision")
        assert seen and page.evaluate(taken_back)
        assert page.evaluate("[studio.revision, studio.shownRevision]") == [revision, revision]
