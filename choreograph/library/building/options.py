"""The settings of a build, and its result."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field
from html import escape
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, TypedDict

from choreograph.core.errors import ParameterError
from choreograph.core.progress import counted, cut_line, one_line
from choreograph.core.settings import Range, settings
from choreograph.library.notes import Note
from choreograph.library.repertoire import Repertoire
from choreograph.motion.bone_map import check_bone_map
from choreograph.nets.configs import config_from_preset, density_config, rollout_config, style_config

Preset = Literal["tiny", "small", "paper"]
Density = Literal["analytic", "learned"]
Device = Literal["auto", "cpu", "cuda"]
Precision = Literal["float32", "bfloat16"]
Pretrained = Literal["default", "clean", "research", "nothing"]
Tracker = Literal["network", "tempo-path", "librosa", "beat-this"]


@settings
class BuildOptions:
    """Settings of a build.

    The fields are also the options of `choreograph build-db`, with dashes. `cg.build` takes them as keywords.

    Raises
    ------
    ParameterError   for a value of another type, an unknown choice, or a number out of range

    Examples
    --------
    >>> cg.BuildOptions(preset="tiny", words=False)
    BuildOptions(preset='tiny', words=False)
    """

    preset: Preset = "small"
    """Size and training length of the networks. "tiny" is for a first try, "small" for two CPU cores, and
    "paper" for a GPU."""

    density: Density = "analytic"
    """Which tempo-density clips carry. "analytic" is computed from motion beats. "learned" trains two more
    networks for it."""

    seed: Annotated[int, Range(0)] = 0
    """Seed of all training. Build with several seeds to measure how much results vary."""

    device: Device = "auto"
    """Where networks are trained. "auto" uses a GPU if there is one."""

    precision: Precision = "float32"
    """Arithmetic of the networks in training. "bfloat16" rounds what they multiply, not their weights, their
    poses or their losses. Results then differ from those with "float32"."""

    beats: Tracker = "network"
    """Beat tracker for the songs of the takes. Change it if takes are counted wrongly."""

    workers: Annotated[int, Range(0)] = 0
    """Processes that read and measure takes and analyse songs. 0 is one for each CPU core. The result does
    not depend on it."""

    dask: str = ""
    """Address of a Dask scheduler, such as tcp://10.0.0.5:8786, whose workers read and measure takes and
    analyse songs. Takes must have the same paths there, unless `stage` is set. The result does not depend on
    it."""

    stage: bool = False
    """Whether takes and songs are sent along to the workers of `dask`, which then need no access to them."""

    cache_gb: Annotated[float, Range(0)] = 4.0
    """Gigabytes of the user's cache for measured takes and analysed songs, so that a later build reads only
    what is new. Those of 15 hours need 4 GB. The result does not depend on it. 0 keeps nothing."""

    resume: bool = False
    """Whether to continue from the checkpoints of a build that was stopped."""

    init_from: Path | None = None
    """Repertoire whose networks the training starts from, such as an older one of the same takes."""

    pretrained: Pretrained = "default"
    """Shipped networks that count takes by their motion and that, with the preset "small", the training of
    style and motion words starts from. "clean" was trained on our own takes only. "research" was also trained
    on data that states no licence. "default" takes style from "clean" and counts from "research". Words are
    those of the built-in takes."""

    train_words: bool = False
    """Whether the network of motion words is trained from nothing, and not started from the shipped one or
    kept as it is. This takes five times as many steps."""

    keep_networks: bool = False
    """Whether the networks that training would start from are used as they are, and the motifs of
    `init_from` with them. A build then takes seconds."""

    compress: bool = False
    """Whether motion is stored in 16 bits, without the body positions that follow from it. The file has about
    a ninth of the size, and rotations are exact to 0.03 degrees."""

    rollout: bool = False
    """Whether the rollout network is trained as well, for the engine "rollout". It takes as long as all
    others together."""

    rollout_teacher: bool = True
    """Whether the rollout network also learns from graph dances. These are on the count, which takes need
    not be. It takes half as long again."""

    leave_out: tuple[str, ...] = ()
    """Names of takes that are left out of everything, such as those held out for an evaluation."""

    skip_bad: bool = False
    """Whether to build from the other takes if some files cannot be read. Without it, they are an error."""

    lock_feet: bool = True
    """Whether feet of takes that slide where they stand are kept in place, before anything is measured."""

    augment_mirror: bool = True
    """Whether training also uses mirrored motion. Switch it off where left must stay left."""

    words: bool = True
    """Whether motion words and motifs are found. Without them, the file has no word network, and only the
    graph engine dances from it."""

    style_changes: Mapping[str, Any] = field(default_factory=dict)
    """Fields of `StyleConfig` that differ from those of the preset."""

    density_changes: Mapping[str, Any] = field(default_factory=dict)
    """Fields of `DensityConfig` that differ from those of the preset."""

    rollout_changes: Mapping[str, Any] = field(default_factory=dict)
    """Fields of `RolloutConfig` that differ from those of the preset."""

    allow_outside: bool = False
    """Whether songs that a manifest names outside of its folder are read. Allow it for your own manifests
    only."""

    bone_map: Mapping[str, str] | None = None
    """Which bone is which, from canonical names to those of the rig, for takes whose rig has all of these
    bones."""

    method: str = "ours"
    """The method that the file states. `choreograph.pipeline.published.published_build` sets "published"."""

    __repr__ = one_line

    def __post_init__(self) -> None:
        check_bone_map(self.bone_map)
        for config, changes in (
            (style_config, self.style_changes),
            (density_config, self.density_changes),
            (rollout_config, self.rollout_changes),
        ):
            config_from_preset({self.preset: config(self.preset)}, self.preset, changes)
        if self.stage and not self.dask:
            raise ParameterError("expected the address of a Dask scheduler (dask) beside stage, got none")


class ReadingSettings(TypedDict, total=False):
    """The fields of `BuildOptions` about the reading of sources, as keywords of `change_takes`."""

    workers: int
    dask: str
    stage: bool
    cache_gb: float
    leave_out: Sequence[str]
    skip_bad: bool
    allow_outside: bool
    bone_map: Mapping[str, str] | None


class BuildSettings(ReadingSettings, total=False):
    """The fields of `BuildOptions` as keywords of `build`, for type checkers and editors."""

    preset: Preset
    density: Density
    seed: int
    device: Device
    precision: Precision
    beats: Tracker
    resume: bool
    init_from: str | Path | None
    pretrained: Pretrained
    train_words: bool
    keep_networks: bool
    compress: bool
    rollout: bool
    rollout_teacher: bool
    lock_feet: bool
    augment_mirror: bool
    words: bool
    style_changes: Mapping[str, Any]
    density_changes: Mapping[str, Any]
    rollout_changes: Mapping[str, Any]
    method: str


# What a build returns.


class BuildResult(NamedTuple):
    """The repertoire that was built, and a summary of what was unusual, in at most 25 lines.

    The summary has a line for each kind of notes, with their number and the ranges of their values.

    Examples
    --------
    >>> motion, _ = cg.starter_repertoire().motion(0, stop_s=10)
    >>> cg.save_motion("walk.bvh", motion)
    >>> built = cg.build("walk.bvh", "rep.h5", preset="tiny", words=False, pretrained="nothing")
    >>> built
    <BuildResult rep.h5: 1 take, 3 clips, 4 notes>
    >>> print(built.notes[0])
    walk: read as centimetres, which makes the body 1.71 m tall
    """

    repertoire: Repertoire
    """The repertoire that was built, opened."""

    notes: tuple[str, ...]
    """What was unusual, one line for each kind."""

    @property
    def details(self) -> tuple[Note, ...]:
        """The notes one by one, as the repertoire stores them. Notes on a resumed training are not stored."""
        return self.repertoire.notes

    @property
    def path(self) -> Path:
        """The file that was written."""
        return self.repertoire.path

    def __repr__(self) -> str:
        takes, clips = counted(len(self.repertoire.takes), "take"), counted(self.repertoire.n_clips, "clip")
        return cut_line(
            f"<BuildResult {self.path.name}: {takes}, {clips}, {counted(len(self.details), 'note')}>"
        )

    def _repr_html_(self) -> str:
        notes = "".join(f"<li>{escape(note)}</li>" for note in self.notes)
        return self.repertoire._repr_html_() + (f"<ul>{notes}</ul>" if notes else "")
