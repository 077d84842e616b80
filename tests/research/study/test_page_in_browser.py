"""The rating page in headless Chromium: playback, answers by key, mouse and touch, reloading and saving."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from browsers import SWIFTSHADER, opening_pages, until
from synthetic_studies import read_key, small_study

from research.study.results import read_study

pytestmark = pytest.mark.slow

PHONE = {"viewport": {"width": 390, "height": 844}, "has_touch": True, "is_mobile": True}


@pytest.fixture(scope="module")
def browser(chromium):
    return chromium(SWIFTSHADER)


@pytest.fixture
def study(tmp_path) -> Path:
    return small_study(tmp_path, n_songs=1)


@pytest.fixture
def opened(browser, study):
    """Open the study; any error or outside request of the page fails the test."""
    drawn = "window.choreograph !== undefined && choreograph.framesDrawn > 0"
    with opening_pages(browser, drawn) as open_page:

        def opened_study(context=None, **options):
            options = {"viewport": {"width": 1280, "height": 800}, **options}
            return open_page(study / "study.html", context=context, **options)

        yield opened_study


def saved(page, folder: Path) -> Path:
    with page.expect_download() as download:
        page.click("#save")
    path = folder / download.value.suggested_filename
    download.value.save_as(path)
    return path


def test_rate_by_key_reload_and_save(opened, study):
    page = opened()
    page.fill("#rater-name", " Ann ")
    page.click("#begin")
    for key in "452":
        page.keyboard.press(key)
    first = {"variation": 4, "naturalness": 5, "style": 2}
    assert page.evaluate("choreograph.answers") == {"1": first}
    page.keyboard.press("n")
    until(page, "choreograph.item === '2'")
    page.reload()
    until(page, "window.choreograph !== undefined", timeout_s=20)
    assert page.evaluate("choreograph.answers") == {"1": first}
    assert page.evaluate("choreograph.item") == "2"
    assert page.input_value("#rater-name") == "Ann"
    page.click("#begin")
    page.keyboard.press("p")
    until(page, "choreograph.item === '1'")
    page.keyboard.press("0")  # the unanswered question is highlighted
    for dance in "23":
        page.keyboard.press("n")
        until(page, f"choreograph.item === '{dance}'")
        for key in "3333":
            page.keyboard.press(key)
    assert page.inner_text("#done") == "all answered"
    page.keyboard.press("n")
    path = saved(page, study)
    rating = json.loads(path.read_text(encoding="utf-8"))
    assert path.name == f"rating-{rating['rater_id']}.json"
    assert (rating["rater_name"], rating["save"]) == ("Ann", 1)
    assert rating["answers"]["1"] == {**first, "rhythm": 0}
    assert path.name in page.inner_text("#saved")
    score = {(s.variant, s.question): s.mean for s in read_study(study).scores}
    assert score[read_key(study)["dances"][0]["variant"], "naturalness"] == 5.0
    page.click("#another")
    until(page, "window.choreograph !== undefined && choreograph.item === '1'", timeout_s=20)
    assert page.evaluate("choreograph.answers") == {}


def test_dances_play_in_sync_with_their_song_and_differ(opened):
    page = opened()
    page.click("#begin")
    page.click("#big-play")
    until(page, "choreograph.playing && choreograph.audioTime > 0.2")
    behind_s = page.evaluate(  # right after a frame was drawn
        """new Promise((resolve) => requestAnimationFrame(() =>
             resolve(choreograph.time - choreograph.audioTime)))"""
    )
    assert abs(behind_s) < 0.1
    page.keyboard.press("Space")
    until(page, "!choreograph.playing")
    first = page.evaluate("choreograph.joints")
    page.click("#next")
    until(page, "choreograph.item === '2' && choreograph.playing && choreograph.time > 0.1")
    assert page.evaluate("choreograph.joints") != first
    until(page, "!choreograph.playing && choreograph.time > 1.3")
    page.locator("#seek").fill("0.5")
    until(page, "Math.abs(choreograph.time - 0.5) < 0.02")


def test_a_study_saved_half_way_lists_unrated_dances(opened, study):
    page = opened()
    page.click("#begin")
    for _ in range(2):
        page.click("#next")
    until(page, "choreograph.item === '3'")
    page.locator("fieldset").nth(1).locator("label").nth(4).click()
    page.click("#next")
    assert page.locator("#open-dances button").all_inner_texts() == ["1", "2", "3"]
    assert json.loads(saved(page, study).read_text(encoding="utf-8"))["answers"] == {"3": {"naturalness": 4}}
    page.locator("#open-dances button").nth(1).click()
    until(page, "choreograph.item === '2'")
    assert not page.locator("#finish").is_visible()


@pytest.fixture
def compared(tmp_path) -> Path:
    return small_study(tmp_path, n_songs=1, ask="pairs")


def test_pairs_are_watched_in_turn_and_answered_by_key_and_mouse(browser, compared):
    drawn = "window.choreograph !== undefined && choreograph.framesDrawn > 0"
    with opening_pages(browser, drawn) as open_page:
        page = open_page(compared / "study.html", viewport={"width": 1280, "height": 800})
        assert "3 pairs of dances" in page.inner_text("#task")
        page.click("#begin")
        assert page.inner_text("#heading") == "Pair 1 of 3"
        assert "Which is more waltz?" in page.inner_text("#questions")
        page.click("#big-play")
        until(page, "choreograph.playing && choreograph.time > 0.3")
        first = page.evaluate("choreograph.joints")
        page.keyboard.press("s")
        until(page, "choreograph.side === 1 && choreograph.playing && choreograph.time > 0.4")
        assert page.evaluate("choreograph.joints") != first
        page.click("#side-0")
        assert page.evaluate("choreograph.side") == 0
        page.keyboard.press("b")
        page.locator("fieldset").nth(1).locator("label").first.click()
        sides = {pair["pair"]: pair["dances"] for pair in read_key(compared)["pairs"]}
        answered = {"p1": {"genre": sides["p1"][1], "computer": sides["p1"][0]}}
        assert page.evaluate("choreograph.answers") == answered
        for pair in ("p2", "p3"):
            page.keyboard.press("n")
            until(page, f"choreograph.item === '{pair}'")
            page.keyboard.press("a")
            page.keyboard.press("a")
        page.keyboard.press("p")
        until(page, "choreograph.item === 'p2'")
        assert page.locator("fieldset input:checked").count() == 2
        page.keyboard.press("n")
        until(page, "choreograph.item === 'p3'")
        assert page.inner_text("#done") == "all answered"
        page.keyboard.press("n")
        rating = json.loads(saved(page, compared).read_text(encoding="utf-8"))
    assert rating["answers"]["p1"] == answered["p1"] and rating["version"] == 1
    assert sum(p.n_answers for p in read_study(compared).preferences) == 6


def test_a_phone(opened):
    page = opened(**PHONE)
    page.tap("#begin")
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    labels = page.locator(".scale label")
    for row in range(4):
        box = labels.nth(6 * row + 3).bounding_box()
        assert box["height"] >= 40 and box["width"] >= 40
        labels.nth(6 * row + 3).tap()
    assert set(page.evaluate("choreograph.answers")["1"].values()) == {3}
    for name in ("next", "play"):
        box = page.locator(f"#{name}").bounding_box()
        assert box["y"] + box["height"] <= 844
    page.tap("#next")
    until(page, "choreograph.item === '2'")
