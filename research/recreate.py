"""Dances that a repertoire does not hold, made again from their motifs.

    python research/recreate.py path/to/dance-with-melody rep.h5 [--planner greedy] [--pins 3]

The motif sequence of every held-out take, segmented on the beats of its own song, is danced to that song by
the mixer. For each take the script prints the share of words whose motif, measured on the rendered dance, is
the given one. It also prints the foot slide in cm/s and the largest distance in metres from the start of the
dance, with those of the real take, and the 95th percentile of the jerk near transitions divided by that
elsewhere. With --pins, as many motifs are pinned at random times in the graph and the mixer, and the share
that is danced is printed.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

import choreograph as cg
from choreograph.choreography.enforcement import danced_motifs
from choreograph.evaluation.metrics.physical import foot_slide_cm_s, jerk_ratio_at
from choreograph.formats.register import import_takes
from choreograph.library.vocabulary import dance_bounds_s
from choreograph.motion.body import body_pos_m
from choreograph.music.song import load_song

FPS = 60.0


def away_m(body: np.ndarray) -> float:
    """Largest distance of the pelvis from where it began, on the ground."""
    return float(np.linalg.norm((body[:, 0] - body[0, 0])[:, [0, 2]], axis=1).max())


def pins_held(song, rep, engine: str, n: int, rng: np.random.Generator) -> float:
    """Share of pinned motifs that the rendered dance shows at their times."""
    beats = cg.dance(song, rep, engine="mixer").plan.music_beats_s
    places = np.sort(rng.choice(np.arange(1, len(beats) - 2), n, replace=False))
    pins = [
        cg.MotifPin((beats[p] + beats[p + 1]) / 2, int(rng.integers(rep.vocabulary.n_motifs))) for p in places
    ]
    made = cg.dance(song, rep, engine=engine, pins=pins)
    bounds = dance_bounds_s(np.array(beats), made.plan.duration_s)
    motifs = danced_motifs(made.motion, bounds, rep)
    return float(np.mean([motifs[np.searchsorted(bounds, p.at_s) - 1] == p.motif for p in pins]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("data", type=Path)
    parser.add_argument("repertoire", type=Path)
    parser.add_argument(
        "--held-out", type=Path, default=Path(__file__).with_name("dance_with_melody_held_out.txt")
    )
    parser.add_argument("--duration", type=float, default=60.0, help="seconds of each dance")
    parser.add_argument("--planner", default="exact")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--pins", type=int, default=0)
    options = parser.parse_args()
    rep = cg.Repertoire.open(options.repertoire)
    config = cg.DanceConfig(planner=options.planner, seed=options.seed)
    rng = np.random.default_rng(options.seed)
    shares, n_words, held = [], [], []
    for name in options.held_out.read_text(encoding="utf-8").split():
        [take] = import_takes(options.data / name)
        lasts_s = min(options.duration, take.motion.duration_s)
        song = load_song(take.song_path, start_s=take.song_start_s, duration_s=lasts_s)
        plan = cg.dance(song, rep, engine="mixer", config=config).plan
        bounds = dance_bounds_s(np.array(plan.music_beats_s), plan.duration_s)
        real = take.motion.sliced(0, int(plan.duration_s * take.motion.fps))
        motifs = np.maximum(danced_motifs(real, bounds, rep), 0)
        made = cg.dance(song, rep, motifs=motifs.tolist(), config=config)
        shown = danced_motifs(made.motion, bounds, rep)
        known = shown >= 0
        shares.append(np.mean(shown[known] == motifs[known]))
        n_words.append(known.sum())
        body, theirs = (body_pos_m(m.resampled(FPS)) for m in (made.motion, real))
        transitions = [w.start_s for w in made.plan.words[1:]]
        slides = [foot_slide_cm_s(b, FPS) for b in (body, theirs)]
        print(f"{name:11s} {known.sum():4d} words, as requested {shares[-1]:.3f}", end="; ")
        print(f"slide {slides[0]:.1f} (real {slides[1]:.1f})", end="; ")
        print(f"away {away_m(body):.1f} m (real {away_m(theirs):.1f})", end="; ")
        print(f"jerk at transitions {jerk_ratio_at(body, FPS, transitions):.2f}", flush=True)
        if options.pins:
            held.append([pins_held(song, rep, engine, options.pins, rng) for engine in ("graph", "mixer")])
            print(f"            pins that hold: graph {held[-1][0]:.2f}, mixer {held[-1][1]:.2f}")
    print(f"all together as asked {np.average(shares, weights=n_words):.4f} of {sum(n_words)} words")
    if held:
        print(f"pins that hold: graph {np.mean(held, axis=0)[0]:.3f}, mixer {np.mean(held, axis=0)[1]:.3f}")


if __name__ == "__main__":
    main()
