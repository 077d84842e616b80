"""The page of several dancers in headless Chromium: all are drawn, and are where Python has them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from browsers import picture, state
from synthetic_pages import DANCE, FPS, plan_for

from choreograph.motion.motion import Motion
from choreograph.view.page import bundle_scripts, page_part, write_page

PLACES_M = (0.0, 2.0, -2.0, 4.0, -4.0, 6.0, -6.0, 8.0)


def dancers() -> list[Motion]:
    moved = [DANCE.moved(shift_m=np.array([x, 0.0, -0.2 * abs(x)])) for x in PLACES_M]
    skeleton = DANCE.skeleton
    tall = replace(skeleton, offsets_m=1.04 * skeleton.offsets_m, tips_m=1.04 * skeleton.tips_m)
    moved[2] = replace(moved[2], skeleton=tall)
    return moved


def write_scene(path: Path, motions: Sequence[Motion]) -> None:
    first, *others = motions
    write_page(path, first, plan_for(first), song_path=None, motion_beats_s=[1.0], others=others)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("scene")
    write_scene(made / "scene.html", dancers())
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


def test_the_order_of_dancers_is_not_seen(opened, tmp_path):
    """Ten of one colour. The last two have their shadows in another row of the texture than the others."""
    places_m = [(2.0 * (index % 5) - 4.0, -0.9 * (index // 5)) for index in range(10)]
    motions = [
        DANCE.moved(yaw_rad=float(index), shift_m=np.array([x, 0.0, z]))
        for index, (x, z) in enumerate(places_m)
    ]
    pictures = []
    for name, order in (("a", motions), ("b", [*motions[3:], *motions[:3]])):
        write_scene(tmp_path / "coloured.html", order)
        grey = re.sub(
            r'"palette":\[\[[^\]]*\](,\[[^\]]*\])*\]',
            lambda found: re.sub(r"\[[\d.,]+\]", "[0.5,0.5,0.5]", found[0]),
            (tmp_path / "coloured.html").read_text(),
        )
        (tmp_path / f"{name}.html").write_text(grey)
        pictures.append(picture(opened(f"{name}.html", folder=tmp_path)))
    assert np.abs(pictures[0] - pictures[1]).max() <= 2
    assert np.ptp(pictures[0]) > 60


def test_less_detail_of_small_dancers_looks_the_same(opened, folder):
    """In software rendering while the dance plays; the page here draws all pictures so, or none."""
    text = (folder / "scene.html").read_text()
    moving = text.replace("  resize(still) {", "  resize(still) { still = false;")
    full = moving.replace("const FINE_PIXELS = 100;", "const FINE_PIXELS = 0;")
    assert len({text, moving, full}) == 3
    shown = []
    for name, page in (("moving", moving), ("full", full)):
        (folder / f"{name}.html").write_text(page)
        shown.append(picture(opened(f"{name}.html", folder=folder)))
    away = np.abs(shown[0] - shown[1]).max(axis=2)
    assert away.max() > 8  # the detail is less
    background = np.median(shown[1], axis=1, keepdims=True)
    bodies = np.abs(shown[1] - background).sum(axis=2) > 60
    assert (away > 60).sum() < 0.1 * bodies.sum()


def test_a_mesh_of_less_detail_has_the_same_extent_colours_and_joints(opened, folder):
    page = opened("scene.html", folder=folder)
    scripts = bundle_scripts([page_part(f"{name}.js") for name in ("skin", "webgl", "body")])
    n = 41  # a square of 40 cm with a vertex each centimetre, of two colours and two joints
    at = np.stack(np.meshgrid(np.arange(n), np.arange(n), indexing="ij"), axis=-1).reshape(-1, 2)
    first = np.flatnonzero((at < n - 1).all(axis=1))
    corners = np.stack([first, first + n, first + 1, first + 1, first + n, first + n + 1], axis=1)
    side = (at[:, 0] > 20).astype(int)
    given = {
        "places": ["Float32Array", np.pad(at / 100.0, ((0, 0), (0, 1)))],
        "normals": ["Int8Array", np.tile([0, 0, 127], (n * n, 1))],
        "joints": ["Uint16Array", np.stack([side, side], axis=1)],
        "weights": ["Uint8Array", np.full(n * n, 255)],
        "colours": ["Uint8Array", np.repeat(200 * side, 3)],
        "indices": ["Uint32Array", corners],
    }
    mesh = ", ".join(
        f"{name}: {kind}.from({values.ravel().tolist()})" for name, (kind, values) in given.items()
    )
    found = page.evaluate(
        f"""(() => {{ {scripts}
        const found = Object.entries(coarseMesh({{ {mesh} }}));
        return Object.fromEntries(found.map(([name, values]) => [name, [...values]])); }})()"""
    )
    places_m, indices = np.array(found["places"]).reshape(-1, 3), np.array(found["indices"])
    assert 40 < len(places_m) == len(found["weights"]) < 150
    assert indices.max() < len(places_m) and 60 < len(indices) / 3 < 300
    assert np.ptp(places_m, axis=0) == pytest.approx([0.4, 0.4, 0.0], abs=0.05)
    assert set(found["joints"]) == {0, 1} and set(found["colours"]) == {0, 200}
    assert set(found["normals"]) == {0, 127}


def test_one_dancer_has_the_page_of_a_dance(tmp_path):
    for name, more in (("a", {}), ("b", {"others": ()})):
        write_page(
            tmp_path / f"{name}.html", DANCE, plan_for(DANCE), song_path=None, motion_beats_s=[], **more
        )
    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()
