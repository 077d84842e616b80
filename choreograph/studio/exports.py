"""What the studio writes beside its project: files of the dance, and repertoires that it builds.

A dance, or a part of it, is written in every format of `choreograph dance`. Repertoires are built in a
process of their own, so that the studio goes on, and with their log.
"""

from __future__ import annotations

import subprocess
import sys
import zipfile
from collections import deque
from dataclasses import replace
from pathlib import Path

from choreograph.characters.character import GltfCharacter
from choreograph.core.arguments import check_choice
from choreograph.core.errors import ChoreographError, ParameterError
from choreograph.core.numerics import default_numerics
from choreograph.core.progress import ProgressReport
from choreograph.formats import output_formats
from choreograph.pipeline.dancing import Dance, figures_from
from choreograph.pipeline.saving import SavedParts, options_used, save_dance
from choreograph.pipeline.scenes import scene_paths
from choreograph.studio.jobs import Job
from choreograph.studio.project import Span
from choreograph.studio.steps import StagedScene

# Files of the dance.


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
    packed = path.with_name(f"{path.stem}-{path.suffix[1:]}.zip")
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


# Builds of repertoires.


def build(takes: Path, output: Path, preset: str, job: Job) -> None:
    """Build a repertoire from the files of a folder, as `choreograph build-db` does.

    Raises `ChoreographError` with the last line of the log if the build fails. A job that is cancelled ends
    the process.
    """
    job.report("building the repertoire", 0, 0)
    _run(["build-db", str(takes), "-o", str(output), "--preset", preset, "--skip-bad"], takes, job)


def check_takes(takes: Path, job: Job) -> None:
    """Check the files of a folder, as `choreograph build-db --check` does. Its table is in the log."""
    job.report("checking the takes", 0, 0)
    _run(["build-db", str(takes), "--check"], takes, job)


def _run(arguments: list[str], takes: Path, job: Job) -> None:
    command = [sys.executable, "-m", "choreograph", *arguments]
    last: deque[str] = deque([""], maxlen=1)
    process = subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        encoding="utf-8", errors="replace", cwd=takes.parent,
    )  # fmt: skip
    try:
        assert process.stdout is not None
        for line in process.stdout:
            if text := line.rstrip().replace(f"{takes}/", ""):
                last.append(text)
                job.say(text)
    finally:
        if process.poll() is None:
            process.terminate()
        status = process.wait()
    if status != 0:
        raise ChoreographError(
            last[0].removeprefix("choreograph: ") or f"the build ended with status {status}"
        )
