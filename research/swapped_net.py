"""Rollout networks other than the repertoire's own: those that `train_rollout_ablations.py` trained."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch

import choreograph as cg
from choreograph.nets.rollout import RolloutNet


class WithNet(cg.Repertoire):
    """A repertoire with another rollout network."""

    swapped: RolloutNet | None = None

    def rollout_net(self) -> RolloutNet:
        return self.swapped or super().rollout_net()


def ablated_nets(folder: Path) -> dict[str, RolloutNet]:
    """The networks of a folder by what they lack."""
    return {path.stem: ablated_net(path) for path in sorted(folder.glob("*.pt"))}


def ablated_net(path: Path) -> RolloutNet:
    stored = torch.load(path, weights_only=True)
    weights = {key: value.numpy() for key, value in stored.pop("weights").items()}
    return RolloutNet.from_arrays(weights, stored)


def bounds_of(dance: cg.Dance) -> np.ndarray:
    return np.array([*(word.start_s for word in dance.plan.words), dance.plan.words[-1].end_s])
