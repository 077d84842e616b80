"""The baseline of the paper, a static motion graph instead of the dynamic one."""

from __future__ import annotations

from collections.abc import Sequence

import networkx as nx
import numpy as np
from numpy.typing import NDArray

from choreograph.choreography.graph.cost import WeightedCost
from choreograph.choreography.graph.costs import BUILTIN_COSTS, Transition
from choreograph.choreography.graph.layers import Layer
from choreograph.choreography.graph.planners import Path
from choreograph.choreography.graph.segments import LayerSource
from choreograph.core.errors import NoPathError
from choreograph.core.progress import StepReport, part
from choreograph.music.song_features import SongFeatures

NEIGHBOURS = 32  # edges of each clip, with the smoothest transitions from its first second


def plan_motion_graph(
    source: LayerSource,
    costs: Sequence[WeightedCost],
    song_features: SongFeatures,
    *,
    report: StepReport | None = None,
) -> Path:
    """A walk on the first warped seconds of clips by transition alone (ChoreoGraph, section 4).

    Only the first second of each warped segment is a node, so completeness and style have no effect. As in
    Kovar's motion graphs, the graph over clips is pruned to its largest strongly connected component, so that
    the walk has no dead ends. The edge is then chosen by the warped poses of the candidates of each second.
    User-defined costs are used as in the other planners.
    """
    n_seconds = source.n_seconds
    allowed_clips = _largest_component(source, song_features, part(report, 0, n_seconds, 2 * n_seconds))
    transition = [w for w in costs if w.cost.name == Transition.name]
    custom = [w for w in costs if type(w.cost) not in BUILTIN_COSTS]
    nodes: list[Layer] = []
    terms: list[dict[str, float]] = []
    for second in range(n_seconds):
        layer = source.layer(second)
        first = layer.offset == 0
        inside = first & np.isin(layer.clip, allowed_clips)
        layer = layer.subset(inside if inside.any() else first)
        total = np.zeros(layer.n_nodes)
        for w in custom:
            value = w.cost.node(layer, song_features)
            total += 0.0 if value is None else w.weight * np.asarray(value)
        smoothness = np.zeros(layer.n_nodes)
        if nodes:
            smoothness = _edges(transition, nodes[-1], layer, song_features)
            total += _edges(custom, nodes[-1], layer, song_features)
        if not np.isfinite(total + smoothness).any():
            raise NoPathError(f"every node of second {second} is forbidden: relax a cost that returns inf")
        best = int(np.argmin(total + smoothness))
        nodes.append(layer.subset(np.array([best])))
        terms.append({Transition.name: float(smoothness[best])})
        if report is not None:
            report(n_seconds + second + 1, 2 * n_seconds)
    return Path(tuple(nodes), tuple(terms))


def _edges(
    costs: Sequence[WeightedCost], before: Layer, layer: Layer, song_features: SongFeatures
) -> NDArray[np.float64]:
    """The weighted costs of going from the one node `before` to each of a layer (N,)."""
    total = np.zeros(layer.n_nodes)
    for w in costs:
        value = w.cost.edge(before, layer, song_features)
        total += 0.0 if value is None else w.weight * np.asarray(value)[0]
    return total


def _largest_component(
    source: LayerSource, song_features: SongFeatures, report: StepReport | None
) -> NDArray[np.integer]:
    """Clips of the largest strongly connected component of the graph of smooth transitions."""
    layers = [source.layer(second) for second in range(0, source.n_seconds, 4)]
    firsts = [layer.subset(layer.offset == 0) for layer in layers]
    graph = nx.DiGraph()
    for done, (here, there) in enumerate(zip(firsts, [*firsts[1:], firsts[0]], strict=True), start=1):
        cost = np.asarray(Transition().edge(here, there, song_features))
        nearest = np.argsort(cost, axis=1)[:, :NEIGHBOURS]
        for row, columns in enumerate(nearest):
            graph.add_edges_from((int(here.clip[row]), int(there.clip[column])) for column in columns)
        if report is not None:
            report(done, len(firsts))
    components = [list(component) for component in nx.strongly_connected_components(graph)]
    return np.array(sorted(components[int(np.argmax([len(c) for c in components]))]))
