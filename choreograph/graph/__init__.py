"""The dynamic graph: a layer of nodes per second, costs on nodes and edges, planners.

- `layers` — `Layer`, all nodes active in one second, and `LayerSource`, which builds them
- `costs` — `Cost` and the built-in costs of nodes and edges; `weighted_costs` sums and checks them
- `ending_costs` — the cost of poses that are held before the first count and after the last
- `motif_costs` — costs that steer a dance towards a genre's signature and motif transitions
- `node_motifs` — the motifs that each node dances
- `planners` — `plan_exact`, the cheapest path, and `plan_greedy`, the paper's
- `motion_graph` — the paper's baseline, a static motion graph
"""

from choreograph.graph.costs import (
    BUILTIN_COSTS,
    Accents,
    Bars,
    Completeness,
    Cost,
    Energy,
    Pace,
    Phrasing,
    Repeat,
    Rhythm,
    Steps,
    Style,
    Transition,
    Variety,
    Velocity,
)
from choreograph.graph.ending_costs import Stillness
from choreograph.graph.layers import ClipTable, Layer, LayerSource
from choreograph.graph.motif_costs import (
    MOTIF_COSTS,
    MotifTransition,
    Signature,
    song_words_s,
    words_between,
)
from choreograph.graph.node_motifs import node_motifs
from choreograph.graph.planners import Path, plan_exact, plan_greedy
from choreograph.graph.weighted_costs import WeightedCost

__all__ = [
    "BUILTIN_COSTS", "MOTIF_COSTS", "Accents", "Bars", "ClipTable", "Completeness", "Cost", "Energy",
    "Layer", "LayerSource", "MotifTransition", "Pace", "Path", "Phrasing", "Repeat", "Rhythm", "Signature",
    "Steps", "Stillness", "Style", "Transition", "Variety", "Velocity", "WeightedCost", "node_motifs",
    "plan_exact", "plan_greedy", "song_words_s", "words_between",
]  # fmt: skip
