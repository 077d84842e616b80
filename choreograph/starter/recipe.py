"""Recipe of the shipped repertoire: render its takes, train its networks, write `starter.h5`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from shutil import copyfile
from typing import Any

from choreograph.building import BuildOptions, build_repertoire
from choreograph.files import atomic_path, check_apart, check_target
from choreograph.locked_folder import locked_folder
from choreograph.progress import ProgressReport
from choreograph.repertoire import Repertoire
from choreograph.starter import STARTER_PATH
from choreograph.starter.takes import take_specs, write_takes


def build_starter(
    work: Path,
    output: Path = STARTER_PATH,
    *,
    preset: str = "small",
    seed: int = 0,
    report: ProgressReport | None = None,
    training_report: Callable[[Any], None] | None = None,
) -> tuple[Repertoire, tuple[str, ...]]:
    """Render the built-in takes, train on them, and write the repertoire.

    With preset small the style networks are those of the shipped set `clean`, which were trained on these
    takes. Takes and checkpoints stay in `work`, so that an interrupted run can resume. Returns the repertoire
    and notes; raises as `build_repertoire`, and `ChoreographError` if another process works in `work`.
    """
    check_apart([check_target(output)], [work / "takes"])
    with locked_folder(work, doing=f"builds {output.name}"):
        return _built_starter(work, output, preset, seed, report, training_report)


def _built_starter(
    work: Path,
    output: Path,
    preset: str,
    seed: int,
    report: ProgressReport | None,
    training_report: Callable[[Any], None] | None,
) -> tuple[Repertoire, tuple[str, ...]]:
    takes = work / "takes"
    if not (takes / "manifest.csv").exists():
        write_takes(takes, take_specs(), report=report)
    # Feet of rendered takes never slide: no foot lock needed.
    options = BuildOptions(
        preset=preset, seed=seed, resume=True, lock_feet=False, pretrained="clean",
        keep_networks=preset == "small", compress=True, rollout=True,
        rollout_teacher=False,  # built-in takes are on the count already
    )  # fmt: skip
    made, notes = build_repertoire(
        [takes], work / output.name, options, report=report, training_report=training_report
    )
    with atomic_path(output) as temporary:
        copyfile(made.path, temporary)
    return Repertoire.open(output), notes
