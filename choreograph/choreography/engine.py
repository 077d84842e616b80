"""The interface of engines, which make a plan from the features of a song and constraints, and their names.

A new engine is one class and one line in `BUILTIN_ENGINES`. Another package adds a class by an entry point of
the group `choreograph.engines`, under the engine's name.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, fields
from pkgutil import resolve_name
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from choreograph.choreography.constraints import Constraints
from choreograph.choreography.graph.cost import Cost
from choreograph.choreography.material import Material
from choreograph.choreography.slots import KeptDance, ResolvedConstraints
from choreograph.core.arguments import check_choice, unexpected
from choreograph.core.cache import NO_MEMORY, Memory
from choreograph.core.errors import ParameterError
from choreograph.core.numerics import AnyFloats, Floats
from choreograph.core.plugins import installed
from choreograph.core.progress import ProgressReport
from choreograph.library.repertoire import Repertoire
from choreograph.motion.motion import Motion
from choreograph.music.count_grids import coming_to_rest_s
from choreograph.music.song import Song
from choreograph.music.song_features import SongFeatures
from choreograph.plan.plan import SHORTEST_STOP_S, Plan
from choreograph.settings import ENGINE_GROUP, DanceConfig, settings_of

# The built-in engines. Their modules import this one, so they are imported when `engines` is called.
BUILTIN_ENGINES = {
    "graph": "choreograph.choreography.graph.engine:GraphEngine",
    "mixer": "choreograph.choreography.mixer.engine:MixerEngine",
    "rollout": "choreograph.choreography.rollout.engine:RolloutEngine",
}
# The settings that every engine uses.
COMMON_SETTINGS = settings_of("")
# The dynamics of a dance by the energy of its song.
LEAST_AMPLITUDE, GREATEST_AMPLITUDE = 0.5, 1.1
_GAIN = 0.85  # of the amplitude, for the difference of the energy from the song's usual one
_ACCENT = 0.5  # of a rise of the energy within 2 s, added to the energy of its first seconds
_USUAL_PERCENTILE = 75  # of the energy, at which a dance has the size of the takes
_NEARLY_USUAL = 0.1  # of the energy. A rise to a softer second is no accent
_STEP = 0.05  # of amplitudes, so that a song of one loudness has none


@dataclass(frozen=True, eq=False)
class DanceRequest:
    """One dance to plan, with everything that an engine may use."""

    song: Song  # the part of the song that is danced
    song_features: SongFeatures  # of this part
    repertoire: Repertoire  # of the takes, motifs and networks
    config: DanceConfig  # all settings
    constraints: ResolvedConstraints  # for each word of the dance
    material: Material  # takes, counts and goals of each part of the dance
    costs: tuple[Cost, ...] = ()  # the user's
    style_song: Song | None = None  # whose style the motion has, if it is another song
    kept: KeptDance | None = None  # its kept parts replace what is planned there
    report: ProgressReport | None = None  # of the progress
    memory: Memory = NO_MEMORY  # of values for this repertoire
    # Shows a plan, without costs, that the engine has early and rarely changes.
    likely: Callable[[Plan], None] | None = None

    @property
    def danced_span_s(self) -> tuple[float, float]:
        """When the held first pose ends, and when the held last pose begins.

        The span is the whole song if no pose is held. It is longer where requested motifs need it.
        """
        features, resolved = self.song_features, self.constraints
        if not self.config.hold_ends:
            return 0.0, features.duration_s
        wanted = sorted(resolved.motifs)
        early = wanted and resolved.bounds_s[wanted[0]] < features.opening_s
        rests_from_s, _ = coming_to_rest_s(features.opening_s, features.closing_s)
        late = wanted and resolved.bounds_s[wanted[-1] + 1] > rests_from_s
        return (
            0.0 if early else features.opening_s,
            features.duration_s if late else features.closing_s,
        )

    @property
    def _amplitudes(self) -> tuple[float, ...]:
        """The amplitude of each second. Requested motifs and pinned takes keep their size."""
        fixed = [
            range(max(0, int(start_s) - 1), int(np.ceil(end_s)) + 1) for start_s, end_s in self._fixed_spans_s
        ]
        seconds = {second for spans in fixed for second in spans}
        return amplitudes(self.song_features.energy, self.config.dynamics, seconds)

    @property
    def _stops_s(self) -> tuple[tuple[float, float], ...]:
        """The stops within the danced span. There is none near requested motifs, nor with pinned takes."""
        if not self.config.dynamics or self.constraints.requested.take_pins:
            return ()
        first_s, last_s = self.danced_span_s
        return tuple(
            (rests_s, moves_s)
            for rests_s, moves_s in self.song_features.stops_s
            if first_s + SHORTEST_STOP_S <= rests_s
            and moves_s + SHORTEST_STOP_S <= last_s
            and not any(
                start_s < moves_s + 1 and end_s > rests_s - 1 for start_s, end_s in self._fixed_spans_s
            )
        )

    @property
    def _fixed_spans_s(self) -> list[tuple[float, float]]:
        """The times of requested motifs and pinned takes."""
        bounds_s = self.constraints.bounds_s
        of_motifs = [(float(bounds_s[slot]), float(bounds_s[slot + 1])) for slot in self.constraints.motifs]
        return [*of_motifs, *((pin.start_s, pin.end_s) for pin in self.constraints.requested.take_pins)]

    def new_plan(self, **parts: Any) -> Plan:
        """A plan with the song, the repertoire and the settings, as every engine stores them."""
        features, config, counts = self.song_features, self.config, self.song_features.counts
        opening_s, closing_s = self.danced_span_s
        common = {
            "song": features.name, "duration_s": features.duration_s, "start_s": self.song.start_s,
            "repertoire": self.repertoire.path.name, "planner": config.planner, "blending": config.blending,
            "seed": config.seed, "fps": config.fps, "weights": {}, "seconds": (), "words": (),
            "music_beats_s": tuple(float(beat) for beat in features.beat_times_s),
            "music_beat_numbers": tuple(map(int, counts.numbers)) if counts.has_bars else (),
            "metre": counts.metre, "opening_s": opening_s,
            "closing_s": closing_s if closing_s < features.duration_s else None,
            "lock_feet": config.lock_feet, "stage": config.stage,
            "front": config.front, "amplitudes": self._amplitudes, "stops_s": self._stops_s,
        }  # fmt: skip
        return Plan(**{**common, **parts})


def amplitudes(energy: AnyFloats, strength: float, fixed: Collection[int] = ()) -> tuple[float, ...]:
    """The amplitude of each second (S,) of a dance by the energy of its song (S,), none if all are 1.

    It is 1 at the energy that a quarter of the song exceeds. A sudden rise is an accent of two seconds. The
    `strength` is 1 for the full range, 0.5 to 1.1, and 0 for none. `fixed` seconds have the amplitude 1.
    """
    known = np.asarray(energy, np.float64)
    before = np.concatenate([known[:1], known[:1], known])[: len(known)]  # 2 s ago
    louder = known - np.percentile(known, _USUAL_PERCENTILE)
    louder += _ACCENT * np.maximum(known - before, 0.0) * (louder > -_NEARLY_USUAL)
    full = np.clip(1.0 + _GAIN * louder, LEAST_AMPLITUDE, GREATEST_AMPLITUDE)
    scaled = np.round(np.round((1.0 + strength * (full - 1.0)) / _STEP) * _STEP, 2)
    scaled[[second for second in fixed if second < len(scaled)]] = 1.0
    return tuple(scaled.tolist()) if (scaled != 1.0).any() else ()


@dataclass(frozen=True, eq=False)
class Check:
    """Words of a plan that have to show certain motifs once it is rendered.

    `again` gets the rendered motion and the embedding of each word (N, D), nan for one that is too short. It
    returns another plan, or a final one with its motion, and raises `NoPathError` if none is left.
    """

    bounds_s: Floats  # (N + 1,) of the words in the dance
    again: Callable[[Motion, NDArray[np.float32]], EngineResult]


@dataclass(frozen=True, eq=False)
class EngineResult:
    """A plan, transitions and their times included, and notes on what was unusual.

    It is final unless it has a `check`. `choreograph.pipeline.planning` renders it.
    """

    plan: Plan
    notes: tuple[str, ...] = ()  # one line each
    unmet: tuple[str, ...] = ()  # what was requested and is not danced, one line each
    motion: Motion | None = None  # the rendered plan, if it was rendered before
    generated: Motion | None = None  # what a network dances, without the stops and amplitudes of the plan
    over: Motion | None = None  # a rendered dance, over which the words of takes in the plan are laid
    check: Check | None = None  # of the rendered plan


class Engine(Protocol):
    """A method that makes a plan from song features and constraints."""

    name: str
    settings: frozenset[str]  # fields of `DanceConfig` and arguments of `dance` beyond `COMMON_SETTINGS`

    def check(
        self,
        repertoire: Repertoire,
        config: DanceConfig,
        constraints: Constraints,
        costs: Sequence[Cost],
    ) -> None:
        """Raise before any work if the engine cannot make this dance.

        Raises `RepertoireError` if the repertoire lacks something that the engine needs, and `ParameterError`
        for constraints or costs that it does not support.
        """

    def plan(self, request: DanceRequest) -> EngineResult:
        """Plan the dance. Raise `NoPathError` if the constraints leave none.

        A plan that has to show certain motifs may have a `Check`, by which the engine is asked again.
        """


def engines() -> dict[str, Engine]:
    """The engines by name: the built-in ones, then those of other packages."""
    builtin = {name: resolve_name(place)() for name, place in BUILTIN_ENGINES.items()}
    return builtin | {name: kind() for name, kind in installed(ENGINE_GROUP, _check_engine).items()}


def engine_named(name: str) -> Engine:
    """The engine of this name. A built-in one is made without loading the others.

    Raises `ParameterError` for an engine of another package that cannot be loaded.
    """
    if name in BUILTIN_ENGINES:
        made: Engine = resolve_name(BUILTIN_ENGINES[name])()
        return made
    known = engines()
    check_choice("engine", name, known)
    return known[name]


def _check_engine(name: str, kind: Any) -> None:
    """Raise unless the class of another package makes an engine of this name."""
    engine = kind()
    if engine.name != name:
        raise unexpected(f"an engine with the name {name!r} of its entry point", engine.name)
    if not all(isinstance(setting, str) for setting in engine.settings):
        raise unexpected("the settings of the engine as names", engine.settings)
    if not (callable(engine.check) and callable(engine.plan)):
        raise unexpected("an engine with the methods check and plan", kind)


def engine_for(config: DanceConfig, constraints: Constraints) -> str:
    """The engine of `config`, or the mixer instead of the graph engine for a whole sequence of motifs."""
    return "mixer" if constraints.motifs and config.engine == "graph" else config.engine


def check_settings(engine: Engine, config: DanceConfig, given: Collection[str]) -> None:
    """Raise `ParameterError` for a setting that `engine` does not use, or that another setting excludes.

    A setting counts if its name is among those `given`, or if its value in `config` is not the default.
    """
    changed = {f.name for f in fields(DanceConfig) if getattr(config, f.name) != _default(f.name)}
    unused = sorted((changed | set(given)) - COMMON_SETTINGS - engine.settings)
    if unused:
        name = unused[0]
        users = " or ".join(other.name for other in engines().values() if name in other.settings)
        raise ParameterError(
            f"expected no {name.replace('_', ' ')} with the {engine.name} engine: it is a setting of the "
            f"{users} engine. Leave it out, or choose that engine"
        )
    aligning = sorted({"density", "time_maps"} & set(given))
    if config.warping == "none" and aligning:
        raise ParameterError(
            f"expected no {aligning[0].replace('_', ' ')} with the warping none, which aligns nothing: leave "
            "it out, or choose the warping dtw"
        )


def _default(name: str) -> object:
    return getattr(DanceConfig(), name)
