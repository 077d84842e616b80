"""The networks of a dance without torch: the embedding of words, and the style of songs.

torch takes over a second to import, which is longer than these networks need for a song. The torch modules of
`nets.words`, `nets.style` and `nets.rollout` define the networks and train them. The
classes here and in `nets.music_counts`, `nets.motion_counts` and `nets.rollout_poses` read the weights of
those modules, by the same names, and agree with them to rounding.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import asdict
from functools import partial
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import frame_blocks
from choreograph.core.timebase import MUSIC_FPS, SEGMENT_S, WORD_FRAMES
from choreograph.motion.body import BODY_JOINTS, clips_to_root_frame
from choreograph.music.mel import MEL_BANDS
from choreograph.music.rhythm import RHYTHM_DIM, RHYTHM_FPS
from choreograph.nets.configs import STYLE_DIM, WORD_DIM, StyleConfig, WordConfig, check_fields
from choreograph.nets.layers import (
    Array,
    Shapes,
    batch_norm,
    conv1d,
    conv2d,
    gelu,
    group_norm,
    gru,
    gru_shapes,
    linear,
    norm_shapes,
    unit,
)

BATCH_SIZE = 128  # rows that a network takes at once
MEL_FRAMES = SEGMENT_S * MUSIC_FPS


class TrainedNet(ABC):
    """The weights of a trained network, by the names of its torch module, and its configuration."""

    config_class: ClassVar[type]

    def __init__(self, weights: Mapping[str, Array], config: Any) -> None:
        self.weights, self.config = weights, config

    @staticmethod
    @abstractmethod
    def shapes(config: Any) -> Shapes:
        """The shapes of the weights that are used, by name."""

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]], config: Mapping[str, Any]) -> Self:
        """The network of stored arrays. Raises `ParameterError` if weights and config disagree."""
        checked = cls.config_class(**check_fields(cls.config_class, config))
        shapes = cls.shapes(checked)
        for name, shape in shapes.items():
            if name not in arrays or np.shape(arrays[name]) != shape:
                raise ParameterError(
                    f"expected weights of the {cls.__name__} configured, got other shapes: a damaged file"
                )
        return cls({name: np.asarray(arrays[name], np.float32) for name in shapes}, checked)

    def to_arrays(self) -> tuple[dict[str, Array], dict[str, Any]]:
        """Weights by name, and the configuration as a plain dictionary."""
        return dict(self.weights), asdict(self.config)


def in_batches(n: int, infer: Callable[[slice], Array], *row_shape: int) -> Array:
    """Rows (n, ...) inferred batch by batch. `row_shape` is needed for n = 0."""
    parts = [infer(rows) for rows in frame_blocks(n, BATCH_SIZE)]
    return np.concatenate(parts) if parts else np.zeros((0, *row_shape), np.float32)


# Motion words to embeddings.


class WordEmbedder(TrainedNet):
    """The motion-word network `nets.words.WordNet`."""

    config_class = WordConfig

    @staticmethod
    def shapes(config: WordConfig) -> Shapes:
        """The shapes of all weights."""
        width, n_values = config.width, 3 * len(BODY_JOINTS)
        shapes: Shapes = {
            "linear.weight": (WORD_DIM, WORD_FRAMES * n_values), "linear.bias": (WORD_DIM,),
            "into.weight": (width, n_values, 3), "into.bias": (width,),
            "out.weight": (WORD_DIM, width * WORD_FRAMES), "out.bias": (WORD_DIM,),
            "mean_m": (WORD_FRAMES, n_values), "std_m": (1,),
        }  # fmt: skip
        for block in range(config.n_blocks):
            for norm, conv in _WORD_LAYERS:
                name = f"blocks.{block}.layers"
                shapes |= {f"{name}.{norm}.weight": (width,), f"{name}.{norm}.bias": (width,)}
                shapes |= {f"{name}.{conv}.weight": (width, width, 3), f"{name}.{conv}.bias": (width,)}
        return shapes

    def embed(self, words_m: NDArray[np.floating]) -> Array:
        """Embeddings (N, 184) of words (N, 13, 21, 3). Raises `ParameterError` for another shape or nan."""
        words = np.asarray(words_m, np.float32)
        if words.shape[1:] != (WORD_FRAMES, len(BODY_JOINTS), 3):
            raise ParameterError(
                f"expected motion words (N, {WORD_FRAMES}, {len(BODY_JOINTS)}, 3), got {words.shape}"
            )
        if not np.isfinite(words).all():
            raise ParameterError("expected finite motion words, got nan or infinity")
        return in_batches(len(words), lambda part: self._embedded(words[part]), WORD_DIM)

    def _embedded(self, words_m: Array) -> Array:
        weights = self.weights
        relative = (
            clips_to_root_frame(words_m.astype(np.float64))
            .reshape(len(words_m), WORD_FRAMES, -1)
            .astype(np.float32)
        )
        x = (relative - weights["mean_m"]) / weights["std_m"]  # (B, 13, 63)
        features = conv1d(x, weights, "into")  # (B, 13, C)
        for block in range(self.config.n_blocks):
            before, name = features, f"blocks.{block}.layers"
            for norm, conv in _WORD_LAYERS:
                normal = gelu(group_norm(features, weights, f"{name}.{norm}"))
                features = conv1d(normal, weights, f"{name}.{conv}")
            features = before + features
        scale_m = weights["std_m"] / np.float32((WORD_FRAMES * len(BODY_JOINTS)) ** 0.5)
        n_words = len(x)
        of_poses, of_features = x.reshape(n_words, -1), features.transpose(0, 2, 1).reshape(n_words, -1)
        embedded: Array = scale_m * (
            linear(of_poses, weights, "linear") + linear(of_features, weights, "out")
        )
        return embedded


_WORD_LAYERS = ((0, 2), (3, 5))  # of a block: normalisations and convolutions


# The style of songs, and the motion beats expected in them.


class SongStyle(TrainedNet):
    """The music network and the beat-count head of `nets.style.StyleNets`."""

    config_class = StyleConfig

    @staticmethod
    def shapes(config: StyleConfig) -> Shapes:
        """The shapes of the weights of the music network and of the head."""
        shapes: Shapes = {}
        width = 0
        if "mel" in config.music_inputs:
            channels = (1, *config.conv_channels)
            for block in range(4):
                shapes[f"music.blocks.{block}.0.weight"] = (channels[block + 1], channels[block], 3, 3)
                shapes |= norm_shapes(f"music.blocks.{block}.1", channels[block + 1])
            n_in = channels[-1] * MEL_BANDS // 16
            shapes |= gru_shapes("music.gru", n_in, config.gru_width, _GRU_LAYERS)
            width += config.gru_width
        if "counts" in config.music_inputs:
            shapes["music.rhythm.0.weight"] = (config.rhythm_width, RHYTHM_DIM)
            shapes["music.rhythm.0.bias"] = (config.rhythm_width,)
            width += config.rhythm_width
        if config.normalised:
            shapes |= norm_shapes("music.spread", width)
        shapes |= {"music.linear.weight": (STYLE_DIM, width), "music.linear.bias": (STYLE_DIM,)}
        sizes = (STYLE_DIM, config.head_width, config.head_width, config.head_width, 1)
        for layer in range(4):
            shapes[f"beat_head.{2 * layer}.weight"] = (sizes[layer + 1], sizes[layer])
            shapes[f"beat_head.{2 * layer}.bias"] = (sizes[layer + 1],)
        for name, size in (("mel", MEL_BANDS), ("rhythm", RHYTHM_DIM), ("beats", 1)):
            shapes |= {f"{name}_mean": (size,), f"{name}_std": (size,)}
        return shapes

    def embed_music(
        self, log_mel: NDArray[np.floating], rhythm: NDArray[np.floating], starts_s: NDArray[np.integer]
    ) -> Array:
        """Style vectors (N, 32) of the 4 s segments of a song from whole seconds `starts_s` (N,).

        `log_mel` (T, 96) at 60 fps and `rhythm` (M, RHYTHM_DIM) at 2 fps begin at the same time. The song is
        padded with silence.
        """
        log_mel, rhythm = np.asarray(log_mel, np.float32), np.asarray(rhythm, np.float32)
        if log_mel.ndim != 2 or log_mel.shape[1] != MEL_BANDS or rhythm.shape[1:] != (RHYTHM_DIM,):
            raise ParameterError(
                f"expected log-mel (T, {MEL_BANDS}) and rhythm (M, {RHYTHM_DIM}), "
                f"got {log_mel.shape} and {rhythm.shape}"
            )
        silence, n_frames = log_mel.min(), len(log_mel)
        starts = np.asarray(starts_s, np.int64)
        frames = np.minimum(starts * MUSIC_FPS, len(log_mel))
        rows = np.minimum((starts + SEGMENT_S // 2) * RHYTHM_FPS, len(rhythm) - 1)

        def segments(part: slice) -> Array:
            at = frames[part, None] + np.arange(MEL_FRAMES)  # (B, 240)
            padded: Array = log_mel[np.minimum(at, n_frames - 1)]
            padded[at >= n_frames] = silence
            return padded

        return in_batches(
            len(starts), lambda part: self._style(partial(segments, part), rhythm[rows[part]]), STYLE_DIM
        )

    def _style(self, mel: Callable[[], Array], rhythm: Array) -> Array:
        """Style vectors (B, 32) of log-mel (B, 240, 96), which is made only if used, and rhythm (B, R)."""
        weights, inputs = self.weights, self.config.music_inputs
        features = []
        if "mel" in inputs:
            x = ((mel() - weights["mel_mean"]) / weights["mel_std"])[:, None]
            for block in range(4):
                name = f"music.blocks.{block}"
                x = conv2d(x, weights, f"{name}.0", stride=(2, 2), padding=(1, 1))
                x = np.maximum(batch_norm(x, weights, f"{name}.1"), 0)  # (B, C, 15, 6) in the end
            x = x.transpose(0, 2, 1, 3).reshape(len(x), x.shape[2], -1)
            features.append(gru(x, weights, "music.gru", _GRU_LAYERS).mean(axis=1))
        if "counts" in inputs:
            standard = (rhythm - weights["rhythm_mean"]) / weights["rhythm_std"]
            features.append(np.maximum(linear(standard, weights, "music.rhythm.0"), 0))
        joined = np.concatenate(features, axis=1)
        if not self.config.normalised:
            return linear(joined, weights, "music.linear")
        return unit(linear(batch_norm(joined, weights, "music.spread"), weights, "music.linear"))

    def predict_beat_count(self, music_style: NDArray[np.floating]) -> Array:
        """Motion beats expected in each 4 s segment, (N,), from music styles (N, 32)."""
        x = np.asarray(music_style, np.float32)
        for layer in (0, 2, 4):
            x = np.maximum(linear(x, self.weights, f"beat_head.{layer}"), 0)
        counts: Array = linear(x, self.weights, "beat_head.6")[:, 0]
        return counts * self.weights["beats_std"] + self.weights["beats_mean"]


_GRU_LAYERS = 2
