"""Trainings in one process or in several, which are started here as `torchrun` starts them."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from pathlib import Path

import numpy as np
import torch
from synthetic_rollouts import synthetic_takes
from synthetic_style_takes import click_take, genre_song, genre_take
from torch import nn

from choreograph.core.errors import ChoreographError
from choreograph.motion.body import body_pos_m
from choreograph.nets.configs import density_config, rollout_config, style_config, word_config
from choreograph.nets.density import MotionDensity
from choreograph.nets.density_training import train_motion_density, train_music_density
from choreograph.nets.processes import joined, n_processes, own_rows, process_index
from choreograph.nets.rollout_training import train_rollout
from choreograph.nets.style_training import train_style
from choreograph.nets.training import TrainingContext, train
from choreograph.nets.words import WordNet, WordTake, train_word_net

NETS = ("style", "motion_density", "music_density", "words", "rollout")
STEPS = 4  # of each network
TOY_STEPS = 30


def train_all(folder: Path) -> None:
    """Train every network for a moment, without dropout, with checkpoints and logs in `folder`."""
    context = TrainingContext(folder, device="cpu", report=lambda progress: print(progress.name))
    style = style_config("tiny", steps=STEPS, music_inputs="mel+counts", dropout=0.0)
    pairs = [genre_take(genre, number) for genre in "ab" for number in range(3)]
    train_style(pairs, style, songs=[genre_song("c", n) for n in range(2)], seed=0, context=context)
    density = density_config("tiny", steps=STEPS, music_steps=STEPS)
    train_motion_density([click_take()], density, seed=0, context=context)
    torch.manual_seed(0)
    untrained = MotionDensity(density)
    train_music_density([click_take()], untrained, density, seed=0, context=context)
    takes = synthetic_takes(2)
    rng = np.random.default_rng(0)
    for take in takes:
        take.embedding[:] = take.motif[:] = rng.normal(size=take.motif.shape)
    words = [WordTake(t.name, body_pos_m(t.motion), 30, t.start_s, t.end_s) for t in takes]
    train_word_net(words, word_config("tiny", steps=STEPS), seed=0, context=context)
    rollout = rollout_config("tiny", steps=STEPS)
    train_rollout(takes, WordNet(word_config("tiny")), rollout, seed=0, context=context)


def train_toy(folder: Path, *, stop: int = -1, end: tuple[int, int] = (-1, -1)) -> list[torch.Tensor]:
    """Train a small network with batch normalisation, from its checkpoint if there is one.

    Ctrl-C is pressed in the last process in the step after `stop` further ones. After as many as the second
    number of `end`, the process with the first one ends as if it was killed.
    """
    torch.manual_seed(3)
    module = nn.Sequential(
        nn.Linear(4, 8, bias=False), nn.BatchNorm1d(8), nn.Tanh(), nn.Linear(8, 4), nn.Unflatten(1, (2, 2)),
        nn.BatchNorm1d(2), nn.Flatten(), nn.Linear(4, 1),
    )  # fmt: skip
    steps: list[int] = []

    def loss(rng, device):
        steps.append(1)
        if len(steps) == stop and process_index() == n_processes() - 1:
            os.kill(os.getpid(), signal.SIGINT)
        if (process_index(), len(steps)) == end:
            os._exit(1)
        x = own_rows(torch.from_numpy(rng.normal(size=(16, 4)).astype(np.float32)))
        return ((module(x)[:, 0] - x.sum(dim=1)) ** 2).mean()

    train(
        module, loss, name="toy", n_steps=TOY_STEPS, learning_rate=1e-2, weight_decay=0.01, seed=0,
        configuration={}, context=TrainingContext(folder, resume=True, device="cpu"),
    )  # fmt: skip
    return list(module.state_dict().values())


def start(*arguments: object, n: int = 2) -> list[subprocess.Popen[str]]:
    """Start this module in `n` processes, with the variables that `torchrun` sets."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    shared = {
        **os.environ, "PYTHONPATH": os.pathsep.join([str(Path(__file__).parent), *filter(None, sys.path)]),
        "OMP_NUM_THREADS": "1", "TORCHELASTIC_RUN_ID": "test", "MASTER_ADDR": "127.0.0.1",
        "MASTER_PORT": str(port), "WORLD_SIZE": str(n), "LOCAL_WORLD_SIZE": str(n),
    }  # fmt: skip
    command = [sys.executable, "-m", "shared_trainings", *map(str, arguments)]
    return [
        subprocess.Popen(
            command, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
            env={**shared, "RANK": str(index), "LOCAL_RANK": str(index)},
        )
        for index in range(n)
    ]  # fmt: skip


def ended(processes: list[subprocess.Popen[str]], timeout_s: float = 300) -> list[tuple[int, str, str]]:
    """Exit status, stdout and stderr of each process. Those that do not end in time are killed."""
    try:
        outputs = [process.communicate(timeout=timeout_s) for process in processes]
    finally:
        for process in processes:
            process.kill()
    return [(process.returncode, *output) for process, output in zip(processes, outputs, strict=True)]


def main(kind: str, folder: str, *numbers: str) -> None:
    """`all FOLDER`, `toy FOLDER STOP` or `toy FOLDER -1 PROCESS STEP`, of `train_all` and `train_toy`."""
    with joined() as is_first:
        if not is_first:
            return
        if kind == "all":
            train_all(Path(folder))
            return
        stop, *end = map(int, numbers)
        try:
            train_toy(Path(folder), stop=stop, end=tuple(end) or (-1, -1))
        except KeyboardInterrupt:
            print("interrupted")
        except ChoreographError as error:
            print(error)
            sys.exit(2)


if __name__ == "__main__":
    main(*sys.argv[1:])
