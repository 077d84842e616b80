"""Ways of selection and the cost `genre`, with many or few clips for each candidate.

    python research/selection_ablation.py dance-with-melody/ r0.h5 r1.h5 … -o results.md \\
        [--songs A.txt B.txt …] [--candidates 512 64 16] [--counted-by choreonet/]

A library of 31 takes has 1,664 clips. A second has 512 candidates, a third of them, and any third has clips
for every song. 64 candidates are as many as 512 in a library of 13,000 clips. Every repertoire dances to the
songs of its file (--songs, one for all or one for each), which it was built without. The measures are genres
of takes, signatures by another network if all dance to the same songs, distances of poses, and the size of
motion in loud and soft sections. Values are means over songs ± the spread of the repertoires.
"""

from __future__ import annotations

import argparse
import runpy
from collections.abc import Sequence
from pathlib import Path

import choreograph as cg
from choreograph.evaluation.results import METRICS, MeasuredDance
from choreograph.evaluation.run import EvaluationConfig, Variant, evaluate_variants
from choreograph.evaluation.songs import find_songs
from research.variants import with_counts

HELD_OUT = Path(__file__).with_name("dance_with_melody_held_out.txt")
WAYS = {
    f"{selection}{', cost' if cost else ''}": (selection, {} if cost else {"genre": 0.0})
    for selection in ("genre", "style", "random")
    for cost in (True, False)
}
SHOWN = (
    "own_genre", "signature_chi2", "fpd_all", "energy_response", "energy_response_space", "foot_slide_cm_s",
    "jerk_ratio_at_boundaries", "distinct_takes_per_minute", "longest_repeat_s",
)  # fmt: skip


def variants_of(candidates: Sequence[int]) -> tuple[Variant, ...]:
    """Every way of using style with every number of candidates."""
    return tuple(
        Variant(
            f"{way}, {number} candidates",
            way,
            cg.DanceConfig(selection=selection, weights=weights, candidates=number),
        )
        for number in candidates
        for way, (selection, weights) in WAYS.items()
    )


def table(dances: Sequence[MeasuredDance], names: Sequence[str], shown: Sequence[str]) -> str:
    """A row a variant: mean over songs ± spread of the repertoires."""
    beside = runpy.run_path(str(Path(__file__).with_name("paper_tables.py")))
    titles = [f"{METRICS[m].label} {METRICS[m].unit}".strip() for m in shown]
    lines = ["| | " + " | ".join(titles) + " |", "| --- " * (len(shown) + 1) + "|"]
    for name in names:
        own = [d for d in dances if d.variant == name]
        found = [beside["cell"](own, metric) for metric in shown]
        cells = [f"{of[0]:.2f} ± {of[1]:.2f}" if of else "" for of in found]
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("data", type=Path)
    parser.add_argument("repertoires", type=Path, nargs="+")
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--songs", type=Path, nargs="+", default=[HELD_OUT], help="one file, or one for each")
    parser.add_argument("--candidates", type=int, nargs="+", default=[512, 64, 16])
    parser.add_argument("--counted-by", type=Path, nargs="*", default=[])
    given = parser.parse_args()
    variants = variants_of(given.candidates)
    files = given.songs * len(given.repertoires) if len(given.songs) == 1 else given.songs
    dances: list[MeasuredDance] = []
    # Motifs are judged by the next repertoire's network, unless it was trained on the songs.
    judged = len(given.songs) == 1 < len(given.repertoires)
    judges = given.repertoires[1:] + given.repertoires[:1] if judged else given.repertoires
    shown = SHOWN if judged else [metric for metric in SHOWN if metric != "signature_chi2"]
    for seed, (path, judge, file) in enumerate(zip(given.repertoires, judges, files, strict=True)):
        only = file.read_text(encoding="utf-8").split()
        songs = with_counts(find_songs(given.data, only=only), given.counted_by)
        found = evaluate_variants(
            cg.Repertoire.open(path),
            songs,
            EvaluationConfig(variants, seeds=1, first_seed=seed),
            judge=None if judge == path else cg.Repertoire.open(judge),
        )
        dances += [*found.dances, *found.sets]
        given.output.write_text(table(dances, [v.name for v in variants], shown), encoding="utf-8")
        print(f"{path.name}: {len(found.dances)} dances", flush=True)
    print(given.output.read_text(encoding="utf-8"))


if __name__ == "__main__":
    main()
