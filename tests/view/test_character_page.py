"""The page of a dance on the user's character: what is in it, and what a browser shows."""

from __future__ import annotations

import json
import re
from importlib import resources

import numpy as np
import pytest
from browsers import picture, state, until
from synthetic_characters import CHARACTERS, write_character
from synthetic_pages import DANCE, plan_for

from choreograph.characters.character import perform, read_character
from choreograph.core.errors import ParameterError
from choreograph.formats.register import save_motion
from choreograph.pipeline.saving import SavedParts, save_dance
from choreograph.plan.plan import Plan

PLAN: Plan = plan_for(DANCE)


def write_character_page(path, character) -> None:
    save_dance(path, SavedParts(DANCE, PLAN, lambda: np.array([1.0]), None, character=character))


@pytest.fixture
def hero(tmp_path):
    """The mannequin as somebody's character: a body with materials."""
    save_motion(tmp_path / "hero.glb", DANCE.sliced(0, 2))
    return read_character(tmp_path / "hero.glb")


def test_the_page_is_the_same_again_and_the_mannequins_has_nothing_of_it(tmp_path, hero):
    for name in ("a.html", "b.html"):
        write_character_page(tmp_path / name, hero)
    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()
    write_character_page(tmp_path / "mannequin.html", None)
    text = (tmp_path / "mannequin.html").read_text()
    assert "Three" not in text and 'id="character"' not in text
    assert len(text) < (tmp_path / "a.html").stat().st_size


def test_the_bundle_is_of_the_version_that_is_said():
    folder = resources.files("choreograph.view") / "page" / "three"
    wanted = json.loads((folder / "package.json").read_text())["dependencies"]["three"]
    bundled = re.search(r'__THREE__\w*[^"]*"(\d+)"', (folder / "three.min.js").read_text())
    assert bundled and wanted.split(".")[1] == bundled[1]
    assert "MIT License" in (folder / "LICENSE").read_text().replace("The MIT", "MIT")


@pytest.mark.parametrize("extension", ["KHR_draco_mesh_compression", "KHR_texture_basisu"])
def test_a_compressed_character_is_refused_before_any_work(tmp_path, hero, extension):
    hero.document.json["extensionsUsed"] = [extension]
    with pytest.raises(ParameterError, match="without compression"):
        write_character_page(tmp_path / "a.html", hero)
    assert not (tmp_path / "a.html").exists()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["mixamo", "unreal", "vrm that looks back", "child"])
def test_joints_in_the_browser_are_where_the_figure_has_them(opened, tmp_path, name):
    write_character(tmp_path / "c.glb", CHARACTERS[name])
    character = read_character(tmp_path / "c.glb")
    write_character_page(tmp_path / "a.html", character)
    page = opened("a.html", folder=tmp_path)
    figure = perform(DANCE, character.rig, character.bones, character.skin).motion
    names = json.loads(
        re.search(r'id="dance"[^>]*>(.*?)</script>', (tmp_path / "a.html").read_text(), re.S)[1]
    )
    for _ in range(3):
        page.keyboard.press("ArrowRight")
        until(page, f"choreograph.time === {round(state(page, 'time'))}")
        frame = round(state(page, "time") * figure.fps)
        found = np.array(state(page, "joints"))
        wanted = [figure.skeleton.index(joint) for joint in names["names"]]
        np.testing.assert_allclose(found, figure.joint_pos_m()[frame, wanted], atol=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("viewport", [{"width": 900, "height": 640}, {"width": 390, "height": 780}])
def test_the_character_is_seen_in_its_own_colours(opened, tmp_path, hero, viewport):
    for material in hero.document.json["materials"]:
        material["pbrMetallicRoughness"]["baseColorFactor"] = [0.9, 0.0, 0.5, 1.0]
    write_character_page(tmp_path / "a.html", hero)
    page = opened("a.html", folder=tmp_path, viewport=viewport)
    seen = picture(page)
    pink = (seen[..., 0] > seen[..., 1] + 60) & (seen[..., 2] > seen[..., 1] + 20)
    rows = np.flatnonzero(pink.any(axis=1))
    assert 0.01 < pink.mean() < 0.5
    assert rows[0] > 0.02 * len(seen) and rows[-1] < 0.98 * len(seen)  # neither cut off above nor below


@pytest.mark.slow
def test_playing_pausing_and_mirroring(opened, tmp_path, hero):
    write_character_page(tmp_path / "a.html", hero)
    page = opened("a.html", folder=tmp_path)
    page.keyboard.press("Space")
    until(page, "choreograph.playing && choreograph.time > 0")  # a slow machine draws few of the 8 s
    page.keyboard.press("Space")
    until(page, "!choreograph.playing")
    assert 0 < state(page, "time") < state(page, "duration")
    page.keyboard.press("m")
    assert state(page, "mirrored")
    page.keyboard.press("End")
    until(page, "choreograph.time === choreograph.duration")
    assert np.isfinite(state(page, "joints")).all()


@pytest.mark.slow
def test_a_character_that_cannot_be_drawn_is_said(opened, tmp_path, hero):
    """A damaged mesh: the song and the timeline go on."""
    character = hero
    mesh = character.document.json["meshes"][0]["primitives"][0]
    mesh["attributes"]["NORMAL"] = 9999
    write_character_page(tmp_path / "a.html", character)
    page = opened("a.html", folder=tmp_path)
    until(page, "!document.getElementById('notice').hidden")
    assert "cannot be shown" in page.locator("#notice").inner_text()
