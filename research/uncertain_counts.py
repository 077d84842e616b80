"""Dances with takes whose counts a network estimated. Does the uncertainty of the counts help?

    python research/uncertain_counts.py path/to/dance-with-melody path/to/choreonet --work FOLDER \\
        --library REPERTOIRE [--seeds 0 1 2]

The true counts of real takes are withheld. They are estimated by networks that were trained on less and less
of them: without their songs (5 trainings per seed), without their songs and figures (5), without takes of
their genre (3), and without recorded takes (the shipped set `clean`, one seed). A confidence is fitted as for
the shipped set (4 trainings of the first seed), without the take that it belongs to. Checkpoints are in
FOLDER, as those of `research/motion_counts.py`.

REPERTOIRE has takes of dance-with-melody with counts, without those of
`research/dance_with_melody_held_out.txt`. The songs of those are danced with the estimated takes only. Takes
are aligned by motion beats alone, by the estimated counts where these are certain, by the counts that a build
uses (`choreograph.library.building.counting`), and by these with their uncertainty. The dances are compared
with the true counts.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.special import i0e, i1e

import choreograph as cg
from choreograph.choreography.constraints import Ban
from choreograph.core.counts import FROM_MOTION, NO_COUNTS, Counts
from choreograph.core.numerics import Floats
from choreograph.core.timebase import NET_FPS
from choreograph.evaluation.metrics.counts import counts_within, downbeat_share
from choreograph.evaluation.plan_scores import danced_counts
from choreograph.evaluation.songs import find_songs
from choreograph.library.building.counting import SURE_MOTION_CONFIDENCE
from choreograph.library.builtin import MAX_MOTION_UNCERTAINTY, MIN_MOTION_CONFIDENCE, pretrained_set
from choreograph.library.schema import UNCERTAINTY
from choreograph.library.songs import DEFAULT_BEATS, song_counts
from choreograph.library.store import RepertoireFile
from choreograph.library.writing import Contents, write_repertoire
from choreograph.music.bar_pointer import DecodedCounts, PhaseCurves, count_uncertainty, decode_counts
from choreograph.music.mel import log_mel
from choreograph.music.song import Song
from choreograph.nets.motion_counts import POINTER, MotionCounts, confidence_features, confidence_of
from content.count_networks import motion_counts_config
from content.motion_counting import CountedMotion, fit_confidence
from content.networks import (
    RecordedTake,
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
SONG, FIGURES, GENRE = "song left out", "song and figures left out", "genre left out"
NOT_SURE, CLEAN = f"{FIGURES}, not sure", "by built-in takes alone"
GROUPS = (SONG, FIGURES, NOT_SURE, GENRE, CLEAN)


@dataclass(frozen=True, eq=False)
class Reading:
    """What a network reads of a take."""

    take: CountedMotion
    curves: PhaseCurves
    decoded: DecodedCounts
    confidence: float = float("nan")

    @classmethod
    def of(cls, net: MotionCounts, take: CountedMotion) -> Reading:
        curves = net.curves(take.body_pos_m)
        return cls(take, curves, decode_counts(curves, POINTER, source=FROM_MOTION))

    @property
    def facts(self) -> Floats:
        return confidence_features(self.curves, self.decoded)

    @property
    def right(self) -> float:
        return share_right(self.decoded.counts, self.take.counts)

    @property
    def counts(self) -> Counts:
        uncertainty = count_uncertainty(self.decoded, NET_FPS)
        return replace(self.decoded.counts, confidence=self.confidence, uncertainty=uncertainty)

    @property
    def is_counted(self) -> bool:
        """Whether a build takes the counts over."""
        counts = self.counts
        return (
            counts.confidence >= MIN_MOTION_CONFIDENCE and counts.uncertainty.mean() <= MAX_MOTION_UNCERTAINTY
        )

    @cached_property
    def phases(self) -> Floats:
        """Mean resultant vectors of the phases in the beat and in the bars, (T, 1 + M, 2)."""
        vectors = np.concatenate([self.curves.beat[:, None], self.curves.bar], axis=1)
        length = np.linalg.norm(vectors, axis=-1, keepdims=True)
        return vectors / np.maximum(length, 1e-9) * (i1e(length) / i0e(length))


def with_confidence(readings: Sequence[Reading], known: Sequence[Reading]) -> list[Reading]:
    """The readings with a confidence, each fitted to the known readings of other takes."""
    of_take = [k.take.name.partition(",")[0] for k in known]
    facts, right = [k.facts for k in known], [k.right for k in known]
    out = []
    for reading in readings:
        others = [i for i, name in enumerate(of_take) if name != reading.take.name]
        weights = fit_confidence([facts[i] for i in others], [right[i] for i in others])
        out.append(replace(reading, confidence=confidence_of(reading.facts, weights)))
    return out


def trials_by_recorded_genre(
    recorded: Sequence[RecordedTake], built_in: Sequence[CountedMotion]
) -> Iterator[Trial]:
    """Recorded genres left out, one at a time. Takes to a song are counted."""
    for genre in sorted({r.motion.genre for r in recorded if r.song_name}):
        kept = [r.motion for r in recorded if r.motion.genre != genre]
        left = [r.motion for r in recorded if r.motion.genre == genre and r.song_name]
        yield Trial(f"no-real-{genre}", [*kept, *built_in], left)


def readings_of(
    sources: Sequence[Path], work: Path, seeds: Sequence[int], groups: Sequence[str] = GROUPS
) -> dict[str, list[list[Reading]]]:
    """Readings by the training data of the networks, seed by seed."""
    config, built_in, recorded = motion_counts_config("small"), built_in_takes(), recorded_takes(sources)
    by_genre = []
    for trial in trials_by_genre(built_in):
        net = trained(trial, config, seeds[0], work).for_inference()
        by_genre += [Reading.of(net, take) for take in [*trial.test, *map(shuffled, trial.test)]]
    kinds = {FIGURES: trials_by_figure, SONG: trials_by_song, GENRE: trials_by_recorded_genre}
    found: dict[str, list[list[Reading]]] = defaultdict(list)
    for seed in seeds:
        known = list(by_genre)
        for what, trials in kinds.items():
            if what != FIGURES and what not in groups:
                continue
            readings = []
            for trial in trials(recorded, built_in):
                net = trained(trial, config, seed, work).for_inference()
                readings += [Reading.of(net, take) for take in trial.test]
                known += [Reading.of(net, shuffled(take)) for take in trial.test if what == FIGURES]
            known += readings if what == FIGURES else []
            found[what].append(with_confidence(readings, known))
        unsure = [r for r in found[FIGURES][-1] if r.confidence < SURE_MOTION_CONFIDENCE]
        found[NOT_SURE].append(unsure)
    stored = pretrained_set("clean")["motion_counts"].arrays
    net = MotionCounts.from_arrays(stored.weights, stored.config)
    weights = net.confidence_weights.double().numpy()
    read = [Reading.of(net, r.motion) for r in recorded if r.song_name and CLEAN in groups]
    found[CLEAN].append([replace(r, confidence=confidence_of(r.facts, weights)) for r in read])
    return {what: found[what] for what in GROUPS if what in groups}


def recounted(path: Path, output: Path, counts: Mapping[str, Counts], *, uncertainty: bool) -> cg.Repertoire:
    """A copy of a repertoire with these counts of its takes, by name, of other takes none, and no figures."""
    file = RepertoireFile(path)
    arrays = {name: array for name, array in file.arrays().items() if name not in UNCERTAINTY}
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
    if uncertainty:
        arrays["counts/doubt"] = np.concatenate([c.uncertainty for c in of_takes])
    nets = {name: file.read_net(name) for name in file.net_names}
    write_repertoire(output, Contents(arrays, file.density, file.provenance, nets))
    return cg.Repertoire.open(output)


def libraries(path: Path, work: Path, readings: Sequence[Reading]) -> Iterator[tuple[str, cg.Repertoire]]:
    """The library without counts, and with those read."""
    sure = {r.take.name: r.counts for r in readings if r.confidence >= SURE_MOTION_CONFIDENCE}
    counted = {r.take.name: r.counts for r in readings if r.is_counted}
    yield "motion beats", recounted(path, work / "no_counts.h5", {}, uncertainty=False)
    if sure and len(sure) < len(counted):
        yield "sure counts", recounted(path, work / "sure.h5", sure, uncertainty=False)
        yield (
            "sure counts and their uncertainty",
            recounted(path, work / "sure_doubt.h5", sure, uncertainty=True),
        )
    if counted:
        yield "counts", recounted(path, work / "counted.h5", counted, uncertainty=False)
        yield (
            "counts and their uncertainty",
            recounted(path, work / "counted_doubt.h5", counted, uncertainty=True),
        )


def scores(song: Song, beats: Counts, repertoire: cg.Repertoire, true: cg.Repertoire, bans: Sequence[Ban]):
    """Of a dance, the true counts on a beat and on a downbeat, and changes of takes a minute."""
    plan = cg.dance(song, repertoire, bans=bans).plan
    counts = danced_counts(plan, true)
    changes = sum(a.take != b.take for a, b in pairwise(plan.seconds))
    return (
        counts_within(counts.times_s, beats.times_s),
        downbeat_share(counts.times_s, counts.numbers, beats.times_s, beats.numbers),
        60 * changes / plan.duration_s,
    )


def mean_text(values: Sequence[float]) -> str:
    """Mean ± spread."""
    return f"{np.mean(values):.2f}" + (f" ± {np.std(values):.2f}" if len(values) > 1 else "")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument(
        "sources", nargs="+", type=Path, help="dance-with-melody, with its songs, and ChoreoNet"
    )
    parser.add_argument("--work", type=Path, required=True, help="folder of checkpoints")
    parser.add_argument("--library", type=Path, required=True, help="repertoire of dance-with-melody")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    parser.add_argument("--groups", nargs="+", choices=GROUPS, default=[SONG, FIGURES, NOT_SURE])
    given = parser.parse_args()
    true = cg.Repertoire.open(given.library)
    songs = []
    for song in find_songs(given.sources[0], only=HELD_OUT.read_text(encoding="utf-8").split()):
        loaded = song.load()
        songs.append((loaded, song_counts(loaded, log_mel(loaded.samples), DEFAULT_BEATS)))
    print("| read | takes | right | danced by | counts within 0.15 beat | count 1 | changes of takes /min |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for what, seeds in readings_of(given.sources, given.work, given.seeds, given.groups).items():
        rows: dict[str, list] = defaultdict(list)
        kept = [[r for r in of if r.take.name in {take.name for take in true.takes}] for of in seeds]
        for readings in kept:
            bans = [Ban(take=t.name) for t in true.takes if t.name not in {r.take.name for r in readings}]
            for how, repertoire in libraries(given.library, given.work, readings):
                danced = [scores(song, beats, repertoire, true, bans) for song, beats in songs]
                rows[how].append(np.nanmean(danced, axis=0))
        about = f"{what} | {', '.join(str(len(of)) for of in kept)}"
        about += f" | {mean_text([np.mean([r.right for r in of]) for of in kept])}"
        for how, values in rows.items():
            print(f"| {about} | {how} | {' | '.join(map(mean_text, np.transpose(values)))} |", flush=True)


if __name__ == "__main__":
    main()
