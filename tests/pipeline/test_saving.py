"""What a strip shows of a dance: poses on beats, with their counts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from synthetic_motions import swaying
from synthetic_pages import plan_for

from choreograph.counts import numbers_in_bar
from choreograph.errors import ParameterError
from choreograph.pipeline.saving import SavedParts, check_outputs, save_dance
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


def test_clicks_need_a_video(tmp_path):
    check_outputs([tmp_path / "a.bvh", tmp_path / "a.mp4"], with_clicks=True)
    with pytest.raises(ParameterError, match=r"expected an \.mp4"):
        check_outputs([tmp_path / "a.bvh", tmp_path / "a.html"], with_clicks=True)
