"""Costs of the user for motion words.

The words of a slot are the nodes of a layer. A cost counts for as long as the word lasts, so that a second
of words costs as much as a second of the graph engine.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from choreograph.choreography.engine import DanceRequest
from choreograph.choreography.graph.cost import WeightedCost, edge_costs, weighted_terms
from choreograph.choreography.graph.costs import own_costs
from choreograph.choreography.graph.layers import Layer, WordLayers
from choreograph.choreography.slots import ResolvedConstraints
from choreograph.core.errors import NoPathError
from choreograph.core.numerics import Floats, Indices


@dataclass(frozen=True, eq=False)
class WordCosts:
    """The costs of the user for the words of a dance, weighted."""

    request: DanceRequest
    bounds_s: Floats  # (N + 1,) of the slots
    costs: tuple[WeightedCost, ...]  # one or more

    @classmethod
    def of(cls, request: DanceRequest, constraints: ResolvedConstraints, engine: str) -> WordCosts | None:
        """Those of a request, or None if it has no costs. Raises as `own_costs`."""
        costs = own_costs(request.config, request.costs, engine)
        return cls(request, constraints.bounds_s, costs) if costs else None

    def of_words(self) -> Floats:
        """Costs (N, W) of all words in every slot. They are `inf` for words of banned takes.

        Raises `ParameterError` for values that a cost must not return, and `NoPathError` if every word of the
        genre is forbidden in a slot.
        """
        constraints, take = self.request.constraints, self.request.repertoire.vocabulary.word_take
        words = np.flatnonzero(constraints.take_allowed[take])
        costs = np.full((len(self.bounds_s) - 1, len(take)), np.inf)
        for slot, costs_here in enumerate(costs):
            costs_here[words] = self._of_nodes(slot, words)
            finite, wanted = np.isfinite(costs_here), constraints.take_wanted[slot, take]
            if not finite[wanted if wanted.any() else words].any():
                raise NoPathError(
                    f"every word of the genre at {self.bounds_s[slot]:.1f} s is forbidden: relax a cost that "
                    "returns inf"
                )
        return costs

    def _of_nodes(self, slot: int, words: Indices) -> Floats:
        """Costs (M,) of words in a slot."""
        layer, features, total = self._layer(slot, words), self.request.song_features, np.zeros(len(words))
        for _, cost in weighted_terms(self.costs, lambda c: c.node(layer, features), total.shape):
            total += cost * self._length_s(slot)
        return np.where(np.isfinite(total), total, np.inf)

    def of_edges(self, slot: int, before: Indices, words: Indices) -> Floats:
        """Costs (M, M') of going to words (M',) of a slot from words (M,) of the slot before."""
        layers = self._layer(slot - 1, before), self._layer(slot, words)
        costs = edge_costs(*layers, self.costs, self.request.song_features).astype(np.float64)
        return costs * self._length_s(slot)

    def _length_s(self, slot: int) -> float:
        return float(self.bounds_s[slot + 1] - self.bounds_s[slot])

    def _layer(self, slot: int, words: Indices) -> Layer:
        second = min(int(self.bounds_s[slot : slot + 2].mean()), self.request.song_features.n_seconds - 1)
        return self._layers.layer(words, slot, second, self._length_s(slot))

    @cached_property
    def _layers(self) -> WordLayers:
        return WordLayers(self.request.repertoire)
