"""Training of the style networks on paired takes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from choreograph.nets.style.config import StyleConfig
from choreograph.nets.style.data import StyleBatch, StyleData, StyleSong, StyleTake
from choreograph.nets.style.losses import contrastive_loss, style_loss
from choreograph.nets.style.model import StyleNets
from choreograph.nets.training import TrainingContext, load_pretrained, steps_of_epochs, train


def train_style(
    takes: Sequence[StyleTake],
    config: StyleConfig,
    *,
    seed: int,
    songs: Sequence[StyleSong] = (),
    context: TrainingContext | None = None,
    pretrained: Mapping[str, NDArray] | None = None,
) -> StyleNets:
    """Train both embeddings and the beat-count head together (ChoreoGraph, section 3.1).

    All songs are trained on, to the last step. Early stopping on a tenth of each genre's songs did not help
    on five held-out songs: by validation loss it kept nearly the last step and retrieved no more of the genre
    (0.565 against 0.558), by validation retrieval it retrieved less (0.497).

    Parameters
    ----------
    takes : pairs of music and motion of at least two songs
    songs : more music, of known genres, that nobody dances to
    pretrained : weights of the same configuration to start from (`StyleNets.to_arrays`)
    context : checkpoints, log, device and progress (`nets.training`)

    Raises
    ------
    ParameterError   fewer than two songs have 4 s of pairs, or `pretrained` has another shape
    """
    data = StyleData(takes, songs, balanced_genres=config.balanced_genres)
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        nets = StyleNets(config)
    if pretrained is not None:
        load_pretrained(nets, "style", pretrained)
    nets.load_state_dict({name: torch.as_tensor(v) for name, v in data.statistics().items()}, strict=False)

    def loss(rng: np.random.Generator, device: torch.device) -> Tensor:
        batch = data.batch(
            config.batch_size, rng, mirrored_share=config.mirrored_share, augmented=config.augmented
        )
        return pair_loss(nets, batch.to(device))

    n_steps = config.steps
    if config.epochs:
        n_steps = steps_of_epochs(config.epochs, data.n_segments, config.batch_size)

    train(
        nets,
        loss,
        name="style",
        n_steps=n_steps,
        learning_rate=config.learning_rate,
        weight_decay=config.weight_decay,
        schedule=config.schedule,
        seed=seed,
        configuration={**asdict(config), "takes": sorted(heard.name for heard in (*takes, *songs))},
        context=context,
    )
    return nets


def pair_loss(nets: StyleNets, batch: StyleBatch) -> Tensor:
    """Equation 1 and, unless `config.loss` is "paper", contrast between songs and between genres."""
    config = nets.config
    all_music = nets.style_of_music(batch.mel, batch.rhythm)  # (B + S, 32)
    motion = nets.style_of_motion(batch.body)
    music = all_music[: len(motion)]
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
    own = torch.eye(len(music), dtype=torch.bool, device=music.device)
    for anchors, others in ((music, motion), (motion, music)):
        loss = loss + 0.5 * config.contrast_weight * contrastive_loss(
            anchors, others, positive=own, negative=~same_song, temperature=config.temperature
        )
    # Genres are contrasted within music and within motion too: each network then learns them alone, and the
    # two need only agree. With contrast across alone, neither has anything to agree with at the start.
    both = torch.cat([all_music, motion])  # (2B + S, 32)
    genre = torch.cat([batch.genre, batch.genre[: len(motion)]])
    known = (genre >= 0)[:, None] & (genre >= 0)[None]
    same_genre = genre[:, None] == genre[None]
    same = torch.eye(len(both), dtype=torch.bool, device=both.device)
    return loss + config.genre_weight * contrastive_loss(
        both,
        both,
        positive=known & same_genre & ~same,
        negative=known & ~same_genre,
        temperature=config.temperature,
    )
