"""The page of several dancers in headless Chromium: all are drawn, and are where Python has them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from browsers import picture, state
from synthetic_pages import DANCE, FPS, plan_for

from choreograph.motion.motion import Motion
from choreograph.view.page import write_page

PLACES_M = (0.0, 2.0, -2.0, 4.0, -4.0, 6.0, -6.0, 8.0)


def dancers() -> list[Motion]:
    moved = [DANCE.moved(shift_m=np.array([x, 0.0, -0.2 * abs(x)])) for x in PLACES_M]
    skeleton = DANCE.skeleton
    tall = replace(skeleton, offsets_m=1.04 * skeleton.offsets_m, tips_m=1.04 * skeleton.tips_m)
    moved[2] = replace(moved[2], skeleton=tall)
    return moved


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("scene")
    first, *others = dancers()
    write_page(
        made / "scene.html", first, plan_for(first), song_path=None, motion_beats_s=[1.0], others=others
    )
    return made


def test_all_dancers_are_where_python_has_them(opened, folder):
    page = opened("scene.html", folder=folder)
    page.keyboard.press("Home")
    for _ in range(3):
        page.keyboard.press("ArrowRight")
    shown_m = np.array(state(page, "dancers"))
    frame = np.array([state(page, "time") * FPS])
    expected_m = np.array([motion.sampled(frame).joint_pos_m()[0] for motion in dancers()])
    assert shown_m.shape == expected_m.shape == (8, DANCE.skeleton.n_joints, 3)
    assert np.abs(shown_m - expected_m).max() < 0.003
    assert np.array_equal(np.array(state(page, "joints")), shown_m[0])


def test_all_dancers_are_drawn(opened, folder):
    pixels = picture(opened("scene.html", folder=folder))
    background = np.median(pixels, axis=1, keepdims=True)
    columns = (np.abs(pixels - background).sum(axis=2) > 150).sum(axis=0) > 3
    starts = np.flatnonzero(np.diff(np.concatenate([[0], columns.astype(int)])) == 1)
    assert len(starts) >= 8 and np.ptp(starts) > 0.6 * pixels.shape[1]


def test_one_dancer_has_the_page_of_a_dance(tmp_path):
    for name, more in (("a", {}), ("b", {"others": ()})):
        write_page(
            tmp_path / f"{name}.html", DANCE, plan_for(DANCE), song_path=None, motion_beats_s=[], **more
        )
    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()
