"""The page in headless Chromium plays: seeking, looping, half speed, and sound as the clock."""

from __future__ import annotations

import numpy as np
import pytest
from browsers import state, until, wait_until_still
from synthetic_motions import swaying
from synthetic_pages import FPS, plan_for, write_seconds

from choreograph.view.page import write_page


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


@pytest.mark.alone
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


@pytest.mark.alone
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


@pytest.mark.alone
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


def test_song_that_cannot_be_played_gives_a_notice_and_the_dance_continues(opened):
    page = opened("broken.html")
    page.wait_for_selector("#notice:visible")
    assert "cannot play the song" in page.locator("#notice").inner_text()
    page.keyboard.press("Space")
    until(page, "choreograph.time > 0.5")


@pytest.mark.alone
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
