"""Does a learned tempo-density warp dances better than the analytic one? On takes and songs held out.

    choreograph build-db dance-with-melody/ choreonet/ -o l0.h5 --density learned --seed 0 \\
        --leave-out @research/dance_with_melody_held_out.txt
    python research/density_experiment.py dance-with-melody/ l0.h5 l1.h5 l2.h5

A repertoire for each seed of its networks. Time maps are those that are played: the path of the DTW smoothed
at each stiffness (0: the raw path), without motion beats drawn onto music beats, which would help every curve
alike.

Recovery: clips of 8 s of the held-out takes, every motion beat moved by up to 0.5 s, slopes in [0.5, 2]. How
far is each frame of the middle 4 s, found again by the curve, from where it was? Beside it: no warp at all, a
constant curve, and the curve of another clip.

Counts: clips of takes whose counts are known, but not used, warped to held-out songs. Of those with the best
fit, how many counts lie within 0.15 beat of a beat? One network is exchanged at a time. Learned curves have
about zero mean and unit variance. Analytic ones get them by one shift and one factor, so that bumps stay
equally high. A fit is the mean squared difference of the curves along the warp, over its chance level: that
of the best clips for the curve of another song. So learned and analytic curves are weighed alike. Beats are
those of two trackers: the analytic curve of music is made from the first's. Beside it: each pair of curves
with the music of another song, whose counts are at chance, and a constant.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np

import choreograph as cg
from choreograph.choreography.graph.warping import smooth_time_maps, subsequence_dtw
from choreograph.core.numerics import interpolate_frames
from choreograph.core.timebase import CLIP_FRAMES, NET_FPS, SEGMENT_FRAMES, SEGMENT_S, STORE_FPS
from choreograph.evaluation.songs import EvaluatedSong, beats_of, check_unseen, find_songs, second_tracker
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion_beats import motion_beat_times_s
from choreograph.music.beats import DEFAULT_TRACKER
from choreograph.music.mel import log_mel
from choreograph.music.song_features import motion_density, music_density
from choreograph.nets.density import MotionDensity, MusicDensity
from choreograph.nets.density_training import random_time_map
from choreograph.nets.style import centred
from research.warp_scores import recovery_errors_ms, summary_ms

STIFFNESS = (0.0, 40.0, 400.0, 4_000.0, 40_000.0)  # frames⁴. The last is what dances use
HELD_OUT = Path(__file__).with_name("dance_with_melody_held_out.txt")
KINDS = ("analytic", "learned")
OWN, OTHER = "own song", "another song"
MIDDLE = slice((CLIP_FRAMES - SEGMENT_FRAMES) // 2, (CLIP_FRAMES + SEGMENT_FRAMES) // 2)
WITHIN = 0.15  # beats
EVERY_S = 4  # of a song, a segment is danced
Errors = dict[tuple[str, ...], list[np.ndarray]]


def time_maps(query: np.ndarray, targets: np.ndarray, stiffness: Sequence[float]) -> Iterator[np.ndarray]:
    """Time maps (K, 80) of `query` (80,) or (K, 80) in `targets` (K, 160), at each stiffness."""
    paths, _ = subsequence_dtw(query, targets)
    nothing = np.zeros(0), np.zeros((len(targets), 2), np.int64), np.zeros(0)
    for value in stiffness:
        if value == 0.0:
            yield paths.astype(np.float64)
            continue
        yield smooth_time_maps(
            paths, clip_frames=CLIP_FRAMES, motion_beats=nothing[0], beat_ranges=nothing[1],
            music_beats=nothing[2], stiffness=value,
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Networks:
    """Both networks of a repertoire."""

    motion: MotionDensity
    music: MusicDensity

    @classmethod
    def of(cls, repertoire: cg.Repertoire) -> Networks:
        motion, music = (repertoire.net(f"{name}_density") for name in ("motion", "music"))
        return cls(
            MotionDensity.from_arrays(motion.weights, motion.config),
            MusicDensity.from_arrays(music.weights, music.config),
        )


def recovery(songs: Sequence[EvaluatedSong], nets: Networks, stiffness: Sequence[float]) -> Errors:
    """Errors in ms by (curve, stiffness). The warps are the same for all networks."""
    rng, errors = np.random.default_rng(123), defaultdict(list)
    for song in songs:
        body = body_pos_m(song.take.motion.resampled(NET_FPS)).astype(np.float32)
        beats_s = motion_beat_times_s(body_pos_m(song.take.motion.resampled(STORE_FPS)), STORE_FPS)
        starts = range(0, len(body) - CLIP_FRAMES, SEGMENT_FRAMES)
        true, curves = [], defaultdict(list)
        for start in starts:
            clip, beats = body[start : start + CLIP_FRAMES], beats_s - start / NET_FPS
            frames = random_time_map(CLIP_FRAMES, NET_FPS, rng, beat_times_s=beats, share=1.0)
            inside = beats[(beats > 0) & (beats * NET_FPS < CLIP_FRAMES - 1)]
            moved = np.interp(inside * NET_FPS, frames, np.arange(CLIP_FRAMES)) / NET_FPS
            curves["analytic"].append([motion_density(CLIP_FRAMES, b) for b in (moved, beats)])
            warped = interpolate_frames(clip, frames)
            curves["learned"].append([nets.motion.take_density(centred(c[None])[0]) for c in (warped, clip)])
            true.append(frames[MIDDLE])
        true = np.array(true)  # (N, 80)
        errors["no warp", ""].append(
            recovery_errors_ms(np.broadcast_to(np.arange(CLIP_FRAMES)[MIDDLE], true.shape), true, NET_FPS)
        )
        for kind in KINDS:
            query, target = np.swapaxes(np.array(curves[kind], np.float32), 0, 1)  # (N, 160) each
            queries = {
                kind: query[:, MIDDLE],
                f"{kind}, of another clip": np.roll(query, 1, axis=0)[:, MIDDLE],
                f"{kind}, constant": np.full_like(query, query.mean())[:, MIDDLE],
            }
            for name, wanted in queries.items():
                for value, maps in zip(stiffness, time_maps(wanted, target, stiffness), strict=True):
                    errors[name, f"{value:g}"].append(recovery_errors_ms(maps, true, NET_FPS))
    return errors


@dataclass(frozen=True, eq=False)
class Clips:
    """Clips of counted takes: their curves (N, 160) by kind, and their counts in clip frames."""

    curves: dict[str, np.ndarray]
    counts: list[np.ndarray]
    shift: float  # of analytic curves,
    factor: float  # and by what they are divided

    @classmethod
    def of(cls, repertoire: cg.Repertoire, nets: Networks) -> Clips:
        curves, counts = defaultdict(list), []
        for take in range(len(repertoire.takes)):
            if not len(repertoire.counts(take)):
                continue
            learned = nets.motion.take_density(repertoire.body_pos_m(take))
            for start in repertoire.clip_start_frame[repertoire.clip_take == take]:
                beats_s = repertoire.motion_beats_s(take) - start / NET_FPS
                curves["analytic"].append(motion_density(CLIP_FRAMES, beats_s))
                curves["learned"].append(learned[start : start + CLIP_FRAMES])
                counts.append(repertoire.counts(take).times_s * NET_FPS - start)
        if not counts:
            raise cg.RepertoireError(f"{repertoire.path}: expected clips of takes with counts, got none")
        analytic, learned = (np.array(curves[kind], np.float32) for kind in KINDS)
        shift, factor = float(analytic.mean()), float(analytic.std())
        curves_of = {"analytic": (analytic - shift) / factor, "learned": learned}
        return cls(curves_of, counts, shift, factor)


@dataclass(frozen=True, eq=False)
class Music:
    """A song's wanted curves (S, 80) by kind, and its beats by tracker."""

    curves: dict[str, np.ndarray]
    beats_s: dict[str, np.ndarray]


def analysed(song: EvaluatedSong, nets: Networks, clips: Clips) -> Music:
    loaded = song.load()
    mel, n_seconds = log_mel(loaded.samples), int(loaded.duration_s)
    trackers = (DEFAULT_TRACKER, second_tracker(DEFAULT_TRACKER))
    beats_s = {name: beats_of(loaded, name).times_s for name in trackers}
    curves = {
        "analytic": (music_density(n_seconds, beats_s[DEFAULT_TRACKER]) - clips.shift) / clips.factor,
        "learned": nets.music.song_density(mel, n_seconds),
        "constant": np.zeros((n_seconds, SEGMENT_FRAMES), np.float32),
    }
    return Music(curves, beats_s)


def fits(query: np.ndarray, targets: np.ndarray, maps: np.ndarray) -> np.ndarray:
    """Mean squared difference (K,) of `query` (80,) and `targets` (K, 160) along time maps (K, 80)."""
    frames = np.arange(CLIP_FRAMES)
    warped = np.stack([np.interp(row, frames, target) for row, target in zip(maps, targets, strict=True)])
    return ((warped - query) ** 2).mean(axis=1)


def beats_off(maps: np.ndarray, counts: Sequence[np.ndarray], beats_s: np.ndarray) -> np.ndarray:
    """How far the counts played by time maps (K, 80) are from a beat, in beats: all of them, (U,)."""
    off = []
    for row, frames in zip(maps, counts, strict=True):
        inside = frames[(frames >= row[0]) & (frames <= row[-1])]
        at_s = np.interp(inside, row, np.arange(SEGMENT_FRAMES)) / NET_FPS
        at_s = at_s[(at_s >= beats_s[0]) & (at_s <= beats_s[-1])]
        index = np.interp(at_s, beats_s, np.arange(len(beats_s)))
        off.append(np.abs(index - np.round(index)))
    return np.concatenate(off)


def counts_found(
    songs: Sequence[EvaluatedSong], repertoire: cg.Repertoire, nets: Networks, options: argparse.Namespace
) -> tuple[Errors, dict[tuple[str, ...], float]]:
    """Beats that counts are off, by (curves, song, stiffness, tracker), and the chosen clips' fit."""
    clips = Clips.of(repertoire, nets)
    music = [analysed(song, nets, clips) for song in songs]
    off: Errors = defaultdict(list)
    fit_of: Errors = defaultdict(list)
    for of_motion, of_music in product(KINDS, (*KINDS, "constant")):
        rng = np.random.default_rng(7)  # the same clips for every pair of curves
        for number, song in enumerate(music):
            own, other = (m.curves[of_music] for m in (song, music[(number + 1) % len(music)]))
            for second in range(0, len(own) - SEGMENT_S, EVERY_S):
                drawn = rng.permutation(len(clips.counts))[: options.clips]
                targets = clips.curves[of_motion][drawn]
                queries = {OWN: own[second], OTHER: other[second % len(other)]}
                for name, query in queries.items():
                    played = time_maps(query, targets, options.stiffness)
                    for value, maps in zip(options.stiffness, played, strict=True):
                        fit = fits(query, targets, maps)
                        best = np.argsort(fit, kind="stable")[: options.best]
                        key = f"{of_motion} motion, {of_music} music", name, f"{value:g}"
                        fit_of[key].append(fit[best])
                        for tracker, beats_s in song.beats_s.items():
                            counts = [clips.counts[drawn[i]] for i in best]
                            off[*key, tracker].append(beats_off(maps[best], counts, beats_s - second))
    means = {key: float(np.concatenate(values).mean()) for key, values in fit_of.items()}
    return off, {(p, n, v): mean / max(means[p, OTHER, v], 1e-9) for (p, n, v), mean in means.items()}


def rows_of(
    path: Path, songs: Sequence[EvaluatedSong], options: argparse.Namespace
) -> dict[str, list[float]]:
    """Every line of both tables for one repertoire: numbers by its label."""
    repertoire = cg.Repertoire.open(path)
    check_unseen(songs, repertoire)
    nets = Networks.of(repertoire)
    rows = {}
    for (name, value), errors in recovery(songs, nets, options.stiffness).items():
        rows[f"recovery, ms | {name} | {value}"] = [*summary_ms(np.concatenate(errors)).values()]
    off, normalised = counts_found(songs, repertoire, nets, options)
    trackers = sorted({key[-1] for key in off}, key=lambda tracker: tracker != DEFAULT_TRACKER)
    for key, fit in normalised.items():
        if key[1] == OTHER and "constant music" in key[0]:
            continue  # the same for every song
        shares = [float((np.concatenate(off[*key, tracker]) <= WITHIN).mean()) for tracker in trackers]
        rows[" | ".join(key)] = [fit, *shares]
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("data", type=Path)
    parser.add_argument("repertoires", type=Path, nargs="+", help="with learned densities, one a seed")
    parser.add_argument("--only", type=Path, default=HELD_OUT, help="names of songs, a line each")
    parser.add_argument("--clips", type=int, default=64, help="warped to each segment of a song")
    parser.add_argument("--best", type=int, default=8, help="of them counted")
    parser.add_argument("--stiffness", type=float, nargs="+", default=STIFFNESS)
    options = parser.parse_args()
    songs = find_songs(options.data, only=options.only.read_text(encoding="utf-8").split())
    found = [rows_of(path, songs, options) for path in options.repertoires]
    print(f"{len(songs)} songs, {len(found)} repertoires: mean ± spread over repertoires")
    print("recovery: median, mean, 90th percentile. Others: fit over chance, and counts within 0.15 beat")
    print(f"of {DEFAULT_TRACKER}'s beats, and of {second_tracker(DEFAULT_TRACKER)}'s.")
    for label in found[0]:
        values = np.array([rows[label] for rows in found])
        cells = (f"{m:.2f} ± {d:.2f}" for m, d in zip(values.mean(axis=0), values.std(axis=0), strict=True))
        print(f"| {label} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
