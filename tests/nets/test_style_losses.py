"""Losses of the style networks."""

import numpy as np
import pytest
import torch

from choreograph.nets.configs import STYLE_DIM
from choreograph.nets.style_training import contrastive_loss, style_loss


def test_constant_embeddings_minimise_the_papers_loss_but_not_contrast():
    same = torch.nn.functional.normalize(torch.ones(6, STYLE_DIM), dim=1)
    apart = torch.eye(6, STYLE_DIM)
    beats = torch.full((6,), 3.0)
    weights = {"style_weight": 1.0, "beat_weight": 1.0}
    assert style_loss(same, same, beats, beats, **weights) == pytest.approx(0.0, abs=1e-5)
    assert style_loss(same, same, beats + 2, beats, **weights) == pytest.approx(2.0, abs=1e-5)
    own = torch.eye(6, dtype=torch.bool)
    masks = {"positive": own, "negative": ~own, "temperature": 0.2}
    assert contrastive_loss(same, same, **masks) == pytest.approx(np.log(6), abs=1e-4)
    assert contrastive_loss(apart, apart, **masks) < 0.01


def test_contrast_without_negatives_is_zero():
    own = torch.eye(3, dtype=torch.bool)
    value = contrastive_loss(
        torch.eye(3), torch.eye(3), positive=own, negative=torch.zeros_like(own), temperature=0.2
    )
    assert value == 0.0
