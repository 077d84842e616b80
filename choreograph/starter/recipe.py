"""Building the shipped repertoire: takes rendered, networks learned, one file written."""

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
from choreograph.starter.takes import take_plans, write_takes


def build_starter(
    work: Path,
    output: Path = STARTER_PATH,
    *,
    learn_from: Sequence[Path] = (),
    leave_out: Sequence[str] = (),
    preset: str = "small",
    seed: int = 0,
    report: ProgressReport | None = None,
    training_report: Callable[[Any], None] | None = None,
) -> tuple[Repertoire, tuple[str, ...]]:
    """Render the starter's takes, learn from them and from real takes, write the repertoire.

    Only the rendered takes go into it; of the real ones (`learn_from`, without those named in
    `leave_out`) nothing but what the style and tempo-density networks learned; motion words are learned from
    the rendered takes alone. Takes and checkpoints stay in `work`, so that a run that was stopped goes on
    where it was. Returns the repertoire and notes; raises as
    `build_repertoire`.
    """
    takes = work / "takes"
    if not (takes / "manifest.csv").exists():
        write_takes(takes, take_plans(), report=report)
    learned = work / "learned.h5"
    # Rendered feet stand where they stand.
    given: dict[str, Any] = {"preset": preset, "seed": seed, "resume": True, "hold_feet": False}
    training = BuildOptions(leave_out=tuple(leave_out), words=False, **given)
    _, notes = build_repertoire(
        [takes, *learn_from], learned, training, report=report, training_report=training_report
    )
    keeping = BuildOptions(init_from=learned, keep_networks=True, compress=True, **given)
    made, more = build_repertoire(
        [takes], work / output.name, keeping, report=report, training_report=training_report
    )
    with atomic_path(output) as temporary:
        copyfile(made.path, temporary)
    return Repertoire.open(output), (*notes, *more)
