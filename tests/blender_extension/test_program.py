"""The part of the extension that runs the program, without Blender."""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
import time
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from command_line import run
from synthetic_characters import CHARACTERS, write_character
from synthetic_motions import stepping

from choreograph.characters.character import perform, read_character
from choreograph.formats.gltf import read_rig
from choreograph.formats.gltf_document import read_gltf
from choreograph.pipeline.saving import save_on_character

FOLDER = Path(__file__).resolve().parents[2] / "blender_extension"


@pytest.fixture(scope="module")
def modules():
    """`program` and `glb` of the extension, whose package itself needs bpy."""
    package = ModuleType("extension_without_blender")
    package.__path__ = [str(FOLDER)]
    sys.modules[package.__name__] = package
    yield [importlib.import_module(f"{package.__name__}.{name}") for name in ("program", "glb")]
    for name in [name for name in sys.modules if name.startswith(package.__name__)]:
        del sys.modules[name]


@pytest.fixture
def skeleton(modules):
    """Hips, a thigh and a shin, the hips turned."""
    _, glb = modules
    translations = np.array([[0.0, 0.9, 0.0], [0.1, 0.0, 0.0], [0.0, 0.4, 0.0]])
    quats = np.array([[0.8, 0.0, 0.6, 0.0], [0.0, 0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 0.0]])
    parents = (-1, 0, 1)
    world = []
    for parent, translation, (w, x, y, z) in zip(parents, translations, quats, strict=True):
        own = np.eye(4)
        own[:3, :3] = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
        own[:3, 3] = translation
        world.append(own if parent < 0 else world[parent] @ own)
    corners = np.array([[-0.2, -0.01, -0.1], [0.2, 1.0, 0.1]])
    return glb.Skeleton(
        ("hips", "thigh", "shin"), parents, translations, quats, np.array(world), 1.0, corners
    )


@pytest.fixture
def program(tmp_path):
    """Makes a program of Python lines."""

    def made(*lines: str) -> str:
        path = tmp_path / "choreograph"
        path.write_text("\n".join([f"#!{sys.executable}", "import os, sys, time", *lines]))
        path.chmod(0o755)
        return str(path)

    return made


def until(condition, *, within_s: float = 20.0) -> None:
    """Wait for a condition."""
    end = time.monotonic() + within_s
    while not condition():
        assert time.monotonic() < end, "it did not come"
        time.sleep(0.01)


def test_a_skeleton_is_read_by_the_program_as_it_was_written(modules, skeleton, tmp_path):
    _, glb = modules
    glb.write_skeleton(tmp_path / "a.glb", skeleton)
    found = read_rig(read_gltf(tmp_path / "a.glb"))
    assert found.rig.names == skeleton.names and found.nodes == (0, 1, 2)
    assert found.rig.parents.tolist() == list(skeleton.parents)
    np.testing.assert_allclose(found.rig.bind_pos_m, skeleton.world[:, :3, 3], atol=1e-6)
    np.testing.assert_allclose(found.rig.rest_world(), skeleton.world, atol=1e-6)
    assert found.rig.floor_m == pytest.approx(-0.01, abs=1e-6)


def test_tracks_are_read_as_the_program_writes_them(modules, tmp_path):
    _, glb = modules
    path = tmp_path / "hero.glb"
    write_character(path, CHARACTERS["unreal"])
    character = read_character(path)
    performance = perform(stepping(30, fps=30.0), character.rig, character.bones)
    save_on_character(tmp_path / "out.glb", stepping(30, fps=30.0), character)
    tracks = glb.read_tracks(tmp_path / "out.glb")
    assert tracks.n_frames == 30
    assert set(tracks.quats) == {character.nodes[bone] for bone in performance.local_quat}
    for bone, quats in performance.local_quat.items():
        np.testing.assert_allclose(tracks.quats[character.nodes[bone]], quats, atol=1e-6)
    for bone, places in performance.translation.items():
        np.testing.assert_allclose(tracks.translations_m[character.nodes[bone]], places, atol=1e-6)


def test_every_option_that_it_gives_is_one_of_the_programs(modules):
    request = modules[0].Request(
        Path("song.mp3"), 30.0, 1.0, 2.0, 3, "house", ("0-2=take:a",), "rep.h5", "map.json"
    )
    shown = run("dance", "--help").output
    given = [word for word in (*request.arguments(), "--json") if word.startswith("--")]
    assert len(given) == 9
    for option in given:
        assert f"{option} " in shown, option


def test_progress_is_read_while_it_runs_and_it_can_be_stopped(modules, program, skeleton):
    lines = ("print('warping 3/12', file=sys.stderr, flush=True)", "time.sleep(60)")
    running = modules[0].Run(program(*lines), modules[0].Request(Path("song.mp3"), 30.0), skeleton)
    until(lambda: running.stage == "warping")
    assert running.fraction == pytest.approx(0.25) and not running.ended()
    folder = running._character.parent
    assert folder.is_dir()
    running.stop()
    assert running.ended() and not folder.exists()


@pytest.mark.skipif(os.name == "nt", reason="a wrapper in shell")
def test_stopping_ends_all_that_a_wrapper_started_within_a_second(modules, skeleton, tmp_path):
    """A wrapper in shell starts a child that ignores the request to end, as users' wrappers do."""
    stubborn, wrapper, pid_file = (tmp_path / name for name in ("stubborn.py", "choreograph", "pid"))
    stubborn.write_text(
        "import os, pathlib, signal, sys, time\n"
        "signal.signal(signal.SIGTERM, signal.SIG_IGN)\n"
        f"pathlib.Path({str(pid_file)!r}).write_text(str(os.getpid()))\n"
        "print('warping 1/2', file=sys.stderr, flush=True)\n"
        "time.sleep(89)\n"
    )
    wrapper.write_text(f"#!/bin/sh\n{sys.executable} {stubborn}\necho done\n")
    wrapper.chmod(0o755)
    running = modules[0].Run(str(wrapper), modules[0].Request(Path("song.mp3"), 30.0), skeleton)
    until(lambda: running.stage == "warping")
    child = int(pid_file.read_text())
    assert is_running(child)
    began_s = time.monotonic()
    running.stop()
    took_s = time.monotonic() - began_s
    assert running.ended() and took_s < 1.0
    until(lambda: not is_running(child), within_s=1.0 - took_s)


def is_running(pid: int) -> bool:
    """Whether a process is there and has not ended; one that nobody waits for has."""
    found = subprocess.run(
        ["ps", "-o", "stat=", "-p", str(pid)], capture_output=True, text=True, check=False
    ).stdout.strip()
    return bool(found) and not found.startswith("Z")


def test_a_program_that_ends_when_asked_is_not_killed(modules, program, skeleton, tmp_path):
    lines = (
        "import signal",
        f"tidy = lambda *_: (open({str(tmp_path / 'tidied')!r}, 'w').close(), sys.exit(1))",
        "signal.signal(signal.SIGTERM, tidy)",
        "print('warping 1/2', file=sys.stderr, flush=True)",
        "time.sleep(60)",
    )
    running = modules[0].Run(program(*lines), modules[0].Request(Path("song.mp3"), 30.0), skeleton)
    until(lambda: running.stage == "warping")
    running.stop()
    assert running.ended() and (tmp_path / "tidied").exists()


def test_its_error_is_its_last_line(modules, program, skeleton):
    lines = (
        "print('analysing the song 0/0', file=sys.stderr)",
        "print('choreograph: expected a song, got none', file=sys.stderr)",
        "sys.exit(2)",
    )
    running = modules[0].Run(program(*lines), modules[0].Request(Path("song.mp3"), 30.0), skeleton)
    with pytest.raises(modules[0].DanceError, match=r"^expected a song, got none$"):
        running.dance()
    assert not running._character.parent.exists()


@pytest.mark.parametrize(("content", "says"), [("#!/bin/sh\n", "got nothing"), ("no program", "Exec format")])
def test_another_program_is_told_from_choreograph(modules, skeleton, tmp_path, content, says):
    path = tmp_path / "choreograph"
    path.write_text(content)
    path.chmod(0o755)
    with pytest.raises(modules[0].DanceError, match=says):
        modules[0].Run(str(path), modules[0].Request(Path("song.mp3"), 30.0), skeleton).dance()


def test_pythons_variables_stay_in_blender(modules, program, skeleton, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", "/blender")
    lines = ("print('choreograph:', os.environ.get('PYTHONPATH'), file=sys.stderr)", "sys.exit(2)")
    running = modules[0].Run(program(*lines), modules[0].Request(Path("song.mp3"), 30.0), skeleton)
    with pytest.raises(modules[0].DanceError, match="None"):
        running.dance()


def test_without_the_program_a_line_says_what_to_install(modules, skeleton, tmp_path):
    with pytest.raises(modules[0].DanceError, match="pip install choreograph"):
        modules[0].Run(str(tmp_path / "nothing"), modules[0].Request(Path("song.mp3"), 30.0), skeleton)
