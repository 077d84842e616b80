"""The stage of the page in headless Chromium: what is drawn, with joints where Python has them."""

from __future__ import annotations

import io

import numpy as np
import pytest
from browsers import NO_COMPOSITING, picture, state, until, wait_until_still
from PIL import Image
from synthetic_pages import DANCE, FPS, plan_for

from choreograph.view.page import write_page


@pytest.fixture(scope="module")
def processor_browser(chromium):
    return chromium(NO_COMPOSITING)


def python_joints_m(time_s: float) -> np.ndarray:
    return DANCE.sampled(np.array([time_s * FPS])).joint_pos_m()[0]


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


def test_the_first_view_is_the_audiences(opened, tmp_path):
    for name, yaw_rad in (("front", 0.0), ("back", np.pi)):
        motion = DANCE.moved(yaw_rad=yaw_rad)
        write_page(
            tmp_path / f"{name}.html", motion, plan_for(motion), song_path=None, motion_beats_s=np.zeros(0)
        )
    sides = []
    for name in ("front", "back"):
        shown = picture(opened(f"{name}.html", folder=tmp_path)).astype(int)
        warmth, columns = shown[..., 0] - shown[..., 2], np.arange(shown.shape[1])
        warm, cool = ((side > 40).sum(axis=0) for side in (warmth, -warmth))
        sides.append((warm @ columns) / warm.sum() - (cool @ columns) / cool.sum())
    assert sides[0] > 0 > sides[1]  # the left arm is warm: to the right of one who faces us


@pytest.mark.parametrize("size", [(900, 640), (1400, 900), (500, 900)])
def test_whole_page_is_drawn_with_software_compositing(processor_browser, pages, size):
    # Not with `opened`: this browser may log warnings about slow read-backs.
    page = processor_browser.new_page(viewport={"width": size[0], "height": size[1]})
    page.goto((pages / "song.html").as_uri())
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


def test_the_mirrored_view_is_a_mirror_image(opened):
    page = opened()
    page.keyboard.press("ArrowRight")
    plain = picture(page)
    page.keyboard.press("m")
    assert state(page, "mirrored")
    mirrored = picture(page)
    assert np.abs(mirrored - plain).mean() > 1.0
    assert np.abs(mirrored[:, ::-1] - plain).mean() < 0.3


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


def test_light_and_dark(opened):
    brightness = {scheme: picture(opened(color_scheme=scheme))[4, 4].mean() for scheme in ("light", "dark")}
    assert brightness["light"] > 180
    assert brightness["dark"] < 60
