"""Tempo of takes from their motion, and of their songs, against the true counts.

    OMP_NUM_THREADS=1 python -m research.tempi dance-with-melody/ choreonet/ --work FOLDER [--seed 0]

Each take is counted by a network that was trained without its song, in five trainings.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np

from choreograph.core.counts import Counts
from choreograph.library.building.options import BuildOptions
from choreograph.library.building.takes import measured_takes
from choreograph.music.bars import tempo_bpm
from choreograph.pipeline.counting import count_file
from content.count_networks import motion_counts_config
from content.networks import built_in_takes, recorded_takes, trained, trials_by_song

WITHIN = 0.02  # of the true tempo


def ratio(found: Counts, true: Counts) -> float:
    """The tempo that was found over the true one, 0 if none was found."""
    return tempo_bpm(found) / tempo_bpm(true) if len(found) > 1 else 0.0


def show(what: str, ratios: list[float], cpu_s: list[float]) -> None:
    right = np.abs(np.array(ratios) - 1.0) <= WITHIN
    print(f"| {what} | {len(ratios)} | {right.mean():.3f} | {np.median(cpu_s):.2f} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("sources", nargs="+", type=Path)
    parser.add_argument("--work", type=Path, required=True)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    print("| | takes | tempo within 2 % | CPU, s |\n| --- | --- | --- | --- |")
    ratios, cpu_s = [], []
    for trial in trials_by_song(recorded_takes(given.sources), built_in_takes()):
        net = trained(trial, motion_counts_config("small"), given.seed, given.work).for_inference()
        for take in trial.test:
            start_s = time.process_time()
            ratios.append(ratio(net.counts(take.body_pos_m), take.counts))
            cpu_s.append(time.process_time() - start_s)
    show("motion, song left out", ratios, cpu_s)
    ratios, cpu_s = [], []
    for measured in measured_takes(given.sources, BuildOptions(), None)[0]:
        take = measured.take
        if take.song_path is not None and len(take.counts):
            start_s = time.process_time()
            ratios.append(ratio(count_file(take.song_path).counts, take.counts))
            cpu_s.append(time.process_time() - start_s)
    show("song", ratios, cpu_s)


if __name__ == "__main__":
    main()
