"""ChoreoGraph's tables and what each part of the engine does, on held-out songs, over several seeds.

    python research/paper_tables.py path/to/dance-with-melody s0.h5 s1.h5 … -o results.md \\
        [--counted-by path/to/choreonet] [--experts FOLDER] [--also learned-density l0.h5 l1.h5 …]

Each repertoire was built by `build-db --seed N --leave-out @research/dance_with_melody_held_out.txt`.
Its number is also the seed of its dances, so that a spread is one of training, dancing and songs together.
Their motifs are judged by the next one's network. Repertoires of --also dance as "ours" does, under that
name. FOLDER holds experts' dances to the songs, laid on their beats (`expert_dances.py`).

Tables 1, 2 and 4 of the method as published, with repertoires of `build-db --published`:

    python research/paper_tables.py path/to/dance-with-melody p0.h5 … -o published.md \\
        --variants random published
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np

import choreograph as cg
from choreograph.evaluation.results import EXPERT, METRICS, REAL, TAKES, MeasuredDance
from choreograph.evaluation.run import EvaluationConfig, evaluate_variants
from choreograph.evaluation.scores import physical_scores, weighted_mean
from choreograph.evaluation.songs import EvaluatedSong, find_songs, read_experts
from choreograph.music.beats import DEFAULT_TRACKER
from choreograph.plan.plan import Plan
from research.variants import variants_named, with_counts

HELD_OUT = Path(__file__).with_name("dance_with_melody_held_out.txt")
LABELS = tuple(f"label_distance_{name}" for name in ("openness", "intensity", "rhythm", "asymmetry"))
COUNTS = ("counts_within", "downbeat_share", "f_score_mean", "f_score_mean_second")
BEATS = ("f_score", "motion_to_music", "music_to_motion")
PHYSICS = (
    "foot_slide_cm_s", "foot_skating_ratio", "pfc", "floor_penetration_cm", "jerk_p95_m_s3",
    "jumps_per_minute",
)  # fmt: skip
STRUCTURE = ("signature_chi2", "transition_bits", "section_agreement", "section_agreement_in_step")
TABLES = {
    "On the count": ("paper", (*COUNTS, "transitions_per_minute", "transitions_at_borders")),
    "Table 1: rhythm and realism": ("paper", (*BEATS, "fpd_all", "fmd_all", "fpd", "fmd")),
    "Table 2: label distances": ("paper", LABELS),
    "Table 4: with and without re-tempo": ("retempo", (*COUNTS, *BEATS, "slope_p05", "slope_p95")),
    "What each part does": (
        "all",
        ("counts_within", "downbeat_share", "f_score_mean", "transitions_per_minute",
         "transitions_at_borders", "own_genre", "fpd_all", "signature_chi2", "jerk_ratio_at_boundaries",
         "foot_slide_cm_s", "distinct_takes_per_minute", "longest_repeat_s", "opening_speed_m_s",
         "closing_speed_m_s"),
    ),
    "Physics": ("paper", PHYSICS),
    "Structure": ("paper", STRUCTURE),
    "Rhythm is a Dancer": (
        "engines",
        ("counts_within", "downbeat_share", "counts_read_within", "downbeat_share_read",
         "aligned_share_published", "beat_ratio_published", "f_score_mean", "signature_chi2", "fpd_all",
         "foot_slide_cm_s", "jerk_p95_m_s3"),
    ),
}  # fmt: skip
RECORDED = "takes-as-recorded"  # those that ours danced with, before their feet were held
GROUPS = {
    "paper": (
        "random", "as-published-motion-graph", "as-published", "motion-graph", "greedy-published", "ours",
        "mixer", EXPERT, REAL, TAKES, RECORDED,
    ),
    "engines": ("random", "ours", "mixer", "rollout", EXPERT, REAL, TAKES),
    "retempo": ("as-published-no-retempo", "as-published", "no-retempo", "ours"),
}  # fmt: skip


def danced(
    path: Path,
    judge: Path,
    songs: Sequence[EvaluatedSong],
    config: EvaluationConfig,
    options: argparse.Namespace,
) -> list[MeasuredDance]:
    """All dances with one repertoire, then the sets of all songs together, with the seed of `config`."""
    found = evaluate_variants(
        cg.Repertoire.open(path),
        songs,
        config,
        references=read_experts(options.experts, songs) if options.experts else (),
        judge=None if judge == path else cg.Repertoire.open(judge),
    )
    print(f"{path.name}: {len(found.dances)} dances", flush=True)
    first = config.variants[0].name if "ours" not in found.variants else "ours"
    plans = {d.song: d.plan for d in found.dances if d.variant == first and d.plan is not None}
    made = (*found.dances, *found.sets, *as_recorded(plans, options.data))
    return [replace(d, seed=config.first_seed, plan=None) for d in made]


def as_recorded(plans: Mapping[str, Plan], data: Path) -> list[MeasuredDance]:
    """The physics of the takes that each song's plan dances with, by how long, as they lie in `data`.

    Nothing if they do not lie there.
    """
    used = {take for plan in plans.values() for take in plan.takes_s()}
    recorded = {s.name: s.take.motion for s in find_songs(data) if s.take is not None and s.name in used}
    if len(recorded) < len(used):  # the repertoire is of other takes
        return []
    known = {name: physical_scores(motion).values for name, motion in recorded.items()}
    return [
        MeasuredDance(RECORDED, song, 0, weighted_mean(known, plan.takes_s())) for song, plan in plans.items()
    ]


def cell(dances: Sequence[MeasuredDance], metric: str) -> tuple[float, float, float | None] | None:
    """Mean, the spread of the seeds' means, and chance. None if it was not measured."""
    by_seed: dict[int, list[float]] = {}
    for d in dances:
        if np.isfinite(d.scores.values.get(metric, np.nan)):
            by_seed.setdefault(d.seed, []).append(d.scores.values[metric])
    if not by_seed:
        return None
    means = [float(np.mean(values)) for values in by_seed.values()]
    chance = [d.scores.chance[metric] for d in dances if np.isfinite(d.scores.chance.get(metric, np.nan))]
    return float(np.mean(means)), float(np.std(means)), float(np.mean(chance)) if chance else None


def as_markdown(dances: Sequence[MeasuredDance], names: Sequence[str]) -> str:
    """The tables with a row for each variant: mean ± spread over seeds (chance)."""
    lines = []
    for title, (group, metrics) in TABLES.items():
        chosen = [n for n in GROUPS.get(group, names) if n in names]
        titles = [f"{METRICS[m].label} {METRICS[m].unit}".strip() for m in metrics]
        lines += [f"## {title}", "", "| | " + " | ".join(titles) + " |", "| --- " * (len(metrics) + 1) + "|"]
        for name in chosen:
            own = [d for d in dances if d.variant == name]
            texts = [_text(cell(own, m), METRICS[m].digits) for m in metrics]
            if any(texts):
                lines.append(f"| {name} | " + " | ".join(texts) + " |")
        lines.append("")
    return "\n".join(lines)


def _text(found: tuple[float, float, float | None] | None, digits: int) -> str:
    if found is None:
        return ""
    mean, spread, chance = found
    return f"{mean:.{digits}f} ± {spread:.{digits}f}" + ("" if chance is None else f" ({chance:.{digits}f})")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("data", type=Path)
    parser.add_argument("repertoires", type=Path, nargs="+")
    parser.add_argument("-o", "--output", type=Path, required=True, help="and a .json beside it")
    parser.add_argument("--variants", nargs="*", default=["paper", "ablations"])
    parser.add_argument("--also", nargs="+", action="append", default=[], metavar=("NAME", "REPERTOIRE"))
    parser.add_argument("--counted-by", type=Path, nargs="*", default=[])
    parser.add_argument("--experts", type=Path, help="folder of SONG.bvh with SONG.counts.csv")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--only", type=Path, default=HELD_OUT, help="names of songs, a line each")
    parser.add_argument(
        "--beats", default=DEFAULT_TRACKER, help="to measure by: a tracker, or a folder of SONG.txt"
    )
    parser.add_argument("--seen", action="store_true", help="also songs that networks were trained on")
    options = parser.parse_args()
    only = options.only.read_text(encoding="utf-8").split()
    songs = with_counts(find_songs(options.data, only=only), options.counted_by)
    variants = variants_named(options.variants)
    dances: list[MeasuredDance] = []
    groups = [("", options.repertoires), *((name, [Path(p) for p in paths]) for name, *paths in options.also)]
    judges = options.repertoires  # of another seed
    jobs = [
        (name, path, judges[(seed + 1) % len(judges)], seed)
        for name, paths in groups
        for seed, path in enumerate(paths)
    ]
    ours = variants_named(["ours"])
    with ProcessPoolExecutor(options.jobs) as pool:
        made = []
        for name, path, judge, seed in jobs:
            config = EvaluationConfig(
                ours if name else variants,
                seeds=1,
                beats=options.beats,
                seen=options.seen,
                first_seed=seed,
            )
            made.append(pool.submit(danced, path, judge, songs, config, options))
        for (name, *_), found in zip(jobs, made, strict=True):
            dances += [
                replace(d, variant=name or d.variant)
                for d in found.result()
                if not name or d.variant == "ours"
            ]
    names = list(dict.fromkeys(d.variant for d in dances))
    options.output.write_text(as_markdown(dances, names), encoding="utf-8")
    rows = [{"variant": d.variant, "song": d.song, "seed": d.seed, **d.scores.values} for d in dances]
    options.output.with_suffix(".json").write_text(json.dumps(rows), encoding="utf-8")


if __name__ == "__main__":
    main()
