"""Settings of a dance: one dataclass, read from TOML; an unknown key is an error."""

from __future__ import annotations

import reprlib
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path

from choreograph.arguments import as_whole, check_choice, check_kind, check_text, is_number, unexpected
from choreograph.errors import FormatError, ParameterError
from choreograph.files import read_text

ENGINES = ("graph", "mixer", "rollout")
PLANNERS = ("exact", "greedy", "motion-graph")
SELECTIONS = ("genre", "style", "random")
WARPINGS = ("counts", "dtw", "none")
BLENDINGS = ("inertial", "linear")
TRANSITION_PLACEMENTS = ("beats", "seconds")
DENSITIES = ("repertoire", "learned")
TIME_MAPS = ("smooth", "raw")
MOTIF_DRAWS = ("missing", "absolute")
STYLE_WINDOWS = ("smooth", "hamming")
MAX_VARIATIONS = 1000  # of one song
# Lengths a transition may have: inertial to each side, linear in all; the first where none is chosen.
TRANSITION_LENGTHS_S = {"inertial": (0.4, 0.25, 0.6), "linear": (0.25,)}
# The first ten but completeness and velocity were weighed on dances to training songs, left out in five
# folds; the paper gives no numbers. Those two and `accents` were chosen by the phase of motion beats within
# the count.
DEFAULT_WEIGHTS = {
    "style": 1.0, "completeness": 2.0, "transition": 3.0, "velocity": 3.0, "rhythm": 14.0, "pace": 0.3,
    "variety": 0.75, "repeat": 8.0, "signature": 3.0, "motif_transition": 0.3,
    "accents": 0.0, "bars": 6.0, "phrasing": 4.0, "energy": 2.0, "steps": 0.5, "stillness": 4.0,
}  # fmt: skip


@dataclass(frozen=True)
class DanceConfig:
    """Settings of a dance; field names are the keys of a config file and, with dashes, the CLI's options."""

    engine: str = "graph"  # what a dance is made of: seconds of takes, words of takes, or a network's motion
    planner: str = "exact"  # graph: exact, greedy or motion-graph; mixer: exact or greedy
    candidates: int = 512  # K clips warped for each second (graph)
    selection: str = "genre"  # which clips: at random, at least half of them of the music's genre; or the
    # nearest in "style", or any at "random" (graph)
    warping: str = "counts"  # counts to beats, "dtw" of tempo-densities where they are not known or for all,
    # or "none": as recorded (graph)
    density: str = "repertoire"  # which the DTW aligns: the repertoire's, or only a "learned" one (graph)
    time_maps: str = "smooth"  # of the DTW: with beats on beats, or its path as it is, "raw" (graph)
    blending: str = "inertial"
    transitions: str = "beats"  # where takes change: on downbeats and beats, or on "seconds" (graph)
    lock_feet: bool = True  # of the finished dance (graph)
    hold_ends: bool = True  # a pose before the song's first count, and one after its last (graph)
    keep_on_stage: bool = True  # by small rotations at transitions (graph)
    motif_draw: str = "missing"  # motifs that the dance lacks, or as far from the signature either way, the
    # "absolute" difference of the paper's equation 5 (mixer, rollout)
    style_strength: float | None = None  # β of equation 4, 40 in the paper; None: the network's (rollout)
    style_window: str | None = None  # equation 4's γ: "smooth" from word to word, or the paper's "hamming"
    # in each; None: the network's (rollout)
    fps: float = 60.0
    seed: int = 0
    beats: str | Path = "network"  # a tracker (`song_counts`), or a file of the song's beats
    weights: Mapping[str, float] = field(
        default_factory=dict
    )  # replace DEFAULT_WEIGHTS; custom costs default to 1 (graph)

    def __post_init__(self) -> None:
        from choreograph.song_counts import check_beats

        check_choice("engine", self.engine, ENGINES)
        check_choice("planner", self.planner, PLANNERS)
        check_choice("selection", self.selection, SELECTIONS)
        check_choice("warping", self.warping, WARPINGS)
        check_choice("density", self.density, DENSITIES)
        check_choice("time_maps", self.time_maps, TIME_MAPS)
        check_choice("blending", self.blending, BLENDINGS)
        check_choice("transitions", self.transitions, TRANSITION_PLACEMENTS)
        check_choice("motif_draw", self.motif_draw, MOTIF_DRAWS)
        if self.style_window is not None:
            check_choice("style_window", self.style_window, STYLE_WINDOWS)
        strength = self.style_strength
        if strength is not None and not (is_number(strength) and 0 <= strength <= 1000):
            raise unexpected("a style_strength from 0 to 1000", strength)
        for name in ("lock_feet", "hold_ends", "keep_on_stage"):
            check_kind(name, getattr(self, name), bool)
        check_beats(self.beats)
        object.__setattr__(self, "candidates", as_whole("candidates of at least 1", self.candidates, least=1))
        if not (is_number(self.fps) and 1 <= self.fps <= 1000):
            raise unexpected("fps from 1 to 1000", self.fps)
        object.__setattr__(self, "seed", as_whole("a seed of 0 or more", self.seed, least=0))
        if not isinstance(self.weights, Mapping):
            raise unexpected("weights of cost name to number", self.weights)
        check_text("the cost that a weight is of", *self.weights)
        for name, weight in self.weights.items():
            if not is_number(weight):
                raise unexpected(f"a finite number as weight of {name!r}", weight)


def load_config(path: str | Path, base: DanceConfig | None = None) -> DanceConfig:
    """The settings of a TOML file, on top of `base` (default: the defaults).

    Raises `FormatError` if the file cannot be read or is not TOML, `ParameterError` for an unknown
    key or a value that cannot be used.
    """
    text = read_text(path, "a config (TOML)")
    try:
        data = tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # an integer of too many digits is no TOMLDecodeError
        raise FormatError(f"{path}: expected a config (TOML), could not read it: {error}") from error
    known = [f.name for f in fields(DanceConfig)]
    unknown = set(data) - set(known)
    if unknown:
        raise ParameterError(f"{path}: expected keys among {', '.join(known)}, got {min(unknown)!r}")
    if not isinstance(data.get("weights", {}), dict):
        got = reprlib.repr(data["weights"])
        raise ParameterError(f"{path}: expected a table [weights] of name = number, got {got}")
    return replace(base or DanceConfig(), **data)


def resolve_weights(given: Mapping[str, float], names: list[str]) -> dict[str, float]:
    """The weight of every cost by name: as given, else its default, else 1 for a custom cost.

    Raises `ParameterError` for a weight that belongs to no cost.
    """
    unknown = sorted(set(given) - set(names))
    if unknown:
        raise unexpected(f"weights of costs among {', '.join(names)}", unknown[0])
    return {name: float(given.get(name, DEFAULT_WEIGHTS.get(name, 1.0))) for name in names}
