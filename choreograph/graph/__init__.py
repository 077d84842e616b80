"""The dynamic graph: a layer of nodes per second, costs on nodes and edges, planners.

- `Layer` — all nodes that may be danced in one second, as arrays
- `Cost`, `Style`, `Completeness`, `Transition`, `Velocity`, `Rhythm`, `Variety`,
  `Repeat` — what makes a node dear
- `plan_exact`, `plan_greedy` — the cheapest path, the paper's walk
"""

from choreograph.graph.costs import (
    BUILTIN_COSTS,
    Completeness,
    Cost,
    Repeat,
    Rhythm,
    Style,
    Transition,
    Variety,
    Velocity,
)
from choreograph.graph.layers import ClipTable, Layer, LayerSource
from choreograph.graph.planners import Path, WeightedCost, plan_exact, plan_greedy

__all__ = [
    "BUILTIN_COSTS", "ClipTable", "Completeness", "Cost", "Layer", "LayerSource", "Path", "Repeat",
    "Rhythm", "Style", "Transition", "Variety", "Velocity", "WeightedCost", "plan_exact", "plan_greedy",
]  # fmt: skip
