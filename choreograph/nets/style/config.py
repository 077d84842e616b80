"""Sizes and training lengths of the style networks: `paper`, `small` (two CPU cores), `tiny` (tests).

The paper gives layer counts, input and output shapes; the widths it does not give are ours.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from choreograph.errors import ParameterError
from choreograph.nets.presets import check_training, config_from_preset

STYLE_DIM = 32  # of style vectors
MUSIC_INPUTS = ("mel", "counts", "mel+counts")
STYLE_LOSSES = ("paper", "contrastive")
N_SONGS = 32  # that the steps of the presets are meant for


@dataclass(frozen=True)
class StyleConfig:
    """Everything that shapes and trains the style networks; stored beside their weights."""

    conv_channels: tuple[int, int, int, int] = (8, 16, 16, 16)  # music: four convolutional blocks over mel
    graph_channels: tuple[int, int, int, int] = (8, 16, 16, 32)  # motion: four graph blocks
    gru_width: int = 32  # two layers each
    rhythm_width: int = 32  # hidden and output width of the rhythm branch
    head_width: int = 32  # beat-count head, four linear layers
    dropout: float = 0.3
    # "mel" is the paper's; "counts": rhythm as the song's counts divide it, beside which mel adds nothing.
    music_inputs: str = "counts"
    loss: str = "contrastive"  # "paper": equation 1 alone, which constant embeddings minimise
    style_weight: float = 0.2  # equation 1's lambda of the style distance
    beat_weight: float = 0.05  # equation 1's lambda of the beat count, per beat
    contrast_weight: float = 0.3  # contrast of a pair against pairs of other songs
    genre_weight: float = 1.0  # contrast of a genre against the others, where takes name theirs
    temperature: float = 0.2  # of squared distances between unit vectors
    normalised: bool = True  # features before the last layer, and vectors to unit length; the paper's are not
    augmented: bool = True  # music and motion of the samples; the paper says nothing of it
    mirrored_share: float = 0.5  # of the augmented motion; 0 where left and right must stay distinct
    balanced_genres: bool = True  # each genre equally often; False: every second of the takes equally often
    batch_size: int = 32
    steps: int = 220  # for up to `N_SONGS` songs; see `style_config`
    epochs: int = 0  # times that the takes are gone through, instead of `steps`; 0: steps
    schedule: str = "cosine"  # of the learning rate: see `nets.training.train`
    learning_rate: float = 5e-3
    weight_decay: float = 1e-2

    def __post_init__(self) -> None:
        if self.music_inputs not in MUSIC_INPUTS:
            raise ParameterError(
                f"expected music_inputs among {', '.join(MUSIC_INPUTS)}, got {self.music_inputs!r}"
            )
        if self.loss not in STYLE_LOSSES:
            raise ParameterError(f"expected a style loss among {', '.join(STYLE_LOSSES)}, got {self.loss!r}")
        check_training(self.epochs, self.schedule)
        if self.steps < 1 or self.batch_size < 2:
            raise ParameterError(
                f"expected at least 1 step and batches of 2, got {self.steps} and {self.batch_size}"
            )


_STYLE_PRESETS = {
    "paper": StyleConfig(
        conv_channels=(32, 64, 128, 128),
        graph_channels=(64, 64, 128, 128),
        gru_width=256,
        rhythm_width=128,
        head_width=128,
        batch_size=256,
        steps=20_000,
        learning_rate=5e-4,
    ),
    "small": StyleConfig(),
    "tiny": StyleConfig(
        conv_channels=(4, 8, 8, 8), graph_channels=(8, 8, 8, 16), gru_width=16, batch_size=16, steps=100
    ),
}


def style_config(preset: str, *, n_songs: int = 0, **changes: Any) -> StyleConfig:
    """The preset's configuration with fields changed; `ParameterError` for an unknown name or field.

    The steps are meant for `N_SONGS` songs. With more (`n_songs`) there are proportionally more steps, so
    that each song is seen as often: with 119 songs in 220 steps the genres did not separate.
    """
    config = config_from_preset(_STYLE_PRESETS, preset, changes)
    return replace(config, steps=round(config.steps * max(1.0, n_songs / N_SONGS)))
