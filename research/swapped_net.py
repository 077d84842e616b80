"""Rollout networks other than the repertoire's own: those that `train_rollout_ablations.py` trained."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import torch

import choreograph as cg
from choreograph.nets.rollout_poses import PosePredictor

NetsByGenre = Mapping[str, PosePredictor]  # of one genre, or "" of all genres


class WithNet(cg.Repertoire):
    """A repertoire with other rollout networks."""

    swapped: NetsByGenre | None = None

    @property
    def rollout_genres(self) -> tuple[str, ...]:
        if self.swapped is None:
            return super().rollout_genres
        return tuple(genre for genre in self.swapped if genre)

    def rollout_net(self, genre: str = "") -> PosePredictor:
        if self.swapped is None:
            return super().rollout_net(genre)
        return self.swapped.get("") or self.swapped[genre]


def ablated_nets(folder: Path) -> dict[str, NetsByGenre]:
    """The networks of a folder by what they lack, and by genre where each genre has its own."""
    nets: dict[str, dict[str, PosePredictor]] = defaultdict(dict)
    for path in sorted(folder.glob("*.pt")):
        name, _, genre = path.stem.partition("@")
        nets[name][genre] = ablated_net(path)
    return dict(nets)


def ablated_net(path: Path) -> PosePredictor:
    stored = torch.load(path, weights_only=True)
    weights = {key: value.numpy() for key, value in stored.pop("weights").items()}
    return PosePredictor.from_arrays(weights, stored)


def bounds_of(dance: cg.Dance) -> np.ndarray:
    return np.array([*(word.start_s for word in dance.plan.words), dance.plan.words[-1].end_s])
