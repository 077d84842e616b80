"""A rollout network that has learned its motifs."""

import numpy as np
import pytest
import torch
from synthetic_rollouts import BEAT_S, synthetic_motion, synthetic_takes, synthetic_words

from choreograph.library.vocabulary import segment_words
from choreograph.motion.body import body_pos_m
from choreograph.nets.configs import rollout_config
from choreograph.nets.rollout_poses import ROLLOUT_FPS, PosePredictor
from choreograph.nets.rollout_training import train_rollout
from choreograph.nets.words import WordNet


@pytest.fixture(scope="package")
def trained(made_once):
    """A network trained on three kinds of beats, its word network, and the embedding of each kind."""
    path = made_once("three kinds of beats", lambda folder: torch.save(_trained(), folder / "trained.pt"))
    return torch.load(path / "trained.pt", weights_only=False)


def _trained() -> tuple[PosePredictor, WordNet, np.ndarray]:
    takes = synthetic_takes()
    words = synthetic_words(takes)
    config = rollout_config(
        "tiny",
        steps=200,
        width=64,
        learning_rate=4e-3,
        own_embedding_share=1.0,
        self_fed_frames=(15, 30),
        style_dropout=1.0,
    )
    torch.set_num_threads(1)
    net = train_rollout(takes, words, config, seed=0)
    bounds = np.arange(2) * BEAT_S
    kinds = [
        words.embed(
            segment_words(body_pos_m(synthetic_motion(np.array([k, k]))), ROLLOUT_FPS, bounds).body_pos_m
        )
        for k in range(3)
    ]
    return PosePredictor.from_arrays(*net.to_arrays()), words, np.concatenate(kinds)
