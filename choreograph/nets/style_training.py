"""Training of the style networks on paired takes."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import torch
from torch import Tensor

from choreograph.nets.losses import contrastive_loss, style_loss
from choreograph.nets.presets import StyleConfig
from choreograph.nets.style import StyleNets
from choreograph.nets.style_data import StyleBatch, StyleData, StyleTake


def train_style(
    takes: Sequence[StyleTake],
    config: StyleConfig,
    *,
    seed: int,
    report: Callable[[int, float], None] = lambda step, loss: None,
) -> StyleNets:
    """Train both embeddings and the beat-count head together."""
    data = StyleData(takes)
    torch.manual_seed(seed)
    nets = StyleNets(config)
    nets.load_state_dict({name: torch.as_tensor(v) for name, v in data.statistics().items()}, strict=False)
    optimizer = torch.optim.AdamW(
        nets.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay
    )
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimizer, config.learning_rate, total_steps=config.steps, pct_start=0.1
    )
    rng = np.random.default_rng(seed)
    nets.train()
    for step in range(config.steps):
        loss = pair_loss(nets, data.batch(config.batch_size, rng))
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        schedule.step()
        report(step, float(loss.detach()))
    return nets.eval()


def pair_loss(nets: StyleNets, batch: StyleBatch) -> Tensor:
    """Equation 1, plus contrast between takes and between genres unless the config asks for it alone."""
    config = nets.config
    music = nets.style_of_music(batch.mel, batch.rhythm)
    motion = nets.style_of_motion(batch.body)
    loss = style_loss(
        music,
        motion,
        nets.beat_count(music),
        batch.n_beats,
        style_weight=config.style_weight,
        beat_weight=config.beat_weight,
    )
    if config.loss == "paper":
        return loss
    same_song = batch.song[:, None] == batch.song[None]  # (B, B)
    own = torch.eye(len(music), dtype=torch.bool)
    loss = loss + config.contrast_weight * contrastive_loss(
        music, motion, positive=own, negative=~same_song, temperature=config.temperature
    )
    known = (batch.genre >= 0)[:, None] & (batch.genre >= 0)[None]
    same_genre = batch.genre[:, None] == batch.genre[None]
    return loss + config.genre_weight * contrastive_loss(
        music,
        motion,
        positive=known & same_genre,
        negative=known & ~same_genre,
        temperature=config.temperature,
    )
