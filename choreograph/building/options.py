"""How a repertoire is built."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class BuildOptions:
    """Settings of a build; see `choreograph build-db --help`."""

    preset: str = "small"  # size and training length of the networks: tiny, small, paper
    density: str = "analytic"  # which tempo-density clips carry, "analytic" or "learned"
    seed: int = 0
    device: str = "auto"  # where networks are trained: auto, cpu, cuda
    resume: bool = False  # continue from the checkpoints of a build that was stopped
    init_from: Path | None = None  # repertoire whose networks training starts from
    pretrained: str = "clean"  # which shipped networks are used: clean, research, nothing
    pretrained_style: Path | None = None  # repertoire whose style networks training starts from otherwise
    keep_networks: bool = False  # take those of `init_from` as they are; only what it lacks is trained
    compress: bool = False  # motion in 16 bits: a third of the size, rotations to 0.03 degrees
    rollout: bool = False  # train the rollout network, which takes as long as all others together
    leave_out: tuple[str, ...] = ()  # takes left out of everything, by name
    lock_feet: bool = True  # of takes, before anything is measured
    augment_mirror: bool = True  # train on mirrored motion, too
    words: bool = True  # find motion words and motifs; without, no word network is stored either
