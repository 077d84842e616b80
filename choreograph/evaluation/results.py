"""The metrics and the results of an evaluation, and tables of them."""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib import resources
from typing import Any, Literal

import numpy as np

from choreograph.core.numerics import Floats
from choreograph.core.progress import one_line
from choreograph.evaluation.plan_scores import DancedMotifs
from choreograph.evaluation.scores import DancedPhases, Scores
from choreograph.motion.motion import Motion
from choreograph.plan.plan import Plan

# The metrics by family, as `metrics.toml` lists them.


Better = Literal["higher", "lower", "real"]  # "real": the closer to real dances, the better


@dataclass(frozen=True, kw_only=True)
class Metric:
    """How tables show a metric, and what it measures."""

    name: str  # key in scores and JSON
    family: str  # of metrics, which share a table
    label: str  # in tables
    unit: str = ""
    better: Better  # direction of better values
    source: str = "ours"  # paper, or ours
    digits: int = 2  # after the decimal point in tables
    limits: str  # what the number does not tell


FAMILIES: Mapping[str, dict[str, Any]] = tomllib.loads(  # each with title, caption and metrics
    resources.files(__package__).joinpath("metrics.toml").read_text(encoding="utf-8")
)
METRICS: Mapping[str, Metric] = {
    row["name"]: Metric(family=name, **row) for name, family in FAMILIES.items() for row in family["metrics"]
}


# The results of an evaluation: the scores of every dance, and all dances to one song for the plots.


EXPERT, REAL, TAKES = "expert", "real", "takes"  # table columns next to the variants
SINGLE = "dance"  # the only column if a single dance is evaluated


@dataclass(frozen=True, eq=False)
class MeasuredDance:
    """The scores of one dance or real take."""

    variant: str
    """Name of the variant, or `EXPERT` or `REAL`."""

    song: str
    """Name of the song."""

    seed: int
    """Seed of the dance."""

    scores: Scores
    """Values of the metrics and their chance levels."""

    plan: Plan | None = None
    """The plan, if it is known."""

    phases: DancedPhases | None = None
    """Phases of its motion beats in the counts."""


@dataclass(frozen=True, eq=False)
class ExampleDance:
    """A dance kept whole, for the plots."""

    variant: str
    """Name of the variant."""

    motion: Motion
    """The dance."""

    plan: Plan | None
    """The plan, if it is known."""

    motifs: DancedMotifs | None = None
    """The motifs that are danced."""


@dataclass(frozen=True, eq=False)
class ExampleSong:
    """All dances to one song, for the plots."""

    song: str
    """Name of the song."""

    music_beats_s: Floats
    """(Q,) beats of the song in seconds."""

    dances: tuple[ExampleDance, ...]
    """All dances to it."""

    template: Floats | None = None
    """(K,) signature of its genre."""


@dataclass(frozen=True, eq=False)
class Evaluation:
    """All results of an evaluation. `tables` summarises them."""

    facts: Mapping[str, Any]
    """What was evaluated and how, for the report and JSON."""

    variants: Mapping[str, str]
    """Description of each variant by its name, in the order of the tables."""

    dances: tuple[MeasuredDance, ...]
    """All dances and real takes."""

    sets: tuple[MeasuredDance, ...]
    """The scores of all songs together. Their `song` is empty."""

    notes: tuple[str, ...] = ()
    """What was unusual, one line each."""

    example: ExampleSong | None = None
    """All dances to one song, for the plots."""

    expert_phases: tuple[DancedPhases, ...] = ()
    """The phases that those of dances are compared with."""

    __repr__ = one_line


def dances_of(dances: Iterable[MeasuredDance], variant: str) -> list[MeasuredDance]:
    """The dances of one variant."""
    return [dance for dance in dances if dance.variant == variant]


# An evaluation as tables, with one row per metric and one column per variant, and as JSON.


FORMAT = "choreograph-evaluation"
VERSION = 1


@dataclass(frozen=True)
class Cell:
    """A variant's values of one metric, over songs and seeds."""

    mean: float
    spread: float  # standard deviation, 0 for a single value
    n: int
    chance: float | None = None  # mean chance level


@dataclass(frozen=True)
class Row:
    """One metric over the columns of a table. A cell is None where it does not apply."""

    metric: Metric
    cells: tuple[Cell | None, ...]


@dataclass(frozen=True)
class Table:
    """The metrics of one family."""

    family: str  # of its metrics
    title: str  # heading
    caption: str  # what the metrics measure
    columns: tuple[str, ...]  # names of variants and references
    rows: tuple[Row, ...]  # one for each metric


def tables(evaluation: Evaluation) -> tuple[Table, ...]:
    """One table for each family that was measured. Variants come first, then real dances and takes."""
    result = []
    for family, about in FAMILIES.items():
        dances = evaluation.sets if family == "sets" else evaluation.dances
        metrics = [metric for metric in METRICS.values() if metric.family == family]
        columns = tuple(
            name
            for name in evaluation.variants
            if any(m.name in d.scores.values for d in dances_of(dances, name) for m in metrics)
        )
        rows = tuple(row for m in metrics if any((row := _row(m, dances, columns)).cells))
        if rows:
            result.append(Table(family, about["title"], about["caption"], columns, rows))
    return tuple(result)


def song_table(evaluation: Evaluation, metric: str) -> dict[str, dict[str, float]]:
    """Mean of a metric over seeds, by song and variant."""
    rows: dict[str, dict[str, float]] = {}
    for song in evaluation.facts["songs"]:
        for variant in evaluation.variants:
            values = _values(metric, [d for d in dances_of(evaluation.dances, variant) if d.song == song])
            if values:
                rows.setdefault(song, {})[variant] = float(np.mean(values))
    return rows


def _row(metric: Metric, dances: Sequence[MeasuredDance], columns: tuple[str, ...]) -> Row:
    return Row(metric, tuple(_cell(metric.name, dances_of(dances, name)) for name in columns))


def _cell(metric: str, dances: Sequence[MeasuredDance]) -> Cell | None:
    values = _values(metric, dances)
    if not values:
        return None
    chance = [d.scores.chance[metric] for d in dances if metric in d.scores.chance]
    chance = [value for value in chance if math.isfinite(value)]
    return Cell(
        float(np.mean(values)), float(np.std(values)), len(values), float(np.mean(chance)) if chance else None
    )


def _values(metric: str, dances: Sequence[MeasuredDance]) -> list[float]:
    """All finite values. A dance without motion beats, for example, has no beat distance."""
    values = [d.scores.values[metric] for d in dances if metric in d.scores.values]
    return [value for value in values if math.isfinite(value)]


def to_json(evaluation: Evaluation) -> str:
    """The evaluation as JSON text by `data_schema/evaluation.schema.json`. nan becomes null."""
    data = {
        "format": FORMAT,
        "version": VERSION,
        "facts": dict(evaluation.facts),
        "variants": dict(evaluation.variants),
        "metrics": {name: asdict(metric) for name, metric in METRICS.items()},
        "tables": [
            {
                "family": table.family,
                "columns": list(table.columns),
                "rows": {
                    row.metric.name: [None if cell is None else asdict(cell) for cell in row.cells]
                    for row in table.rows
                },
            }
            for table in tables(evaluation)
        ],
        "dances": [_dance_data(dance) for dance in evaluation.dances],
        "sets": [_dance_data(dance) for dance in evaluation.sets],
        "notes": list(evaluation.notes),
    }
    return json.dumps(data, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def _dance_data(dance: MeasuredDance) -> dict[str, Any]:
    return {
        "variant": dance.variant,
        "song": dance.song,
        "seed": dance.seed,
        "values": {name: _finite(value) for name, value in dance.scores.values.items()},
        "chance": {name: _finite(value) for name, value in dance.scores.chance.items()},
    }


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def number_text(value: float, digits: int) -> str:
    """A number as displayed in tables. The published FID has fifteen digits if a feature is constant."""
    return f"{value:.1e}" if abs(value) >= 1e6 else f"{value:.{digits}f}"


def column_title(name: str) -> str:
    """The title of a column."""
    return {EXPERT: "experts on the beat", REAL: "real dances", TAKES: "takes used"}.get(name, name)
