"""Do dances keep the counts and bars of the music? The table of targets, with chance, experts and real takes.

    python research/on_the_count.py path/to/dance-with-melody s0.h5 s1.h5 … -o results.md \\
        [--counted-by path/to/choreonet] [--experts FOLDER] [--engines graph mixer] \\
        [--weights JSON] [--dances 3]

Each repertoire was built by `build-db --seed N --leave-out @research/dance_with_melody_held_out.txt`. Its
number is also the seed of its dances (of several each with --dances). Its motif signatures are evaluated by
the network of the next repertoire. FOLDER holds dances of experts to the held-out songs (SONG.bvh with
SONG.counts.csv), placed on the tracked beats by their choreographies. With a file of songs for each
repertoire (--songs A.txt B.txt …), every repertoire dances to those that it was built without. "Real" are the
takes as recorded, which were never synchronised with their songs. Built-in takes dance to the benchmark
songs, whose beats and bars are known exactly, and to the spliced songs. No network was trained on any of
these songs.
"""

from __future__ import annotations

import argparse
import json
import runpy
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import choreograph as cg
from choreograph.core.counts import Counts, numbers_in_bar
from choreograph.evaluation.metrics import beat, counts
from choreograph.evaluation.plan_scores import danced_counts
from choreograph.evaluation.results import EXPERT, REAL, MeasuredDance
from choreograph.evaluation.run import EvaluationConfig, Variant, evaluate_variants
from choreograph.evaluation.scores import DancedPhases
from choreograph.evaluation.songs import beats_of, find_songs, read_experts
from choreograph.motion.body import body_pos_m
from choreograph.music.bars import track_bars
from choreograph.music.beats import DEFAULT_TRACKER, get_beat_tracker
from choreograph.music.mel import log_mel
from choreograph.music.song import load_song
from content.songs.known_songs import BENCHMARK_SONGS
from content.songs.synthesis.song import SyntheticSong, write_song
from research.variants import with_counts

HELD_OUT = Path(__file__).with_name("dance_with_melody_held_out.txt")
METRES = {"waltz": 3}
DEFAULT_METRE = 4

# What to show of each dance: metric, digits, target.
DANCE_ROWS = {
    "counts within 0.15 beat of a tracked beat": ("counts_within", 2, "0.95"),
    "the same by the second tracker": ("counts_within_second", 2, ""),
    "count 1 within 0.15 beat of a tracked downbeat": ("downbeat_share", 2, "0.85"),
    "count 1 nearest to a tracked downbeat": ("downbeat_nearest", 2, ""),
    "danced from takes with counts": ("counted_share", 2, ""),
    "drift of the counts, beats/min": ("count_drift", 2, ""),
    "F at 70 ms, mean of five detectors": ("f_score_mean", 2, "beside experts"),
    "the same by the second tracker, F": ("f_score_mean_second", 2, ""),
    "F at 70 ms, our detector": ("f_score", 2, ""),
    "F at 70 ms, AIST++'s detector": ("f_score_aist", 2, ""),
    "F at 70 ms, Gaussian of 0.05 s": ("f_score_gaussian_50_ms", 2, ""),
    "F at 70 ms, Savitzky-Golay of 0.35 s": ("f_score_savitzky_golay", 2, ""),
    "F at 70 ms, Gaussian of 0.1 s": ("f_score_gaussian_100_ms", 2, ""),
    "jerk at transitions / elsewhere": ("jerk_ratio_at_boundaries", 2, "≤ 0.94"),
    "foot sliding, cm/s": ("foot_slide_cm_s", 1, "≤ 39"),
    "PFC": ("pfc", 3, "≤ 0.38"),
    "FPD of all songs": ("fpd_all", 2, "≤ 0.31"),
    "one-frame jumps a minute": ("jumps_per_minute", 1, "≤ 0.5"),
    "transitions a minute": ("transitions_per_minute", 1, "≤ 20"),
    "transitions at bar or figure borders": ("transitions_at_borders", 2, "0.8"),
    "turned away by more than 100°": ("turned_away_share", 2, "≤ 0.10"),
    "last pose within 45° of the front": ("ends_to_front", 2, "1"),
    "joint speed in the first 0.3 s, m/s": ("opening_speed_m_s", 2, "< 0.15"),
    "joint speed in the last 0.3 s, m/s": ("closing_speed_m_s", 2, "< 0.15"),
    "closes in a held pose": ("closing_held", 2, ""),
    "from the last downbeat to the held pose, s": ("hold_delay_s", 2, "≤ 0.1"),
    "signature χ² to the genre's, judged by another network": ("signature_chi2", 3, ""),
}


@dataclass(frozen=True)
class Line:
    """A row of the table, as text."""

    what: str
    target: str
    measured: str
    chance: str = ""
    expert: str = ""
    real: str = ""


def dances_of(
    path: Path, judge: Path, seed: int, songs_file: Path, given: argparse.Namespace
) -> tuple[list[MeasuredDance], list[DancedPhases]]:
    """All dances to the held-out songs, those of experts and the real ones, and the phases of the experts."""
    only = songs_file.read_text(encoding="utf-8").split()
    songs = with_counts(find_songs(given.data, only=only, duration_s=given.duration), given.counted_by)
    variants = tuple(
        Variant(
            engine,
            f"the {engine} engine",
            cg.DanceConfig(engine=engine, weights=given.weights if engine == "graph" else {}),
        )
        for engine in given.engines
    )
    found = evaluate_variants(
        cg.Repertoire.open(path),
        songs,
        EvaluationConfig(variants, seeds=given.dances, beats=given.beats, first_seed=seed * given.dances),
        references=read_experts(given.experts, songs) if given.experts else (),
        judge=None if judge == path else cg.Repertoire.open(judge),
    )
    print(f"{path.name}: measured, motifs judged by {found.facts['motifs_judged_by']}", flush=True)
    # The spread is that of repertoires, however often each dances.
    dances = [replace(dance, seed=seed) for dance in (*found.dances, *found.sets)]
    return dances, list(found.expert_phases)


def mean_by_seed(
    dances: Sequence[MeasuredDance], value: Callable[[MeasuredDance], float | None]
) -> list[float]:
    """The mean over songs, for every seed in which it is known."""
    means = []
    for seed in sorted({dance.seed for dance in dances}):
        known = [v for d in dances if d.seed == seed and (v := value(d)) is not None and np.isfinite(v)]
        if known:
            means.append(float(np.mean(known)))
    return means


def text(values: Sequence[float], digits: int = 2) -> str:
    """Mean ± spread over seeds."""
    if not values:
        return ""
    spread = f" ± {np.std(values):.{digits}f}" if len(values) > 1 else ""
    return f"{np.mean(values):.{digits}f}{spread}"


def dance_lines(engine: str, dances: Sequence[MeasuredDance], *, judged: bool) -> list[Line]:
    """The rows of one engine's dances to real songs. `judged`: signatures are by another network."""
    of = {name: [d for d in dances if d.variant == name] for name in (engine, EXPERT, REAL)}
    lines = []
    for what, (metric, digits, target) in DANCE_ROWS.items():
        if metric == "signature_chi2" and not judged:
            continue
        shown = {
            name: text(mean_by_seed(group, lambda d, m=metric: d.scores.values.get(m)), digits)
            for name, group in of.items()
        }
        chance = mean_by_seed(of[engine], lambda d, m=metric: d.scores.chance.get(m))
        if any(shown.values()):
            lines.append(Line(what, target, shown[engine], text(chance, digits), shown[EXPERT], shown[REAL]))
    return lines


def phases_by_genre(
    dances: Sequence[DancedPhases], experts: Sequence[DancedPhases], rng: np.random.Generator
) -> dict[str, dict[str, float]]:
    """`counts.evaluate_phases` of all dances of a genre together against its experts, by genre.

    A single dance has few motion beats, so that much of its distance is chance. Genres without a dance or
    without experts' dances to two songs are left out.
    """
    found = {}
    for genre in sorted({dance.genre for dance in dances}):
        danced = np.concatenate([d.phases for d in dances if d.genre == genre])
        known = [e for e in experts if e.genre == genre and len(e.phases)]
        if len(danced) and len({e.song for e in known}) > 1:
            found[genre] = counts.evaluate_phases(
                danced, [e.phases for e in known], [e.song for e in known], rng
            )
    return found


def phase_lines(engine: str, dances: Sequence[MeasuredDance], experts: Sequence[DancedPhases]) -> list[Line]:
    """Phase of motion beats within the count against the experts', a row a genre: distances in beats."""
    danced = [d.phases for d in dances if d.variant == engine and d.phases is not None]
    found = phases_by_genre(danced, experts, np.random.default_rng(0))
    return [
        Line(
            f"phase in the count, {genre}: distance to experts, beats, and way from chance to their halves",
            "way > 0.5",
            f"{row['phase_distance']:.3f}; {row['phase_nearness']:.2f}",
            f"{row['phase_distance_chance']:.3f}",
            f"{row['phase_distance_halves']:.3f}",
        )
        for genre, row in found.items()
    ]


def true_counts(song: SyntheticSong) -> Counts:
    beats_s = song.beat_times_s
    return Counts(beats_s, numbers_in_bar(len(beats_s), song.beats_per_bar), song.beats_per_bar)


def built_in_lines(repertoire: cg.Repertoire, config: cg.DanceConfig) -> list[Line]:
    """Dances of built-in takes to songs with true beats and bars, and how well those are tracked."""
    rng = np.random.default_rng(0)
    rows: dict[str, list[dict[str, float]]] = {}
    for bench in BENCHMARK_SONGS:
        truth = bench.render()
        with TemporaryDirectory() as folder:
            path = Path(folder) / "song.wav"
            write_song(path, truth)
            song = load_song(path)
            made = cg.dance(song, repertoire, config=config)
        beats, placed = true_counts(truth), danced_counts(made.plan, repertoire)
        pair = (placed.times_s, placed.numbers, beats.times_s, beats.numbers)
        row = counts.evaluate(*pair)
        level = counts.evaluate_chance(*pair, duration_s=truth.duration_s, rng=rng)
        row |= {f"{name}_chance": value for name, value in level.items()}
        row |= beat.evaluate_detectors(body_pos_m(made.motion), made.motion.fps, beats.times_s)
        mel = log_mel(song.samples)
        tracked = get_beat_tracker().beats(song, mel)
        bars = track_bars(song.samples, mel, tracked)
        row["tracked beats F"] = beat.f_score(tracked, beats.times_s)
        row["downbeat F"] = beat.f_score(bars.downbeat_times_s, beats.downbeat_times_s)
        row["metre right"] = float(bars.metre == beats.metre)
        for group in (bench.group, f"{beats.metre} in a bar", "all"):
            rows.setdefault(group, []).append(row)
        shown = ("counts_within", "downbeat_share", "f_score_mean", "downbeat F")
        print(f"{bench.name}:", ", ".join(f"{name} {row[name]:.2f}" for name in shown), flush=True)
    wanted = {
        "counts within 0.15 beat of a true beat": ("counts_within", "0.97"),
        "count 1 within 0.15 beat of a true downbeat": ("downbeat_share", "0.95"),
        "F at 70 ms, mean of five detectors": ("f_score_mean", "0.90"),
        "tracked downbeats, F at 70 ms": ("downbeat F", "0.85"),
        "tracked beats, F at 70 ms": ("tracked beats F", ""),
        "tracked metre": ("metre right", ""),
    }
    return [
        Line(f"{what}: {group}", target, _mean(of_group, name), _mean(of_group, f"{name}_chance"))
        for what, (name, target) in wanted.items()
        for group, of_group in rows.items()
    ]


def _mean(rows: Sequence[dict[str, float]], name: str) -> str:
    known = [row[name] for row in rows if name in row and np.isfinite(row[name])]
    return f"{np.mean(known):.2f}" if known else ""


def real_metre_lines(given: argparse.Namespace) -> list[Line]:
    """The metre of the ballroom songs, waltz against the rest. Chance is the more frequent one for all."""
    wanted, right = [], []
    for song in find_songs(given.data):
        metre = METRES.get(song.genre, DEFAULT_METRE)
        wanted.append(metre)
        right.append(beats_of(song.load(), given.beats).metre == metre)
    commoner = max(wanted.count(metre) for metre in set(wanted)) / len(wanted)
    what = f"metre of {len(wanted)} real songs, waltz against the rest"
    return [Line(what, "0.85", f"{np.mean(right):.2f}", f"{commoner:.2f}")]


def spliced_lines(repertoire: cg.Repertoire, config: cg.DanceConfig, seeds: int) -> list[Line]:
    """Dances of built-in takes to songs spliced from two genres."""
    beside = runpy.run_path(str(Path(__file__).with_name("spliced_songs.py")))
    rows = beside["spliced_table"](repertoire, config, seeds)
    columns = {
        "spliced songs: each half's own genre": ("part_genre", "0.85", "part_genre_chance"),
        "spliced songs: dances that switch": ("switched", "", ""),
        "spliced songs: time to switch, s": ("seconds_to_switch", "4", ""),
    }
    return [
        Line(what, target, *(text([r[k] for r in rows if k and np.isfinite(r[k])]) for k in (name, chance)))
        for what, (name, target, chance) in columns.items()
    ]


def markdown(title: str, lines: Sequence[Line]) -> str:
    rows = [
        f"| {ln.what} | {ln.target} | {ln.measured} | {ln.chance} | {ln.expert} | {ln.real} |" for ln in lines
    ]
    head = "| | target | measured | chance | experts | real takes |\n| --- | --- | --- | --- | --- | --- |"
    return f"## {title}\n\n{head}\n" + "\n".join(rows) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("data", type=Path)
    parser.add_argument("repertoires", type=Path, nargs="*")
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--counted-by", type=Path, nargs="*", default=[])
    parser.add_argument("--experts", type=Path, help="folder of SONG.bvh with SONG.counts.csv")
    parser.add_argument("--songs", type=Path, nargs="+", default=[HELD_OUT], help="one file, or one for each")
    parser.add_argument("--duration", type=float, help="seconds of each real song, by default all")
    parser.add_argument("--engines", nargs="+", default=["graph"])
    parser.add_argument("--weights", type=json.loads, default={}, help='of the graph\'s, as {"accents": 1}')
    parser.add_argument("--beats", default=DEFAULT_TRACKER, help="to measure by")
    parser.add_argument("--built-in", type=Path, help="repertoire in place of the built-in one")
    parser.add_argument("--dances", type=int, default=1, help="to each real song by each repertoire")
    parser.add_argument("--seeds", type=int, default=1, help="of the dances to spliced songs")
    parser.add_argument("--skip", nargs="*", default=[], choices=["built-in", "spliced", "metre"])
    parser.add_argument("--jobs", type=int, default=1)
    given = parser.parse_args()
    parts = []
    # With songs for each repertoire the next one was trained on this one's, and cannot judge its motifs.
    judged = len(given.songs) == 1 < len(given.repertoires)
    judges = given.repertoires[1:] + given.repertoires[:1] if judged else given.repertoires
    songs = given.songs * len(given.repertoires) if len(given.songs) == 1 else given.songs
    with ProcessPoolExecutor(given.jobs) as pool:
        made = [
            pool.submit(dances_of, path, judge, seed, songs_file, given)
            for seed, (path, judge, songs_file) in enumerate(
                zip(given.repertoires, judges, songs, strict=True)
            )
        ]
        found = [done.result() for done in made]
    dances = [dance for of_repertoire, _ in found for dance in of_repertoire]
    experts = found[0][1] if found else []  # the same with every repertoire: those of other songs, too
    for engine in given.engines if dances else ():
        lines = [*dance_lines(engine, dances, judged=judged), *phase_lines(engine, dances, experts)]
        parts.append(markdown(f"Real takes, {engine} engine, {len(given.repertoires)} seeds", lines))
    built_in = cg.Repertoire.open(given.built_in) if given.built_in else cg.starter_repertoire()
    for engine in given.engines:
        config = cg.DanceConfig(engine=engine, weights=given.weights if engine == "graph" else {})
        if "built-in" not in given.skip:
            parts.append(markdown(f"Built-in takes, {engine} engine", built_in_lines(built_in, config)))
        if "spliced" not in given.skip:
            lines = spliced_lines(built_in, config, given.seeds)
            parts.append(markdown(f"Spliced songs, {engine} engine", lines))
    if "metre" not in given.skip:
        parts.append(markdown("Music", real_metre_lines(given)))
    given.output.write_text("\n".join(parts), encoding="utf-8")
    print("\n".join(parts))


if __name__ == "__main__":
    main()
