"""Writes scenes of several dancers to files. The suffix of a name selects the format."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from choreograph.core.arguments import check_text
from choreograph.core.files import atomic_path, check_apart
from choreograph.core.progress import ProgressReport, substage
from choreograph.formats import formats_using, output_formats
from choreograph.formats.glb import as_dance, scene_document
from choreograph.formats.gltf_camera import with_camera
from choreograph.formats.usd import export_stage, scene_stage
from choreograph.motion.cameras import CameraMode, CameraPath, plan_cameras
from choreograph.pipeline.saving import (
    SavedParts,
    check_options,
    check_outputs,
    format_of,
    save_dance,
    save_document,
)

if TYPE_CHECKING:
    from choreograph.pipeline.scenes import Dancer, Scene


def scene_paths(path: str | Path, n_dancers: int, *, characters: bool = False) -> tuple[Path, ...]:
    """The files that a scene writes for a path: the path itself, or NAME-1.bvh and so on for each dancer."""
    path = Path(path)
    has_one = output_formats()[format_of(path)].together
    if n_dancers == 1 or (has_one and not (characters and _holds_characters(format_of(path)))):
        return (path,)
    return tuple(path.with_name(f"{path.stem}-{number + 1}{path.suffix}") for number in range(n_dancers))


def _holds_characters(format: str) -> bool:
    """Whether the files of a format can hold the characters of a scene: a file for each."""
    return format in formats_using("character", in_scenes=True)


def check_scene_outputs(paths: Sequence[str | Path], n_dancers: int, *, characters: bool = False) -> None:
    """Raise `ParameterError` before any work if a format is unknown or a folder does not exist."""
    check_outputs(paths)
    check_apart([one for path in paths for one in scene_paths(path, n_dancers, characters=characters)], ())


def save_scene(
    scene: Scene,
    path: Path,
    *,
    with_clicks: bool = False,
    camera: CameraMode | None = None,
    report: ProgressReport | None = None,
) -> None:
    """Write a scene to `path` by its suffix. Raises as `Scene.save`."""
    n_dancers, suffix = len(scene.dancers), format_of(path)
    characters = any(dancer.character is not None for dancer in scene.dancers)
    check_scene_outputs([path], n_dancers, characters=characters)
    if camera is not None:
        check_text("camera", camera)
    check_options(path, {"camera": camera})
    plan = scene.plan.dances[0]
    filmed = None if camera is None else plan_cameras(scene.motions, camera, plan.phrase_borders_s)
    paths = scene_paths(path, n_dancers, characters=characters)
    check_apart(paths, [scene.song_path] if scene.song_path is not None else [])
    if suffix == "json":
        with atomic_path(path) as temporary:
            temporary.write_text(scene.plan.to_json(), encoding="utf-8")
    elif len(paths) == n_dancers:
        used = "character" in output_formats()[suffix].uses
        for dancer, own in zip(scene.dancers, paths, strict=True):
            parts = _parts(scene, dancer, with_clicks and suffix == "mp4", filmed)
            save_dance(own, replace(parts, character=dancer.character if used else None), report)
    elif suffix == "html":
        _save_page(scene, path, filmed, report)
    elif suffix in ("glb", "fbx"):
        names = [dancer.name for dancer in scene.dancers]
        document = scene_document(scene.motions, names)
        save_document(path, as_dance(document if filmed is None else with_camera(document, filmed)))
    elif suffix in ("usda", "usdc"):
        names = [dancer.name for dancer in scene.dancers]
        with atomic_path(path) as temporary:
            export_stage(scene_stage(scene.motions, names, filmed), temporary)
    else:
        parts = _parts(scene, scene.dancers[0], with_clicks, filmed)
        save_dance(path, replace(parts, others=scene.motions[1:]), report)


def _parts(scene: Scene, dancer: Dancer, with_clicks: bool, filmed: CameraPath | None) -> SavedParts:
    """What is saved of one dancer."""
    dance = dancer.dance
    return SavedParts(
        dance.motion, dance.plan, lambda: dance.motion_beats_s, scene.song_path, with_clicks, camera=filmed,
        figures=dance.figures,
    )  # fmt: skip


def _save_page(scene: Scene, path: Path, filmed: CameraPath | None, report: ProgressReport | None) -> None:
    from choreograph.view.page import write_page

    if report is not None:
        report("writing the page", 0, 0)
    leader = scene.dancers[0].dance
    write_page(
        path, leader.motion, leader.plan, song_path=scene.song_path,
        motion_beats_s=leader.motion_beats_s, others=scene.motions[1:], camera=filmed,
        report=substage(report, "writing the page"),
    )  # fmt: skip
