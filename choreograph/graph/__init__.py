"""The dynamic graph: a layer of nodes per second, costs on nodes and edges, planners.

- `layers` — `Layer`, all nodes active in one second, and `LayerSource`, which builds them
- `costs` — `Cost` and the built-in costs of nodes and edges; `weighted_costs` sums and checks them
- `motif_costs` — costs that steer a dance towards a genre's signature and motif transitions
- `node_motifs` — the motifs that each node dances
- `planners` — `plan_exact`, the cheapest path, and `plan_greedy`, the paper's
- `motion_graph` — the paper's baseline, a static motion graph
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
from choreograph.graph.planners import Path, plan_exact, plan_greedy
from choreograph.graph.weighted_costs import WeightedCost

__all__ = [
    "BUILTIN_COSTS", "MOTIF_COSTS", "ClipTable", "Completeness", "Cost", "Layer", "LayerSource",
    "MotifTransition", "Pace", "Path", "Repeat", "Rhythm", "Signature", "Style", "Transition", "Variety",
    "Velocity", "WeightedCost", "node_motifs", "plan_exact", "plan_greedy", "song_words_s",
]  # fmt: skip
