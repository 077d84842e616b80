"""The commands that faults are tried on, with tiny inputs: a run takes a second or two."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from short_trainings import shorten_trainings
from synthetic_motions import stepping
from synthetic_repertoire import synthetic_repertoire, write_clicks

from choreograph.cli.main import main
from choreograph.formats.register import save_motion
from choreograph.nets import training

_STEPS = 5  # of every training


@dataclass(frozen=True)
class Task:
    """A command that writes files into a folder."""

    arguments: Callable[[Path, Path], list[str]]  # of the folders of inputs and outputs
    outputs: tuple[str, ...]
    resumes: bool = True  # by --resume, which a run after a fault is given
    checkpoint_every_s: float = 0.0  # of trainings: a checkpoint after every step

    def run(self, inputs: Path, folder: Path, *, resume: bool) -> int:
        """Run the command in this process; its exit status."""
        _shorten_trainings(self.checkpoint_every_s)
        given = self.arguments(inputs, folder) + (["--resume"] if resume and self.resumes else [])
        try:
            main(given, standalone_mode=True)
        except SystemExit as ended:
            return int(ended.code or 0)
        return 0


def _build(inputs: Path, folder: Path) -> list[str]:
    return [
        "build-db", str(inputs / "takes"), "--preset", "tiny", "-q", "-o", str(folder / "rep.h5"),
        "--beats", "tempo-path",
    ]  # fmt: skip


TASKS: Mapping[str, Task] = {
    "build": Task(_build, ("rep.h5",), checkpoint_every_s=30.0),
    "training": Task(_build, ("rep.h5",)),
    "rollout training": Task(lambda i, o: [*_build(i, o), "--rollout"], ("rep.h5",)),
    "dance": Task(
        lambda inputs, folder: [
            "dance", str(inputs / "songs" / "song.wav"), "--db", str(inputs / "rep.h5"), "-q",
            *(part for name in ("d.bvh", "d.glb", "d.html", "d.json") for part in ("-o", str(folder / name))),
        ],
        ("d.bvh", "d.glb", "d.html", "d.json"),
        resumes=False,
    ),
    "evaluate": Task(
        lambda inputs, folder: [
            "evaluate", "--db", str(inputs / "rep.h5"), "--songs", str(inputs / "songs"), "-q",
            "--seeds", "2", "--variants", "random", "--json", str(folder / "e.json"),
        ],
        ("e.json",),
    ),
}  # fmt: skip


def write_inputs(folder: Path) -> None:
    """Takes to clicks, a song, and a repertoire to dance with."""
    (folder / "takes").mkdir(parents=True)
    (folder / "songs").mkdir()
    for seed, (name, bpm) in enumerate({"even": 110, "quick": 130}.items()):
        save_motion(folder / "takes" / f"{name}.bvh", stepping(16 * 30, period_s=60 / bpm, seed=seed))
        write_clicks(folder / "takes" / f"{name}.wav", duration_s=16.0, bpm=bpm)
    write_clicks(folder / "songs" / "song.wav", duration_s=6.0)
    synthetic_repertoire(folder / "rep.h5")


def _shorten_trainings(checkpoint_every_s: float) -> None:
    training.CHECKPOINT_EVERY_S = checkpoint_every_s
    shorten_trainings(_STEPS)
    sys.stdin.close()  # nothing waits for an answer
