"""The networks of a dance without torch: layers in NumPy, the embedding of words, and the style of songs.

torch takes over a second to import, which is longer than these networks need for a song. The torch modules of
`nets.words`, `nets.style`, `nets.count_phases` and `nets.rollout` define the networks and train them. The
classes here and in `nets.music_counts`, `nets.motion_counts` and `nets.rollout_poses` read the weights of
those modules, by the same names, and agree with them to rounding.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import asdict
from functools import partial
from itertools import pairwise
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

Array = NDArray[np.float32]
Shapes = dict[str, tuple[int, ...]]

BATCH_SIZE = 128  # rows that a network takes at once
MEL_FRAMES = SEGMENT_S * MUSIC_FPS
EPSILON = 1e-5  # of torch's normalisations
_CONV_ROWS = 1024  # of a convolution over rows and columns, computed at once
_CONV_FRAMES = 8192  # of a convolution over frames


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


# Layers. `name` is that of the layer in the torch module, and x is float32.


def linear(x: Array, weights: Mapping[str, Array], name: str) -> Array:
    """Rows (..., F) to rows (..., O)."""
    result: Array = x @ weights[f"{name}.weight"].T
    bias = weights.get(f"{name}.bias")
    return result if bias is None else result + bias


def conv1d(x: Array, weights: Mapping[str, Array], name: str, *, dilation: int = 1) -> Array:
    """Frames (B, T, C) to frames (B, T, O), with zeros outside. The kernel has an odd length."""
    kernel = weights[f"{name}.weight"]  # (O, C, K)
    n_frames, n_taps = x.shape[1], kernel.shape[2]
    side = n_taps // 2 * dilation
    flat = kernel.transpose(2, 1, 0).reshape(-1, len(kernel))  # (K C, O)
    result = np.empty((len(x), n_frames, len(kernel)), np.float32)
    # A short block would have its products computed in another order, so all are about as long.
    bounds = np.linspace(0, n_frames, n_frames // _CONV_FRAMES + 2).astype(np.int64).tolist()
    for low, stop in pairwise(bounds):
        padded = padded_frames(x, low - side, stop + side)
        n_rows = stop - low
        # All taps of a frame side by side, so that the sum over taps and channels is one product of matrices.
        taps = np.concatenate(
            [padded[:, k * dilation : k * dilation + n_rows] for k in range(n_taps)], axis=2
        )
        product = taps.reshape(-1, len(flat)) @ flat + weights[f"{name}.bias"]
        result[:, low:stop] = product.reshape(len(x), n_rows, -1)
    return result


def padded_frames(x: Array, first: int, stop: int) -> Array:
    """Frames `first` to `stop` - 1 of rows (B, T, ...), with zeros before and after the rows."""
    n_frames = x.shape[1]
    outside = (max(0, -first), max(0, stop - n_frames))
    return np.pad(x[:, max(0, first) : min(n_frames, stop)], ((0, 0), outside, *[(0, 0)] * (x.ndim - 2)))


def conv2d(
    x: Array, weights: Mapping[str, Array], name: str, *, stride: tuple[int, int], padding: tuple[int, int]
) -> Array:
    """Images (B, C, H, W) to images (B, O, H', W'), with zeros outside."""
    kernel = weights[f"{name}.weight"]  # (O, C, K, L)
    padded = np.pad(x, ((0, 0), (0, 0), *((side, side) for side in padding)))
    windows = np.lib.stride_tricks.sliding_window_view(padded, kernel.shape[2:], (2, 3))
    windows = windows[:, :, :: stride[0], :: stride[1]].transpose(0, 2, 3, 1, 4, 5)  # (B, H', W', C, K, L)
    out = np.empty((*windows.shape[:3], len(kernel)), np.float32)
    for rows in frame_blocks(windows.shape[1], _CONV_ROWS):
        block = windows[:, rows]
        out[:, rows] = block.reshape(*block.shape[:3], -1) @ kernel.reshape(len(kernel), -1).T
    bias = weights.get(f"{name}.bias")
    if bias is not None:
        out += bias
    return out.transpose(0, 3, 1, 2)


def batch_norm(x: Array, weights: Mapping[str, Array], name: str) -> Array:
    """Rows (B, C, ...) normalised by the statistics of the training."""
    shape = (-1, *(1,) * (x.ndim - 2))
    mean, variance, scale, shift = (
        weights[f"{name}.{part}"].reshape(shape) for part in ("running_mean", "running_var", "weight", "bias")
    )
    normal: Array = (x - mean) / np.sqrt(variance + np.float32(EPSILON)) * scale + shift
    return normal


def norm_shapes(name: str, width: int) -> Shapes:
    """The shapes of the arrays that `batch_norm` uses."""
    return {f"{name}.{part}": (width,) for part in ("running_mean", "running_var", "weight", "bias")}


def group_norm(x: Array, weights: Mapping[str, Array], name: str) -> Array:
    """Each of the rows (B, T, C) with mean 0 and variance 1, scaled and shifted by channel."""
    centred = x - x.mean(axis=(1, 2), keepdims=True)
    deviation = np.sqrt(np.square(centred).mean(axis=(1, 2), keepdims=True) + np.float32(EPSILON))
    normal: Array = centred / deviation * weights[f"{name}.weight"] + weights[f"{name}.bias"]
    return normal


def gru(x: Array, weights: Mapping[str, Array], name: str, n_layers: int) -> Array:
    """Outputs (B, T, W) of the last layer for rows (B, T, F)."""
    for layer in range(n_layers):
        into, recurrent, into_bias, recurrent_bias = (
            weights[f"{name}.{part}_l{layer}"] for part in ("weight_ih", "weight_hh", "bias_ih", "bias_hh")
        )
        gates = x @ into.T + into_bias  # (B, T, 3 W): reset, update, new
        hidden = np.zeros((len(x), recurrent.shape[1]), np.float32)
        outputs = []
        for t in range(x.shape[1]):
            reset, update, new = np.split(gates[:, t], 3, axis=1)
            from_reset, from_update, from_new = np.split(hidden @ recurrent.T + recurrent_bias, 3, axis=1)
            candidate = np.tanh(new + sigmoid(reset + from_reset) * from_new)
            keep = sigmoid(update + from_update)
            hidden = (1 - keep) * candidate + keep * hidden
            outputs.append(hidden)
        x = np.stack(outputs, axis=1)
    return x


def gru_shapes(name: str, n_in: int, width: int, n_layers: int) -> Shapes:
    """The shapes of the arrays that `gru` uses."""
    shapes: Shapes = {}
    for layer in range(n_layers):
        for part, n_inputs in (("ih", n_in if layer == 0 else width), ("hh", width)):
            shapes[f"{name}.weight_{part}_l{layer}"] = (3 * width, n_inputs)
            shapes[f"{name}.bias_{part}_l{layer}"] = (3 * width,)
    return shapes


def sigmoid(x: Array) -> Array:
    """The logistic function, from 0 to 1."""
    from scipy.special import expit

    result: Array = expit(x)
    return result


def gelu(x: Array) -> Array:
    """x Φ(x), with Φ the distribution function of the standard normal distribution, to 2e-7 |x|.

    Abramowitz and Stegun, *Handbook of Mathematical Functions*, equation 7.1.26: several times as fast as
    the error function of scipy.
    """
    magnitude = np.abs(x)
    one = np.float32(1)
    t: Array = one / (one + np.float32(0.3275911 * 0.5**0.5) * magnitude)
    polynomial: Array = np.zeros_like(t)
    for coefficient in (1.061405429, -1.453152027, 1.421413741, -0.284496736, 0.254829592):
        polynomial = (polynomial + np.float32(coefficient)) * t
    beyond = np.float32(0.5) * polynomial * np.exp(np.float32(-0.5) * np.square(x))  # Φ(-|x|)
    result: Array = np.maximum(x, 0) - magnitude * beyond
    return result


def elu(x: Array) -> Array:
    """x (B, C, T, W) where it is positive, and exp(x) - 1 elsewhere. It is computed in place."""
    for part in frame_blocks(x.shape[2]):
        rows = x[:, :, part]
        negative = np.minimum(rows, 0)
        np.copyto(rows, np.expm1(negative, out=negative), where=~(rows > 0))
    return x


def unit(x: Array) -> Array:
    """Rows (..., D) of length 1."""
    result: Array = x / np.maximum(np.linalg.norm(x, axis=-1, keepdims=True), 1e-12)
    return result


# The trunk of the networks that estimate counts, `nets.count_phases.Trunk`.


def trunk(x: Array, weights: Mapping[str, Array], n_blocks: int) -> Array:
    """Features (1, T, width) with a context of many seconds, of features (1, T, F)."""
    x = conv1d(x, weights, "trunk.into")
    for block in range(n_blocks):
        name = f"trunk.blocks.{block}.layers"
        y = conv1d(_normal(x, weights, f"{name}.0"), weights, f"{name}.1", dilation=2**block)
        x = x + conv1d(gelu(y), weights, f"{name}.4")
    return _normal(x, weights, "trunk.norm")


def trunk_shapes(n_features: int, width: int, n_blocks: int, kernel: int) -> Shapes:
    """The shapes of the arrays that `trunk` uses. A convolution has a kernel of so many frames."""
    shapes: Shapes = {
        "trunk.into.weight": (width, n_features, kernel), "trunk.into.bias": (width,),
        "trunk.norm.scale": (width, 1), "trunk.norm.shift": (width, 1),
    }  # fmt: skip
    for block in range(n_blocks):
        name = f"trunk.blocks.{block}.layers"
        shapes |= {f"{name}.0.scale": (width, 1), f"{name}.0.shift": (width, 1)}
        shapes |= {f"{name}.1.weight": (width, width, kernel), f"{name}.1.bias": (width,)}
        shapes |= {f"{name}.4.weight": (width, width, 1), f"{name}.4.bias": (width,)}
    return shapes


def _normal(x: Array, weights: Mapping[str, Array], name: str) -> Array:
    """Each frame of (B, T, C) with mean 0 and variance 1 over its channels, scaled and shifted."""
    centred = x - x.mean(axis=2, keepdims=True)
    variance = np.square(centred).mean(axis=2, keepdims=True)
    deviation = np.sqrt(variance + np.float32(EPSILON))
    scale, shift = weights[f"{name}.scale"][:, 0], weights[f"{name}.shift"][:, 0]
    normal: Array = centred / deviation * scale + shift
    return normal


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
