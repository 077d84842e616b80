"""`build`: a repertoire from takes, every option a keyword."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from choreograph.arguments import as_list, as_texts, check_function
from choreograph.build_pipeline.graph_teacher import teach_rollout
from choreograph.building.build import build_repertoire
from choreograph.building.options import BuildOptions
from choreograph.building.result import BuildResult
from choreograph.files import as_path
from choreograph.numerics import default_numerics
from choreograph.progress import ProgressReport


@default_numerics()
def build(
    sources: str | Path | Iterable[str | Path],
    output: str | Path,
    *,
    preset: str = "small",
    density: str = "analytic",
    seed: int = 0,
    device: str = "auto",
    beats: str = BuildOptions.beats,
    resume: bool = False,
    init_from: str | Path | None = None,
    pretrained: str = BuildOptions.pretrained,
    keep_networks: bool = False,
    compress: bool = False,
    rollout: bool = False,
    rollout_teacher: bool = BuildOptions.rollout_teacher,
    leave_out: Sequence[str] = (),
    skip_bad: bool = False,
    lock_feet: bool = True,
    augment_mirror: bool = True,
    words: bool = True,
    style_changes: Mapping[str, Any] | None = None,
    density_changes: Mapping[str, Any] | None = None,
    allow_outside: bool = False,
    bone_map: Mapping[str, str] | None = None,
    method: str = "ours",
    report: ProgressReport | None = None,
    training_report: Callable[[Any], None] | None = None,
) -> BuildResult:
    """Build a repertoire from takes and their songs, and write it to one file.

    Parameters
    ----------
    sources : a folder or file of takes, or several
    output : the file to write; work in progress lies beside it in `OUTPUT.build/`
    preset, density, seed, device, beats, resume, keep_networks, compress, rollout, rollout_teacher,
        leave_out, skip_bad, lock_feet, augment_mirror, words, pretrained, style_changes, density_changes,
        allow_outside, bone_map, method : as in `BuildOptions`; `choreograph.published.published_build` gives
        those of the method as published
    init_from : repertoire whose networks training starts from
    report : called with the stage's name, how much is done, of how much
    training_report : called with a `TrainingProgress` now and then

    Raises
    ------
    ChoreographError  another process builds the same file, or it cannot be written
    ParameterError    no take is left, two takes share a name, an unknown choice, an argument of another type
    FormatError       a source is damaged; an `UnreadFilesError` names several damaged files
    RepertoireError   a repertoire to start from cannot be read
    """
    paths = as_list("sources", [sources] if isinstance(sources, str | Path) else sources, "paths", str | Path)
    check_function("report", report)
    check_function("training_report", training_report)
    options = BuildOptions(
        preset=preset, density=density, seed=seed, device=device, beats=beats, resume=resume,
        init_from=None if init_from is None else as_path("init_from", init_from),
        pretrained=pretrained, keep_networks=keep_networks,
        compress=compress, rollout=rollout, rollout_teacher=rollout_teacher,
        leave_out=as_texts("leave_out", leave_out), skip_bad=skip_bad,
        lock_feet=lock_feet, augment_mirror=augment_mirror, words=words,
        style_changes={} if style_changes is None else style_changes,
        density_changes={} if density_changes is None else density_changes,
        allow_outside=allow_outside, bone_map=bone_map, method=method,
    )  # fmt: skip
    return build_repertoire(
        paths, as_path("the output", output), options,
        teacher=partial(teach_rollout, beats=beats, seed=seed, report=report),
        report=report, training_report=training_report,
    )  # fmt: skip
