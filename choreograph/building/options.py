"""How a repertoire is built."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from choreograph.errors import ParameterError
from choreograph.song_counts import DEFAULT_BEATS, TRACKER_NAMES, names_a_tracker

DENSITIES = ("analytic", "learned")


@dataclass(frozen=True)
class BuildOptions:
    """Settings of a build; see `choreograph build-db --help`."""

    preset: str = "small"  # size and training length of the networks: tiny, small, paper
    density: str = "analytic"  # which tempo-density clips carry: analytic, or "learned" by two more networks
    seed: int = 0
    device: str = "auto"  # where networks are trained: auto, cpu, cuda
    beats: str = DEFAULT_BEATS  # tracker of the takes' songs: see `song_counts`
    resume: bool = False  # continue from the checkpoints of a build that was stopped
    init_from: Path | None = None  # repertoire whose networks training starts from
    # Which shipped networks count takes by their motion, and with preset small begin the training of style:
    # default, clean, research, nothing (`pretrained.library`).
    pretrained: str = "default"
    keep_networks: bool = False  # take the networks that training would start from as they are
    compress: bool = False  # motion in 16 bits: a third of the size, rotations to 0.03 degrees
    rollout: bool = False  # train the rollout network, which takes as long as all others together
    rollout_teacher: bool = True  # the rollout network learns from graph dances, too
    leave_out: tuple[str, ...] = ()  # takes left out of everything, by name
    lock_feet: bool = True  # of takes, before anything is measured
    augment_mirror: bool = True  # train on mirrored motion, too
    words: bool = True  # find motion words and motifs; without, no word network is stored either
    # Fields of `StyleConfig` and `DensityConfig` that are unlike the preset's.
    style_changes: Mapping[str, Any] = field(default_factory=dict)
    density_changes: Mapping[str, Any] = field(default_factory=dict)
    allow_outside: bool = False  # read songs that a manifest names outside of its folder
    method: str = "ours"  # what the file says of how it was built: see `choreograph.published`

    def __post_init__(self) -> None:
        if not names_a_tracker(self.beats):
            raise ParameterError(f"expected beats among {', '.join(TRACKER_NAMES)}, got {self.beats!r}")
        if self.density not in DENSITIES:
            raise ParameterError(
                f"expected a tempo-density among {', '.join(DENSITIES)}, got {self.density!r}"
            )
