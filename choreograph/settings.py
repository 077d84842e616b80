"""Settings of a dance, also from TOML files."""

from __future__ import annotations

import reprlib
import tomllib
from collections.abc import Mapping
from dataclasses import field
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal, TypedDict, get_args

from choreograph.core.arguments import as_stage_m, check_choice, check_text, is_number, unexpected
from choreograph.core.errors import FormatError, ParameterError
from choreograph.core.files import read_text
from choreograph.core.plugins import Group, installed_names
from choreograph.core.progress import one_line
from choreograph.core.settings import Range, UsedBy, changed, described, settings
from choreograph.music.song import Song

EngineName = Literal["graph", "mixer", "rollout"]  # the built-in ones
Planner = Literal["exact", "greedy", "motion-graph"]
Selection = Literal["genre", "style", "random"]
Warping = Literal["counts", "dtw", "none"]
Blending = Literal["inertial", "linear"]
Front = Literal["audience", "free"]
Transitions = Literal["beats", "seconds"]
Density = Literal["repertoire", "learned", "clip"]
TimeMaps = Literal["smooth", "raw"]
MotifDraw = Literal["missing", "absolute"]
StyleWindow = Literal["smooth", "hamming"]
MAX_VARIATIONS = 1000  # of one song
# Lengths a transition may have: inertial to each side, linear in all. The first one is the default.
TRANSITION_LENGTHS_S = {"inertial": (0.4, 0.25, 0.6), "linear": (0.25,)}
# What other packages add by entry points.
ENGINE_GROUP = Group("choreograph.engines", get_args(EngineName))


@settings
class DanceConfig:
    """Settings of a dance.

    The names of the fields are also keywords of `dance`, keys of a settings file (TOML), and names for
    `choreograph dance --set NAME=VALUE`. Each setting says which engines use it. `ParameterError` is raised
    for a value of another type, an unknown choice, or a number out of range.

    Examples
    --------
    >>> config = cg.DanceConfig(engine="mixer", seed=3)
    >>> config
    DanceConfig(engine='mixer', seed=3)
    >>> config.planner
    'exact'
    >>> cg.DanceConfig(candidates=0)
    Traceback (most recent call last):
    choreograph.core.errors.ParameterError: expected candidates as whole number of 1 or more, got 0
    """

    engine: Annotated[EngineName | str, UsedBy("")] = "graph"
    """What a dance is made of. "graph" joins seconds of takes, "mixer" joins motion words of takes, and
    "rollout" generates motion with a network. Graph dances are the most like the takes. Other packages can
    add engines."""

    planner: Annotated[Planner, UsedBy("graph", "mixer")] = "exact"
    """How the engine searches. "exact" finds the cheapest dance of the whole song. "greedy" takes the
    cheapest step each time, as ChoreoGraph does. In the mixer, it takes the word of each motif that begins
    nearest to the last poses, on any count, as Rhythm is a Dancer does. "motion-graph" walks through a graph
    of similar poses, as a baseline of the graph engine."""

    bound: Annotated[bool, UsedBy("graph")] = False
    """Whether the planner "exact" also computes a lower bound of the costs of all paths, for the plan and a
    note. It takes as long as the search again."""

    candidates: Annotated[int, Range(1), UsedBy("graph")] = 512
    """How many clips may be warped for each second. More clips give the planner more choice and take longer.
    If all of them are of one genre, half as many are warped."""

    selection: Annotated[Selection, UsedBy("graph")] = "genre"
    """Which clips become candidates. "genre" draws them at random from the genre that suits the music. If
    the genre is not known or you add a cost, up to half of them are of any genre. "style" takes those that
    are nearest in style, as ChoreoGraph does. "random" draws from all clips."""

    warping: Annotated[Warping, UsedBy("graph")] = "counts"
    """How clips are aligned with the music. "counts" moves the counts of a take onto the beats, and uses
    "dtw" where a take has no counts. "dtw" aligns tempo-densities by subsequence DTW. "none" plays the
    clips as they were recorded."""

    density: Annotated[Density, UsedBy("graph")] = "repertoire"
    """Which tempo-density the DTW aligns: the one that the repertoire was built with, or only a "learned"
    one. With "learned", a repertoire without learned densities is refused. With "clip", its network also
    estimates the density of each clip from that clip alone, as in ChoreoGraph. Otherwise, it is the mean of
    the estimates of clips that overlap."""

    time_maps: Annotated[TimeMaps, UsedBy("graph")] = "smooth"
    """How the path of the DTW is played. "smooth" keeps beats on beats and avoids sudden changes of speed.
    "raw" plays the path as it is, as ChoreoGraph does."""

    blending: Annotated[Blending, UsedBy("graph", "mixer")] = "inertial"
    """How takes are joined. "inertial" lets differences of pose and velocity decay on both sides of the
    join. "linear" is the crossfade of the paper."""

    transitions: Annotated[Transitions, UsedBy("graph")] = "beats"
    """When the take changes: on beats, preferably downbeats and borders of figures, or on whole "seconds"
    as in the paper."""

    lock_feet: Annotated[bool, UsedBy("graph", "mixer")] = True
    """Whether feet that touch the floor are kept in place. Switch it off to compare with the takes as they
    are."""

    hold_ends: Annotated[bool, UsedBy("")] = True
    """Whether a pose is held before the first count of the song, and another after its last strong count.
    Held poses stand on both feet, breathe and shift their weight."""

    stage: Annotated[str, UsedBy("graph", "mixer", "rollout")] = "near"
    """Where the dancer stays: "near" the middle by small rotations at joins, or "free". "4x3" is a stage 4 m
    wide and 3 m deep, and motion that leaves it has a cost as well."""

    front: Annotated[Front, UsedBy("graph", "mixer", "rollout")] = "audience"
    """Where the dancer faces. With "audience", the graph engine and the mixer prefer motion that faces the
    audience, and small rotations bring the dancer of every engine back after figures that turn. "free" does
    without both. The front of a take is the direction that its dancer faces most."""

    motif_draw: Annotated[MotifDraw, UsedBy("mixer", "rollout")] = "missing"
    """How motifs are drawn. "missing" draws motifs that the dance does not yet have as often as its
    signature asks for. "absolute" weighs them by the absolute difference, which is equation 5 of Rhythm is
    a Dancer as printed, and draws single ones for any count."""

    phrase_counts: Annotated[int, Range(1, 64), UsedBy("mixer", "rollout")] = 16
    """About how many counts each passage of a take lasts, from which motifs are drawn. A passage begins at
    the start of a bar, and returns with its phrase of the song, where its last four counts may vary. Dances
    of longer passages are more like the takes. With 1, motifs are drawn one by one, as in Rhythm is a
    Dancer."""

    style_strength: Annotated[Annotated[float, Range(0, 1000)] | None, UsedBy("rollout")] = None
    """How much the music changes the style of the motion: β in equation 4 of Rhythm is a Dancer, which uses
    40. None takes the value that the network was trained with."""

    style_window: Annotated[StyleWindow | None, UsedBy("rollout")] = None
    """How the style changes from word to word: γ in equation 4. "smooth" interpolates, "hamming" fades it
    in and out in each word as in the paper. None takes what the network was trained with."""

    style_song: Annotated[str | Path | Song | None, UsedBy("rollout")] = None
    """Another song, whose style the motion takes on. None takes the style of the song itself."""

    dynamics: Annotated[float, Range(0, 1), UsedBy("")] = 1.0
    """How much the size of the dance follows the dynamics of the music, from 0 (not at all, as real ballroom
    dancers) to 1. With 1, the dance is up to 50 % smaller in soft parts and 10 % larger in loud ones, and
    stops where the music is silent. Set it to 0 to dance in the size of the takes."""

    fps: Annotated[float, Range(1, 1000), UsedBy("")] = 60.0
    """Frames per second of the dance. Game engines often use 30."""

    seed: Annotated[int, Range(0), UsedBy("")] = 0
    """Seed of everything that is drawn at random. Another seed gives another dance."""

    beats: Annotated[str | Path, UsedBy("")] = "network"
    """Where the beats of the song come from: the tracker "network", "tempo-path", "librosa" or "beat-this",
    or the path of a file of beats. Use a file where no tracker is right."""

    cache: Annotated[bool, UsedBy("")] = True
    """Whether the analysis of the song and motifs of takes are kept in the user's cache and read from there.
    The dance is the same. The variable CHOREOGRAPH_CACHE names another folder."""

    weights: Annotated[Mapping[str, float], UsedBy("graph", "mixer", "rollout")] = field(default_factory=dict)
    """Weights of costs by name, in place of the defaults, from 0 on. 0 leaves a cost out. A cost of your own
    has the weight 1 unless it is named here. A cost of another package takes part if it is named here. The
    mixer and the rollout have no built-in costs."""

    __repr__ = one_line

    def __post_init__(self) -> None:
        from choreograph.library.songs import check_beats

        if self.engine not in get_args(EngineName):
            check_choice("engine", self.engine, engine_names())
        check_beats(self.beats)
        as_stage_m(self.stage)
        check_text("the cost that a weight is of", *self.weights)
        for name, weight in self.weights.items():
            if not (is_number(weight) and weight >= 0):
                raise unexpected(f"a finite number as weight of {name!r}, not below 0", weight)


class DanceSettings(TypedDict, total=False):
    """The fields of `DanceConfig` as keywords of `dance` and `vary`, for type checkers and editors."""

    engine: EngineName | str
    planner: Planner
    bound: bool
    candidates: int
    selection: Selection
    warping: Warping
    density: Density
    time_maps: TimeMaps
    blending: Blending
    transitions: Transitions
    lock_feet: bool
    hold_ends: bool
    stage: str
    front: Front
    motif_draw: MotifDraw
    phrase_counts: int
    style_strength: float | None
    style_window: StyleWindow | None
    style_song: str | Path | Song | None
    dynamics: float
    fps: float
    seed: int
    beats: str | Path
    cache: bool
    weights: Mapping[str, float]


@cache
def settings_of(engine: str) -> frozenset[str]:
    """The settings that say that a built-in engine uses them, or all engines for ""."""
    return frozenset(setting.name for setting in described(DanceConfig) if engine in setting.engines)


def engine_names() -> tuple[str, ...]:
    """The names of the built-in engines, then those of engines of other packages."""
    return (*ENGINE_GROUP.builtin, *installed_names(ENGINE_GROUP))


def as_config(config: object) -> DanceConfig:
    """A `DanceConfig`. Raises `ParameterError` for anything else."""
    if not isinstance(config, DanceConfig):
        raise unexpected("a DanceConfig as config", config)
    return config


def as_weights(weights: object) -> dict[str, Any]:
    """Weights as a dictionary, as in `DanceConfig`. Raises `ParameterError` for anything but a mapping."""
    if not isinstance(weights, Mapping):
        raise unexpected("weights as a mapping of cost name to number", weights)
    return dict(weights)


def load_config(path: str | Path, base: DanceConfig | None = None) -> DanceConfig:
    """The settings of a TOML file, on top of `base` (default: the defaults).

    Raises `FormatError` if the file cannot be read or is not TOML, `ParameterError` for an unknown
    key or a value that cannot be used.
    """
    text = read_text(path, "a config (TOML)")
    try:
        data = tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # an integer of too many digits is not a TOMLDecodeError
        raise FormatError(f"{path}: expected a config (TOML), could not read it: {error}") from error
    if not isinstance(data.get("weights", {}), dict):
        got = reprlib.repr(data["weights"])
        raise ParameterError(f"{path}: expected a table [weights] of name = number, got {got}")
    try:
        return changed(base or DanceConfig(), data)
    except ParameterError as error:
        raise ParameterError(f"{path}: {error}") from None
