"""The dance-with-melody importer on the real data, where it is, and on broken files."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from choreograph.errors import FormatError
from choreograph.importers import dance_with_melody

DATA = Path(__file__).resolve().parents[2].parent / "shared" / "data" / "dance-with-melody"


def _write(folder: Path, **changes) -> Path:
    folder.mkdir()
    data = {"length": 3, "center": [[0, 0, 0]] * 3, "skeletons": [[[0, 0, 0]] * 23] * 3} | changes
    (folder / "skeletons.json").write_text(json.dumps(data))
    (folder / "config.json").write_text(json.dumps({"start_position": 0, "end_position": 3}))
    return folder


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"center": [[0, 0]] * 3}, "expected center"),
        ({"center": None}, "expected center|expected numbers"),
        ({"length": 9}, "cut short"),
        ({"center": [[float("nan"), 0, 0]] * 3}, "finite"),
    ],
)
def test_broken_files_end_in_one_line(tmp_path, changes, words):
    with pytest.raises(FormatError, match=words) as caught:
        dance_with_melody.read(_write(tmp_path / "DANCE_C_9", **changes))
    assert "\n" not in str(caught.value)


def test_not_json(tmp_path):
    folder = _write(tmp_path / "DANCE_W_9")
    (folder / "skeletons.json").write_text("{")
    with pytest.raises(FormatError, match="JSON"):
        dance_with_melody.read(tmp_path)


def test_other_folders_are_not_ours(tmp_path):
    assert not dance_with_melody.detect(tmp_path)


@pytest.mark.skipif(not DATA.is_dir(), reason=f"the real data is not at {DATA}")
def test_a_real_take_fits_and_stands_on_the_floor():
    (take,) = dance_with_melody.read(DATA / "DANCE_W_23")
    pos = dance_with_melody.read_points_m(DATA / "DANCE_W_23" / "skeletons.json")
    bodies = dance_with_melody.measure_bodies(pos, dance_with_melody.ROLES, 1)
    assert dance_with_melody.fit_bodies(bodies, pos, take.motion.fps)[2].mean() < 0.02
    assert take.credits.genre == "waltz"
    assert take.motion.duration_s == pytest.approx(1036 / 25)
    lowest = dance_with_melody.sole_pos_m(take.motion)[..., 1].min(axis=1)
    assert abs(np.median(lowest)) < 0.03
