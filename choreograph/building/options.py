"""How a repertoire is built."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class BuildOptions:
    """How to build a repertoire; see `choreograph build-db --help`."""

    preset: str = "small"  # size and training length of the networks: tiny, small, paper
    density: str = "analytic"  # which tempo-density clips carry; the README's table says why
    seed: int = 0
    device: str = "auto"
    resume: bool = False
    init_from: Path | None = None  # networks of another repertoire to begin with
    pretrained_style: Path | None = (
        None  # style networks to begin with where `init_from` has none (CLI: starter's)
    )
    keep_networks: bool = False  # take those as they are; only what they lack is trained
    packed: bool = False  # motion in 16 bits: a third of the size, turns to 0.03 degrees
    rollout: bool = False  # train the network that dances motifs, too: as long as all else together
    leave_out: tuple[str, ...] = ()  # takes left out of everything, by name
    lock_feet: bool = True  # of takes: what a dance then does to its feet makes fewer beats nobody danced
    augment_mirror: bool = True  # networks learn from motion seen in a mirror, too
    words: bool = True  # cut motion words and find motifs; without, a word network is not even taken over
