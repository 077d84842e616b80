"""Fits `LEAST_AGREEMENT` of `choreograph/nets/music_counts.py`, below which the tempo path is used.

    python research/fit_music_agreement.py songs/ without0.npz without1.npz without2.npz

Songs are training songs in `songs/`, each augmented anew. They are tracked by the network that was trained
without their genre. The script prints the mean F-score of beats by threshold. Below the threshold the tempo
path is used, and above it the bar pointer.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from runpy import run_path

import numpy as np

from choreograph.evaluation.metrics.beat import f_score
from choreograph.nets.music_counts import activated_beats, decoded_beats, read_music_counts
from content.music_counting import augmented

THRESHOLDS = np.arange(0.0, 1.01, 0.05)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("weights", type=Path, nargs="+")
    parser.add_argument("--songs", type=int, default=200)
    given = parser.parse_args()
    beside = run_path(str(Path(__file__).with_name("train_music_counts.py")))
    nets = [read_music_counts(path) for path in given.weights]
    rng = np.random.default_rng(0)
    rows = []
    for song in beside["synthetic_songs"](given.folder, given.songs):
        for net, about in nets:
            if song.genres <= set(about["without_genres"]):
                mel = augmented(song.mel.log_mel.astype(np.float32), rng)
                curves = net.curves(mel)
                beats_s, agreement = decoded_beats(curves)
                truth = song.mel.counts.times_s
                rows.append(
                    (agreement, f_score(beats_s, truth), f_score(activated_beats(curves, mel), truth))
                )
    agreement, pointed, activated = np.array(rows).T
    for threshold in THRESHOLDS:
        below = agreement < threshold
        chosen = np.where(below, activated, pointed)
        print(f"{threshold:.2f}: F {chosen.mean():.3f}, {below.mean():.2f} of {len(rows)} by the tempo path")


if __name__ == "__main__":
    main()
