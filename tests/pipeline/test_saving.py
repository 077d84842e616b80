"""What is saved of a dance: strips, options by format, what files say they are; never over an input."""

from __future__ import annotations

import inspect
import shutil
from dataclasses import replace

import numpy as np
import pytest
import soundfile
from synthetic_characters import CHARACTERS, write_character
from synthetic_motions import swaying
from synthetic_pages import plan_for

import choreograph as cg
from choreograph.core.counts import numbers_in_bar
from choreograph.core.errors import ParameterError
from choreograph.formats.bvh import BvhOptions
from choreograph.formats.register import import_takes, save_motion
from choreograph.pipeline.saving import SavedParts, is_saved_dance, output_formats, save_dance
from choreograph.view import strip
from choreograph.view.video import write_video


@pytest.fixture
def drawn(monkeypatch):
    """The times and labels of the strip that is saved."""
    seen = {}

    def note(path, motion, times_s, *, labels=None, **_):
        seen.update(times_s=times_s, labels=labels)

    monkeypatch.setattr(strip, "write_strip", note)
    return seen


def _strip(tmp_path, duration_s: float, **changes) -> None:
    motion = swaying(round(duration_s * 30), fps=30.0)
    plan = replace(plan_for(motion), **changes)  # a beat every half second
    save_dance(tmp_path / "strip.png", SavedParts(motion, plan, lambda: np.zeros(0), None))


def test_counts_and_bars_are_written_under_the_poses(tmp_path, drawn):
    _strip(tmp_path, 3.0, music_beat_numbers=(3, 1, 2, 3, 1, 2), metre=3)
    assert drawn["times_s"] == [0, 0.5, 1.0, 1.5, 2.0, 2.5]
    assert drawn["labels"][0] == "0.00 s   bar 0 · 3"
    assert drawn["labels"][4] == "2.00 s   bar 2 · 1"


@pytest.mark.parametrize(
    ("metre", "duration_s", "counts"),
    [(4, 18.0, {1, 2, 3, 4}), (4, 30.0, {1, 3}), (4, 50.0, {1}), (3, 30.0, {1}), (4, 110.0, {1})],
)
def test_a_long_strip_has_the_downbeats(tmp_path, drawn, metre, duration_s, counts):
    numbers = tuple(numbers_in_bar(round(2 * duration_s), metre, first=metre).tolist())
    _strip(tmp_path, duration_s, music_beat_numbers=numbers, metre=metre)
    assert {int(label[-1]) for label in drawn["labels"]} == counts
    assert 14 < len(drawn["labels"]) <= 40


def test_without_bars_beats_are_numbered(tmp_path, drawn):
    _strip(tmp_path, 30.0)
    assert drawn["labels"][:2] == ["beat 1 · 0.0 s", "beat 3 · 1.0 s"]
    _strip(tmp_path, 3.0, music_beats_s=())
    assert (drawn["times_s"], drawn["labels"]) == ([0.0, 1.0, 2.0], None)


def test_mmd_gets_the_danced_part_of_the_song(tmp_path):
    sound = np.sin(np.arange(3 * 8000) / 9)[:, None] * [0.5, 0.25]
    soundfile.write(tmp_path / "song.flac", sound, 8000, subtype="PCM_16")
    motion = swaying(30, fps=30.0)
    plan = replace(plan_for(motion), start_s=0.5)
    parts = SavedParts(motion, plan, lambda: np.zeros(0), tmp_path / "song.flac", target="mmd", from_s=0.25)
    save_dance(tmp_path / "a.vmd", parts)
    wav, rate_hz = soundfile.read(tmp_path / "a.wav")
    assert rate_hz == 8000 and soundfile.info(tmp_path / "a.wav").subtype == "PCM_16"
    np.testing.assert_allclose(wav, sound[6000:14000], atol=2e-4)
    save_dance(tmp_path / "a.vmd", parts)  # both are replaced
    save_dance(tmp_path / "b.vmd", replace(parts, target=None))
    assert not (tmp_path / "b.wav").exists()
    save_dance(tmp_path / "c.vmd", replace(parts, song_path=None))
    assert not (tmp_path / "c.wav").exists()


def test_the_sound_beside_a_dance_replaces_no_other_file(tmp_path):
    parts = SavedParts(
        swaying(30), plan_for(swaying(30)), lambda: np.zeros(0), tmp_path / "song.wav", target="mmd"
    )
    for name in ("song.wav", "mine.wav"):
        (tmp_path / name).write_bytes(b"mine")
        with pytest.raises(ParameterError):
            save_dance((tmp_path / name).with_suffix(".vmd"), parts)
        assert (tmp_path / name).read_bytes() == b"mine"
    assert not list(tmp_path.glob("*.vmd"))


OPTIONS = {
    "click": True, "loop": True, "bvh": BvhOptions(naming="ue"), "character": "hero.glb",
    "camera": "front", "target": "unreal",
}  # fmt: skip
USED = {
    "bvh": {"bvh", "loop"}, "npz": {"loop"}, "vrma": {"loop"},
    "glb": {"loop", "character", "camera", "target"}, "vmd": {"loop", "target"},
    "usda": {"loop", "camera"}, "usdc": {"loop", "camera"}, "fbx": {"loop", "character"},
    "html": {"character", "camera"}, "mp4": {"click", "camera"}, "png": set(), "json": set(),
}  # fmt: skip


def test_the_table_of_formats_is_whole():
    assert set(USED) == set(output_formats())
    assert set(OPTIONS) == set(inspect.signature(cg.Dance.save).parameters) - {"self", "path", "report"}


@pytest.mark.parametrize("suffix", sorted(USED))
@pytest.mark.parametrize("option", sorted(OPTIONS))
def test_an_option_that_a_format_does_not_use_is_refused(tmp_path, monkeypatch, suffix, option):
    monkeypatch.chdir(tmp_path)
    write_character(tmp_path / "hero.glb", CHARACTERS["mixamo"])
    motion = swaying(300, fps=30.0)
    plan = replace(plan_for(motion), music_beat_numbers=numbers_in_bar(20, 4), metre=4)
    value = "mmd" if (suffix, option) == ("vmd", "target") else OPTIONS[option]
    dance = cg.Dance(motion, plan)
    seen = []
    monkeypatch.setattr(
        "choreograph.pipeline.dancing.save_dance", lambda path, parts, report: seen.append(parts)
    )
    if option not in USED[suffix]:
        with pytest.raises(ParameterError, match=f"for {option}, got .*leave out {option}"):
            dance.save(tmp_path / f"a.{suffix}", **{option: value})
        assert not seen
        return
    for options in ({}, {option: value}):
        dance.save(tmp_path / f"a.{suffix}", **options)
    without, parts = seen
    field = {"click": "with_clicks", "loop": "motion"}.get(option, option)
    assert getattr(parts, field) is not getattr(without, field)


@pytest.mark.parametrize("suffix", output_formats())
def test_dances_are_known_by_their_files(made, tmp_path, suffix):
    path = tmp_path / f"a.{suffix}"
    if suffix == "fbx":
        pytest.skip("an FBX says nothing of who made it")
    if suffix.startswith("usd"):
        pytest.importorskip("pxr")
    if suffix == "mp4":
        write_video(path, made.motion.sliced(0, 30), size=(64, 64))
    else:
        made.save(path)
    assert is_saved_dance(path)
    if suffix not in ("json", "html", "mp4", "png"):
        save_motion(path, made.motion)
        assert not is_saved_dance(path)  # it may be a recording


@pytest.mark.parametrize("stem", ["x" * 240, "x" * 251, "é" * 125])
def test_names_near_the_limit_are_written(made, tmp_path, stem):
    for suffix in (".bvh", ".npz"):
        made.save(tmp_path / f"{stem}{suffix}")
    assert len(list(tmp_path.iterdir())) == 2
    (take,) = import_takes(tmp_path / f"{stem}.bvh")
    assert take.name == stem


def test_the_api_writes_over_no_input(made, tmp_path):
    folder = tmp_path / "takes"
    folder.mkdir()
    save_motion(folder / "a.bvh", swaying(60))
    with pytest.raises(ParameterError, match="input"):
        cg.build(folder, folder / "a.bvh")
    write_character(tmp_path / "hero.glb", CHARACTERS["unreal"])
    hero = (tmp_path / "hero.glb").read_bytes()
    for given in (tmp_path / "hero.glb", cg.read_character(tmp_path / "hero.glb")):
        with pytest.raises(ParameterError, match="input"):
            made.save(tmp_path / "hero.glb", character=given)
    assert (tmp_path / "hero.glb").read_bytes() == hero
    clip = tmp_path / "clip.mp4"
    shutil.copy(made.song_path, clip)
    with pytest.raises(ParameterError, match="input"):
        cg.Dance(made.motion, made.plan, song_path=clip).save(clip)
    assert clip.read_bytes() == made.song_path.read_bytes()


def test_a_camera_is_planned_on_the_phrases_and_refused_where_no_file_has_one(tmp_path, monkeypatch):
    motion = swaying(32 * 30, fps=30.0)
    numbers = tuple(numbers_in_bar(64, 4, first=4).tolist())  # a beat every half second
    dance = cg.Dance(motion, replace(plan_for(motion), music_beat_numbers=numbers, metre=4))
    assert dance.plan.phrase_borders_s == (8.5, 16.5, 24.5)
    seen = []
    monkeypatch.setattr(
        "choreograph.pipeline.dancing.save_dance", lambda path, parts, report: seen.append(parts)
    )
    dance.save(tmp_path / "a.glb", camera="cuts")
    assert seen[0].camera.cuts_s == [8.5, 16.5, 24.5]
    dance.save(tmp_path / "a.glb")
    assert seen[1].camera is None
    with pytest.raises(ParameterError, match="for camera, got"):
        dance.save(tmp_path / "a.bvh", camera="front")
    with pytest.raises(ParameterError, match="among front, follow, cuts"):
        dance.save(tmp_path / "a.glb", camera="drone")
