"""Pose strips: pictures of a dance at several times, on one sheet."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont
from PIL.PngImagePlugin import PngInfo

from choreograph.core.errors import ParameterError
from choreograph.core.files import atomic_path
from choreograph.formats.writer import DANCE_GENERATOR
from choreograph.motion.motion import Motion
from choreograph.view.crowd import shots_of
from choreograph.view.renderer import Pixels

_COLUMNS = 8
_BAR = 0.085  # height of the bar of a label over the width of a tile
_BAR_RGB, _TEXT_RGB = (62, 70, 92), (240, 238, 233)
_GAP_PX = 2
_MAX_PIXELS = 200_000_000


def write_strip(
    path: str | Path,
    motion: Motion,
    times_s: Sequence[float],
    *,
    labels: Sequence[str] | None = None,
    columns: int | None = None,
    tile: tuple[int, int] = (240, 320),
    front_rad: float = 0.0,
    others: Sequence[Motion] = (),
) -> None:
    """Write the poses at `times_s` as one PNG with `columns` in a row (8, or fewer if there are fewer poses).

    The camera stands with the audience, in the direction `front_rad`, 0 for +Z. `labels`, one for each pose,
    are the times by default. `tile` is the size of one pose in pixels. `others` are further dancers of a
    scene, who are shown together.

    Raises `ParameterError` if there is no time, a time is outside of the motion, labels do not match, the
    sheet would be empty or larger than 200 megapixels, or the folder is missing. Raises `ChoreographError` if
    the file cannot be written.
    """
    sheet = draw_strip(
        motion, times_s, labels=labels, columns=columns, tile=tile, front_rad=front_rad, others=others
    )
    about = PngInfo()
    about.add_text("Software", DANCE_GENERATOR)
    with atomic_path(path) as temporary:
        Image.fromarray(sheet).save(temporary, format="PNG", pnginfo=about)


def draw_strip(
    motion: Motion,
    times_s: Sequence[float],
    *,
    labels: Sequence[str] | None = None,
    columns: int | None = None,
    tile: tuple[int, int] = (240, 320),
    front_rad: float = 0.0,
    others: Sequence[Motion] = (),
) -> Pixels:
    """The contact sheet of `write_strip`, (H, W, 3)."""
    if labels is None:
        labels = [f"{time:.2f} s" for time in times_s]
    n_poses = len(times_s)
    columns = min(_COLUMNS, n_poses) if columns is None else columns
    if len(labels) != n_poses:
        raise ParameterError(f"expected a label for each of {n_poses} poses, got {len(labels)}")
    if min(*tile, columns, n_poses) < 1:
        raise ParameterError(f"expected poses, columns and pixels, got {n_poses}, {columns} and {tile}")
    width, height = tile
    bar = round(_BAR * width)
    rows = -(-n_poses // columns)
    step_y, step_x = height + bar + _GAP_PX, width + _GAP_PX
    if rows * step_y * columns * step_x > _MAX_PIXELS:
        raise ParameterError(f"a sheet of {n_poses} poses of {width} x {height} pixels is too large")
    shots = shots_of((motion, *others), times_s, aspect=width / height, front_rad=front_rad)
    sheet = np.full((rows * step_y - _GAP_PX, columns * step_x - _GAP_PX, 3), 255, np.uint8)
    for index, label in enumerate(labels):
        y, x = index // columns * step_y, index % columns * step_x
        sheet[y : y + height, x : x + width] = shots.render(index, tile)
        sheet[y + height : y + height + bar, x : x + width] = _label(label, width, bar)
    return sheet


def _label(text: str, width: int, height: int) -> Pixels:
    bar = Image.new("RGB", (width, height), _BAR_RGB)
    if height >= 4:
        font = ImageFont.load_default(size=0.72 * height)
        ImageDraw.Draw(bar).text((width / 2, height / 2), text, fill=_TEXT_RGB, font=font, anchor="mm")
    return np.asarray(bar)
