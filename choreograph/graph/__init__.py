"""The dynamic graph: a layer of nodes per second, costs on nodes and edges, planners.

- `Layer` — all nodes that may be danced in one second, as arrays
- `Cost`, `Style`, `Completeness`, `Transition`, `Velocity`, `Rhythm`, `Pace`, `Variety`,
  `Repeat` — what makes a node dear
- `Signature`, `MotifTransition` — what steers a dance towards a genre; `node_motifs` for them
- `plan_exact`, `plan_greedy` — the cheapest path, the paper's walk
"""

from choreograph.graph.costs import (
    BUILTIN_COSTS,
    Completeness,
    Cost,
    Pace,
    Repeat,
    Rhythm,
    Style,
    Transition,
    Variety,
    Velocity,
)
from choreograph.graph.layers import ClipTable, Layer, LayerSource
from choreograph.graph.motif_costs import MOTIF_COSTS, MotifTransition, Signature, song_words_s
from choreograph.graph.node_motifs import node_motifs
from choreograph.graph.planners import Path, WeightedCost, plan_exact, plan_greedy

__all__ = [
    "BUILTIN_COSTS", "MOTIF_COSTS", "ClipTable", "Completeness", "Cost", "Layer", "LayerSource",
    "MotifTransition", "Pace", "Path", "Repeat", "Rhythm", "Signature", "Style", "Transition", "Variety",
    "Velocity", "WeightedCost", "node_motifs", "plan_exact", "plan_greedy", "song_words_s",
]  # fmt: skip
