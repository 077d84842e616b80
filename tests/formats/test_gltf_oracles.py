"""glTF files as other programs see them: the Khronos validator, three.js and three-vrm.

They are npm packages: `npm ci` in tests/javascript. Without them, or without Chromium, these tests skip.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import threading
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import numpy as np
import pytest
from browsers import SWIFTSHADER, until
from synthetic_characters import CHARACTERS, VRM, write_character
from synthetic_motions import on_other_axes, swaying

from choreograph.characters.character import read_character
from choreograph.formats.glb import GlbWriter, clips_document
from choreograph.formats.register import save_motion
from choreograph.formats.writer import NAMES, TARGETS
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import CANONICAL_JOINTS

PROGRAMS = tuple(name for name in TARGETS if name != "mmd")
JAVASCRIPT = Path(__file__).resolve().parents[1] / "javascript"

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        not (JAVASCRIPT / "node_modules").is_dir() or shutil.which("node") is None,
        reason="no packages to compare with: npm ci in tests/javascript",
    ),
]


@pytest.fixture(scope="module")
def motion() -> Motion:
    return swaying(120, fps=60.0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory, motion) -> Path:
    """Files of all kinds, and what loads them."""
    folder = tmp_path_factory.mktemp("gltf")
    save_motion(folder / "dance.glb", motion)
    save_motion(folder / "other.glb", on_other_axes(motion, 2))
    save_motion(folder / "dance.vrma", motion)
    several = clips_document({"first": swaying(90, fps=60.0), "second": motion}, TARGETS["unreal"])
    (folder / "dances.glb").write_bytes(several.to_glb())
    for name in PROGRAMS:
        writer = GlbWriter()
        writer.target = TARGETS[name]
        save_motion(folder / f"dance-{name}.glb", motion, writer=writer)
    for number, (name, spec) in enumerate(CHARACTERS.items()):
        write_character(folder / f"character-{number}.glb", spec)
        dancing = read_character(folder / f"character-{number}.glb").dancing(motion)
        (folder / f"dancing-{number}.glb").write_bytes(dancing.to_glb())
        if name == "vrm":
            shutil.copy(folder / f"character-{number}.glb", folder / "avatar.vrm")
    shutil.copy(JAVASCRIPT / "load.html", folder)
    (folder / "node_modules").symlink_to(JAVASCRIPT / "node_modules")
    return folder


@pytest.fixture(scope="module")
def page(chromium, folder):
    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, *arguments) -> None:
            pass

    Quiet.extensions_map[".js"] = "text/javascript"  # whatever this machine says
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(folder)))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    page = chromium(SWIFTSHADER).new_page()
    page.goto(f"http://127.0.0.1:{server.server_port}/load.html")
    until(page, "window.loaded === true", timeout_s=30)
    yield page
    server.shutdown()


def test_the_validator_finds_nothing(folder):
    paths = sorted([*folder.glob("d*.glb"), folder / "other.glb", folder / "dance.vrma"])
    found = subprocess.run(
        ["node", JAVASCRIPT / "validate.js", *paths],
        capture_output=True,
        text=True,
        check=True,
        cwd=JAVASCRIPT,
    )
    for path, report in zip(paths, json.loads(found.stdout), strict=True):
        assert (report["errors"], report["warnings"]) == (0, 0), (path.name, report["messages"])


def test_three_js_shows_the_dance(page, motion):
    frame = 73
    shown = page.evaluate(f"posed('dance.glb', {frame / motion.fps})")
    pos = motion.joint_pos_m()[frame]
    for joint, name in enumerate(motion.skeleton.names):
        np.testing.assert_allclose(shown[name], pos[joint], atol=1e-3)


@pytest.mark.parametrize("name", PROGRAMS)
def test_three_js_shows_a_dance_for_a_program(page, motion, name):
    frame = 73
    shown = page.evaluate(f"posed('dance-{name}.glb', {frame / motion.fps})")
    path_m = motion.root_pos_m[frame] * [1.0, 0.0, 1.0]
    pos = motion.joint_pos_m()[frame] - (path_m if TARGETS[name].in_place else 0.0)
    for joint, role in enumerate(motion.skeleton.names):
        own = NAMES[TARGETS[name].naming][role].replace(".", "")  # three.js removes dots
        np.testing.assert_allclose(shown[own], pos[joint], atol=1e-3)


def test_three_js_shows_the_second_of_several_dances(page, motion):
    shown = page.evaluate(f"posed('dances.glb', {73 / motion.fps}, 1)")
    for joint, role in enumerate(motion.skeleton.names):
        np.testing.assert_allclose(shown[NAMES["ue"][role]], motion.joint_pos_m()[73, joint], atol=1e-3)


def test_three_vrm_puts_the_animation_on_an_avatar(page, motion):
    frame = 73
    shown = page.evaluate(f"posedAvatar('avatar.vrm', 'dance.vrma', {frame / motion.fps})")
    pos = motion.joint_pos_m()[frame]
    # The avatar has the canonical body's proportions, so that it is where the dancer is.
    for part in ("pelvis", "left_elbow", "right_wrist", "left_knee", "right_ankle", "head"):
        np.testing.assert_allclose(shown[VRM[part]], pos[CANONICAL_JOINTS.index(part)], atol=2e-3)


def test_three_js_shows_a_character_that_dances(page, motion):
    number = list(CHARACTERS).index("unreal")
    shown = page.evaluate(f"posed('dancing-{number}.glb', 1.0)")
    pos = motion.joint_pos_m()[60]
    names = CHARACTERS["unreal"].names
    for start, end in (("left_shoulder", "left_elbow"), ("right_elbow", "right_wrist")):
        own = np.subtract(shown[names[end]], shown[names[start]])
        dancers = pos[CANONICAL_JOINTS.index(end)] - pos[CANONICAL_JOINTS.index(start)]
        np.testing.assert_allclose(own, dancers, atol=1e-3)
