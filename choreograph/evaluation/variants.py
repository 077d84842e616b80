"""Variants to compare: the paper's Table 1, ablations of our own parts, and the engines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from choreograph import published
from choreograph.audio.song import Song
from choreograph.config import DEFAULT_WEIGHTS, TRANSITION_LENGTHS_S, DanceConfig
from choreograph.constraints.spec import Constraints
from choreograph.engines import ENGINES
from choreograph.errors import ChoreographError, ParameterError, RepertoireError
from choreograph.pipeline import Dance, dance, render
from choreograph.plan import Plan, PlannedSecond
from choreograph.repertoire import Repertoire
from choreograph.timebase import CLIP_S, NODE_FRAMES, SEGMENT_S


@dataclass(frozen=True)
class Variant:
    """A way to dance: the settings of an engine, or random clips."""

    name: str
    description: str  # one line in the report
    config: DanceConfig = field(default_factory=DanceConfig)
    seeded: bool = True  # whether the dance depends on the seed
    random_clips: bool = False
    method: str = ""  # what the provenance of its repertoires begins with; "": any


def _variant(name: str, description: str, *, seeded: bool = True, **settings) -> Variant:
    return Variant(name, description, DanceConfig(**settings), seeded)


def _published(name: str, description: str, **settings) -> Variant:
    config = published.published_dance(**settings)
    return Variant(name, description, config, seeded=False, method=published.METHOD)


def _without_cost(cost: str) -> Variant:
    return _variant(
        f"no-{cost}", f"ours without the {cost} cost", seeded=cost != "variety", weights={cost: 0.0}
    )


_NO_EDGES = dict.fromkeys(
    ("completeness", "transition", "velocity", "repeat", "signature", "motif_transition"), 0.0
)
VARIANTS: dict[str, Variant] = {
    variant.name: variant
    for variant in (
        Variant(
            "random", "random clips: their middle 4 s unwarped, linear blending", random_clips=True,
            config=DanceConfig(blending="linear", transitions="seconds"),
        ),
        _variant(
            "motion-graph", "the paper's Motion Graph variant: first warped seconds, transition cost only, "
            "linear blending, transitions on seconds", seeded=False, planner="motion-graph",
            selection="style", blending="linear", transitions="seconds", weights=published.WEIGHTS,
        ),
        _variant(
            "greedy-published", "ChoreoGraph's graph as published: greedy planner, unweighted style, "
            "completeness and transition costs, linear blending, transitions on seconds; with our warping "
            "and foot lock",
            seeded=False, planner="greedy", selection="style", blending="linear", transitions="seconds",
            weights=published.WEIGHTS,
        ),
        _published(
            "as-published", "ChoreoGraph as published, throughout: networks, selection, warping, graph and "
            "blending",
        ),
        _published(
            "as-published-motion-graph", "the same with the paper's Motion Graph variant of the graph",
            planner="motion-graph",
        ),
        _published(
            "as-published-no-retempo", "as published without warping: clips' middle 4 s at recorded speed",
            warping="none",
        ),
        _variant("ours", "the defaults"),
        _variant("greedy", "ours with the greedy planner", planner="greedy"),
        _variant("linear", "ours with linear blending", blending="linear"),
        _variant("no-retempo", "ours without warping: clips at recorded speed", warping="none"),
        _variant(
            "no-selection", "ours with random candidates and without the style cost", selection="random",
            weights={"style": 0.0},
        ),
        _variant("style-selection", "ours with the clips nearest in style, the paper's", selection="style"),
        _variant(
            "no-graph", "ours without costs between seconds: the best node for each second alone",
            weights=_NO_EDGES,
        ),
        _variant("transitions-on-seconds", "ours with transitions on seconds", transitions="seconds"),
        *(_without_cost(cost) for cost in DEFAULT_WEIGHTS),
        _variant("mixer", "the mixer engine: motion words of takes", engine="mixer"),
        _variant(
            "mixer-absolute", "the mixer with equation 5 as published: the absolute difference of signatures",
            engine="mixer", motif_draw="absolute",
        ),
        _variant("rollout", "the rollout engine: motion from a network", engine="rollout"),
    )
}  # fmt: skip
GROUPS: dict[str, tuple[str, ...]] = {
    "paper": ("ours", "greedy-published", "motion-graph", "random"),
    "published": ("as-published", "as-published-motion-graph", "as-published-no-retempo"),
    "ablations": (
        "ours", "no-selection", "style-selection", "no-retempo", "no-graph", "greedy", "linear",
        "transitions-on-seconds",
        *(f"no-{cost}" for cost in DEFAULT_WEIGHTS),
    ),
    "engines": ("ours", "mixer", "rollout"),
}  # fmt: skip


def variants_named(names: Sequence[str]) -> tuple[Variant, ...]:
    """The variants with these names or in these `GROUPS`, each once; `ParameterError` for an unknown name."""
    chosen: dict[str, Variant] = {}
    for name in names:
        if name not in GROUPS and name not in VARIANTS:
            known = ", ".join([*GROUPS, *VARIANTS])
            raise ParameterError(f"expected variants among {known}, got {name!r}")
        chosen.update({member: VARIANTS[member] for member in GROUPS.get(name, (name,))})
    return tuple(chosen.values())


def check_variant(variant: Variant, repertoire: Repertoire) -> None:
    """Raise `RepertoireError` or `ParameterError`, before any work, if the repertoire cannot dance it."""
    built_by = repertoire.provenance.get("method", "ours")
    if not built_by.startswith(variant.method):
        raise RepertoireError(
            f"{repertoire.path}: expected a repertoire of `choreograph build-db --{variant.method}` for "
            f"{variant.name}, got one built otherwise: its networks were trained by another method"
        )
    if not variant.random_clips:
        try:
            ENGINES[variant.config.engine].check(repertoire, variant.config, Constraints(), ())
        except ChoreographError as error:
            raise type(error)(f"cannot dance the variant {variant.name}: {error}") from error
    elif repertoire.n_clips == 0:
        raise RepertoireError(
            f"{repertoire.path}: expected clips, got none: all takes are shorter than {CLIP_S} s"
        )


def dance_variant(variant: Variant, song: Song, repertoire: Repertoire, *, seed: int = 0) -> Dance:
    """The variant's dance to a song; raises as `dance` and `check_variant` do."""
    check_variant(variant, repertoire)
    config = replace(variant.config, seed=seed)
    if not variant.random_clips:
        return dance(song, repertoire, config=config)
    plan = _random_plan(song, repertoire, config)
    return Dance(render(plan, repertoire), plan, song_path=song.path)


def _random_plan(song: Song, repertoire: Repertoire, config: DanceConfig) -> Plan:
    """A random clip for every 4 s: its middle 4 s at recorded speed."""
    n_seconds = max(1, int(np.ceil(song.duration_s - 1e-9)))
    drawn = np.random.default_rng(config.seed).integers(repertoire.n_clips, size=-(-n_seconds // SEGMENT_S))
    seconds = []
    for second in range(n_seconds):
        clip, offset = int(drawn[second // SEGMENT_S]), second % SEGMENT_S
        take = repertoire.takes[int(repertoire.clip_take[clip])]
        first_s = repertoire.clip_start_s(clip) + (CLIP_S - SEGMENT_S) / 2 + offset
        seconds.append(
            PlannedSecond(
                second=second, take=take.name, clip=clip, clip_start_s=repertoire.clip_start_s(clip),
                segment_second=second - offset, offset=offset,
                source_times_s=tuple(np.linspace(first_s, first_s + 1.0, NODE_FRAMES + 1).tolist()),
                start_s=float(second), transition_s=TRANSITION_LENGTHS_S[config.blending][0],
                costs={}, credits=take.credits,
            )
        )  # fmt: skip
    return Plan(
        song=song.name, duration_s=song.duration_s, start_s=song.start_s, repertoire=repertoire.path.name,
        planner="greedy", blending=config.blending, seed=config.seed, fps=config.fps, weights={},
        music_beats_s=(), seconds=tuple(seconds),
    )  # fmt: skip
