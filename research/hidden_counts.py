"""Takes whose counts are hidden: are they danced beside counted ones, and is one warper as good as two?

    python research/hidden_counts.py path/to/dance-with-melody path/to/choreonet --work FOLDER \\
        --library REPERTOIRE [--seed 0] [--dances 2]

The counts of every second song of each genre are hidden. A network that was trained without these songs
estimates them (its checkpoint is in FOLDER). REPERTOIRE has takes of dance-with-melody with counts, without
those of `research/dance_with_melody_held_out.txt`, whose songs are danced. The true counts are compared with
the beats of the songs.

The second table compares warpers on the same candidates: 64 clips for every sixth second. `count_time_maps`
aligns counts, which are certain or estimated. `subsequence_dtw` aligns tempo-densities. The alternative is a
subsequence DTW of the phases of beat and bar, with the same steps, either of counts, which are then landed on
beats, or of the vectors that the network outputs.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

import choreograph as cg
from choreograph.choreography.constraints import Ban
from choreograph.choreography.graph.warp_kernels import UNREACHED, smooth_batch
from choreograph.choreography.graph.warping import CountedClips, count_time_maps, subsequence_dtw
from choreograph.core.counts import NO_COUNTS, Counts, index_at
from choreograph.core.kernel_cache import njit
from choreograph.core.numerics import Floats
from choreograph.core.timebase import CLIP_FRAMES, MAX_SLOPE, MIN_SLOPE, NET_FPS, SEGMENT_FRAMES
from choreograph.evaluation.metrics.counts import counts_within, downbeat_share
from choreograph.evaluation.plan_scores import danced_counts
from choreograph.evaluation.songs import find_songs
from choreograph.library.builtin import are_likely_right, pretrained_set
from choreograph.library.songs import DEFAULT_BEATS, song_counts
from choreograph.music.count_grids import SongGrid, TakeGrids
from choreograph.music.mel import log_mel
from choreograph.music.song_features import music_density
from content.count_networks import motion_counts_config
from content.networks import RecordedTake, Trial, built_in_takes, recorded_takes, trained
from research.uncertain_counts import HELD_OUT, Reading, recounted

N_CLIPS, EVERY_S = 64, 6
STIFFNESS, EXACT = 2_000.0, 1e6  # of maps whose counts are landed exactly on the beats

Maps = tuple[NDArray[np.int64], Floats]  # candidates (K',) and time maps (K', 81)


def hidden_readings(recorded: Sequence[RecordedTake], seed: int, work: Path) -> list[Reading]:
    """The takes of every second song of each genre, as a network reads them that was trained without."""
    with_song = [r for r in recorded if r.song_name]
    hidden = set()
    for genre in {r.motion.genre for r in with_song}:
        songs = sorted({r.song_name for r in with_song if r.motion.genre == genre})
        hidden |= {r.motion.name for r in with_song if r.motion.genre == genre and r.song_name in songs[::2]}
    motions = [r.motion for r in recorded]
    train = [*(m for m in motions if m.name not in hidden), *built_in_takes()]
    trial = Trial("half0", train, [m for m in motions if m.name in hidden])
    net = trained(trial, motion_counts_config("small"), seed, work)
    weights = pretrained_set("research")["motion_counts"].arrays.weights["confidence_weights"]
    net.confidence_weights.copy_(torch.from_numpy(weights.astype(np.float32)))
    counter = net.for_inference()
    readings = [Reading.of(counter, take) for take in trial.test]
    return [replace(r, confidence=counter.counts(r.take.body_pos_m).confidence) for r in readings]


def hidden_dances(
    songs: Mapping[str, tuple[cg.Song, Counts]], true: cg.Repertoire, readings: Sequence[Reading], given
) -> None:
    """Print the share of the seconds from hidden takes, and where the true counts of both kinds lie."""
    names = [take.name for take in true.takes]
    hidden = {r.take.name for r in readings}
    counts = {name: true.counts(i) for i, name in enumerate(names) if name not in hidden}
    counts |= {r.take.name: r.counts for r in readings if are_likely_right(r.counts)}
    counts = {
        name: c if len(c.uncertainty) else replace(c, uncertainty=np.zeros(len(c)))
        for name, c in counts.items()
    }
    repertoire = recounted(given.library, given.work / "hidden.h5", counts, uncertainty=True)
    only = [
        recounted(given.library, given.work / f"{kind}.h5", of, uncertainty=False)
        for kind, of in (
            ("of_hidden", {n: true.counts(i) for i, n in enumerate(names) if n in hidden}),
            ("of_others", {n: true.counts(i) for i, n in enumerate(names) if n not in hidden}),
        )
    ]
    bans = [Ban(take=name) for name in names if not name.startswith("DANCE")]
    rows = []
    for song, _ in songs.values():
        for seed in range(given.dances):
            plan = cg.dance(song, repertoire, seed=seed, duration_s=60, bans=bans).plan
            beats = np.array(plan.music_beats_s), np.array(plan.music_beat_numbers)
            seconds = plan.takes_s()
            row = [sum(seconds.get(name, 0.0) for name in hidden) / sum(seconds.values())]
            for truth in only:
                danced = danced_counts(plan, truth)
                row.append(counts_within(danced.times_s, beats[0]))
                row.append(downbeat_share(danced.times_s, danced.numbers, *beats))
            rows.append(row)
    print("| danced from hidden takes | their counts | count 1 | the others' counts | count 1 |")
    print("| --- | --- | --- | --- | --- |")
    print(f"| {' | '.join(f'{value:.3f}' for value in np.nanmean(rows, axis=0))} |", flush=True)


@njit(nogil=True, error_model="numpy")
def phase_dtw(queries, targets):  # pragma: no cover - compiled
    """As `dtw_batch`, of four phases each: queries (K, Tq, 4), targets (K, 4, Tt)."""
    n, n_query, _ = queries.shape
    n_target = targets.shape[2]
    paths, costs = np.empty((n, n_query)), np.empty(n)
    for k in range(n):
        local = np.zeros((n_query, n_target), np.float32)
        for i in range(n_query):
            for c in range(4):
                for j in range(n_target):
                    d = queries[k, i, c] - targets[k, c, j]
                    local[i, j] += d * d
        table = np.full((n_query + 1, n_target + 2), UNREACHED, np.float32)
        table[1, 2:] = local[0]
        for i in range(1, n_query):
            for j in range(n_target):
                c = local[i, j]
                steps = min(table[i, j + 1] + c, table[i, j] + c)
                table[i + 1, j + 2] = min(steps, table[i - 1, j + 1] + (c + c))
        i, j = n_query - 1, int(np.argmin(table[n_query, 2:]))
        costs[k] = table[n_query, j + 2] / n_query
        paths[k, i] = j
        while i > 0:
            c = local[i, j]
            both, target_twice = table[i, j + 1] + c, table[i, j] + c
            if table[i - 1, j + 1] + (c + c) < min(both, target_twice):
                paths[k, i - 1] = j - 0.5
                i -= 2
                j -= 1
            elif target_twice < both:
                i -= 1
                j -= 2
            else:
                i -= 1
                j -= 1
            paths[k, i] = j
    return paths, costs


def phases(counts: Counts, times_s: Floats) -> Floats:
    """Cos and sin of the phases of beat and bar (T, 4) of certain counts."""
    index = index_at(counts.times_s, times_s)
    low = np.clip(np.floor(index).astype(int), 0, len(counts) - 1)
    bar = (counts.numbers[low] - 1 + index - low) / counts.metre
    return np.stack([f(2 * np.pi * p) for p in (index, bar) for f in (np.cos, np.sin)], axis=1)


def with_end(maps: Floats) -> Floats:
    """Maps (K, 80) with the end of the last frame, (K, 81)."""
    return np.concatenate([maps, 2 * maps[:, -1:] - maps[:, -2:-1]], axis=1)


def judged(
    maps: Floats, start_s: Floats, true: Sequence[Counts], song: Counts, second: int
) -> Iterator[Floats]:
    """Of each clip the shares of counts and counts 1 on the beat, and how its speed varies in 4 s, (4,)."""
    grid = np.linspace(0, SEGMENT_FRAMES, 12 * SEGMENT_FRAMES + 1)
    for time_map, start, counts in zip(maps, start_s, true, strict=True):
        source_s = start + np.interp(grid, np.arange(len(time_map)), time_map) / NET_FPS
        inside = (counts.times_s >= source_s[0]) & (counts.times_s <= source_s[-1])
        index = index_at(song.times_s, second + np.interp(counts.times_s[inside], source_s, grid) / NET_FPS)
        beat = np.clip(np.round(index).astype(int), 0, len(song) - 1)
        on_beat = np.abs(index - np.round(index)) <= 0.15
        first = counts.numbers[inside] == 1
        on_bar = (on_beat & (song.numbers[beat] == 1))[first]
        speed = np.diff(time_map)
        flicker = np.diff(np.log2(np.maximum(speed, 0.05))).std()
        yield np.array(
            [on_beat.mean(), on_bar.mean() if first.any() else np.nan, flicker, speed.std() / speed.mean()]
        )


def warped(
    second: int, clip: NDArray[np.int64], clips: CountedClips, true: cg.Repertoire, used: Sequence[Counts],
    song: Counts, vectors: Mapping[int, Floats],
) -> Iterator[tuple[str, Maps]]:  # fmt: skip
    """Each warper with its time maps of the clips (K,), of takes with these counts."""
    laid = count_time_maps(second, clip, clips)
    yield "counts (the program)", (laid.candidates, laid.time_maps)
    every, start_s = np.arange(len(clip)), clips.start_s[clip]
    beats = (song.times_s - second) * NET_FPS
    beats = beats[(beats > -10) & (beats < SEGMENT_FRAMES + 10)]
    rate = {"stiffness": STIFFNESS, "anchor_weight": EXACT, "window": 6.0}

    def smooth(paths: Floats, at: Sequence[Floats], *, stiffness, anchor_weight, window) -> Floats:
        stops = np.cumsum([len(frames) for frames in at])
        ranges = np.stack([stops - [len(frames) for frames in at], stops], axis=1)
        return with_end(
            smooth_batch(
                paths.astype(np.float64), np.concatenate(at), ranges, beats, window, stiffness,
                anchor_weight, MIN_SLOPE, MAX_SLOPE, CLIP_FRAMES - 2.0,
            )
        )  # fmt: skip

    at_s = np.arange(SEGMENT_FRAMES) / NET_FPS
    query = np.broadcast_to(phases(song, second + at_s), (len(clip), SEGMENT_FRAMES, 4)).astype(np.float32)
    frames_s = start_s[:, None] + np.arange(CLIP_FRAMES) / NET_FPS  # (K, 160)
    takes = clips.take[clip].tolist()
    targets = [phases(used[take], times_s).T for take, times_s in zip(takes, frames_s, strict=True)]
    paths, _ = phase_dtw(query, np.stack(targets).astype(np.float32))
    counts = [(used[take].times_s - start) * NET_FPS for take, start in zip(takes, start_s, strict=True)]
    yield "DTW of the phases of counts, landed on beats", (every, smooth(paths, counts, **rate))
    yield "… its path", (every, with_end(paths))
    none = [np.zeros(0)] * len(clip)
    if vectors:
        targets = [
            vectors[take][np.minimum(np.round(times_s * NET_FPS).astype(int), len(vectors[take]) - 1)].T
            for take, times_s in zip(takes, frames_s, strict=True)
        ]
        paths, _ = phase_dtw(query, np.stack(targets).astype(np.float32))
        rate = {"stiffness": 40_000.0, "anchor_weight": 0.0, "window": 4.0}
        yield "DTW of the network's phases", (every, smooth(paths, none, **rate))
    music = music_density(1, song.times_s[(song.times_s >= second) & (song.times_s < second + 4)] - second)[0]
    paths, _ = subsequence_dtw(music, true.clip_motion.density(clip))
    own = [true.clip_motion_beats(int(one)) for one in clip]
    rate = {"stiffness": 40_000.0, "anchor_weight": 400.0, "window": 4.0}
    yield "DTW of motion beats (the program)", (every, smooth(paths, own, **rate))


def compared(
    songs: Mapping[str, tuple[cg.Song, Counts]], true: cg.Repertoire, readings: Sequence[Reading]
) -> None:
    """Print what each warper makes of the same clips, whose counts are certain or estimated."""
    names, rng = [take.name for take in true.takes], np.random.default_rng(0)
    of_take = [true.counts(take) for take in range(len(names))]
    read = {names.index(r.take.name): r for r in readings if r.take.name in names}
    print("| counts | warped by | on a beat | count 1 | flicker, octaves | speed, std / mean |")
    print("| --- | --- | --- | --- | --- | --- |")
    for what in ("certain", "estimated"):
        used = of_take if what == "certain" else [
            read[i].counts if i in read else NO_COUNTS for i in range(len(names))
        ]  # fmt: skip
        found: dict[str, list[Floats]] = defaultdict(list)
        for song, beats in songs.values():
            grids = TakeGrids(used, [()] * len(names), [true.motion_beats_s(i) for i in range(len(names))])
            grid = SongGrid.of(beats, song.duration_s)
            joins_s = np.arange(song.duration_s + 8.0)
            clips = CountedClips.of(true.clip_take, true.clip_start_frame, grids, grid, joins_s)
            suits = [
                counts.metre == beats.metre and names[i].startswith("DANCE") and len(used[i]) > 8
                for i, counts in enumerate(of_take)
            ]
            pool = np.flatnonzero(np.array(suits)[true.clip_take])
            vectors = {
                i: r.phases[:, [0, 1 + r.curves.metres.index(beats.metre)]].reshape(-1, 4)
                for i, r in read.items() if what == "estimated"
            }  # fmt: skip
            for second in range(EVERY_S, min(50, int(song.duration_s) - 8), EVERY_S):
                clip = rng.choice(pool, N_CLIPS)
                ways = dict(warped(second, clip, clips, true, used, beats, vectors))
                same = set(next(iter(ways.values()))[0].tolist())  # clips that all warpers have a map of
                for name, (candidates, maps) in ways.items():
                    kept = [row for row, candidate in enumerate(candidates) if candidate in same]
                    chosen = clip[candidates[kept]]
                    truth = [of_take[take] for take in clips.take[chosen]]
                    found[name] += judged(maps[kept], clips.start_s[chosen], truth, beats, second)
        for name, rows in found.items():
            values = " | ".join(f"{value:.3f}" for value in np.nanmean(rows, axis=0))
            print(f"| {what} | {name} | {values} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument(
        "sources", nargs="+", type=Path, help="dance-with-melody, with its songs, and ChoreoNet"
    )
    parser.add_argument("--work", type=Path, required=True, help="folder of checkpoints")
    parser.add_argument("--library", type=Path, required=True, help="repertoire of dance-with-melody")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--dances", type=int, default=2, help="of each song")
    given = parser.parse_args()
    true = cg.Repertoire.open(given.library)
    songs = {}
    for song in find_songs(given.sources[0], only=HELD_OUT.read_text(encoding="utf-8").split()):
        loaded = song.load()
        songs[song.name] = loaded, song_counts(loaded, log_mel(loaded.samples), DEFAULT_BEATS)
    readings = hidden_readings(recorded_takes(given.sources), given.seed, given.work)
    readings = [r for r in readings if r.take.name in {take.name for take in true.takes}]
    compared(songs, true, readings)
    hidden_dances(songs, true, readings, given)


if __name__ == "__main__":
    main()
