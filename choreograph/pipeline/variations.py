"""Several dances for one song that all differ."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from choreograph.arguments import is_whole, unexpected
from choreograph.audio.song import Song
from choreograph.config import MAX_VARIATIONS
from choreograph.engines import ENGINES
from choreograph.errors import ParameterError
from choreograph.pipeline.arguments import as_config, as_costs, as_song
from choreograph.pipeline.dancing import Dance, dance
from choreograph.pipeline.unlike import Unlike
from choreograph.plan import Plan
from choreograph.repertoire import Repertoire

_SEEDS = 3  # tried for each variation


def vary(
    song: str | Path | Song, repertoire: str | Path | Repertoire | None = None, n: int = 3, **options: Any
) -> list[Dance]:
    """`n` dances for one song that all differ; `options` are the keywords of `dance`.

    Their seeds are `seed` (or `config`'s) and the ones after it. With an engine that has costs, what earlier
    variations danced in a second costs more in the later ones (`Unlike`). Raises `ParameterError` if `n` is
    below 1 or above 1000, or so many different dances cannot be found.
    """
    if not is_whole(n) or not 1 <= n <= MAX_VARIATIONS:
        raise unexpected(f"1 to {MAX_VARIATIONS} variations", n)
    config, costs = as_config(options.pop("config", None)), as_costs(options.pop("costs", ()))
    if options.get("seed") is not None:
        config = replace(config, seed=options["seed"])
    options.pop("seed", None)
    part = {k: options.pop(k) for k in ("start_s", "duration_s") if options.get(k) is not None}
    loaded = as_song("a song", song, **part)
    made: list[Dance] = []
    for seed in range(config.seed, config.seed + _SEEDS * n):
        has_costs = bool(made) and "costs" in ENGINES[made[0].plan.engine].settings
        unlike = (Unlike([one.plan for one in made]),) if has_costs else ()
        one = dance(loaded, repertoire, config=replace(config, seed=seed), costs=(*costs, *unlike), **options)
        if all(_content(one.plan) != _content(other.plan) for other in made):
            made.append(one)
        if len(made) == n:
            return made
    raise ParameterError(f"expected {n} different dances, got {len(made)}: so little is left to chance")


def _content(plan: Plan) -> list[tuple[object, ...]]:
    """What is danced, without what it cost."""
    sources = [(b.start_s, b.planned.take, b.source_start_s, b.source_end_s) for b in plan.blocks]
    return [*sources, *((word.start_s, word.motif) for word in plan.words)]
