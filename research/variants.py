"""Variants of the papers' tables: ChoreoGraph as published, and ours without each of its parts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from choreograph.choreography.graph.costs import DEFAULT_WEIGHTS
from choreograph.evaluation import run as shipped
from choreograph.evaluation.run import Variant
from choreograph.evaluation.songs import EvaluatedSong
from choreograph.formats.register import annotate_takes
from choreograph.pipeline import published
from choreograph.settings import DanceConfig


def _variant(name: str, description: str, *, seeded: bool = True, **settings: Any) -> Variant:
    return Variant(name, description, DanceConfig(**settings), seeded)


def _published(name: str, description: str, **settings: Any) -> Variant:
    config = published.published_dance(**settings)
    return Variant(name, description, config, seeded=False, method=published.METHOD)


def _without_cost(cost: str) -> Variant:
    return _variant(
        f"no-{cost}", f"ours without the {cost} cost", seeded=cost != "variety", weights={cost: 0.0}
    )


_NO_EDGES = dict.fromkeys(
    ("completeness", "transition", "velocity", "repeat", "signature", "motif_transition"), 0.0
)
_ABLATIONS = (
    _variant(
        "no-selection", "ours with random candidates and without the cost `genre`", selection="random",
        weights={"genre": 0.0},
    ),
    _variant("style-selection", "ours with the clips nearest in style, the paper's", selection="style"),
    _variant("no-retempo", "ours without warping: clips at recorded speed", warping="none"),
    _variant(
        "no-graph", "ours without costs between seconds: the best node for each second alone",
        weights=_NO_EDGES,
    ),
    shipped.VARIANTS["greedy"],
    _variant("linear", "ours with linear blending", blending="linear"),
    _variant("transitions-on-seconds", "ours with transitions on seconds", transitions="seconds"),
    *(_without_cost(cost) for cost in DEFAULT_WEIGHTS),
)  # fmt: skip
VARIANTS: dict[str, Variant] = shipped.VARIANTS | {
    variant.name: variant
    for variant in (
        _variant(
            "motion-graph", "the paper's Motion Graph variant: first warped seconds, transition cost only, "
            "linear blending, transitions on seconds", seeded=False, planner="motion-graph",
            selection="style", blending="linear", transitions="seconds", weights=published.WEIGHTS,
        ),
        _variant(
            "greedy-published", "ChoreoGraph's graph as published: greedy planner, unweighted style, "
            "completeness and transition costs, linear blending, transitions on seconds, but our warping "
            "and foot lock",
            seeded=False, planner="greedy", selection="style", blending="linear", transitions="seconds",
            weights=published.WEIGHTS,
        ),
        _published(
            "as-published-motion-graph", "as published, with the paper's Motion Graph variant of the graph",
            planner="motion-graph",
        ),
        _published(
            "as-published-no-retempo", "as published without warping: clips' middle 4 s at recorded speed",
            warping="none",
        ),
        _variant(
            "mixer-absolute", "the mixer with equation 5 as published: the absolute difference of signatures",
            engine="mixer", motif_draw="absolute",
        ),
        *_ABLATIONS,
    )
}  # fmt: skip
GROUPS: dict[str, tuple[str, ...]] = shipped.GROUPS | {
    "paper": ("ours", "greedy-published", "motion-graph", "random"),
    "published": ("as-published", "as-published-motion-graph", "as-published-no-retempo"),
    "ablations": ("ours", *(variant.name for variant in _ABLATIONS)),
}


def variants_named(names: Sequence[str]) -> tuple[Variant, ...]:
    """The variants with these names or in these `GROUPS`, each once. `ParameterError` for an unknown name."""
    return shipped.variants_named(names, VARIANTS, GROUPS)


def with_counts(songs: Sequence[EvaluatedSong], sources: Sequence[Path]) -> list[EvaluatedSong]:
    """The songs with the counts of their real takes from other sources, such as ChoreoNet's lists."""
    takes = [song.take for song in songs if song.take is not None]
    for source in sources:
        takes = annotate_takes(takes, source)
    counted = {take.name: take for take in takes}
    return [song if song.take is None else replace(song, take=counted[song.name]) for song in songs]
