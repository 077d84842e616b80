"""Recipe of the shipped repertoire: render its takes, train its networks, write `starter.h5`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from shutil import copyfile
from typing import Any

from choreograph.building import BuildOptions, build_repertoire
from choreograph.files import atomic_path
from choreograph.progress import ProgressReport
from choreograph.repertoire import Repertoire
from choreograph.starter import STARTER_PATH
from choreograph.starter.takes import take_specs, write_takes


def build_starter(
    work: Path,
    output: Path = STARTER_PATH,
    *,
    train_on: Sequence[Path] = (),
    leave_out: Sequence[str] = (),
    preset: str = "small",
    seed: int = 0,
    report: ProgressReport | None = None,
    training_report: Callable[[Any], None] | None = None,
) -> tuple[Repertoire, tuple[str, ...]]:
    """Render the built-in takes, train on them and on real takes, and write the repertoire.

    The repertoire contains only the rendered takes. Real takes (`train_on`, without those named in
    `leave_out`) only train the style networks; motion words are learned from the rendered takes
    alone. Takes and checkpoints stay in `work`, so that an interrupted run can resume.
    Returns the repertoire and notes; raises as `build_repertoire`.
    """
    takes = work / "takes"
    if not (takes / "manifest.csv").exists():
        write_takes(takes, take_specs(), report=report)
    learned = work / "learned.h5"
    # Feet of rendered takes never slide: no foot lock needed.
    given: dict[str, Any] = {"preset": preset, "seed": seed, "resume": True, "lock_feet": False}
    training = BuildOptions(leave_out=tuple(leave_out), words=False, **given)
    _, notes = build_repertoire(
        [takes, *train_on], learned, training, report=report, training_report=training_report
    )
    keeping = BuildOptions(init_from=learned, keep_networks=True, compress=True, **given)
    made, more = build_repertoire(
        [takes], work / output.name, keeping, report=report, training_report=training_report
    )
    with atomic_path(output) as temporary:
        copyfile(made.path, temporary)
    return Repertoire.open(output), (*notes, *more)
