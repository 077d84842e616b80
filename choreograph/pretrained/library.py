"""Loader of the networks that ship with the package."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from choreograph.errors import ParameterError
from choreograph.repertoire.store import NetArrays, read_networks

PRETRAINED = ("clean", "research")
NOTHING = "nothing"


@dataclass(frozen=True)
class PretrainedSet:
    """One of the sets, or nothing."""

    name: str
    nets: Mapping[str, NetArrays] = field(default_factory=dict)
    trained_on: tuple[str, ...] = ()  # songs of built-in and recorded takes

    @property
    def description(self) -> str:
        """What a user should know of the set, in a line."""
        return {
            "clean": "the networks 'clean', trained on the program's own takes",
            "research": "the networks 'research', also trained on data that states no licence "
            "(--pretrained clean: without)",
        }.get(self.name, "no networks")


def pretrained_set(name: str) -> PretrainedSet:
    """The networks of a set, none of "nothing".

    Raises `ParameterError` for an unknown name, `RepertoireError` if the installation lacks the file.
    """
    if name == NOTHING:
        return PretrainedSet(name)
    if name not in PRETRAINED:
        raise ParameterError(f"expected pretrained among {', '.join((*PRETRAINED, NOTHING))}, got {name!r}")
    nets, provenance = read_networks(pretrained_path(name))
    return PretrainedSet(name, nets, tuple(provenance.get("trained_on", ())))


def pretrained_path(name: str) -> Path:
    """The file of a set."""
    return Path(__file__).with_name(f"{name}.h5")
