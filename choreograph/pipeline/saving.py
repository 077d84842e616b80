"""A dance to files: the suffix says what is written."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from choreograph.characters import GltfCharacter
from choreograph.counts import bars_of
from choreograph.errors import ParameterError
from choreograph.exporters import FORMATS, BvhOptions, BvhWriter, save_motion
from choreograph.exporters.usd import require_usd
from choreograph.fbx import convert, require_blender
from choreograph.files import as_path, atomic_path, check_target
from choreograph.motion.motion import Motion
from choreograph.plan import Plan
from choreograph.progress import ProgressReport, substage

if TYPE_CHECKING:
    from choreograph.preview.page_bodies import PageCharacter

CHARACTER_FORMATS = ("glb", "fbx", "html")  # in which a character dances
_STRIP_POSES = 40


@dataclass(frozen=True, eq=False)
class SavedParts:
    """What files are made of."""

    motion: Motion
    plan: Plan
    motion_beats_s: Callable[[], NDArray[np.float64]]
    song_path: Path | None
    with_clicks: bool = False  # on the counts, in a video
    character: GltfCharacter | None = None  # that dances in `CHARACTER_FORMATS`, not the mannequin
    bvh: BvhOptions | None = None


def save_dance(path: str | Path, parts: SavedParts, report: ProgressReport | None = None) -> None:
    """Write a dance to `path`: a motion format, the plan, or something to look at, by the suffix.

    Raises `ParameterError` for an unknown suffix, a missing folder, or clicks in anything but a video,
    `ChoreographError` if the file cannot be written, `FormatError` if the song can no longer be read.
    """
    check_outputs([path], with_clicks=parts.with_clicks)
    suffix = _suffix(path)
    if suffix in ("glb", "fbx") and parts.character is not None:
        save_on_character(path, parts.motion, parts.character)
    elif suffix in FORMATS:
        save_motion(path, parts.motion, writer=BvhWriter(parts.bvh) if suffix == "bvh" else None)
    else:
        _SAVERS[suffix](parts, Path(path), report)


def save_on_character(path: str | Path, motion: Motion, character: GltfCharacter) -> None:
    """Write the character again, as GLB or FBX, with the motion as its animation; raises as `save_dance`."""
    content = character.dancing(motion).to_glb()
    with atomic_path(path) as temporary:
        if _suffix(path) != "fbx":
            temporary.write_bytes(content)
            return
        with TemporaryDirectory() as folder:
            glb, fbx = Path(folder) / "a.glb", Path(folder) / "a.fbx"
            glb.write_bytes(content)
            convert(glb, fbx)
            temporary.write_bytes(fbx.read_bytes())


def check_outputs(paths: Sequence[str | Path], *, with_clicks: bool = False) -> None:
    """Raise `ParameterError` before any work if a format is unknown or a folder does not exist.

    And if clicks are wanted, but none of the files is a video.
    """
    for path in paths:
        as_path("a file to write", path)
        if _suffix(path) not in OUTPUT_FORMATS:
            raise ParameterError(
                f"{path}: expected a format among {', '.join(OUTPUT_FORMATS)}, got {_suffix(path)!r}"
            )
        if _suffix(path) == "fbx":
            require_blender(path)
        if _suffix(path) in ("usda", "usdc"):
            require_usd(path)
        check_target(path)
    if with_clicks and not any(_suffix(path) == "mp4" for path in paths):
        raise ParameterError(
            f"expected an .mp4 for the clicks to sound in, got {', '.join(str(path) for path in paths)}"
        )


def is_motion_file(path: str | Path) -> bool:
    """Whether the file that is written to `path` holds a motion, for other programs."""
    return _suffix(path) in FORMATS


def check_character(character: GltfCharacter, paths: Sequence[str | Path]) -> None:
    """Raise `ParameterError` before any work if one of the files is a page, and cannot show the character."""
    from choreograph.preview.page_bodies import check_page_character

    if any(_suffix(path) == "html" for path in paths):
        check_page_character(character.document)


def _suffix(path: str | Path) -> str:
    return Path(path).suffix.lower().removeprefix(".")


def _save_plan(parts: SavedParts, path: Path, report: ProgressReport | None) -> None:
    with atomic_path(path) as temporary:
        temporary.write_text(parts.plan.to_json(), encoding="utf-8")


def _save_page(parts: SavedParts, path: Path, report: ProgressReport | None) -> None:
    from choreograph.preview.page import write_page

    if report is not None:
        report("writing the page", 0, 0)
    write_page(
        path, parts.motion, parts.plan, song_path=parts.song_path, motion_beats_s=parts.motion_beats_s(),
        character=None if parts.character is None else _in_page(parts.character, parts.motion),
        report=substage(report, "writing the page"),
    )  # fmt: skip


def _in_page(character: GltfCharacter, motion: Motion) -> PageCharacter:
    from choreograph.preview.page_bodies import PageCharacter

    nodes = {name: character.nodes[bone] for name, bone in character.bones.items()}
    return PageCharacter(character.dancing(motion), nodes)


def _save_video(parts: SavedParts, path: Path, report: ProgressReport | None) -> None:
    from choreograph.preview.clicks import Clicks
    from choreograph.preview.video import write_video

    plan = parts.plan
    clicks = Clicks(plan.music_beats_s, plan.music_beat_numbers) if parts.with_clicks else None
    write_video(
        path, parts.motion, song_path=parts.song_path, start_s=plan.start_s, clicks=clicks, report=report
    )


def _save_strip(parts: SavedParts, path: Path, report: ProgressReport | None) -> None:
    from choreograph.preview.strip import write_strip

    plan, duration_s = parts.plan, parts.motion.duration_s
    shown = _shown_beats(plan, duration_s)
    if len(shown) == 0:
        times_s = np.arange(0.0, duration_s)[:_STRIP_POSES]
        write_strip(path, parts.motion, times_s.tolist())
        return
    labels = _labels(plan)
    times_s = np.array(plan.music_beats_s)[shown]
    write_strip(path, parts.motion, times_s.tolist(), labels=[labels[index] for index in shown])


def _shown_beats(plan: Plan, duration_s: float) -> NDArray[np.int64]:
    """Indices of at most `_STRIP_POSES` beats; where some must be left out, count 1 is among the others."""
    beats = np.flatnonzero(np.array(plan.music_beats_s) <= duration_s)
    every = max(1, -(-len(beats) // _STRIP_POSES))
    ones = np.flatnonzero(np.array(plan.music_beat_numbers) == 1)
    if every == 1 or plan.metre == 0 or len(ones) == 0:
        return beats[::every]
    while every % plan.metre and plan.metre % every:
        every += 1
    return beats[ones[0] % every :: every]


def _labels(plan: Plan) -> list[str]:
    """What is written under the pose of each beat: its time and its count, or which beat it is."""
    if not plan.music_beat_numbers:
        return [f"beat {index + 1} · {time:.1f} s" for index, time in enumerate(plan.music_beats_s)]
    counts = zip(plan.music_beats_s, bars_of(plan.music_beat_numbers), plan.music_beat_numbers, strict=True)
    return [f"{time:.2f} s   bar {bar} · {number}" for time, bar, number in counts]


_SAVERS: dict[str, Callable[[SavedParts, Path, ProgressReport | None], None]] = {
    "json": _save_plan, "html": _save_page, "mp4": _save_video, "png": _save_strip,
}  # fmt: skip
OUTPUT_FORMATS = (*FORMATS, *_SAVERS)
