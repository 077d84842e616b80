"""`build`: a repertoire from takes, every option a keyword."""

from __future__ import annotations

import reprlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import Any

from choreograph.build_pipeline.graph_teacher import teach_rollout
from choreograph.building.build import build_repertoire
from choreograph.building.options import BuildOptions
from choreograph.building.result import BuildResult
from choreograph.errors import ParameterError
from choreograph.progress import ProgressReport

_FLAGS = frozenset(f.name for f in fields(BuildOptions) if f.type == "bool")


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
    lock_feet: bool = True,
    augment_mirror: bool = True,
    words: bool = True,
    style_changes: Mapping[str, Any] | None = None,
    density_changes: Mapping[str, Any] | None = None,
    allow_outside: bool = False,
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
        leave_out, lock_feet, augment_mirror, words, pretrained, style_changes, density_changes,
        allow_outside, method : as in `BuildOptions`; `choreograph.published.published_build` gives those of
        the method as published
    init_from : repertoire whose networks training starts from
    report : called with the stage's name, how much is done, of how much
    training_report : called with a `TrainingProgress` now and then

    Raises
    ------
    ChoreographError  another process builds the same file, or it cannot be written
    ParameterError    no take is left, two takes share a name, an unknown preset, an argument of another type
    FormatError       a source is damaged
    RepertoireError   a repertoire to start from cannot be read
    """
    paths = [sources] if isinstance(sources, str | Path) else sources
    if not isinstance(paths, Iterable):
        raise ParameterError(f"expected sources as paths, got {reprlib.repr(sources)}")
    paths = [_as_path("sources", path) for path in paths]
    if isinstance(leave_out, str | bytes) or not isinstance(leave_out, Iterable):
        raise ParameterError(f"expected leave_out as a list of takes, got {reprlib.repr(leave_out)}")
    for name, changes in (("style_changes", style_changes), ("density_changes", density_changes)):
        if not (changes is None or isinstance(changes, Mapping)):
            raise ParameterError(f"expected {name} of field to value, got {reprlib.repr(changes)}")
    for name, called in (("report", report), ("training_report", training_report)):
        if not (called is None or callable(called)):
            raise ParameterError(f"expected a function as {name}, got {reprlib.repr(called)}")
    if isinstance(seed, bool) or not isinstance(seed, int) or seed < 0:
        raise ParameterError(f"expected a seed of 0 or more, got {reprlib.repr(seed)}")
    options = BuildOptions(
        preset=preset, density=density, seed=seed, device=device, beats=beats, resume=resume,
        init_from=None if init_from is None else _as_path("init_from", init_from),
        pretrained=pretrained, keep_networks=keep_networks,
        compress=compress, rollout=rollout, rollout_teacher=rollout_teacher, leave_out=tuple(leave_out),
        lock_feet=lock_feet, augment_mirror=augment_mirror, words=words,
        style_changes=dict(style_changes or {}), density_changes=dict(density_changes or {}),
        allow_outside=allow_outside, method=method,
    )  # fmt: skip
    for name in sorted(_FLAGS):
        if not isinstance(getattr(options, name), bool):
            raise ParameterError(f"expected {name} as True or False, got {getattr(options, name)!r}")
    return build_repertoire(
        paths, _as_path("output", output), options,
        teacher=partial(teach_rollout, beats=beats, seed=seed, report=report),
        report=report, training_report=training_report,
    )  # fmt: skip


def _as_path(what: str, path: object) -> Path:
    if not isinstance(path, str | Path):
        raise ParameterError(f"expected {what} as a path, got {reprlib.repr(path)}")
    return Path(path)
