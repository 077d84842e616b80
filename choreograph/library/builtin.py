"""What ships with the package: songs, the file of the built-in repertoire, and networks.

There are two sets of networks, which differ in the data that they were trained on (`pretrained_set`). One of
their networks estimates the counts of a take from its motion (`load_motion_counter`). The built-in repertoire
is opened by `repertoire.starter_repertoire`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from choreograph.core.counts import Counts
from choreograph.core.errors import ParameterError
from choreograph.core.files import sha256_of
from choreograph.library.schema import NetArrays
from choreograph.library.store import read_networks

STARTER_PATH = Path(__file__).parent / "shipped" / "starter.h5"
SONGS_PATH = Path(__file__).parent / "shipped" / "songs"


def example_songs() -> dict[str, Path]:
    """The built-in songs, by name.

    Returns
    -------
    dict   name to path of the sound file

    Examples
    --------
    >>> songs = cg.example_songs()
    >>> sorted(songs)
    ['cha-cha', 'house', 'waltz']
    >>> song = cg.load_song(songs["house"])
    """
    return {path.stem: path for path in sorted(SONGS_PATH.glob("*.ogg"))}


# The networks that ship with the package.


PRETRAINED = ("clean", "research")
DEFAULT, NOTHING = "default", "nothing"
CHOICES = (DEFAULT, *PRETRAINED, NOTHING)
# The set "clean" is used if it is as good (`research/results/style.md`, `research/results/motion_counts.md`).
_BY_DEFAULT = {"style": "clean", "motion_counts": "research"}
_DESCRIPTIONS = {
    "clean": "the networks 'clean', trained on the program's own takes",
    "research": "the networks 'research', also trained on data that states no licence (--pretrained clean: "
    "without)",
}


@dataclass(frozen=True, eq=False)
class PretrainedNet:
    """A network of one of the sets."""

    set_name: str
    arrays: NetArrays
    trained_on: tuple[str, ...]  # names of songs and takes

    @property
    def description(self) -> str:
        """The set and its training data, in one line."""
        return _DESCRIPTIONS[self.set_name]


def pretrained_set(name: str) -> dict[str, PretrainedNet]:
    """The networks of a set by name. "nothing" has none. "default" has the better set for each network.

    Raises `ParameterError` for an unknown name, `RepertoireError` if the installation lacks a file.
    """
    if name not in CHOICES:
        raise ParameterError(f"expected pretrained among {', '.join(CHOICES)}, got {name!r}")
    chosen = {}
    for set_name in PRETRAINED:
        if name not in (DEFAULT, set_name):
            continue
        nets, provenance = read_networks(pretrained_path(set_name))
        trained_on = tuple(provenance.get("trained_on", ()))
        for net_name, arrays in nets.items():
            if name == set_name or _BY_DEFAULT[net_name] == set_name:
                chosen[net_name] = PretrainedNet(set_name, arrays, trained_on)
    return chosen


def shipped_checksums(name: str) -> list[str]:
    """SHA-256 of the files that `pretrained_set` reads for a choice."""
    return [sha256_of(pretrained_path(set_name)) for set_name in PRETRAINED if name in (DEFAULT, set_name)]


def pretrained_path(name: str) -> Path:
    """The file of a set."""
    return Path(__file__).parent / "shipped" / f"{name}.h5"


# The network that estimates the counts of a take from its motion.


MotionCounter = Callable[[NDArray[np.floating]], Counts]  # body positions (T, 21, 3) at 20 fps to counts
# Confidence below which counts from motion are not used,
MIN_MOTION_CONFIDENCE = 0.5
# Mean uncertainty above which none are used. It is 0.13 to 0.29 in real takes with figures that the network
# was not trained on, and 0.34 and more in takes that are shuffled or stand still.
MAX_MOTION_UNCERTAINTY = 0.3
MOTION_NET = "motion_counts"  # its name among the pretrained networks


def load_motion_counter(pretrained: Mapping[str, PretrainedNet]) -> MotionCounter | None:
    """The network that estimates counts from motion, or None if the set has none."""
    if MOTION_NET not in pretrained:
        return None
    return partial(_counts_by, pretrained[MOTION_NET].arrays)


def _counts_by(stored: NetArrays, body_pos_m: NDArray[np.floating]) -> Counts:
    from choreograph.nets.motion_counts import MotionCounts

    return MotionCounts.from_arrays(stored.weights, stored.config).counts(body_pos_m)


def are_likely_right(counts: Counts) -> bool:
    """Whether counts that were estimated from the motion are used."""
    return counts.confidence >= MIN_MOTION_CONFIDENCE and mean_uncertainty(counts) <= MAX_MOTION_UNCERTAINTY


def mean_uncertainty(counts: Counts) -> float:
    """The mean of the uncertainty of counts, 0 if no network estimated them."""
    return float(counts.uncertainty.mean()) if len(counts.uncertainty) else 0.0
