"""Three ways to align takes with estimated counts with a song: densities, phase curves and counts.

    python research/warping_experiment.py path/to/dance-with-melody path/to/choreonet --work FOLDER \\
        [--seeds 0 1 2] [--densities l0.h5 l1.h5 l2.h5]

The true counts of real takes are withheld. They are estimated by networks that were trained on less and less
of them, as in `research/uncertain_counts.py`. Clips of 8 s of such takes are aligned with songs other than
their own. Of a few dozen, those with the best fit are compared with their true counts, which should lie
within 0.15 beat of a beat, and count 1 of a downbeat.

- tempo-densities, analytic and learned (`--densities`: a repertoire with both networks for each seed), and
  analytic ones with motion beats moved to music beats, as in dances without counts
- the DTW of phase curves: cosine and sine of the phase of the song in the beat, or in beat and bar, against
  those that the network estimates. Each vector is as long as its mean resultant (0 if nothing is known). The
  cost is the squared difference, with a weight for the bar. Steps are those of
  `choreograph.choreography.graph.warping`, and paths are smoothed at each stiffness
- counts decoded from the same curves, placed count by count: any of the clips, and those that fit best

A fit is the mean squared difference along the map, divided by its chance level: that of the best clips for
another song, whose counts are at chance, too. `constant` means curves that are equal at every frame.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from runpy import run_path

import numpy as np

import choreograph as cg
from choreograph.choreography.graph.warping import CountedClips, count_time_maps, smooth_time_maps
from choreograph.core.counts import Counts
from choreograph.core.numerics import Floats
from choreograph.core.timebase import CLIP_FRAMES, NET_FPS, SEGMENT_FRAMES, SEGMENT_S
from choreograph.evaluation.metrics.counts import WITHIN_BEATS
from choreograph.evaluation.songs import EvaluatedSong, find_songs
from choreograph.library.songs import DEFAULT_BEATS, song_counts
from choreograph.motion.motion_beats import motion_beat_times_s
from choreograph.music.bar_pointer import METRES
from choreograph.music.count_grids import SongGrid, TakeGrids
from choreograph.music.mel import log_mel
from choreograph.music.song_features import motion_density, music_density
from choreograph.nets.density import MotionDensity, MusicDensity

STIFFNESS = (0.0, 400.0, 40_000.0, 400_000.0)  # frames⁴. Dances without counts use the third
PLAYED = 40_000.0
BAR_WEIGHTS = (0.0, 0.5, 1.0, 2.0)  # of the bar's squared difference against the beat's
HELD_OUT = Path(__file__).with_name("dance_with_melody_held_out.txt")
OWN, OTHER = "own song", "another song"
READ = run_path(str(Path(__file__).with_name("uncertain_counts.py")))
GROUPS = [READ[name] for name in ("NOT_SURE", "FIGURES", "GENRE", "CLEAN")]


class Clips:
    """Clips of 8 s of read takes: where they are, and their curves."""

    def __init__(self, readings: Sequence, density: MotionDensity | None) -> None:
        self.readings = readings
        starts = [range(0, len(r.take.body_pos_m) - CLIP_FRAMES + 1, NET_FPS) for r in readings]
        self.take = np.repeat(np.arange(len(readings)), [len(s) for s in starts])
        self.start = np.concatenate([np.array(s) for s in starts])
        self.beats_s = [motion_beat_times_s(r.take.body_pos_m, NET_FPS) for r in readings]
        self.curves = {
            "phases": [r.phases for r in readings],
            "analytic": [
                motion_density(len(r.take.body_pos_m), b) for r, b in zip(readings, self.beats_s, strict=True)
            ],
        }
        if density is not None:
            self.curves["learned"] = [density.take_density(r.take.body_pos_m) for r in readings]
        analytic = np.concatenate(self.curves["analytic"])
        self.shift, self.factor = float(analytic.mean()), float(analytic.std())
        self.curves["analytic"] = [(c - self.shift) / self.factor for c in self.curves["analytic"]]
        self.grids = TakeGrids([r.decoded.counts for r in readings], [()] * len(readings))

    def of(self, kind: str, clips: Floats) -> Floats:
        """Curves of clips, (K, 160, ...)."""
        rows = zip(self.take[clips], self.start[clips], strict=True)
        return np.stack([self.curves[kind][take][start : start + CLIP_FRAMES] for take, start in rows])

    def motion_beats(self, clips: Floats) -> list[Floats]:
        """In clip frames."""
        rows = zip(self.take[clips], self.start[clips], strict=True)
        beats = [self.beats_s[take] * NET_FPS - start for take, start in rows]
        return [b[(b >= 0) & (b < CLIP_FRAMES)] for b in beats]

    def true_counts(self, clip: int) -> tuple[Floats, Floats]:
        """Clip frames and numbers of the true counts."""
        counts = self.readings[self.take[clip]].take.counts
        return counts.times_s * NET_FPS - self.start[clip], counts.numbers


@dataclass(frozen=True, eq=False)
class Heard:
    """A song, its mel and its counts."""

    name: str
    duration_s: float
    mel: Floats
    counts: Counts

    @classmethod
    def of(cls, song: EvaluatedSong) -> Heard:
        loaded = song.load()
        mel = log_mel(loaded.samples)
        return cls(song.name, loaded.duration_s, mel, song_counts(loaded, mel, DEFAULT_BEATS))


class Music:
    """What a song wants of the 4 s from each second."""

    def __init__(self, song: Heard, clips: Clips, density: MusicDensity | None) -> None:
        self.name, self.counts = song.name, song.counts
        self.n_seconds = int(song.duration_s) - SEGMENT_S
        self.grid = SongGrid.of(song.counts, song.duration_s)
        analytic = music_density(self.n_seconds, song.counts.times_s)
        self.density = {"analytic": (analytic - clips.shift) / clips.factor}
        if density is not None:
            self.density["learned"] = density.song_density(song.mel, self.n_seconds)

    def phases(self, second: int) -> Floats:
        """Unit vectors of the phase in beat and bar, (80, 2, 2)."""
        index = self.grid.index_at(second + np.arange(SEGMENT_FRAMES) / NET_FPS)
        beat = np.floor(index).astype(int)
        turns = np.stack([index - beat, (self.grid.numbers[beat] - 1 + index - beat) / self.counts.metre], 1)
        return np.stack([np.cos(2 * np.pi * turns), np.sin(2 * np.pi * turns)], axis=-1)


def dtw_paths(query: Floats, targets: Floats) -> Floats:
    """As `subsequence_dtw`, of vectors: query (80, D) in targets (K, 160, D), to paths (K, 80)."""
    square = (query**2).sum(-1)[None, :, None] + (targets**2).sum(-1)[:, None, :]
    cost = square - 2 * np.einsum("id,kjd->kij", query, targets)  # (K, 80, 160)
    k, n_query, n_target = cost.shape
    table = np.full((n_query + 1, k, n_target + 2), np.inf)  # padded by a row and two columns in front
    step = np.zeros((n_query, k, n_target), np.int8)
    table[1, :, 2:] = cost[:, 0]
    for i in range(1, n_query):
        c = cost[:, i]
        ways = np.stack(
            [table[i, :, 1:-1] + c, table[i, :, :-2] + c, table[i - 1, :, 1:-1] + 2 * c]
        )  # steps (1, 1), (1, 2), (2, 1), preferred in this order
        step[i] = ways.argmin(axis=0)
        table[i + 1, :, 2:] = ways.min(axis=0)
    paths = np.empty((k, n_query))
    for row in range(k):
        i, j = n_query - 1, int(table[-1, row, 2:].argmin())
        paths[row, i] = j
        while i > 0:
            way = step[i, row, j]
            if way == 2:
                paths[row, i - 1] = j - 0.5
            i, j = i - (2 if way == 2 else 1), j - (2 if way == 1 else 1)
            paths[row, i] = j
    return paths


def smoothed(paths: Floats, stiffness: float, beats: Sequence[Floats] = (), music: Floats | None = None):
    """Time maps (K, 80). Motion beats are drawn onto the music's if given."""
    if stiffness == 0.0:
        return paths
    stops = np.cumsum([len(b) for b in beats] or np.zeros(len(paths), int))
    return smooth_time_maps(
        paths, clip_frames=CLIP_FRAMES, motion_beats=np.concatenate([[], *beats]),
        beat_ranges=np.stack([np.append(0, stops[:-1]), stops], axis=1),
        music_beats=np.zeros(0) if music is None else music, stiffness=stiffness,
    )  # fmt: skip


def fits(query: Floats, targets: Floats, maps: Floats) -> Floats:
    """Mean squared difference (K,) of query (80, D) and targets (K, 160, D) along maps (K, 80)."""
    low = np.clip(np.floor(maps).astype(int), 0, CLIP_FRAMES - 2)
    weight, rows = (maps - low)[..., None], np.arange(len(maps))[:, None]
    played = targets[rows, low] * (1 - weight) + targets[rows, low + 1] * weight
    return ((played - query) ** 2).sum(axis=-1).mean(axis=1)


def judged(clips: Clips, chosen: Floats, maps: Floats, second: int, beats: Counts) -> tuple[Floats, Floats]:
    """Whether each true count played by maps (K, 80) is on a beat, and each count 1 on a downbeat."""
    on_beat, on_bar = [], []
    for clip, row in zip(chosen, maps, strict=True):
        frames, numbers = clips.true_counts(clip)
        inside = (frames >= row[0]) & (frames <= row[-1])
        at_s = second + np.interp(frames[inside], row, np.arange(SEGMENT_FRAMES)) / NET_FPS
        known = (at_s >= beats.times_s[0]) & (at_s <= beats.times_s[-1])
        index = np.interp(at_s[known], beats.times_s, np.arange(len(beats)))
        near = np.abs(index - np.round(index)) <= WITHIN_BEATS
        on_beat.append(near)
        is_one = numbers[inside][known] == 1
        on_bar.append((near & (beats.numbers[np.round(index).astype(int)] == 1))[is_one])
    return np.concatenate(on_beat), np.concatenate(on_bar)


Laid = tuple[str, float, Floats, Floats]  # how, stiffness, time maps (K, 80) and fits (K,)


def laid_by_dtw(
    clips: Clips, drawn: Floats, wanted: Music, at: int, stiffness: Sequence[float]
) -> Iterator[Laid]:
    """Clips laid by densities and by phase curves, on what a song wants from a second."""
    ways: list[tuple[str, Floats, Floats]] = [
        (f"{kind} densities", curve[at][:, None], clips.of(kind, drawn)[..., None])
        for kind, curve in wanted.density.items()
    ]
    song, motion = wanted.phases(at), clips.of("phases", drawn)
    motion = motion[:, :, [0, 1 + METRES.index(wanted.counts.metre)]]  # of the song's metre
    for bar in BAR_WEIGHTS:
        scale = np.sqrt([1.0, bar])[:, None]
        query, target = (
            (song * scale).reshape(SEGMENT_FRAMES, -1),
            (motion * scale).reshape(*motion.shape[:2], -1),
        )
        ways.append((f"phases, bar x {bar:g}" if bar else "phases, beat alone", query, target))
        if bar == 1.0:
            ways.append(("phases, constant", query, np.full_like(target, 0.5)))
    music = (wanted.counts.times_s - at) * NET_FPS
    music = music[(music > -10) & (music < SEGMENT_FRAMES + 10)]
    for name, query, target in ways:
        paths = dtw_paths(query, target)
        for value in stiffness:
            maps = smoothed(paths, value)
            yield name, value, maps, fits(query, target, maps)
        if name == "analytic densities":
            maps = smoothed(paths, PLAYED, clips.motion_beats(drawn), music)
            yield "analytic densities, beats on beats", PLAYED, maps, fits(query, target, maps)


def laid_by_counts(clips: Clips, drawn: Floats, song: Music, at: int) -> tuple[Floats, Floats, Floats]:
    """Which of the clips can be laid count by count by their decoded counts, maps and fits of phases."""
    table = CountedClips.of(clips.take, clips.start, clips.grids, song.grid, np.arange(1000.0))
    laid = count_time_maps(at, drawn, table)
    motion = clips.of("phases", drawn[laid.candidates])[:, :, [0, 1 + METRES.index(song.counts.metre)]]
    maps = laid.time_maps[:, :-1]
    query = song.phases(at).reshape(SEGMENT_FRAMES, -1)
    return drawn[laid.candidates], maps, fits(query, motion.reshape(*motion.shape[:2], -1), maps)


def measured(
    clips: Clips, music: Sequence[Music], options: argparse.Namespace
) -> dict[tuple, tuple[float, ...]]:
    """Fit over chance, counts on a beat and counts 1 on a downbeat, by (how, stiffness, whose song)."""
    on_beat, on_bar, fit_of = defaultdict(list), defaultdict(list), defaultdict(list)
    names = np.array([r.take.name for r in clips.readings])[clips.take]
    for number, song in enumerate(music):
        rng, other = np.random.default_rng(7), music[(number + 1) % len(music)]
        others = np.flatnonzero(names != song.name)

        def add(key, chosen, maps, fit, at, song=song):
            best = np.argsort(fit, kind="stable")[: options.best]
            beat, bar = judged(clips, chosen[best], maps[best], at, song.counts)
            on_beat[key].append(beat)
            on_bar[key].append(bar)
            fit_of[key].append(fit[best])

        for at in range(0, song.n_seconds, options.every):
            drawn = rng.permutation(others)[: options.clips]
            for whose, wanted in ((OWN, song), (OTHER, other)):
                for how, value, maps, fit in laid_by_dtw(
                    clips, drawn, wanted, at % wanted.n_seconds, options.stiffness
                ):
                    add((how, value, whose), drawn, maps, fit, at)
            chosen, maps, fit = laid_by_counts(clips, drawn, song, at)
            if len(chosen):
                add(("decoded counts, best fit", 0.0, OWN), chosen, maps, fit, at)
                add(("decoded counts, any", 0.0, OWN), chosen, maps, rng.random(len(fit)), at)
    means = {key: float(np.concatenate(values).mean()) for key, values in fit_of.items()}
    return {
        key: (
            mean / means.get((*key[:2], OTHER), np.nan),
            *(float(np.concatenate(on[key]).mean()) for on in (on_beat, on_bar)),
        )
        for key, mean in means.items()
    }


def densities(paths: Sequence[Path], number: int) -> tuple[MotionDensity | None, MusicDensity | None]:
    """Both networks of one of the repertoires, if there are any."""
    if number >= len(paths):
        return None, None
    repertoire = cg.Repertoire.open(paths[number])
    motion, music = repertoire.net("motion_density"), repertoire.net("music_density")
    return (
        MotionDensity.from_arrays(motion.weights, motion.config),
        MusicDensity.from_arrays(music.weights, music.config),
    )


def text(values: Sequence[float]) -> str:
    """Mean ± spread over seeds. Empty if there is no such number."""
    return READ["mean_text"](values) if np.isfinite(values).all() else ""


def print_table(what: str, seeds: Sequence[Sequence], songs: Sequence[Heard], options: argparse.Namespace):
    rows: dict[tuple, list] = defaultdict(list)
    for number, readings in enumerate(seeds):
        motion, music = densities(options.densities, number)
        clips = Clips(readings, motion)
        found = measured(clips, [Music(song, clips, music) for song in songs], options)
        for key, values in found.items():
            rows[key].append(values)
    right = text([np.mean([r.right for r in readings]) for readings in seeds])
    counted = text([np.mean([r.is_counted for r in readings]) for readings in seeds])
    n_takes = ", ".join(str(len(readings)) for readings in seeds)
    print(f"\n{what}: {n_takes} takes, counts right {right}, counted by a build {counted}\n")
    print("| laid by | stiffness | song | fit over chance | counts within 0.15 beat | count 1 |")
    print("| --- | --- | --- | --- | --- | --- |")
    for (how, value, whose), values in sorted(rows.items(), key=lambda row: row[0][2] != OWN):
        print(f"| {how} | {value:g} | {whose} | {' | '.join(map(text, np.transpose(values)))} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("sources", nargs="+", type=Path, help="dance-with-melody, and ChoreoNet")
    parser.add_argument("--work", type=Path, required=True, help="folder of checkpoints")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    parser.add_argument("--densities", type=Path, nargs="*", default=[], help="a repertoire for each seed")
    parser.add_argument("--clips", type=int, default=64, help="laid on each segment of a song")
    parser.add_argument("--best", type=int, default=8, help="of them judged")
    parser.add_argument("--every", type=int, default=4, help="seconds of a song, a segment is danced")
    parser.add_argument("--stiffness", type=float, nargs="+", default=STIFFNESS)
    options = parser.parse_args()
    held_out = HELD_OUT.read_text(encoding="utf-8").split()
    songs = [Heard.of(song) for song in find_songs(options.sources[0], only=held_out)]
    readings = READ["readings_of"](options.sources, options.work, options.seeds, GROUPS)
    for what in GROUPS:
        print_table(what, readings[what], songs, options)


if __name__ == "__main__":
    main()
