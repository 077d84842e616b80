"""Ways to dance that are compared: the paper's Table 1, what each of our own parts does, other engines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from choreograph.audio.song import Song
from choreograph.config import DEFAULT_WEIGHTS, TRANSITION_LENGTHS_S, DanceConfig
from choreograph.errors import ParameterError, RepertoireError
from choreograph.pipeline import Dance, dance, render
from choreograph.plan import Plan, PlannedSecond
from choreograph.repertoire import Repertoire
from choreograph.timebase import CLIP_S, NODE_FRAMES, SEGMENT_S

_JOINTS_TO_NORM = float(np.sqrt(21.0))  # our transition is a mean over 21 joints, the paper's their norm


@dataclass(frozen=True)
class Variant:
    """A way to dance: settings of an engine, or clips at random."""

    name: str
    says: str  # what it is, in a line of a report
    config: DanceConfig = field(default_factory=DanceConfig)
    seeded: bool = True  # another seed, another dance; else one seed is enough
    random_clips: bool = False


def _graph(name: str, says: str, *, seeded: bool = True, **settings) -> Variant:
    return Variant(name, says, DanceConfig(**settings), seeded)


def _without(cost: str) -> Variant:
    return _graph(
        f"no-{cost}", f"ours without the cost {cost}", seeded=cost != "variety", weights={cost: 0.0}
    )


_AS_PUBLISHED = {
    **dict.fromkeys(DEFAULT_WEIGHTS, 0.0), "style": 1.0, "completeness": 1.0, "transition": _JOINTS_TO_NORM,
}  # fmt: skip
_NO_EDGES = dict.fromkeys(
    ("completeness", "transition", "velocity", "repeat", "signature", "motif_transition"), 0.0
)
VARIANTS: dict[str, Variant] = {
    variant.name: variant
    for variant in (
        Variant(
            "random", "clips at random, their middle 4 s unwarped, joined linearly", random_clips=True,
            config=DanceConfig(blending="linear", transitions="seconds"),
        ),
        _graph(
            "motion-graph", "the paper's Motion Graph variant: first warped seconds, transition cost only, "
            "linear blending, joins on seconds",
            seeded=False, planner="motion-graph", blending="linear", transitions="seconds", weights=_AS_PUBLISHED,
        ),
        _graph(
            "greedy-published", "ChoreoGraph as published: greedy, costs style + completeness + transition "
            "unweighted, linear blending, joins on seconds; our selection, warping and locked feet",
            seeded=False, planner="greedy", blending="linear", transitions="seconds", weights=_AS_PUBLISHED,
        ),
        _graph("ours", "the defaults"),
        _graph("greedy", "ours with the greedy planner", planner="greedy"),
        _graph("linear", "ours with linear blending", blending="linear"),
        _graph("no-retempo", "ours without warping: clips as fast as recorded", warping="none"),
        _graph(
            "no-selection", "ours with candidates drawn at random, and no style cost", selection="random",
            weights={"style": 0.0},
        ),
        _graph(
            "no-graph", "ours without costs between seconds: each the best for itself", weights=_NO_EDGES
        ),
        _graph("joins-on-seconds", "ours with joins on seconds", transitions="seconds"),
        *(_without(cost) for cost in DEFAULT_WEIGHTS),
        _graph("mixer", "the mixer engine: motion words of takes", engine="mixer"),
        _graph("rollout", "the rollout engine: a network's motion", engine="rollout"),
    )
}  # fmt: skip
GROUPS: dict[str, tuple[str, ...]] = {
    "paper": ("ours", "greedy-published", "motion-graph", "random"),
    "ablations": (
        "ours", "no-selection", "no-retempo", "no-graph", "greedy", "linear", "joins-on-seconds",
        *(f"no-{cost}" for cost in DEFAULT_WEIGHTS),
    ),
    "engines": ("ours", "mixer", "rollout"),
}  # fmt: skip


def variants_named(names: Sequence[str]) -> tuple[Variant, ...]:
    """Variants by their names and the names of `GROUPS`, each once; `ParameterError` for an unknown one."""
    chosen: dict[str, Variant] = {}
    for name in names:
        if name not in GROUPS and name not in VARIANTS:
            known = ", ".join([*GROUPS, *VARIANTS])
            raise ParameterError(f"expected variants among {known}, got {name!r}")
        chosen.update({member: VARIANTS[member] for member in GROUPS.get(name, (name,))})
    return tuple(chosen.values())


def dance_as(
    variant: Variant, song: Song, repertoire: Repertoire, *, seed: int = 0, start_s: float = 0.0
) -> Dance:
    """The variant's dance to a song that begins at `start_s` of its file. Raises as `dance` does."""
    config = replace(variant.config, seed=seed)
    if not variant.random_clips:
        return dance(song, repertoire, config=config, start_s=start_s)
    plan = _random_plan(song, repertoire, config, start_s)
    return Dance(render(plan, repertoire), plan, song_path=song.path)


def _random_plan(song: Song, repertoire: Repertoire, config: DanceConfig, start_s: float) -> Plan:
    """A clip drawn anew for every 4 s, and its middle 4 s as they are."""
    if repertoire.n_clips == 0:
        raise RepertoireError(
            f"{repertoire.path}: the repertoire has no clip: its takes are shorter than {CLIP_S} s"
        )
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
                start_s=float(second), transition_s=TRANSITION_LENGTHS_S[config.blending][0], costs={}, credits=take.credits,
            )
        )  # fmt: skip
    return Plan(
        song=song.name, duration_s=song.duration_s, start_s=start_s, repertoire=repertoire.path.name,
        planner="greedy", blending=config.blending, seed=config.seed, fps=config.fps, weights={},
        music_beats_s=(), seconds=tuple(seconds),
    )  # fmt: skip
