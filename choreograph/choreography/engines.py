"""The engines by name, and the choice of the engine for a dance.

A new engine is one class (`choreography.engine.Engine`) and one line in `BUILTIN_ENGINES`. Another package
adds a class by an entry point of the group `choreograph.engines`, under the engine's name.
"""

from __future__ import annotations

from choreograph.choreography.constraints import Constraints
from choreograph.choreography.engine import Engine
from choreograph.choreography.graph.engine import GraphEngine
from choreograph.choreography.mixer.engine import MixerEngine
from choreograph.choreography.rollout.engine import RolloutEngine
from choreograph.core import installed
from choreograph.settings import ENGINE_GROUP, DanceConfig

BUILTIN_ENGINES: tuple[type[Engine], ...] = (GraphEngine, MixerEngine, RolloutEngine)


def engines() -> dict[str, Engine]:
    """The engines by name: the built-in ones, then those of other packages."""
    added = {name: kind() for name, kind in installed(ENGINE_GROUP).items()}
    return {**{engine.name: engine() for engine in BUILTIN_ENGINES}, **added}


def engine_for(config: DanceConfig, constraints: Constraints) -> str:
    """The engine of `config`, or the mixer instead of the graph engine for a whole sequence of motifs."""
    return MixerEngine.name if constraints.motifs and config.engine == GraphEngine.name else config.engine
