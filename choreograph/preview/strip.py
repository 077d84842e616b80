"""A contact sheet (PNG): labelled poses at chosen times, side by side."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont
from PIL.PngImagePlugin import PngInfo

from choreograph.errors import ParameterError
from choreograph.exporters import DANCE_GENERATOR
from choreograph.files import atomic_path
from choreograph.motion.motion import Motion
from choreograph.preview.camera_path import follow_camera
from choreograph.preview.renderer import Pixels

_COLUMNS = 8
_BAR = 0.085  # height of the label's bar over the tile's width
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
) -> None:
    """Write the poses at `times_s` as one PNG with `columns` per row (8, or fewer if there are fewer poses).

    All are seen from the same direction, 28° to the side of the dancer's mean heading. `labels`, one per
    pose, default to the times. `tile` is the size of one pose in pixels.

    Raises `ParameterError` if there is no time, one lies outside the motion, labels do not match, the
    sheet would be empty or larger than 200 megapixels, or the file's folder is missing;
    `ChoreographError` if it cannot be written.
    """
    sheet = draw_strip(motion, times_s, labels=labels, columns=columns, tile=tile)
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
    shots = follow_camera(motion, times_s, aspect=width / height)
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
