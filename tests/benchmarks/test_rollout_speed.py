"""How fast the rollout network dances at the paper's size; the goal is 5 times real time on two cores."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from synthetic_rollouts import synthetic_motion

from choreograph.nets.rollout.config import rollout_config
from choreograph.nets.rollout.model import RolloutNet
from choreograph.rollout.generation import MotifScore, roll_out

pytestmark = pytest.mark.slow

SONG_S = 20.0


@pytest.mark.parametrize("preset", ["small", "paper"])
def test_a_rollout(benchmark, preset):
    torch.manual_seed(0)
    net = RolloutNet(rollout_config(preset)).eval()
    bounds = np.arange(0.0, SONG_S + 0.1, 0.5)
    rng = np.random.default_rng(0)
    n_words = len(bounds) - 1
    score = MotifScore(
        bounds[:-1], bounds[1:], rng.normal(0, 0.1, (n_words, 184)), rng.random((round(SONG_S * 30), 4)),
        rng.random((n_words, 87)),
    )  # fmt: skip
    seed = synthetic_motion(np.array([0, 1]))
    roll_out(net, score, seed, fps=60)
    benchmark.pedantic(roll_out, args=(net, score, seed), kwargs={"fps": 60}, rounds=3)
    benchmark.extra_info["times_real_time"] = SONG_S / benchmark.stats["mean"]
