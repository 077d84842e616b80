"""Counts estimated from motion alone: the table, with chance, a baseline and the confidence.

    python research/motion_counts.py path/to/dance-with-melody path/to/choreonet --work FOLDER \\
        [--seeds 0 1 2] [--library REPERTOIRE] [-o results.md]

For each seed, networks are trained without songs (5 folds), without songs and all their figures (5), and, for
as many seeds as `--seeds-built-in` gives, without built-in genres (4) and on built-in takes alone (1). Each
takes a minute on one thread. Checkpoints are in FOLDER, and the same command continues from there.

A confidence is fitted as for the shipped networks, to takes whose figures or genre the network was not
trained on, and to the same takes shuffled. The confidence of a take is fitted without the take and its fold.
"Decoder chosen on other folds" means that its stiffness, the cost of a break, and the number of tempi at
which a take is decoded are those that count the held-out takes of all other folds best.

REPERTOIRE has takes of dance-with-melody with counts, without those of
`research/dance_with_melody_held_out.txt`. Its takes are counted by networks that were not trained on their
songs, or not at all if those are uncertain. The held-out songs are danced with these counts, and the dances
are compared with the true ones.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter1d

import choreograph as cg
from choreograph.core.counts import FROM_MOTION, NO_COUNTS, Counts, numbers_in_bar
from choreograph.core.timebase import NET_FPS, frames_to_seconds
from choreograph.evaluation.metrics.counts import WITHIN_BEATS, downbeat_share, signed_errors_beats
from choreograph.evaluation.metrics.counts import evaluate as counts_scores
from choreograph.evaluation.plan_scores import danced_counts
from choreograph.formats.register import import_takes
from choreograph.library.building.counting import SURE_MOTION_CONFIDENCE
from choreograph.library.store import RepertoireFile
from choreograph.library.writing import Contents, write_repertoire
from choreograph.motion.motion_beats import mean_joint_speed_m_s
from choreograph.music.bar_pointer import PhaseCurves, decode_counts
from choreograph.music.bars import track_bars
from choreograph.music.beats import best_beat_sequence, get_beat_tracker
from choreograph.music.mel import autocorrelations, log_mel
from choreograph.music.song import load_song
from choreograph.nets.motion_counts import POINTER, TEMPI, confidence_features, confidence_of
from content.count_networks import motion_counts_config
from content.motion_counting import CountedMotion, fit_confidence
from content.networks import (
    Trial,
    built_in_takes,
    recorded_takes,
    share_right,
    shuffled,
    trained,
    trials_by_figure,
    trials_by_genre,
    trials_by_song,
)

HELD_OUT = Path(__file__).with_name("dance_with_melody_held_out.txt")
SHUFFLED = ", shuffled"  # ends the name of a take in random pieces, which has no count
ALONE = "clean"  # the trial on built-in takes alone, as the recipe calls it
BY_SONG, BY_FIGURE = "real takes, song left out", "real takes, song and figures left out"
BY_GENRE = "built-in takes, genre left out"
THRESHOLDS = (0.5, 0.6, 0.65, 0.7, 0.75, 0.8, 0.85, 0.9)  # of the confidence
N_PARTS = 6  # of a take, to see where in it counts are wrong
DECODERS = [
    (n_tempi, replace(POINTER, tempo_std=std, break_cost=cost))
    for std in (0.001, 0.002, 0.005, 0.01)
    for cost in (12.0, 40.0)
    for n_tempi in (1, len(TEMPI))
]
SHARE_OF_A_RIGHT_TAKE = 0.9  # of its counts


@dataclass(frozen=True, eq=False)
class Reading:
    """How one take was counted."""

    take: CountedMotion
    found: Counts
    facts: np.ndarray | None = None  # about the curves, for the confidence
    confidence: float = float("nan")
    trial: str = ""
    curves: Mapping[int, PhaseCurves] | None = None  # by the number of tempi

    @property
    def right(self) -> float:
        return share_right(self.found, self.take.counts)

    @property
    def ones(self) -> float:
        true = self.take.counts
        return downbeat_share(self.found.times_s, self.found.numbers, true.times_s, true.numbers)


def read_by(trial: Trial, config, seed: int, work: Path) -> list[Reading]:
    """The trial's takes, counted by its network, and the same takes shuffled, which show what no count is."""
    net = trained(trial, config, seed, work).for_inference()
    readings = []
    for take in [*trial.test, *(map(shuffled, trial.test) if trial.name != ALONE else ())]:
        curves = {1: net.curves(take.body_pos_m, (1.0,)), len(TEMPI): net.curves(take.body_pos_m)}
        decoded = decode_counts(curves[len(TEMPI)], POINTER)
        facts = confidence_features(curves[len(TEMPI)], decoded)
        readings.append(Reading(take, decoded.counts, facts, trial=trial.name, curves=curves))
    right = np.mean([r.right for r in readings[: len(trial.test)]])
    print(f"{trial.name}, seed {seed}: {right:.3f}", flush=True)
    return readings


def with_confidence(readings: Sequence[Reading], known: Sequence[Reading]) -> list[Reading]:
    """The readings with a confidence, each fitted to the `known` readings of all other takes and folds."""
    rights = [k.right for k in known]
    out = []
    for reading in readings:
        own = reading.take.name.removesuffix(SHUFFLED)
        others = [
            (k.facts, right)
            for k, right in zip(known, rights, strict=True)
            if k.take.name.removesuffix(SHUFFLED) != own and k.trial != reading.trial
        ]
        weights = fit_confidence(*zip(*others, strict=True))
        out.append(replace(reading, confidence=confidence_of(reading.facts, weights)))
    return out


def with_decoder_of_others(readings: Sequence[Reading]) -> list[Reading]:
    """The estimates by the decoder that counts the takes of all other folds best, without confidence."""
    found = [[decode_counts(r.curves[n], pointer).counts for n, pointer in DECODERS] for r in readings]
    right = np.array(
        [[share_right(c, r.take.counts) for c in of_take] for r, of_take in zip(readings, found, strict=True)]
    )
    folds = np.array([r.trial for r in readings])
    best = [right[folds != r.trial].mean(axis=0).argmax() for r in readings]
    return [
        Reading(r.take, found[i][b], trial=r.trial)
        for i, (r, b) in enumerate(zip(readings, best, strict=True))
    ]


def is_shuffled(reading: Reading) -> bool:
    return reading.take.name.endswith(SHUFFLED)


def by_joint_speed(take: CountedMotion) -> Counts:
    """The baseline: beats at the period of the joint speed's autocorrelation, where the body is slow.

    The beat tracker's dynamic programming, with slowness in place of onsets. It has no bars: every fourth.
    """
    speed = mean_joint_speed_m_s(take.body_pos_m, NET_FPS)
    fine = np.interp(np.arange(3 * len(speed)) / 3, np.arange(len(speed)), np.log(speed + 0.02))
    slow = np.maximum(0.0, gaussian_filter1d(fine, 60.0) - fine)
    centres = np.arange(0, len(slow), 30)
    gain = 1.5 * autocorrelations(slow[:, None], centres, 8.0)[:, 0, 16:73]  # 225 to 50 BPM at 60 fps
    beats_s = frames_to_seconds(best_beat_sequence(slow, gain, 30, 16, 1000.0, 1e6), 60.0)
    return Counts(beats_s, numbers_in_bar(len(beats_s), 4), 4)


def at_the_level_of(found: Counts, true: Counts) -> Counts:
    """Counts at twice, three times, half or a third of their tempo, whichever is nearest to the true one."""
    period_s = np.median(np.diff(found.times_s)) / np.median(np.diff(true.times_s))
    factor = min((1, 2, 3, 1 / 2, 1 / 3), key=lambda f: abs(np.log(period_s / f)))
    every, n = max(1, round(1 / factor)), len(found)
    times_s = np.interp(np.arange(0, n - 1, 1 / max(1, factor)), np.arange(n), found.times_s)[::every]
    return Counts(times_s, numbers_in_bar(len(times_s), true.metre), true.metre)


def line(what: str, seeds: Sequence[Sequence[Reading]]) -> str:
    """A row of the table: means over takes, ± the spread over seeds."""

    def text(value: Callable[[Reading], float]) -> str:
        means = [np.mean([value(r) for r in readings]) for readings in seeds]
        return f"{np.mean(means):.2f}" + (f" ± {np.std(means):.2f}" if len(means) > 1 else "")

    shown = [
        text(lambda r: r.right),
        text(lambda r: r.ones),
        text(lambda r: r.found.metre == r.take.counts.metre),
    ]
    return f"| {what} | {len(seeds[0])} | {' | '.join(shown)} | {_sure_text(seeds)} |"


def _sure_text(seeds: Sequence[Sequence[Reading]]) -> str:
    if any(np.isnan(r.confidence) for readings in seeds for r in readings):
        return " | | "
    sure = [[r for r in readings if r.confidence >= SURE_MOTION_CONFIDENCE] for readings in seeds]
    of_all = f"{np.mean([len(s) / len(r) for s, r in zip(sure, seeds, strict=True)]):.2f}"
    flat = [r for s in sure for r in s]
    if not flat:
        return f"{of_all} | | "
    takes = np.mean([r.right >= SHARE_OF_A_RIGHT_TAKE for r in flat])
    return f"{of_all} | {np.mean([r.right for r in flat]):.2f} | {takes:.2f}"


def lines_by_genre(what: str, seeds: Sequence[Sequence[Reading]]) -> list[str]:
    genres = sorted({r.take.genre for r in seeds[0]})
    return [line(what, seeds)] + [
        line(f"… {genre}", [[r for r in readings if r.take.genre == genre] for readings in seeds])
        for genre in genres
        if len(genres) > 1
    ]


def in_parts(readings: Sequence[Reading]) -> list[float]:
    """Share of right counts in each sixth of the takes, from the first to the last."""
    shares = []
    for reading in readings:
        errors = np.abs(signed_errors_beats(reading.found.times_s, reading.take.counts.times_s))
        shares.append([np.mean(part <= WITHIN_BEATS) for part in np.array_split(errors, N_PARTS)])
    return list(np.mean(shares, axis=0))


def threshold_lines(readings: Mapping[str, Sequence[Reading]]) -> list[str]:
    """A table: the share of takes that reach each threshold, and of their counts that are right."""
    lines = [f"| confidence of at least | {' | '.join(readings)} |", "| --- |" + " --- |" * len(readings)]
    for threshold in THRESHOLDS:
        cells = []
        for of_kind in readings.values():
            right = [r.right for r in of_kind if r.confidence >= threshold]
            cells.append(f"{len(right) / len(of_kind):.2f}" + (f" ({np.mean(right):.2f})" if right else ""))
        lines.append(f"| {threshold:g} | {' | '.join(cells)} |")
    return lines


def recounted(path: Path, output: Path, counts: Mapping[str, Counts]) -> cg.Repertoire:
    """A copy of a repertoire with these counts of its takes, by name, of other takes none, and no figures."""
    file = RepertoireFile(path)
    arrays = file.arrays()
    of_takes = [counts.get(str(name), NO_COUNTS) for name in arrays["takes/name"]]
    stops = np.cumsum([len(c) for c in of_takes])
    arrays |= {
        "takes/count_start": stops - [len(c) for c in of_takes],
        "takes/count_stop": stops,
        "takes/metre": np.array([c.metre for c in of_takes]),
        "takes/counts_source": np.array([c.source for c in of_takes]),
        "takes/counts_confidence": np.array([c.confidence for c in of_takes]),
        "counts/time_s": np.concatenate([c.times_s for c in of_takes]),
        "counts/number": np.concatenate([c.numbers for c in of_takes]),
    }
    arrays |= {name: array[:0] for name, array in arrays.items() if name.startswith("figures/")}
    nets = {name: file.read_net(name) for name in file.net_names}
    write_repertoire(output, Contents(arrays, file.density, file.provenance, nets))
    return cg.Repertoire.open(output)


def library_lines(data: Path, library: Path, work: Path, readings: Sequence[Reading]) -> list[str]:
    """Dances to held-out songs of a library counted by its motion: true counts against tracked beats."""
    sure = {
        r.take.name: replace(r.found, source=FROM_MOTION, confidence=r.confidence)
        for r in readings
        if r.confidence >= SURE_MOTION_CONFIDENCE
    }
    true = cg.Repertoire.open(library)
    by_motion = recounted(library, work / "by_motion.h5", sure)
    without = recounted(library, work / "without_counts.h5", {})
    n_sure = sum(take.name in sure for take in by_motion.takes)
    libraries = {"true counts": true, f"{n_sure} takes counted by motion": by_motion, "no counts": without}
    scores: dict[str, list[dict[str, float]]] = {}
    for name in HELD_OUT.read_text(encoding="utf-8").split():
        (take,) = import_takes(data / name)
        song = load_song(take.song_path, start_s=take.song_start_s, duration_s=take.motion.duration_s)
        mel = log_mel(song.samples)
        beats = track_bars(song.samples, mel, get_beat_tracker().beats(song, mel))
        for what, repertoire in libraries.items():
            danced = danced_counts(cg.dance(song, repertoire).plan, true)
            row = counts_scores(danced.times_s, danced.numbers, beats.times_s, beats.numbers)
            scores.setdefault(what, []).append(row)
            print(f"{name}, {what}: {row['counts_within']:.2f}", flush=True)
    means = {
        what: [np.nanmean([row[name] for row in rows]) for name in ("counts_within", "downbeat_share")]
        for what, rows in scores.items()
    }
    return [f"| {what} | {within:.2f} | {ones:.2f} |" for what, (within, ones) in means.items()]


def starter_takes() -> list[CountedMotion]:
    """The takes of the built-in repertoire, which no recipe trains on."""
    rep = cg.starter_repertoire()
    return [
        CountedMotion(take.name, take.credits.genre, rep.body_pos_m(i), rep.counts(i), is_built_in=True)
        for i, take in enumerate(rep.takes)
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("sources", nargs="+", type=Path)
    parser.add_argument("--work", type=Path, required=True)
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    parser.add_argument("--seeds-built-in", type=int, help="so many seeds for built-in takes, by default all")
    parser.add_argument("--steps", type=int, help="of every training, by default the preset's")
    parser.add_argument("--library", type=Path, help="repertoire of dance-with-melody's takes with counts")
    parser.add_argument("-o", "--output", type=Path)
    given = parser.parse_args()
    config = motion_counts_config("small", **({"steps": given.steps} if given.steps else {}))
    built_in, recorded = built_in_takes(), recorded_takes(given.sources)
    danced = [r.motion for r in recorded if r.song_name]
    trials = {
        BY_SONG: list(trials_by_song(recorded, built_in)),
        BY_FIGURE: list(trials_by_figure(recorded, built_in)),
        BY_GENRE: list(trials_by_genre(built_in)),
        ALONE: [Trial(ALONE, built_in, [*starter_takes(), *danced])],
    }
    seeds_of = {what: given.seeds[: given.seeds_built_in] for what in (BY_GENRE, ALONE)}
    found: dict[str, list[list[Reading]]] = {
        what: [
            [r for t in of for r in read_by(t, config, seed, given.work)]
            for seed in seeds_of.get(what, given.seeds)
        ]
        for what, of in trials.items()
    }
    known = [r for what in (BY_FIGURE, BY_GENRE) for readings in found[what] for r in readings]
    found = {what: [with_confidence(readings, known) for readings in of] for what, of in found.items()}
    mixed = [r for of in found.values() for s in of for r in s]
    found = {what: [[r for r in s if not is_shuffled(r)] for s in of] for what, of in found.items()}
    alone = found.pop(ALONE)
    by_threshold = {what: [r for s in found[what] for r in s] for what in (BY_SONG, BY_FIGURE, BY_GENRE)}
    by_threshold |= {"takes in shuffled pieces": [r for r in mixed if is_shuffled(r)]}
    by_threshold |= {
        "real takes, by built-in takes alone": [r for s in alone for r in s if not r.take.is_built_in]
    }
    for what in (BY_SONG, BY_FIGURE):
        found[f"{what}, counts not uncertain"] = [
            [r for r in s if r.take.counts.confidence == 1.0] for s in found[what]
        ]
        found[f"{what}, decoder chosen on other folds"] = [with_decoder_of_others(s) for s in found[what]]
    found["built-in takes, seed left out"] = [[r for r in s if r.take.is_built_in] for s in alone]
    found["real takes, by built-in takes alone"] = [[r for r in s if not r.take.is_built_in] for s in alone]
    found["takes in shuffled pieces"] = [[r for r in mixed if is_shuffled(r)]]
    rows = [row for what, seeds in found.items() for row in lines_by_genre(what, seeds)]
    for what, takes in (("real", danced), ("built-in", starter_takes())):
        found_by_speed = [Reading(t, by_joint_speed(t)) for t in takes]
        told = [Reading(r.take, at_the_level_of(r.found, r.take.counts)) for r in found_by_speed]
        rows += lines_by_genre(f"{what} takes, by joint speed", [found_by_speed])
        rows += lines_by_genre(f"{what} takes, by joint speed with the true level", [told])
    head = (
        "| | takes | counts within 0.15 beat | count 1 right | metre right | sure of | "
        "counts right of those | takes right of those |\n"
        "| --- | --- | --- | --- | --- | --- | --- | --- |\n"
    )
    table = head + "\n".join(rows) + "\n\n" + "\n".join(threshold_lines(by_threshold)) + "\n"
    table += f"\n| counts right, by sixths of a take |{' |' * N_PARTS}\n| --- |{' --- |' * N_PARTS}\n"
    for what in (BY_SONG, BY_FIGURE):
        parts = np.mean([in_parts(readings) for readings in found[what]], axis=0)
        table += f"| {what} | {' | '.join(f'{share:.2f}' for share in parts)} |\n"
    if given.library:
        readings = found[BY_SONG][0]
        lines = library_lines(given.sources[0], given.library, given.work, readings)
        table += "\n| danced with | true counts within 0.15 beat | count 1 |\n| --- | --- | --- |\n"
        table += "\n".join(lines) + "\n"
    print(table)
    if given.output:
        given.output.write_text(table, encoding="utf-8")


if __name__ == "__main__":
    main()
