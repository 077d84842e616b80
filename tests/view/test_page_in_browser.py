"""The page in headless Chromium: its keys and buttons, what it says of a second, and where it is read."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
from browsers import state, until
from synthetic_pages import DANCE, plan_for

from choreograph.motion.cameras import plan_cameras
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import Skeleton
from choreograph.view.page import write_page


def test_keys_and_buttons(opened):
    page = opened()
    for key, name, button in (("m", "mirrored", "mirror"), ("f", "following", "follow")):
        before = state(page, name)
        page.keyboard.press(key)
        assert state(page, name) is not before
        assert page.get_attribute(f"#{button}", "aria-pressed") == str(not before).lower()
        page.click(f"#{button}")
        assert state(page, name) is before
    page.keyboard.press("?")
    assert page.locator("#keys").is_visible()
    page.keyboard.press("Escape")
    assert not page.locator("#keys").is_visible()
    page.locator("#loop").focus()
    page.keyboard.press("Space")  # the space bar presses a focused button
    assert state(page, "loop")["on"] and not state(page, "playing")
    page.locator("#timeline").focus()
    shown_s = state(page, "shownTo")
    page.keyboard.press("+")
    assert state(page, "shownTo") - state(page, "shownFrom") < 0.7 * shown_s
    page.keyboard.press("0")
    assert state(page, "shownTo") == shown_s


def test_pointing_at_a_second_shows_its_source(opened):
    page = opened()
    box = page.locator("#timeline").bounding_box()
    assert not page.locator("#card").is_visible()
    page.mouse.move(box["x"] + box["width"] * 3.5 / 8, box["y"] + 100)
    text = page.locator("#card").inner_text()
    for words in (
        "ben-house",
        "genre of ben-house",
        "dancer of ben-house",
        "CC0",
        "41",
        "15.25",
        "16.50",
        "1.25×",
    ):
        assert words in text
    assert re.search(r"style\s+0\.280", text) and re.search(r"transition\s+0\.000", text)
    assert page.locator("#card .bar").count() == 2
    page.mouse.move(5, 5)
    assert not page.locator("#card").is_visible()


def test_the_count_follows_the_time(opened, tmp_path):
    plan = plan_for(DANCE)  # a beat every half second
    counted = replace(plan, music_beat_numbers=tuple((3 + i) % 4 + 1 for i in range(16)), metre=4)
    write_page(tmp_path / "counts.html", DANCE, counted, song_path=None, motion_beats_s=[])
    page = opened("counts.html", folder=tmp_path)
    box = page.locator("#timeline").bounding_box()
    for time_s, count in ((0.2, {"bar": 0, "number": 4}), (0.6, {"bar": 1, "number": 1}),
                          (4.2, {"bar": 2, "number": 4}), (4.7, {"bar": 3, "number": 1})):  # fmt: skip
        page.mouse.click(box["x"] + box["width"] * time_s / 8, box["y"] + 40)
        until(page, f"Math.abs(choreograph.time - {time_s}) < 0.1")
        assert state(page, "count") == count
        shown = f"bar {count['bar']}, count {count['number']}"
        until(page, f"document.getElementById('now-count').textContent === '{shown}'")
    page.mouse.move(box["x"] + box["width"] * 3.5 / 8, box["y"] + 100)
    assert "bar 2, count 2" in page.locator("#card").inner_text()


def test_without_bars_there_is_no_count(opened):
    page = opened()
    assert state(page, "count") is None
    assert not page.locator("#now-count").is_visible()


def test_a_phone(opened):
    page = opened(
        viewport={"width": 390, "height": 844}, has_touch=True, is_mobile=True, device_scale_factor=2
    )
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    boxes = [
        page.locator(f"#{name}").bounding_box()
        for name in ("play", "speed", "loop", "mirror", "follow", "help")
    ]
    assert all(box["x"] >= 0 and box["x"] + box["width"] <= 390 and box["height"] >= 36 for box in boxes)
    box = page.locator("#timeline").bounding_box()
    page.touchscreen.tap(box["x"] + 100, box["y"] + 60)
    assert page.locator("#card").is_visible()
    card = page.locator("#card").bounding_box()
    assert card["x"] >= 0 and card["x"] + card["width"] <= 390
    assert state(page, "time") > 0


def test_names_are_escaped(opened, tmp_path):
    evil = "<img src=x onerror=alert(1)></script>"
    plan = replace(plan_for(DANCE, takes=(evil,)), song=evil)
    write_page(tmp_path / "page.html", DANCE, plan, song_path=None, motion_beats_s=[])
    page = opened("page.html", folder=tmp_path)
    assert page.locator("h1").inner_text() == evil
    assert page.locator("#now-take").inner_text() == evil
    assert page.title() == evil


def test_smallest_dance_of_an_unknown_skeleton(opened, tmp_path):
    """One frame of one joint with an unknown name: the page opens, plays and ends."""
    skeleton = Skeleton(("thing",), np.array([-1]), np.zeros((1, 3)))
    motion = Motion(skeleton, np.zeros((1, 3)), np.array([[[1.0, 0.0, 0.0, 0.0]]]), 30.0)
    write_page(tmp_path / "page.html", motion, plan_for(motion), song_path=None, motion_beats_s=[])
    page = opened("page.html", folder=tmp_path)
    page.keyboard.press("Space")
    until(page, "!choreograph.playing && choreograph.time > 0.03")
    assert state(page, "joints") == [[0, 0, 0]]


def test_cameras_film_until_the_view_is_turned(opened, tmp_path):
    path = plan_cameras([DANCE], "cuts", (3.0, 5.5))
    write_page(
        tmp_path / "filmed.html", DANCE, plan_for(DANCE), song_path=None, motion_beats_s=[], camera=path
    )
    page = opened("filmed.html", folder=tmp_path)
    box = page.locator("#timeline").bounding_box()
    for time_s, shot in ((1.0, "wide"), (4.0, "follow"), (7.0, "wide")):
        page.mouse.click(box["x"] + box["width"] * time_s / DANCE.duration_s, box["y"] + 100)
        until(page, f"Math.abs(window.choreograph.time - {time_s}) < 0.1", timeout_s=5)
        assert state(page, "shot") == shot
    view = page.locator("#view").bounding_box()
    x, y = view["x"] + view["width"] / 2, view["y"] + view["height"] / 3
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 60, y)
    page.mouse.up()
    assert state(page, "shot") is None
    page.mouse.dblclick(x, y)
    assert state(page, "shot") == "wide"
    assert state(opened(), "shot") is None  # a page without cameras
