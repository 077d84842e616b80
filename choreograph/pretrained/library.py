"""Loader of the networks that ship with the package."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from choreograph.errors import ParameterError
from choreograph.files import sha256_of
from choreograph.repertoire.layout import NetArrays
from choreograph.repertoire.store import read_networks

PRETRAINED = ("clean", "research")
DEFAULT, NOTHING = "default", "nothing"
CHOICES = (DEFAULT, *PRETRAINED, NOTHING)
# The clean one where it is as good (`examples/results/style.md`, `examples/results/motion_counts.md`).
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
    trained_on: tuple[str, ...]  # songs of built-in and recorded takes that its set heard

    @property
    def description(self) -> str:
        """What a user should know of the set, in a line."""
        return _DESCRIPTIONS[self.set_name]


def pretrained_set(name: str) -> dict[str, PretrainedNet]:
    """The networks of a set by their names; none of "nothing". "default" takes the better set for each.

    Raises `ParameterError` for an unknown name, `RepertoireError` if the installation lacks a file.
    """
    if name not in CHOICES:
        raise ParameterError(f"expected pretrained among {', '.join(CHOICES)}, got {name!r}")
    chosen = {}
    for set_name in PRETRAINED:
        if name not in (DEFAULT, set_name):
            continue
        nets, provenance = read_networks(pretrained_path(set_name))
        heard = tuple(provenance.get("trained_on", ()))
        for net_name, arrays in nets.items():
            if name == set_name or _BY_DEFAULT[net_name] == set_name:
                chosen[net_name] = PretrainedNet(set_name, arrays, heard)
    return chosen


def shipped_checksums(name: str) -> list[str]:
    """SHA-256 of the files that `pretrained_set` reads for a choice."""
    return [sha256_of(pretrained_path(set_name)) for set_name in PRETRAINED if name in (DEFAULT, set_name)]


def pretrained_path(name: str) -> Path:
    """The file of a set."""
    return Path(__file__).with_name(f"{name}.h5")
