"""Files of the dance or a part of it, in every format that `choreograph dance` writes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from choreograph.characters.gltf_character import GltfCharacter
from choreograph.core.arguments import check_choice
from choreograph.core.errors import ParameterError
from choreograph.core.numerics import default_numerics
from choreograph.core.progress import ProgressReport
from choreograph.pipeline.dancing import Dance
from choreograph.pipeline.saving import SavedParts, options_used, output_formats, save_dance
from choreograph.studio.project import Span

NAMES = {"usd": "usdc"}  # what pages ask for, and the suffix
EXPORTED = (  # that pages offer
    "bvh", "glb", "fbx", "usd", "npz", "vrma", "vmd", "mp4", "png", "html", "json",
)  # fmt: skip


def suffix_of(format: str) -> str:
    """The suffix of a format. Raises `ParameterError` for an unknown one."""
    suffix = NAMES.get(format, format)
    check_choice("a format", suffix, output_formats())
    return suffix


@default_numerics()
def export(
    path: Path,
    dance: Dance,
    span: Span | None,
    character: GltfCharacter | None,
    report: ProgressReport | None,
    *,
    click: bool = False,
) -> None:
    """Write the dance, or a span of it, to a file whose suffix is the format.

    Raises `ParameterError` for a span of a plan or a page, which are of whole dances, and as `Dance.save`.
    """
    motion, plan = dance.motion, dance.plan
    if span is not None:
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
    used = options_used(path, {"character": character, "click": click})
    parts = SavedParts(
        motion,
        plan,
        lambda: dance.motion_beats_s,
        dance.song_path,
        used.get("click", False),
        used.get("character"),
        None,
    )
    if report is not None:
        report(f"writing {path.name}", 0, 0)
    save_dance(path, parts, report)
