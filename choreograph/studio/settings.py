"""The settings of a dance, or of several dancers, that the studio changes."""

from __future__ import annotations

import reprlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any

from choreograph.choreography.formations import FORMATIONS
from choreograph.choreography.schedule import parse_schedule
from choreograph.core.arguments import check_choice, check_text, is_whole, unexpected
from choreograph.core.errors import ParameterError
from choreograph.core.settings import changed as changed_settings
from choreograph.pipeline.scene_planning import SceneRequest, dancer_names
from choreograph.plan.scenes import MOST_DANCERS
from choreograph.settings import DanceConfig

ENGINES = ("graph", "mixer", "rollout")
RELATIONS = ("unison", "mirror", "canon:2", "canon:4", "canon:8", "call-and-response", "free")  # for pages
SCENE_SETTINGS = ("dancers", "formation", "relation")  # which leave the dance of the leader as it is
_TEXTS = ("bans", "formation", "relation")
_MOST_TEXTS, _LONGEST_TEXT = 200, 100  # of formations or relations


@dataclass(frozen=True)
class Settings:
    """The settings of a dance that the studio changes, named as in `DanceConfig`, with the requests."""

    engine: str = "graph"
    seed: int = 0
    genre: str | None = None  # that is danced, or None for what suits the song
    dynamics: float = 1.0
    front: str = "audience"
    stage: str = "near"
    weights: Mapping[str, float] = field(default_factory=dict)  # of costs, instead of the defaults
    repertoire: str = ""  # name of the file of the takes that are danced
    bans: tuple[str, ...] = ()  # such as "take:house-01"
    dancers: int = 1
    formation: tuple[str, ...] = ("v",)  # of several dancers: VALUE, or WHEN=VALUE for a part of the song
    relation: tuple[str, ...] = ("unison",)  # as well

    def changed(self, changes: Mapping[str, Any]) -> Settings:
        """The settings with some changed, as JSON states them. `weights` are added to the others.

        A weight of None is the default again. Raises `ParameterError` for a name or value that is not valid.
        """
        known = [one.name for one in fields(Settings)]
        for name in changes:
            if name not in known:
                raise ParameterError(f"expected settings among {', '.join(known)}, got {name[:80]!r}")
        new = dict(changes)
        if "weights" in new:
            if not isinstance(new["weights"], Mapping):
                got = reprlib.repr(new["weights"])
                raise ParameterError(f"expected weights as numbers by name, got {got}")
            weights = {**self.weights, **new["weights"]}
            new["weights"] = {name: weight for name, weight in weights.items() if weight is not None}
        for name in _TEXTS:
            if name in new:
                new[name] = _texts(name, new[name])
        made = replace(self, **new)
        check_choice("engine", made.engine, ENGINES)
        if not (made.genre is None or isinstance(made.genre, str)):
            raise ParameterError(f"expected a genre by name, got {reprlib.repr(made.genre)}")
        check_text("a repertoire by name", made.repertoire)
        if not is_whole(made.dancers) or not 1 <= made.dancers <= MOST_DANCERS:
            raise unexpected(f"1 to {MOST_DANCERS} dancers", made.dancers)
        for entry in parse_schedule("formation", made.formation, "v"):
            check_choice("a formation", entry.value, FORMATIONS)  # and no file, whose name a page would send
        made.scene_request()
        made.config()
        return made

    def config(self) -> DanceConfig:
        """The settings of a dance. Raises `ParameterError` for a value that is not valid."""
        names = ("engine", "seed", "dynamics", "front", "stage", "weights")
        return changed_settings(DanceConfig(), {name: getattr(self, name) for name in names})

    def dance_config(self) -> DanceConfig:
        """The settings of a dance, without weights if the engine has no built-in costs."""
        config = self.config()
        return config if self.engine == "graph" else replace(config, weights={})

    def scene_request(self) -> SceneRequest:
        """The dancers, formations and relations. Raises `ParameterError` if a text is not valid."""
        return SceneRequest.of(dancer_names(self.dancers), self.formation, self.relation)

    def of_dancer(self, index: int) -> Settings:
        """The settings of the dance that a dancer has for itself, in a relation without others."""
        usual = {name: getattr(Settings, name) for name in SCENE_SETTINGS}
        return replace(self, seed=self.seed + index, **usual)

    def to_data(self) -> dict[str, Any]:
        """The settings as JSON. Those of several dancers are left out where they are the defaults."""
        data = asdict(self)
        return {
            name: data[name]
            for name in data
            if name not in SCENE_SETTINGS or data[name] != getattr(Settings, name)
        }


def _texts(name: str, given: object) -> tuple[str, ...]:
    """A list of texts. Raises `ParameterError` for anything else, and for far too many of them."""
    if not isinstance(given, list | tuple) or not all(isinstance(one, str) for one in given):
        raise ParameterError(f"expected {name} as a list of texts, got {reprlib.repr(given)}")
    is_long = len(given) > _MOST_TEXTS or any(len(one) > _LONGEST_TEXT for one in given)
    if name in SCENE_SETTINGS and is_long:
        raise ParameterError(
            f"expected at most {_MOST_TEXTS} texts of {_LONGEST_TEXT} characters as {name}, got more"
        )
    return tuple(given)
