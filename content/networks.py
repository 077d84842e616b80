"""Recipe of the shipped networks, trained on rendered takes, and in `research` on recorded takes as well.

    python -m content.networks clean --work FOLDER
    python -m content.networks research dance-with-melody/ choreonet/ --work FOLDER

`motion_counts` estimates counts from motion. Its confidence is fitted to takes that other networks, trained
in the same way, were not trained on. These are built-in takes of genres that were left out, and recorded
takes whose song and figures were left out. Takes that cannot be counted are the same ones cut into pieces
and shuffled. An interrupted run continues from its checkpoints in the folder.
"""

from __future__ import annotations

import argparse
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path

import numpy as np
import torch

from choreograph.core.counts import ANNOTATED, Counts, Figure, make_counts, numbers_in_bar
from choreograph.core.files import locked_folder
from choreograph.core.numerics import Floats
from choreograph.core.timebase import NET_FPS
from choreograph.evaluation.metrics.counts import counts_per_beat, counts_within
from choreograph.library.building.networks import STYLE_NET, checksum_of
from choreograph.library.building.options import BuildOptions
from choreograph.library.building.takes import measured_takes
from choreograph.library.builtin import MOTION_NET, PRETRAINED, pretrained_path
from choreograph.library.schema import NetArrays
from choreograph.library.writing import write_networks
from choreograph.motion.body import body_pos_m
from choreograph.music.bar_pointer import decode_counts
from choreograph.nets.motion_counts import POINTER, MotionCountsConfig, confidence_features
from choreograph.nets.style import StyleNets
from choreograph.nets.training import TrainingContext
from content.count_networks import MotionCountsNet, motion_counts_config
from content.motion_counting import CountedMotion, fit_confidence, train_motion_counts
from content.moves.genres import GENRES
from content.moves.sequencer import render_take
from content.songs.danced_styles import DANCED
from content.songs.synthesis.song import TempoMap
from content.style_networks import built_in_style_takes, style_takes, train_shipped_style

TAKES_PER_GENRE = 40
FIRST_SEED = 50_000  # beyond the seeds of the starter's takes and of the benchmark songs
_DURATION_S = 30.0
_BEYOND_BPM = 0.1  # of the range of a genre's songs
_RAMP_STD = 0.05  # of the logarithm of a take's last tempo over its first
N_FOLDS = 5  # of recorded songs
_TESTED_PER_GENRE = 8  # of the built-in takes of a genre that is left out
_LEVEL_RATIO = 1.25  # of counts to beats, and less, is the same metrical level
_FIGURE_SEEDS = (0, 1, 2)  # of the networks without some figures. Each alone has an error of a few hundredths
_GENRES_LEFT_OUT = 2  # at a time, to measure the confidence of a network on unknown genres


def built_in_takes(
    per_genre: int = TAKES_PER_GENRE, *, first_seed: int = FIRST_SEED, genres: Collection[str] = GENRES
) -> list[CountedMotion]:
    """Dances of the synthesiser with their true counts, without music, 30 s each, at a random tempo."""
    takes = []
    for number, genre in enumerate(sorted(GENRES)):
        for i in range(per_genre if genre in genres else 0):
            seed = first_seed + 1000 * number + i
            takes.append(_built_in_take(genre, seed))
    return takes


def _built_in_take(genre: str, seed: int) -> CountedMotion:
    rng = np.random.default_rng(seed)
    low, high = DANCED[genre].bpm
    metre = GENRES[genre].bar
    bpm = float(rng.uniform((1 - _BEYOND_BPM) * low, (1 + _BEYOND_BPM) * high))
    n_beats = int(_DURATION_S * bpm / 60)
    ramp = TempoMap.ramp(bpm, bpm * float(np.exp(rng.normal(0, _RAMP_STD))), n_beats)
    beats_s = ramp.seconds(np.arange(n_beats))
    energy = np.repeat(rng.uniform(0, 1, n_beats // (4 * metre) + 1), 4 * metre)[:n_beats]  # a phrase each
    dance = render_take(GENRES[genre], beats_s, energy=energy, seed=seed, fps=float(NET_FPS))
    counts = make_counts(beats_s, numbers_in_bar(n_beats, metre), metre, source=ANNOTATED)
    pos_m = body_pos_m(dance.motion).astype(np.float32)
    return CountedMotion(f"{genre}-{seed}", genre, pos_m, counts, is_built_in=True)


@dataclass(frozen=True, eq=False)
class RecordedTake:
    """A recorded take with counts, and its figures."""

    motion: CountedMotion
    song_name: str  # "" without music
    figures: tuple[Figure, ...]


def recorded_takes(sources: Iterable[str | Path]) -> list[RecordedTake]:
    """Recorded takes that have counts, as a build imports them. Raises as a build does."""
    measured, _ = measured_takes(sources, BuildOptions(), None)
    return [
        RecordedTake(
            CountedMotion(m.take.name, m.take.credits.genre, m.body_pos_m, m.take.counts),
            m.take.song_name if m.take.song_path else "",
            m.take.figures,
        )
        for m in measured
        if len(m.take.counts)
    ]


def without_figures(take: RecordedTake, left_out: Collection[str]) -> CountedMotion:
    """The take counted only in its figures that are not among the names `left_out`."""
    counts = take.motion.counts
    is_kept = np.zeros(len(counts), bool)
    for figure in take.figures:
        if figure.name not in left_out:
            is_kept |= (counts.times_s > figure.start_s - 1e-6) & (counts.times_s < figure.end_s + 1e-6)
    kept = Counts(counts.times_s[is_kept], counts.numbers[is_kept], counts.metre, counts.source)
    return replace(take.motion, counts=kept)


def song_folds(recorded: Sequence[RecordedTake]) -> dict[str, int]:
    """Fold of every take that has a song. Genres are spread evenly over the folds."""
    folds: dict[str, int] = {}
    with_song = [r for r in recorded if r.song_name]
    for genre in sorted({r.motion.genre for r in with_song}):
        songs = sorted({r.song_name for r in with_song if r.motion.genre == genre})
        folds |= {
            r.motion.name: songs.index(r.song_name) % N_FOLDS for r in with_song if r.motion.genre == genre
        }
    return folds


def share_right(found: Counts, true: Counts) -> float:
    """Share of counts within 0.15 beat of a true one, 0 at another metrical level or without counts."""
    per_beat = counts_per_beat(found.times_s, true.times_s)
    if not 1 / _LEVEL_RATIO < per_beat < _LEVEL_RATIO:
        return 0.0
    return counts_within(found.times_s, true.times_s)


def shuffled(take: CountedMotion) -> CountedMotion:
    """The take in pieces of half a second to two seconds in random order, which is motion without counts.

    Its counts do not change, so they are found at chance level.
    """
    rng = np.random.default_rng(len(take.body_pos_m))
    pos_m, pieces, n_made = take.body_pos_m, [], 0
    while n_made < len(pos_m):
        length = min(int(rng.integers(NET_FPS // 2, 2 * NET_FPS)), len(pos_m))
        start = int(rng.integers(len(pos_m) - length + 1))
        piece = pos_m[start : start + length]
        pieces.append(piece - piece[:1, :1] * np.array([1.0, 0.0, 1.0], np.float32))  # each from the middle
        n_made += length
    return replace(take, name=f"{take.name}, shuffled", body_pos_m=np.concatenate(pieces)[: len(pos_m)])


def calibration(net: MotionCountsNet, takes: Iterable[CountedMotion]) -> list[tuple[Floats, float]]:
    """Features of each take's counts by a network, and the share of these counts that is right."""
    rows, counter = [], net.for_inference()
    for take in takes:
        curves = counter.curves(take.body_pos_m)
        pointed = decode_counts(curves, POINTER)
        rows.append((confidence_features(curves, pointed), share_right(pointed.counts, take.counts)))
    return rows


def fit(net: MotionCountsNet, rows: Sequence[tuple[Floats, float]]) -> None:
    """Fit a network's confidence to rows of `calibration`, in place."""
    facts, right = zip(*rows, strict=True)
    net.confidence_weights.copy_(torch.from_numpy(fit_confidence(facts, right)))


@dataclass(frozen=True)
class Trial:
    """One training: its takes, and those that it leaves out."""

    name: str
    train: list[CountedMotion]
    test: list[CountedMotion]  # to be counted by the network


def trials_by_genre(built_in: Sequence[CountedMotion]) -> Iterator[Trial]:
    """Built-in genres left out, a few at a time. A few takes of each are counted."""
    by_genre = {
        genre: [t for t in built_in if t.genre == genre] for genre in sorted({t.genre for t in built_in})
    }
    genres = list(by_genre)
    for i in range(0, len(genres), _GENRES_LEFT_OUT):
        out = genres[i : i + _GENRES_LEFT_OUT]
        kept = [take for take in built_in if take.genre not in out]
        left = [take for genre in out for take in by_genre[genre][:_TESTED_PER_GENRE]]
        yield Trial(f"no-{'-'.join(out)}", kept, left)


def trials_by_song(recorded: Sequence[RecordedTake], built_in: Sequence[CountedMotion]) -> Iterator[Trial]:
    """Songs left out, a fold at a time. Takes without song (ChoreoNet's recordings) are trained on."""
    folds = song_folds(recorded)
    for fold in range(N_FOLDS):
        test = [r.motion for r in recorded if folds.get(r.motion.name) == fold]
        train = [r.motion for r in recorded if folds.get(r.motion.name) != fold]
        yield Trial(f"no-song-{fold}", [*train, *built_in], test)


def trials_by_figure(recorded: Sequence[RecordedTake], built_in: Sequence[CountedMotion]) -> Iterator[Trial]:
    """A song of each genre left out, and all its figures in all takes."""
    folds = song_folds(recorded)
    for fold in range(N_FOLDS):
        test: dict[str, RecordedTake] = {}
        for take in recorded:
            if folds.get(take.motion.name) == fold:
                test.setdefault(take.motion.genre, take)
        names = {take.motion.name for take in test.values()}
        figures = {figure.name for take in test.values() for figure in take.figures}
        train = [without_figures(r, figures) for r in recorded if r.motion.name not in names]
        yield Trial(f"no-figure-{fold}", [*train, *built_in], [take.motion for take in test.values()])


def trained(trial: Trial, config: MotionCountsConfig, seed: int, work: Path | None) -> MotionCountsNet:
    """The network of a trial. With `work`, it is continued from the checkpoint there."""
    name = f"{trial.name}-{seed}"
    context = TrainingContext(work, resume=work is not None, content={"takes": checksum_of(trial.train)})
    return train_motion_counts(trial.train, config, seed=seed, name=name, context=context)


def make_motion_counts(
    name: str, recorded: Sequence[RecordedTake], config: MotionCountsConfig, work: Path
) -> MotionCountsNet:
    """Train a set's network on built-in and recorded takes, if there are any, and fit its confidence."""
    built_in, motions = built_in_takes(), [r.motion for r in recorded]
    net = trained(Trial(name, [*built_in, *motions], []), config, 0, work)
    trials = [(trial, 0) for trial in trials_by_genre(built_in)]
    if recorded:
        by_figure = list(trials_by_figure(recorded, built_in))
        trials += [(trial, seed) for seed in _FIGURE_SEEDS for trial in by_figure]
    rows = []
    for trial, seed in trials:
        takes = [*trial.test, *map(shuffled, trial.test)]
        rows += calibration(trained(trial, config, seed, work), takes)
    fit(net, rows)
    return net


def write_set(
    motion_counts: MotionCountsNet, style: StyleNets, trained_on: Iterable[str], output: Path
) -> None:
    """Write a set's networks. `trained_on` are the songs and takes that they were trained on."""
    nets = {}
    for name, net in ((MOTION_NET, motion_counts), (STYLE_NET, style)):
        weights, config = net.to_arrays()
        nets[name] = NetArrays(config, weights)
    write_networks(
        output, nets, {"choreograph": version("choreograph"), "trained_on": sorted(set(trained_on))}
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("set", choices=PRETRAINED)
    parser.add_argument("sources", nargs="*", type=Path, help="dance-with-melody and ChoreoNet, for research")
    parser.add_argument("--work", type=Path, required=True, help="folder of checkpoints")
    given = parser.parse_args()
    if bool(given.sources) != (given.set == "research"):
        parser.error("research needs sources of recorded takes, clean takes none")
    with locked_folder(given.work, doing=f"trains the set {given.set}"):
        recorded = recorded_takes(given.sources) if given.sources else []
        built_in = built_in_style_takes(given.work / "takes")
        danced = [*built_in, *(style_takes(given.sources) if given.sources else [])]
        motion_counts = make_motion_counts(given.set, recorded, motion_counts_config("small"), given.work)
        style = train_shipped_style(danced, given.work / "style")
        trained_on = [*(take.song_name for take in danced), *(r.motion.name for r in recorded)]
        write_set(motion_counts, style, trained_on, pretrained_path(given.set))


if __name__ == "__main__":
    main()
