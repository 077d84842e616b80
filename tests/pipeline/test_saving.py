"""What a strip shows of a dance, and which formats use which options of `Dance.save`."""

from __future__ import annotations

import inspect
from dataclasses import replace

import numpy as np
import pytest
from synthetic_characters import CHARACTERS, write_character
from synthetic_motions import swaying
from synthetic_pages import plan_for

import choreograph as cg
from choreograph.counts import numbers_in_bar
from choreograph.errors import ParameterError
from choreograph.exporters import BvhOptions
from choreograph.pipeline.saving import OUTPUT_FORMATS, SavedParts, save_dance
from choreograph.preview import strip


@pytest.fixture
def drawn(monkeypatch):
    """The times and labels of the strip that is saved."""
    seen = {}

    def note(path, motion, times_s, *, labels=None):
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


OPTIONS = {
    "click": True, "loop": True, "bvh": BvhOptions(naming="ue"), "character": "hero.glb",
}  # fmt: skip
USED = {
    "bvh": {"bvh", "loop"}, "npz": {"loop"}, "glb": {"loop", "character"}, "vrma": {"loop"},
    "usda": {"loop"}, "usdc": {"loop"}, "fbx": {"loop", "character"}, "html": {"character"},
    "mp4": {"click"}, "png": set(), "json": set(),
}  # fmt: skip


def test_the_table_of_formats_is_whole():
    assert set(USED) == set(OUTPUT_FORMATS)
    assert set(OPTIONS) == set(inspect.signature(cg.Dance.save).parameters) - {"self", "path", "report"}


@pytest.mark.parametrize("suffix", sorted(USED))
@pytest.mark.parametrize("option", sorted(OPTIONS))
def test_an_option_that_a_format_does_not_use_is_refused(tmp_path, monkeypatch, suffix, option):
    monkeypatch.chdir(tmp_path)
    write_character(tmp_path / "hero.glb", CHARACTERS["mixamo"])
    motion = swaying(300, fps=30.0)
    plan = replace(plan_for(motion), music_beat_numbers=numbers_in_bar(20, 4), metre=4)
    dance = cg.Dance(motion, plan)
    seen = []
    monkeypatch.setattr(
        "choreograph.pipeline.dancing.save_dance", lambda path, parts, report: seen.append(parts)
    )
    if option not in USED[suffix]:
        with pytest.raises(ParameterError, match=f"for {option}, got .*leave out {option}"):
            dance.save(tmp_path / f"a.{suffix}", **{option: OPTIONS[option]})
        assert not seen
        return
    for options in ({}, {option: OPTIONS[option]}):
        dance.save(tmp_path / f"a.{suffix}", **options)
    without, parts = seen
    field = {"click": "with_clicks", "loop": "motion"}.get(option, option)
    assert getattr(parts, field) is not getattr(without, field)
