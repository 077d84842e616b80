"""Writes scenes of several dancers to files. The suffix of a name selects the format."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from choreograph.core.errors import ParameterError
from choreograph.core.files import atomic_path, check_apart
from choreograph.core.progress import ProgressReport, substage
from choreograph.formats import writers
from choreograph.pipeline.saving import check_outputs, format_of

if TYPE_CHECKING:
    from choreograph.pipeline.scenes import Scene

_TOGETHER = ("html", "json")  # formats of one file for all dancers


def scene_paths(path: str | Path, n_dancers: int) -> tuple[Path, ...]:
    """The files that a scene writes for a path: the path itself, or NAME-1.bvh and so on for each dancer."""
    path = Path(path)
    if n_dancers == 1 or format_of(path) in _TOGETHER:
        return (path,)
    return tuple(path.with_name(f"{path.stem}-{number + 1}{path.suffix}") for number in range(n_dancers))


def check_scene_outputs(paths: Sequence[str | Path], n_dancers: int) -> None:
    """Raise `ParameterError` before any work if a format is unknown or a folder does not exist."""
    check_outputs(paths)
    for path in paths:
        if n_dancers > 1 and format_of(path) not in (*_TOGETHER, *writers()):
            raise ParameterError(f"{path}: expected a format of scenes, got {format_of(path)}")
    check_apart([one for path in paths for one in scene_paths(path, n_dancers)], ())


def save_scene(
    scene: Scene, path: Path, *, with_clicks: bool = False, report: ProgressReport | None = None
) -> None:
    """Write a scene to `path` by its suffix. Raises as `Scene.save`."""
    n_dancers, suffix = len(scene.dancers), format_of(path)
    check_scene_outputs([path], n_dancers)
    read = [scene.song_path] if scene.song_path is not None else []
    check_apart(scene_paths(path, n_dancers), read)
    if suffix == "json":
        with atomic_path(path) as temporary:
            temporary.write_text(scene.plan.to_json(), encoding="utf-8")
    elif n_dancers > 1 and suffix == "html":
        _save_page(scene, path, report)
    else:
        for dancer, own in zip(scene.dancers, scene_paths(path, n_dancers), strict=True):
            used = suffix in ("glb", "fbx", "html") and dancer.character is not None
            character = dancer.character if used else None
            click = with_clicks and suffix == "mp4"
            dancer.dance.save(own, character=character, click=click, report=report)


def _save_page(scene: Scene, path: Path, report: ProgressReport | None) -> None:
    from choreograph.view.page import write_page

    if report is not None:
        report("writing the page", 0, 0)
    leader = scene.dancers[0].dance
    write_page(
        path, leader.motion, leader.plan, song_path=scene.song_path,
        motion_beats_s=leader.motion_beats_s, others=scene.motions[1:],
        report=substage(report, "writing the page"),
    )  # fmt: skip
