"""Speed of generation with the rollout network; the goal is 5 times real time on two cores."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from synthetic_rollouts import synthetic_motion

from choreograph.choreography.rollout.generation import MotifSequence, generate_motion
from choreograph.nets.configs import rollout_config
from choreograph.nets.rollout import RolloutNet
from choreograph.nets.rollout_poses import PosePredictor

pytestmark = pytest.mark.slow

SONG_S = 20.0


@pytest.mark.parametrize("preset", ["small", "paper"])
def test_generation(benchmark, preset):
    torch.manual_seed(0)
    net = PosePredictor.from_arrays(*RolloutNet(rollout_config(preset)).to_arrays())
    bounds = np.arange(0.0, SONG_S + 0.1, 0.5)
    rng = np.random.default_rng(0)
    n_words = len(bounds) - 1
    sequence = MotifSequence(
        bounds[:-1], bounds[1:], rng.normal(0, 0.1, (n_words, 184)), *rng.random((2, round(SONG_S * 30), 4)),
        rng.random((n_words, 87)),
    )  # fmt: skip
    seed = synthetic_motion(np.array([0, 1]))
    generate_motion(net, sequence, seed, fps=60)
    benchmark.pedantic(generate_motion, args=(net, sequence, seed), kwargs={"fps": 60}, rounds=3)
    benchmark.extra_info["times_real_time"] = SONG_S / benchmark.stats["mean"]
