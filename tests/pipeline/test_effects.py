"""No request is ignored: each option changes the files, and each setting the dances, that it is declared for.

They are judged by what is written and danced, with and without them. Others are refused.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import av
import numpy as np
import pytest
from command_line import all_commands
from synthetic_characters import CHARACTERS, write_character

import choreograph as cg
from choreograph.cli.declared import Declared
from choreograph.core.errors import ChoreographError, ParameterError
from choreograph.core.settings import described
from choreograph.formats import formats_using, output_formats
from choreograph.formats.bvh import BvhOptions
from choreograph.formats.register import load_motion
from choreograph.settings import DanceConfig, settings_of

pytestmark = pytest.mark.slow
SONG = cg.example_songs()["house"]
OPTIONS = {
    "character": "hero.glb", "bvh": BvhOptions(naming="ue"), "loop": True, "click": True, "camera": "front",
    "target": "unreal",
}  # fmt: skip


@pytest.fixture(scope="module")
def danced() -> dict[str, cg.Dance]:
    return {fps: cg.dance(SONG, duration_s=6.0, fps=float(fps)) for fps in ("60", "30")}


def test_every_option_of_a_file_is_tried():
    declared = [param for command in all_commands().values() for param in command.params]
    saved = {param.saves for param in declared if isinstance(param, Declared)} - {""}
    assert saved == {*OPTIONS, "fps"}


@pytest.mark.parametrize("format", sorted({*output_formats()} - {"fbx"}))
def test_an_option_of_files_changes_the_formats_it_is_declared_for(danced, tmp_path, monkeypatch, format):
    monkeypatch.chdir(tmp_path)
    if format in ("usda", "usdc"):
        pytest.importorskip("pxr")
    write_character(Path("hero.glb"), CHARACTERS["mixamo"])
    if format == "mp4":  # of a second, since a picture takes as long as the dance
        danced = {fps: replace(one, motion=one.motion.sliced(0, int(fps))) for fps, one in danced.items()}
    dance = danced["60"]
    dance.save(f"plain.{format}")
    plain = Path(f"plain.{format}").read_bytes()
    for option, value in OPTIONS.items():
        value = "mmd" if (format, option) == ("vmd", "target") else value
        if format in formats_using(option):
            dance.save(f"{option}.{format}", **{option: value})
            written = Path(f"{option}.{format}").read_bytes()
            if (format, option) == ("vmd", "target"):  # the sound that its program plays
                assert Path("target.wav").exists() and not Path("plain.wav").exists()
            else:
                assert written != plain, option
        else:
            with pytest.raises(ParameterError, match="leave out"):
                dance.save(f"{option}.{format}", **{option: value})
    danced["30"].save(f"slow.{format}")
    if format in formats_using("fps"):
        assert Path(f"slow.{format}").read_bytes() != plain
    if format == "mp4":
        assert rates(Path("slow.mp4")) == rates(Path("plain.mp4"))
    if format == "vmd":
        assert load_motion("slow.vmd").fps == load_motion("plain.vmd").fps


def rates(path: Path) -> tuple[object, int]:
    """The rate and the number of pictures of a video."""
    with av.open(str(path)) as container:
        [stream] = container.streams.video
        return stream.average_rate, sum(1 for _ in container.decode(stream))


DTW: dict[str, object] = {"warping": "dtw"}
# Another value of each setting, with what it needs beside it to have an effect.
OTHERS: dict[str, tuple[object, dict[str, object]]] = {
    "planner": ("greedy", {}), "bound": (True, {}), "candidates": (8, {}), "selection": ("random", {}),
    "warping": ("none", {}), "density": ("clip", DTW), "time_maps": ("raw", DTW),
    "blending": ("linear", {}), "transitions": ("seconds", {}), "lock_feet": (False, {}),
    "hold_ends": (False, {}), "stage": ("free", {}), "front": ("free", {}), "motif_draw": ("absolute", {}),
    "phrase_counts": (4, {}), "style_strength": (500.0, {}), "style_window": ("hamming", {}),
    "style_song": (cg.example_songs()["waltz"], {}), "dynamics": (0.0, {}), "fps": (30.0, {}),
    "seed": (11, {}), "beats": ("beats.txt", {}), "weights": ({"transition": 90.0}, {}),
}  # fmt: skip
NO_EFFECT = {"engine", "cache"}  # which the other tests choose, and which is declared to change no dance


def test_every_setting_is_tried():
    assert {setting.name for setting in described(DanceConfig)} == {*OTHERS, *NO_EFFECT}


@pytest.fixture(scope="module")
def session() -> cg.Session:
    return cg.Session(SONG, start_s=6.0, duration_s=12.0)


@pytest.mark.parametrize("engine", ["graph", "mixer", "rollout"])
def test_a_setting_changes_the_dances_of_the_engines_it_is_declared_for(
    session, tmp_path, monkeypatch, engine
):
    monkeypatch.chdir(tmp_path)
    Path("beats.txt").write_text("".join(f"{time_s:.3f}\n" for time_s in np.arange(0.2, 40.0, 0.61)))
    plain: dict[str, tuple[str, bytes]] = {}
    for name, (value, beside) in OTHERS.items():
        used = name in settings_of(engine) | settings_of("")
        if not used:
            with pytest.raises(ParameterError, match="it is a setting of the"):
                session.dance(engine=engine, **{name: value})
            continue
        if str(beside) not in plain:
            plain[str(beside)] = content(session.dance(engine=engine, **beside))
        if name in ("density", "weights") and not (engine == "graph" and name == "weights"):
            with pytest.raises(ChoreographError, match="expected"):  # it cannot be met here, and that is said
                session.dance(engine=engine, **beside, **{name: value})
            continue
        other = content(session.dance(engine=engine, **beside, **{name: value}))
        assert other != plain[str(beside)], name


def content(dance: cg.Dance) -> tuple[str, bytes]:
    """The plan and the motion of a dance."""
    return dance.plan.to_json(), dance.motion.local_quat.tobytes() + dance.motion.root_pos_m.tobytes()
