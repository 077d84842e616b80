"""Train what the rollout network is compared with: it without the perceptual loss, audio, or motifs.

    python examples/papers/train_rollout_ablations.py path/to/dance-with-melody REPERTOIRE… -o FOLDER

Each REPERTOIRE was built with `--rollout`. Its ablations are trained on the same takes, with its preset and
seed, and written to FOLDER/NAME OF THE REPERTOIRE for `rollout.py --ablations FOLDER`. Each takes as long as
the network itself. After a stop, the same command continues.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import torch

import choreograph as cg
from choreograph.building.segmentation import segment_takes
from choreograph.building.train_rollout import rollout_takes
from choreograph.importers.dance_with_melody import read
from choreograph.nets.rollout.config import rollout_config
from choreograph.nets.rollout.train import train_rollout
from choreograph.nets.training import TrainingContext, TrainingProgress
from choreograph.repertoire.contents import MeasuredTake
from choreograph.takes import Take

ABLATIONS = {
    "no-perceptual-loss": {"perceptual_weight": 0.0},
    "no-audio": {"use_audio": False},
    "acLSTM-no-motifs": {"motifs": False, "perceptual_weight": 0.0},
}


def train(takes: Mapping[str, Take], repertoire: cg.Repertoire, folder: Path, names: Sequence[str]) -> None:
    """Train those of `names` that `folder` lacks."""
    lacking = [name for name in names if not (folder / f"{name}.pt").exists()]
    if not lacking:
        return
    folder.mkdir(parents=True, exist_ok=True)
    own = [
        MeasuredTake(takes[t.name], np.zeros((0, 21, 3), np.float32), np.zeros(0)) for t in repertoire.takes
    ]
    words = repertoire.word_net()
    learned = rollout_takes(own, segment_takes(own)[0], repertoire.vocabulary, words)
    for name in lacking:
        config = rollout_config(str(repertoire.provenance["preset"]), **ABLATIONS[name])
        context = TrainingContext(folder / name, resume=True, report=show)
        net = train_rollout(learned, words, config, seed=int(repertoire.provenance["seed"]), context=context)
        torch.save(net.to_arrays()[1] | {"weights": net.state_dict()}, folder / f"{name}.pt")


def show(progress: TrainingProgress) -> None:
    print(progress.step, f"{progress.loss:.3f}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("data", type=Path)
    parser.add_argument("repertoires", type=Path, nargs="+")
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--networks", nargs="+", choices=list(ABLATIONS), default=list(ABLATIONS))
    given = parser.parse_args()
    torch.set_num_threads(1)
    takes = {take.name: take for take in read(given.data)}
    for path in given.repertoires:
        train(takes, cg.Repertoire.open(path), given.output / path.stem, given.networks)


if __name__ == "__main__":
    main()
