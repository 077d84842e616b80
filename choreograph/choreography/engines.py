"""Ways from song features and constraints to a plan.

- `base` — the `Engine` protocol, its request and its result
- `graph` — seconds of takes: select, warp, and search a path through a graph of them (ChoreoGraph)
- `mixer` — motion words of takes that dance a sequence of motifs (Rhythm is a Dancer)
- `rollout` — a recurrent network that dances a sequence of motifs (Rhythm is a Dancer)
- `candidates`, `word_bank`, `word_search` — the words that fit each slot, and the best sequence of them
- `enforce_motifs`, `danced_motifs` — pinned and banned motifs, checked in the rendered motion
"""

from __future__ import annotations

from choreograph.choreography.constraints import Constraints
from choreograph.choreography.engine import DanceRequest, Engine, EngineResult, check_settings
from choreograph.choreography.graph.engine import GraphEngine
from choreograph.choreography.mixer.engine import MixerEngine
from choreograph.choreography.rollout.engine import RolloutEngine
from choreograph.settings import DanceConfig, EngineName

ENGINES: dict[str, Engine] = {
    engine.name: engine for engine in (GraphEngine(), MixerEngine(), RolloutEngine())
}

__all__ = ["ENGINES", "DanceRequest", "Engine", "EngineResult", "check_settings", "engine_name"]


def engine_name(config: DanceConfig, given: EngineName | None, constraints: Constraints) -> EngineName:
    """The given engine; by default `config`'s, or the mixer for a whole sequence of motifs."""
    if given is not None:
        return given
    return "mixer" if constraints.motifs and config.engine == GraphEngine.name else config.engine
