"""The studio in headless Chromium, as stories: songs, takes and characters in, files out."""

from __future__ import annotations

import base64
import json
import time

import numpy as np
import pytest
from heads_in_blender import bone_heads_m
from studio_pages import PATIENCE_S, drop, opening, select, serving, shown, until
from synthetic_characters import CHARACTERS, write_character
from synthetic_motions import stepping

from choreograph.formats.fbx import find_blender
from choreograph.formats.gltf_document import read_gltf
from choreograph.formats.register import load_motion, save_motion
from choreograph.studio import file_routes

pytestmark = pytest.mark.slow

SKELETON_IS_DRAWN = """(() => {
  const canvas = document.getElementById('skeleton'), blank = document.createElement('canvas');
  Object.assign(blank, { width: canvas.width, height: canvas.height });
  return canvas.toDataURL() !== blank.toDataURL();
})()"""


def exported(page, folder):
    """Press the button of the export panel, and save the file that is downloaded."""
    with page.expect_download(timeout=1000 * PATIENCE_S) as download:
        page.click("#export-form [type=submit]")
    path = folder / download.value.suggested_filename
    download.value.save_as(path)
    return path


def test_a_span_is_exported_and_read_again(danced, browser, tmp_path):
    with opening(browser, danced, accept_downloads=True) as page:
        shown(page)
        select(page, 4.0, 8.0)
        page.click("#tab-export")
        page.check("[name=format][value=bvh]")
        page.check("[name=part][value=span]")
        motion = load_motion(exported(page, tmp_path))
        from_s, to_s = page.evaluate("[studio.span.from, studio.span.to]")
        assert motion.duration_s == pytest.approx(to_s - from_s, abs=0.05)


def test_a_newcomers_task(browser, tmp_path, song, record_property):
    """Song in, change the second half, own character, GLB out: at most 12 actions, at most a minute."""
    write_character(tmp_path / "hero.glb", CHARACTERS["mixamo"])
    (tmp_path / "work").mkdir()
    with (
        serving(tmp_path / "work") as address,
        opening(browser, address, accept_downloads=True) as page,
    ):
        since, actions = time.monotonic(), 0

        def act(do, *arguments) -> None:
            nonlocal actions
            actions += 1
            do(*arguments)

        act(drop, page, song)
        until(page, "studio.playing && studio.time > 0.1")
        act(select, page, 6.0, 10.0)
        until(page, "document.querySelectorAll('#alternatives button').length > 0")
        act(page.locator("#alternatives button").first.click)
        shown(page, "studio.dance.edits.length === 1")
        act(drop, page, tmp_path / "hero.glb")
        shown(page, "studio.character === 'hero.glb'")
        act(page.click, "#to-export")
        act(page.check, "[name=format][value=glb]")
        actions += 1
        path = exported(page, tmp_path)
        record_property("actions", actions)
        record_property("seconds", time.monotonic() - since)
        assert actions <= 12
    document = read_gltf(path)
    assert len(document.json["animations"]) == 1
    assert any("mixamorig:Hips" in node.get("name", "") for node in document.json["nodes"])
    assert load_motion(path).duration_s == pytest.approx(12.4, abs=0.1)


def drop_folder(page, paths) -> None:
    """Drop a folder of files on the page. A script cannot make the entry of a folder, so one is put there."""
    page.evaluate(
        """(files) => {
             const made = files.map(([name, text]) =>
               new File([Uint8Array.from(atob(text), (c) => c.charCodeAt(0))], name));
             const entries = made.map((file) => ({ isFile: true, file: (got) => got(file) }));
             const parts = [entries, []]; // a reader returns some entries at a time, and at last none
             const reader = { readEntries: (got) => got(parts.shift()) };
             const folder = { isFile: false, createReader: () => reader };
             DataTransferItem.prototype.webkitGetAsEntry = () => folder;
             const transfer = new DataTransfer();
             transfer.items.add(new File([], "takes"));
             for (const name of ["dragenter", "dragover", "drop"]) {
               const event = new DragEvent(name, { dataTransfer: transfer, bubbles: true, cancelable: true });
               document.getElementById("stage").dispatchEvent(event);
             }
           }""",
        [[path.name, base64.b64encode(path.read_bytes()).decode("ascii")] for path in paths],
    )


def test_a_folder_of_takes_is_dropped_built_and_danced_with(browser, tmp_path, song, monkeypatch):
    build = (
        file_routes.build
    )  # with the preset of the quickest build, since the page has no choice of presets
    monkeypatch.setattr(
        file_routes, "build", lambda takes, output, preset, job: build(takes, output, "tiny", job)
    )
    paths = []
    for seed in range(2):
        paths.append(tmp_path / f"walk{seed}.bvh")
        save_motion(paths[-1], stepping(24 * 30, seed=seed))
    (tmp_path / "work").mkdir()
    with serving(tmp_path / "work") as address, opening(browser, address) as page:
        drop(page, song)
        until(page, "studio.playing && studio.time > 0.1")
        drop_folder(page, paths)
        until(page, "/walk1.bvh/.test(document.getElementById('build-log').textContent)")
        page.reload()  # the build goes on without the page, but is not danced with
        until(page, "window.studio !== undefined")
        shown(page)
        drop_folder(page, paths)
        until(page, "studio.dance && studio.dance.takes.every(({ name }) => /^walk/.test(name))")
        shown(page)
        assert "my-takes.h5" in page.inner_text("#repertoire")
        page.click("#undo")
        shown(page, "studio.dance.takes.some(({ name }) => !/^walk/.test(name))")


def test_a_bone_is_changed_and_the_character_is_written_for_blender(browser, tmp_path, song):
    """The file is opened in Blender where there is one, and by our reader in any case."""
    write_character(tmp_path / "hero.glb", CHARACTERS["mixamo"])
    (tmp_path / "work").mkdir()
    with (
        serving(tmp_path / "work") as address,
        opening(browser, address, accept_downloads=True) as page,
    ):
        drop(page, song)
        until(page, "studio.playing && studio.time > 0.1")
        drop(page, tmp_path / "hero.glb")
        shown(page, "studio.character === 'hero.glb'")
        page.click("#tab-character")
        select_head = page.locator("#bones select").nth(page.evaluate("studio.joints.indexOf('head')"))
        before = select_head.input_value()
        select_head.select_option("")
        until(page, "studio.bones && !('head' in studio.bones)")
        page.reload()
        until(page, "window.studio !== undefined")
        shown(page, "!('head' in studio.bones)")
        page.click("#tab-character")
        until(page, SKELETON_IS_DRAWN)
        select_head.select_option(before)
        until(page, f"studio.bones.head === {json.dumps(before)}")
        shown(page)
        page.click("#to-export")
        page.check("[name=format][value=glb]")
        path = exported(page, tmp_path)
    motion = load_motion(path)
    assert motion.duration_s == pytest.approx(12.4, abs=0.1)
    if find_blender() is not None:
        frames = [0, 120, 600]
        heads = bone_heads_m([path], frames, 60.0, tmp_path)[path.name]
        names = [name.rpartition(":")[2] for name in heads]
        assert "Hips" in names and "Head" in names
        hips_m = np.array(heads[list(heads)[names.index("Hips")]])
        assert np.abs(np.diff(hips_m, axis=0)).max() > 0.01  # it dances there
        ours_m = motion.root_pos_m[frames]
        assert np.abs((hips_m - hips_m[0]) - (ours_m - ours_m[0])).max() < 0.02


def test_a_file_that_is_no_song_is_refused_in_words(danced, browser, tmp_path):
    (tmp_path / "broken.wav").write_bytes(b"no song at all" * 100)
    with opening(browser, danced) as page:
        shown(page)
        revision = page.evaluate("studio.revision")
        drop(page, tmp_path / "broken.wav")
        page.wait_for_selector(".message.error")
        assert "broken.wav" in page.inner_text(".message.error")
        assert page.evaluate("studio.revision") == revision
        page.keyboard.press("Space")
        until(page, "studio.playing")
