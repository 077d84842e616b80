"""Files of the dance or a part of it, in every format that `choreograph dance` writes."""

from __future__ import annotations

import zipfile
from dataclasses import replace
from pathlib import Path

from choreograph.characters.gltf_character import GltfCharacter
from choreograph.core.arguments import check_choice
from choreograph.core.errors import ParameterError
from choreograph.core.numerics import default_numerics
from choreograph.core.progress import ProgressReport
from choreograph.formats import output_formats
from choreograph.pipeline.dancing import Dance
from choreograph.pipeline.figures import figures_from
from choreograph.pipeline.saving import SavedParts, options_used, save_dance
from choreograph.pipeline.scenes import scene_paths
from choreograph.studio.project import Span
from choreograph.studio.step_scenes import StagedScene

NAMES = {"usd": "usdc"}  # what pages ask for, and the suffix
EXPORTED = (  # that pages offer
    "bvh", "glb", "fbx", "usd", "npz", "vrma", "vmd", "mp4", "png", "html", "json",
)  # fmt: skip


def suffix_of(format: str) -> str:
    """The suffix of a format. Raises `ParameterError` for an unknown one."""
    suffix = NAMES.get(format, format)
    check_choice("a format", suffix, output_formats())
    return suffix


def exports_of_each(*, characters: bool = False) -> list[str]:
    """The formats of which each dancer gets a file, on mannequins or on characters."""
    return [
        format
        for format in EXPORTED
        if len(scene_paths(f"a.{suffix_of(format)}", 2, characters=characters)) > 1
    ]


def zip_path(path: Path) -> Path:
    """The file that holds those of each dancer, where a format is of one dancer."""
    return path.with_name(f"{path.stem}-{path.suffix[1:]}.zip")


@default_numerics()
def export(
    path: Path,
    dance: Dance,
    span: Span | None,
    character: GltfCharacter | None,
    report: ProgressReport | None,
    *,
    click: bool = False,
) -> Path:
    """Write the dance, or a span of it, to a file whose suffix is the format. Returns its path.

    Raises `ParameterError` for a span of a plan or a page, which are of whole dances, and as `Dance.save`.
    """
    if span is not None:
        dance = _part(path, dance, span)
    used = options_used(path, {"character": character, "click": click})
    parts = SavedParts(
        dance.motion,
        dance.plan,
        lambda: dance.motion_beats_s,
        dance.song_path,
        used.get("click", False),
        used.get("character"),
        figures=dance.figures,
    )
    if report is not None:
        report(f"writing {path.name}", 0, 0)
    save_dance(path, parts, report)
    return path


@default_numerics()
def export_scene(
    path: Path,
    staged: StagedScene,
    song_path: Path | None,
    span: Span | None,
    character: GltfCharacter | None,
    report: ProgressReport | None,
    *,
    click: bool = False,
) -> Path:
    """As `export` for all dancers, who have the same character. Returns the path of the file.

    Where a format is of one dancer, the file is a .zip with a file for each. Raises as `export`, and
    `ParameterError` for a character that is far larger or smaller than the takes.
    """
    if report is not None:
        report(f"writing {path.name}", 0, 0)
    used = options_used(path, {"character": character, "click": click})
    scene = staged.scene(song_path, used.get("character"))
    if span is not None:
        dancers = [replace(one, dance=_part(path, one.dance, span)) for one in scene.dancers]
        scene = replace(scene, dancers=tuple(dancers))
    scene.save(path, click=used.get("click", False), report=report)
    written = scene_paths(path, len(scene.dancers), characters=used.get("character") is not None)
    if written == (path,):
        return path
    packed = zip_path(path)
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as file:
        for one in written:
            file.writestr(zipfile.ZipInfo(one.name), one.read_bytes(), zipfile.ZIP_DEFLATED)  # without a date
            one.unlink()
    return packed


def _part(path: Path, dance: Dance, span: Span) -> Dance:
    """A span of a dance for a file. Raises `ParameterError` if the format is of whole dances."""
    motion, plan = dance.motion, dance.plan
    start_s, end_s = span
    if path.suffix in (".json", ".html"):
        raise ParameterError(f"expected the whole dance as {path.suffix}, got a part of it")
    if not 0 <= start_s < end_s <= plan.duration_s + 0.1:
        raise ParameterError(
            f"expected a part of the dance of {plan.duration_s:g} s, got {start_s:g} to {end_s:g}"
        )
    first = round(start_s * motion.fps)
    motion = motion.sliced(first, max(first + 1, min(motion.n_frames, round(end_s * motion.fps))))
    inside = [
        (s - start_s, n)
        for s, n in zip(
            plan.music_beats_s, plan.music_beat_numbers or [0] * len(plan.music_beats_s), strict=True
        )
        if start_s <= s < end_s
    ]
    numbers = tuple(n for _, n in inside) if plan.music_beat_numbers else ()
    plan = replace(
        plan, start_s=plan.start_s + start_s, duration_s=motion.duration_s,
        music_beats_s=tuple(s for s, _ in inside), music_beat_numbers=numbers,
    )  # fmt: skip
    return replace(dance, motion=motion, plan=plan, figures=figures_from(dance.figures, start_s))
