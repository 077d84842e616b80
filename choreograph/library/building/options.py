"""How a repertoire is built, and what a build returns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from html import escape
from pathlib import Path
from typing import Any, NamedTuple

from choreograph.core.arguments import as_texts, as_whole, check_choice, check_kind, check_text, unexpected
from choreograph.core.files import as_path
from choreograph.library.builtin import CHOICES
from choreograph.library.repertoire import Repertoire
from choreograph.library.songs import DEFAULT_BEATS, TRACKER_NAMES
from choreograph.motion.bone_map import check_bone_map
from choreograph.nets.configs import DEVICES, PRESET_NAMES, config_from_preset, density_config, style_config

# How a repertoire is built.


DENSITIES = ("analytic", "learned")


@dataclass(frozen=True)
class BuildOptions:
    """Settings of a build; see `choreograph build-db --help`.

    Raises `ParameterError` for an unknown choice, or a field of another type.
    """

    preset: str = "small"  # size and training length of the networks: tiny, small, paper
    density: str = "analytic"  # which tempo-density clips carry: analytic, or "learned" by two more networks
    seed: int = 0
    device: str = "auto"  # where networks are trained: auto, cpu, cuda
    beats: str = DEFAULT_BEATS  # tracker of the takes' songs: see `song_counts`
    resume: bool = False  # continue from the checkpoints of a build that was stopped
    init_from: Path | None = None  # repertoire whose networks training starts from
    # Which shipped networks count takes by their motion, and with preset small begin the training of style:
    # default, clean, research, nothing (`library.builtin`).
    pretrained: str = "default"
    keep_networks: bool = False  # take the networks that training would start from as they are
    compress: bool = False  # motion in 16 bits: a third of the size, rotations to 0.03 degrees
    rollout: bool = False  # train the rollout network, which takes as long as all others together
    rollout_teacher: bool = True  # the rollout network learns from graph dances, too
    leave_out: tuple[str, ...] = ()  # takes left out of everything, by name
    skip_bad: bool = False  # build from the other takes where files cannot be read
    lock_feet: bool = True  # of takes, before anything is measured
    augment_mirror: bool = True  # train on mirrored motion, too
    words: bool = True  # find motion words and motifs; without, no word network is stored either
    # Fields of `StyleConfig` and `DensityConfig` that are unlike the preset's.
    style_changes: Mapping[str, Any] = field(default_factory=dict)
    density_changes: Mapping[str, Any] = field(default_factory=dict)
    allow_outside: bool = False  # read songs that a manifest names outside of its folder
    # Canonical name to the rig's name, for takes whose rig has all bones of it: see `motion.bone_map`.
    bone_map: Mapping[str, str] | None = None
    method: str = "ours"  # what the file says of how it was built: see `choreograph.settings`

    def __post_init__(self) -> None:
        check_choice("a preset", self.preset, PRESET_NAMES)
        check_choice("a tempo-density", self.density, DENSITIES)
        check_choice("a device", self.device, DEVICES)
        check_choice("beats", self.beats, TRACKER_NAMES)
        check_choice("pretrained", self.pretrained, CHOICES)
        check_text("the method", self.method)
        check_bone_map(self.bone_map)
        object.__setattr__(self, "seed", as_whole("a seed of 0 or more", self.seed, least=0))
        if self.init_from is not None:
            object.__setattr__(self, "init_from", as_path("a repertoire to start from", self.init_from))
        object.__setattr__(self, "leave_out", as_texts("leave_out", self.leave_out))
        for option in fields(self):
            value = getattr(self, option.name)
            if option.type == "bool":
                check_kind(option.name, value, bool)
            elif option.name.endswith("_changes") and not isinstance(value, Mapping):
                raise unexpected(f"{option.name} of field to value", value)
        for config, changes in ((style_config, self.style_changes), (density_config, self.density_changes)):
            config_from_preset({self.preset: config(self.preset)}, self.preset, changes)


# What a build returns.


class BuildResult(NamedTuple):
    """The repertoire that was built, and notes on what was unusual, one line each."""

    repertoire: Repertoire
    notes: tuple[str, ...]

    @property
    def path(self) -> Path:
        """The file that was written."""
        return self.repertoire.path

    def __repr__(self) -> str:
        takes, clips = len(self.repertoire.takes), self.repertoire.n_clips
        return f"<BuildResult {self.path.name}: {takes} takes, {clips} clips, {len(self.notes)} notes>"

    def _repr_html_(self) -> str:
        notes = "".join(f"<li>{escape(note)}</li>" for note in self.notes)
        return self.repertoire._repr_html_() + (f"<ul>{notes}</ul>" if notes else "")
