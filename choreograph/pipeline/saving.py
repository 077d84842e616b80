"""A dance to files: the suffix says what is written."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from choreograph.errors import ParameterError
from choreograph.exporters import FORMATS, save_motion
from choreograph.files import atomic_path, check_target
from choreograph.progress import ProgressReport

if TYPE_CHECKING:
    from choreograph.pipeline.dancing import Dance


_STRIP_POSES = 40


def save(dance: Dance, path: str | Path, report: ProgressReport | None = None) -> None:
    """Write `dance` to `path`: a motion format, the plan, or something to look at, by the suffix.

    Raises `ParameterError` for an unknown suffix or a missing folder, `ChoreographError` if the file
    cannot be written, `FormatError` if the song cannot be read again.
    """
    check_outputs([path])
    suffix = _suffix(path)
    if suffix in FORMATS:
        save_motion(path, dance.motion)
    else:
        _SAVERS[suffix](dance, Path(path), report)


def check_outputs(paths: Sequence[str | Path]) -> None:
    """Raise `ParameterError` before any work if a format is unknown or a folder does not exist."""
    for path in paths:
        if _suffix(path) not in OUTPUT_FORMATS:
            raise ParameterError(
                f"{path}: unknown format {_suffix(path)!r}: expected one of {', '.join(OUTPUT_FORMATS)}"
            )
        check_target(path)


def _suffix(path: str | Path) -> str:
    return Path(path).suffix.lower().removeprefix(".")


def _save_plan(dance: Dance, path: Path, report: ProgressReport | None) -> None:
    with atomic_path(path) as temporary:
        temporary.write_text(dance.plan.to_json(), encoding="utf-8")


def _save_page(dance: Dance, path: Path, report: ProgressReport | None) -> None:
    from choreograph.preview.page import write_page

    if report is not None:
        report("writing the page", 0, 1)
    write_page(path, dance.motion, dance.plan, song_path=dance.song_path, motion_beats_s=dance.motion_beats_s)
    if report is not None:
        report("writing the page", 1, 1)


def _save_video(dance: Dance, path: Path, report: ProgressReport | None) -> None:
    from choreograph.preview.video import write_video

    write_video(
        path, dance.motion, song_path=dance.song_path, start_s=dance.plan.start_s, report=report
    )  # fmt: skip


def _save_strip(dance: Dance, path: Path, report: ProgressReport | None) -> None:
    from choreograph.preview.strip import write_strip

    beats_s = np.array(dance.plan.music_beats_s)
    numbers = np.flatnonzero(beats_s <= dance.motion.duration_s)
    if len(numbers) == 0:
        times_s = np.arange(0.0, dance.motion.duration_s)[:_STRIP_POSES]
        write_strip(path, dance.motion, times_s.tolist())
        return
    every = int(np.ceil(len(numbers) / _STRIP_POSES))
    labels = [f"beat {number + 1} · {beats_s[number]:.1f} s" for number in numbers[::every]]
    write_strip(path, dance.motion, beats_s[numbers[::every]].tolist(), labels=labels)


_SAVERS: dict[str, Callable[[Dance, Path, ProgressReport | None], None]] = {
    "json": _save_plan, "html": _save_page, "mp4": _save_video, "png": _save_strip,
}  # fmt: skip
OUTPUT_FORMATS = (*FORMATS, *_SAVERS)
