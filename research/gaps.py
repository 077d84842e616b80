"""How well gaps between two kept passages of a dance are filled, by every engine, to the built-in songs.

    python research/gaps.py [--db REPERTOIRE] [--seeds 5 6]

A graph dance is kept up to 11 s and from 4, 8 or 20 s later on. The part between is danced again. "same" is
the share of kept frames that are equal to the bit. "slide" is that of low feet in the gap, with that of the
existing dance in the same seconds and that of a whole dance of the engine. "jerk" is the highest within 0.6 s
of a join, divided by the highest of a whole dance of the engine. "read" is the share of the counts that a
network estimates in the gap that lie on beats.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from pathlib import Path

import numpy as np

import choreograph as cg
from choreograph.evaluation.dance_scores import read_counts
from choreograph.evaluation.metrics.counts import counts_within
from choreograph.evaluation.metrics.physical import foot_slide_cm_s, joint_jerk_m_s3
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion import Motion

FROM_S, GAPS_S = 11.0, (4.0, 8.0, 20.0)
ENGINES = ("graph", "mixer", "rollout")
NEAR_JOIN_S = 0.6


def measured(filled: cg.Dance, existing: Motion, own: Motion, gap_s: float) -> dict[str, float]:
    """What became of one gap."""
    motion, fps = filled.motion, existing.fps
    gap = slice(round(FROM_S * fps), round((FROM_S + gap_s) * fps))
    is_kept = np.ones(motion.n_frames, bool)
    is_kept[gap] = False
    same = (motion.root_pos_m == existing.root_pos_m).all(axis=1)
    same &= (motion.local_quat == existing.local_quat).all(axis=(1, 2))
    body, before, danced = (body_pos_m(m) for m in (motion, existing, own))
    jerk = joint_jerk_m_s3(body, fps)[1]
    at_s = np.arange(len(jerk)) * motion.duration_s / len(jerk)
    near = np.min(np.abs(at_s[:, None] - [FROM_S, FROM_S + gap_s]), axis=1) < NEAR_JOIN_S
    read_s = read_counts(motion).times_s
    inside = (read_s > FROM_S) & (read_s < FROM_S + gap_s)
    return {
        "same": same[is_kept].mean(),
        "slide cm/s": foot_slide_cm_s(body[gap], fps),
        "of the existing": foot_slide_cm_s(before[gap], fps),
        "of the engine": foot_slide_cm_s(danced[gap], fps),
        "jerk": jerk[near].max() / joint_jerk_m_s3(danced, fps)[1].max(),
        "read": counts_within(read_s[inside], np.array(filled.plan.music_beats_s)),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--db", type=Path, help="default: the built-in repertoire")
    parser.add_argument("--seeds", type=int, nargs="+", default=[5, 6])
    given = parser.parse_args()
    repertoire = cg.Repertoire.open(given.db or cg.starter_repertoire().path)
    rows = defaultdict(list)
    for path in cg.example_songs().values():
        song = cg.load_song(path)
        existing = cg.dance(song, repertoire, seed=0)
        for seed in given.seeds:
            for engine in ENGINES:
                own = cg.dance(song, repertoire, engine=engine, seed=seed)
                for gap_s in GAPS_S:
                    kept = [cg.Keep(0.0, FROM_S), cg.Keep(FROM_S + gap_s, song.duration_s)]
                    filled = cg.dance(
                        song, repertoire, engine=engine, existing=existing, keep=kept, seed=seed
                    )
                    row = measured(filled, existing.motion, own.motion, gap_s)
                    rows[f"{engine}, {gap_s:g} s"].append(row)
                    print(path.stem, seed, engine, gap_s, {k: round(float(v), 2) for k, v in row.items()})
    for name, of_name in rows.items():
        means = {key: np.mean([row[key] for row in of_name]) for key in of_name[0]}
        print(f"{name} ({len(of_name)}):", ", ".join(f"{key} {value:.2f}" for key, value in means.items()))


if __name__ == "__main__":
    main()
