"""The page in headless Chromium: playing, seeking, looping, mirroring; joints are where Python has them."""

from __future__ import annotations

import io
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from browsers import NO_COMPOSITING, SWIFTSHADER, note_complaints, until
from PIL import Image
from synthetic_motions import swaying
from synthetic_pages import plan_for, write_seconds

from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import Skeleton
from choreograph.preview.page import write_page

pytestmark = pytest.mark.alone

FPS = 60.0
MOTION = swaying(480, fps=FPS)  # 8 s


@pytest.fixture(scope="module")
def browser(chromium):
    return chromium(SWIFTSHADER)


@pytest.fixture(scope="module")
def processor_browser(chromium):
    return chromium(NO_COMPOSITING)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """The same dance with its song, without a song, and with a broken song."""
    folder = tmp_path_factory.mktemp("pages")
    song = write_seconds(folder / "song.wav", duration_s=9.0)
    options = {"motion_beats_s": np.arange(0.25, 8.0, 0.5), "title": "A dance"}
    write_page(folder / "song.html", MOTION, plan_for(MOTION), song_path=song, **options)
    write_page(folder / "silent.html", MOTION, plan_for(MOTION), song_path=None, **options)
    text = (folder / "song.html").read_text(encoding="utf-8")
    broken = re.sub(r'(id="sound">)[^<]{4000}', r"\g<1>" + "AAAA" * 1000, text)
    (folder / "broken.html").write_text(broken, encoding="utf-8")
    return folder


@pytest.fixture
def opened(browser, files):
    """Open one of the pages; console messages, errors and network requests fail the test at its end."""
    contexts, complaints = [], []

    def open_page(name: str = "song.html", *, folder: Path = files, **options):
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


def state(page, name: str):
    return page.evaluate(f"choreograph.{name}")


def picture(page) -> np.ndarray:
    """Screenshot of the stage (H, W, 3) without the page's text and buttons."""
    page.evaluate(
        "document.querySelectorAll('header, #big-play').forEach((e) => (e.style.visibility = 'hidden'))"
    )
    page.wait_for_timeout(400)
    png = page.locator("#view").screenshot()
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB")).astype(float)


def python_joints_m(time_s: float) -> np.ndarray:
    return MOTION.sampled(np.array([time_s * FPS])).joint_pos_m()[0]


def wait_until_still(page) -> None:
    until(page, "choreograph.audioTime === null || Math.abs(choreograph.time - choreograph.audioTime) < 1e-3")


def test_dancer_is_drawn_and_moves(opened):
    page = opened()
    before = picture(page)
    stage = before[4, 4]
    body = np.abs(before - stage).sum(axis=2) > 150
    assert 0.01 < body.mean() < 0.5
    page.keyboard.press("Space")
    until(page, "choreograph.time > 1.0")
    assert state(page, "playing")
    page.keyboard.press("Space")
    moved = np.abs(picture(page) - before).sum(axis=2) > 60
    assert moved.mean() > 0.01


@pytest.mark.parametrize("size", [(900, 640), (1400, 900), (500, 900)])
def test_whole_page_is_drawn_with_software_compositing(processor_browser, files, size):
    # Not with `opened`: this browser may log warnings about slow read-backs.
    page = processor_browser.new_page(viewport={"width": size[0], "height": size[1]})
    page.goto((files / "song.html").as_uri())
    until(page, "window.choreograph !== undefined", timeout_s=20)
    for _ in range(2):  # paused, then playing
        page.wait_for_timeout(400)
        drawn = Image.open(io.BytesIO(page.screenshot())).convert("RGBA")
        assert (np.asarray(drawn)[..., 3] == 255).all()
        page.keyboard.press("Space")


@pytest.mark.parametrize("name", ["song.html", "silent.html"])
def test_joints_agree_with_python(opened, name):
    page = opened(name)
    for keys in (["ArrowRight"] * 3, ["Shift+ArrowRight"] * 5, ["End"], ["Shift+ArrowLeft"] * 7, ["Home"]):
        for key in keys:
            page.keyboard.press(key)
        wait_until_still(page)
        joints_m = np.array(state(page, "joints"))
        apart_m = np.linalg.norm(joints_m - python_joints_m(state(page, "time")), axis=1)
        assert apart_m.max() < 0.005


def test_a_click_seeks_to_the_frame(opened):
    page = opened()
    box = page.locator("#timeline").bounding_box()
    for part in (0.71, 0.13, 0.5):
        x = round(box["width"] * part)
        page.mouse.click(box["x"] + x, box["y"] + 40)
        wait_until_still(page)
        wanted_s = state(page, "shownFrom") + x / box["width"] * (
            state(page, "shownTo") - state(page, "shownFrom")
        )
        assert abs(state(page, "time") - wanted_s) <= 1 / FPS
        assert abs(state(page, "frame") - wanted_s * FPS) <= 1
        assert abs(state(page, "audioTime") - wanted_s) <= 1 / FPS


def test_dragging_seeks_and_playing_continues_from_there(opened):
    page = opened()
    page.keyboard.press("Space")
    box = page.locator("#timeline").bounding_box()
    page.mouse.move(box["x"] + 0.2 * box["width"], box["y"] + 40)
    page.mouse.down()
    for part in (0.3, 0.4, 0.5, 0.6):
        page.mouse.move(box["x"] + part * box["width"], box["y"] + 40)
    assert not state(page, "playing")
    assert state(page, "time") == pytest.approx(0.6 * 8, abs=0.05)
    page.mouse.up()
    until(page, "choreograph.playing && choreograph.time > 5.0")
    assert state(page, "time") < 6.5


def test_sound_is_the_clock(opened):
    page = opened()
    page.keyboard.press("Space")
    until(page, "choreograph.time > 0.3")
    for _ in range(15):
        time_s, audio_s = page.evaluate(  # right after a frame was drawn
            """new Promise((resolve) => requestAnimationFrame(() =>
                 resolve([choreograph.time, choreograph.audioTime])))"""
        )
        assert abs(time_s - audio_s) < 0.09
        page.wait_for_timeout(30)
    page.keyboard.press("Space")
    wait_until_still(page)
    paused_s = state(page, "audioTime")
    page.wait_for_timeout(200)
    assert state(page, "time") == pytest.approx(paused_s, abs=1e-3)


@pytest.mark.parametrize("name", ["song.html", "silent.html"])
def test_half_speed(opened, name):
    page = opened(name)
    page.keyboard.press("s")
    assert state(page, "speed") == 0.5
    assert page.get_attribute("#speed", "aria-pressed") == "true"
    page.keyboard.press("Space")
    until(page, "choreograph.time > 0.2")
    first = page.evaluate("[choreograph.time, performance.now() / 1000]")
    page.wait_for_timeout(1200)
    second = page.evaluate("[choreograph.time, performance.now() / 1000]")
    assert (second[0] - first[0]) / (second[1] - first[1]) == pytest.approx(0.5, abs=0.08)


def test_the_mirrored_view_is_a_mirror_image(opened):
    page = opened()
    page.keyboard.press("ArrowRight")
    plain = picture(page)
    page.keyboard.press("m")
    assert state(page, "mirrored")
    mirrored = picture(page)
    assert np.abs(mirrored - plain).mean() > 1.0
    assert np.abs(mirrored[:, ::-1] - plain).mean() < 0.3


@pytest.mark.parametrize("name", ["song.html", "silent.html"])
def test_a_range_loops(opened, name):
    page = opened(name)
    page.keyboard.press("ArrowRight")
    page.keyboard.press("i")
    page.keyboard.press("ArrowRight")
    page.keyboard.press("o")
    assert state(page, "loop") == {"on": True, "from": 1, "to": 2}
    page.keyboard.press("Space")
    times = []
    for _ in range(26):
        times.append(state(page, "time"))
        page.wait_for_timeout(100)
    assert state(page, "playing")
    assert (np.diff(times) < -0.5).sum() >= 2
    assert min(times[2:]) >= 0.99 and max(times) < 2.2
    page.keyboard.press("l")
    until(page, "choreograph.time > 2.5")


def test_shift_drag_selects_a_loop(opened):
    page = opened()
    box = page.locator("#timeline").bounding_box()
    page.keyboard.down("Shift")
    page.mouse.move(box["x"] + 0.75 * box["width"], box["y"] + 40)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.25 * box["width"], box["y"] + 40, steps=3)
    page.mouse.up()
    page.keyboard.up("Shift")
    loop = state(page, "loop")
    assert loop["on"]
    assert (loop["from"], loop["to"]) == (pytest.approx(2.0, abs=0.02), pytest.approx(6.0, abs=0.02))
    assert state(page, "time") == 0


def test_playing_stops_at_the_end_and_play_restarts(opened):
    page = opened()
    page.keyboard.press("End")
    page.keyboard.press("ArrowLeft")
    page.keyboard.press("Space")
    until(page, "!choreograph.playing && choreograph.time > 7.9")
    assert page.get_attribute("#play", "aria-label") == "Play"
    page.click("#play")
    until(page, "choreograph.playing && choreograph.time > 0.1 && choreograph.time < 4")


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
    plan = plan_for(MOTION)  # a beat every half second
    counted = replace(plan, music_beat_numbers=tuple((3 + i) % 4 + 1 for i in range(16)), metre=4)
    write_page(tmp_path / "counts.html", MOTION, counted, song_path=None, motion_beats_s=[])
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


def test_orbit_and_zoom(opened):
    page = opened()
    first = picture(page)
    page.mouse.move(450, 200)
    page.mouse.down()
    page.mouse.move(650, 200, steps=4)
    page.mouse.up()
    turned = picture(page)
    page.mouse.wheel(0, -400)
    closer = picture(page)
    page.mouse.dblclick(300, 200)
    again = picture(page)
    for one, other in ((first, turned), (turned, closer)):
        assert np.abs(one - other).mean() > 1.0
    assert np.abs(first - again).mean() < 0.1


def test_song_that_cannot_be_played_gives_a_notice_and_the_dance_continues(opened):
    page = opened("broken.html")
    page.wait_for_selector("#notice:visible")
    assert "cannot play the song" in page.locator("#notice").inner_text()
    page.keyboard.press("Space")
    until(page, "choreograph.time > 0.5")


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


def test_light_and_dark(opened):
    brightness = {scheme: picture(opened(color_scheme=scheme))[4, 4].mean() for scheme in ("light", "dark")}
    assert brightness["light"] > 180
    assert brightness["dark"] < 60


def test_names_are_escaped(opened, tmp_path):
    evil = "<img src=x onerror=alert(1)></script>"
    plan = replace(plan_for(MOTION, takes=(evil,)), song=evil)
    write_page(tmp_path / "page.html", MOTION, plan, song_path=None, motion_beats_s=[])
    page = opened("page.html", folder=tmp_path)
    assert page.locator("h1").inner_text() == evil
    assert page.locator("#now-take").inner_text() == evil
    assert page.title() == evil


@pytest.mark.slow
def test_drawing_four_minutes_does_not_delay_the_sound(opened, tmp_path, record_property):
    """Also without a graphics card; the frame rate is recorded, with a low bound."""
    motion = swaying(14_400, fps=FPS)
    song = write_seconds(tmp_path / "song.wav", duration_s=240.0)
    beats_s = np.arange(0.25, 240.0, 0.5)
    write_page(tmp_path / "page.html", motion, plan_for(motion), song_path=song, motion_beats_s=beats_s)
    page = opened("page.html", folder=tmp_path, viewport={"width": 1280, "height": 800})
    page.keyboard.press("Space")
    until(page, "choreograph.time > 1")
    counted = "[choreograph.framesDrawn, choreograph.audioTime, performance.now() / 1000]"
    first = np.array(page.evaluate(counted))
    page.wait_for_timeout(10_000)
    frames, sounded_s, passed_s = np.array(page.evaluate(counted)) - first
    record_property("frames_per_s", frames / passed_s)
    record_property("pixel_scale", state(page, "pixelScale"))
    assert sounded_s / passed_s == pytest.approx(1.0, abs=0.03)
    assert frames / passed_s > 5


def test_smallest_dance_of_an_unknown_skeleton(opened, tmp_path):
    """One frame of one joint with an unknown name: the page opens, plays and ends."""
    skeleton = Skeleton(("thing",), np.array([-1]), np.zeros((1, 3)))
    motion = Motion(skeleton, np.zeros((1, 3)), np.array([[[1.0, 0.0, 0.0, 0.0]]]), 30.0)
    write_page(tmp_path / "page.html", motion, plan_for(motion), song_path=None, motion_beats_s=[])
    page = opened("page.html", folder=tmp_path)
    page.keyboard.press("Space")
    until(page, "!choreograph.playing && choreograph.time > 0.03")
    assert state(page, "joints") == [[0, 0, 0]]
