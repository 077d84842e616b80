"""Several dancers on the page of the studio: their number, formation and relation, edits, undo and files."""

from __future__ import annotations

import numpy as np
import pytest
from studio_pages import PHONE, opening, select, shown, until

import choreograph as cg

pytestmark = pytest.mark.slow
FORMATION, RELATION = "#dancers-form select >> nth=0", "#dancers-form select >> nth=1"


def set_number(page, n: int) -> None:
    page.fill("#dancers-form input", str(n))
    page.press("#dancers-form input", "Tab")
    shown(page, f"studio.dancers.length === {n}")


def changed(page, act) -> None:
    revision = page.evaluate("studio.revision")
    act()
    shown(page, f"studio.revision > {revision}")


def test_dancers_are_where_the_scene_has_them_and_follow_an_edit(danced, browser, song):
    with opening(browser, danced) as page:
        shown(page)
        page.keyboard.press("4")
        assert not page.is_visible(FORMATION)
        set_number(page, 4)
        assert page.evaluate(
            "document.activeElement.matches('#dancers-form select')"
        )  # the one that has come
        changed(page, lambda: page.select_option(FORMATION, "line"))
        changed(page, lambda: page.select_option(RELATION, "mirror"))
        page.evaluate("studio.seek(3)")
        until(page, "Math.abs(studio.time - 3) < 0.02")
        scene = cg.scene(song, dancers=4, formation="line", relation="mirror")
        at_m = [motion.joint_pos_m()[180] for motion in scene.motions]
        until(page, f"Math.abs(studio.dancers[3][0] - {at_m[3][0, 0]}) < 0.01")
        there_m = np.array(page.evaluate("studio.dancers")).reshape(4, -1, 3)
        assert np.abs(there_m - np.array(at_m)).max() < 0.005
        assert page.text_content("#dancers-note").startswith("What you change is the dance of the leader")
        select(page, 2.0, 4.0)
        changed(page, lambda: page.keyboard.press("x"))
        page.evaluate("studio.seek(3)")
        until(page, f"Math.abs(studio.dancers[0][6] - {there_m[0, 2, 0]}) > 0.001")
        right, left, *_ = np.array(page.evaluate("studio.dancers")).reshape(4, -1, 3)
        assert np.abs(right[0] - left[0] * [-1, 1, 1]).max() < 0.01  # the pelvis is mirrored
        for n in (4, 4, 4, 1):
            changed(page, lambda: page.click("#undo"))
            assert len(page.evaluate("studio.dancers")) == n


def test_a_part_of_the_song_has_a_formation_of_its_own(danced, browser):
    with opening(browser, danced) as page:
        shown(page)
        page.click("#tab-settings")
        set_number(page, 3)
        select(page, 4.0, 8.0)
        page.check("#only-span")
        changed(page, lambda: page.select_option(FORMATION, "circle"))
        until(page, "document.querySelectorAll('#dancers-parts li').length === 1")
        assert "circle" in page.text_content("#dancers-parts li")
        assert page.input_value(FORMATION) == "circle"
        page.uncheck("#only-span")
        assert page.input_value(FORMATION) == "v"
        changed(page, lambda: page.press("#dancers-parts button", "Enter"))
        assert page.locator("#dancers-parts li").count() == 0
        assert page.evaluate("document.activeElement.matches('#dancers-form select')")
        set_number(page, 1)


def test_all_dancers_are_exported_and_compared(danced, browser, tmp_path):
    with opening(browser, danced) as page:
        shown(page)
        page.click("#tab-compare")
        page.click("#keep-A")
        page.click("#tab-settings")
        set_number(page, 2)
        page.click("#tab-compare")
        page.click("#keep-B")
        until(page, "!document.querySelector('#show-B').disabled")
        for slot, n in (("A", 1), ("B", 2)):
            page.click(f"#show-{slot}")
            until(page, f"studio.dancers.length === {n}")
        page.click("#show-both")
        page.click("#show-current")
        page.click("#tab-export")
        packed = "a .zip with a file for each dancer"
        assert packed not in page.text_content(".format:has([value=glb])")
        assert packed in page.text_content(".format:has([value=bvh])")
        page.check("#formats [value=bvh]")
        with page.expect_download() as told:
            page.click("#export-form [type=submit]")
        assert told.value.suggested_filename.endswith("-bvh.zip")
        page.click("#tab-settings")
        set_number(page, 1)


def test_a_phone_shows_the_dancers_and_their_controls(danced, browser):
    with opening(browser, danced, PHONE) as page:
        shown(page)
        page.click("#tab-settings")
        set_number(page, 4)
        assert page.evaluate("document.documentElement.scrollWidth") == PHONE[0]
        unnamed = """[...document.querySelectorAll('#dancers-form input, #dancers-form select')]
            .filter((control) => !control.labels[0]?.textContent.trim()).length"""
        assert page.evaluate(unnamed) == 0
        for control in ("#dancers-form input", FORMATION, RELATION):
            box = page.locator(control).bounding_box()
            assert box["x"] >= 0 and box["x"] + box["width"] <= PHONE[0]
        set_number(page, 1)
