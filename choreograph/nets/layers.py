"""Layers of networks in NumPy, as those of torch. `name` is that of the layer in the torch module.

Rows x are float32.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from choreograph.core.numerics import frame_blocks

Array = NDArray[np.float32]
Shapes = dict[str, tuple[int, ...]]

EPSILON = 1e-5  # of torch's normalisations
_CONV_ROWS = 1024  # of a convolution over rows and columns, computed at once
_CONV_FRAMES = 8192  # of a convolution over frames


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


# The trunk of the networks that estimate counts, `content.count_networks.Trunk`.


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
