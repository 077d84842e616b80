"""The contact sheet: its grid, its labels, its file."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image
from synthetic_motions import swaying

from choreograph.core.errors import ParameterError
from choreograph.view.strip import draw_strip, write_strip

MOTION = swaying(60)
TILE = (48, 64)


def test_poses_are_in_rows_with_labels(tmp_path):
    times = np.linspace(0, 1.0, 5)
    write_strip(tmp_path / "strip.png", MOTION, times, columns=2, tile=TILE)
    with Image.open(tmp_path / "strip.png") as image:
        sheet = np.asarray(image)
    bar = round(0.085 * 48)
    assert sheet.shape == (3 * (64 + bar + 2) - 2, 2 * 50 - 2, 3)
    assert (sheet[-30:, 60:] == 255).all()  # the sixth place is empty
    assert list(tmp_path.iterdir()) == [tmp_path / "strip.png"]


def test_same_time_gives_the_same_tile():
    sheet = draw_strip(MOTION, [0.2, 0.2, 0.9], tile=TILE, labels=["", "", ""])
    tiles = [sheet[:64, x : x + 48] for x in (0, 50, 100)]
    assert np.array_equal(tiles[0], tiles[1]) and not np.array_equal(tiles[0], tiles[2])


def test_a_turned_back_is_seen_as_a_back():
    turned = MOTION.moved(yaw_rad=np.pi)
    face, back, other_side = (
        draw_strip(motion, [0.5], tile=(120, 160), labels=[""], front_rad=front_rad)[:160].astype(int)
        for motion, front_rad in ((MOTION, 0.0), (turned, 0.0), (turned, np.pi))
    )
    # The left arm and leg are warm, the right ones cool. Facing the camera, left is to the right.
    assert warm_to_the_right(face) and not warm_to_the_right(back)
    assert np.abs(face - other_side).mean() < 5 < np.abs(face - back).mean()


def warm_to_the_right(tile: np.ndarray) -> bool:
    warmth, columns = tile[..., 0] - tile[..., 2], np.arange(tile.shape[1])
    warm, cool = ((side > 40).sum(axis=0) for side in (warmth, -warmth))
    return bool((warm @ columns) / warm.sum() > (cool @ columns) / cool.sum())


def test_labels_are_written():
    named, other = (draw_strip(MOTION, [0.0], labels=[text], tile=(200, 60)) for text in ("beat 1", "beat 8"))
    assert np.array_equal(named[:60], other[:60])  # the pose
    assert not np.array_equal(named[60:], other[60:])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"times_s": []}, "poses"),
        ({"labels": ["a"]}, "label for each of 2"),
        ({"columns": 0}, "columns"),
        ({"tile": (0, 20)}, "pixels"),
        ({"tile": (20000, 20000)}, "too large"),
        ({"times_s": [0.0, 99.0]}, "within the motion"),
    ],
)
def test_wrong_input_is_a_one_line_error(changes, message):
    arguments = {"times_s": [0.0, 0.5], "tile": TILE} | changes
    with pytest.raises(ParameterError, match=message) as caught:
        draw_strip(MOTION, arguments.pop("times_s"), **arguments)
    assert "\n" not in str(caught.value)


def test_missing_folder(tmp_path):
    with pytest.raises(ParameterError, match="no folder"):
        write_strip(tmp_path / "none" / "strip.png", MOTION, [0.0], tile=TILE)
