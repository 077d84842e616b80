"""Numerics for several rooms: default settings, blocks of frames, distances and interpolation."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

import numpy as np
import scipy
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

# Types of arrays that most modules have in their signatures.
Floats = NDArray[np.float64]
AnyFloats = NDArray[np.floating]
AnyInts = NDArray[np.integer]
Indices = NDArray[np.int64]

# Settings of NumPy and torch.
#
# Both libraries keep settings for the whole process or thread. Results do not depend on settings of the
# caller, which are restored afterwards. Random numbers are drawn from generators of our own. The state of
# torch's global generator is forked.


@contextmanager
def default_numerics() -> Iterator[None]:
    """Use the default settings of NumPy and torch in the block. It decorates functions, too.

    These are NumPy's handling of floating-point errors, and torch's default type and device, precision of
    matrix products, autocast and recording of gradients. It does not import torch.
    """
    with ExitStack() as stack:
        stack.enter_context(np.errstate(divide="warn", over="warn", under="ignore", invalid="warn"))
        if "torch" in sys.modules:
            stack.enter_context(_default_torch())
        yield


@contextmanager
def _default_torch() -> Iterator[None]:
    import torch

    dtype, precision = torch.get_default_dtype(), torch.get_float32_matmul_precision()
    with ExitStack() as stack:
        # Settings of the whole process are changed only where they differ, because other threads share them.
        if dtype != torch.float32:
            stack.callback(torch.set_default_dtype, dtype)
            torch.set_default_dtype(torch.float32)
        if precision != "highest":
            stack.callback(torch.set_float32_matmul_precision, precision)
            torch.set_float32_matmul_precision("highest")
        if torch.get_default_device().type != "cpu":
            stack.enter_context(torch.device("cpu"))
        if torch.is_autocast_enabled("cpu"):
            stack.enter_context(torch.autocast("cpu", enabled=False))
        stack.enter_context(torch.inference_mode(False))
        stack.enter_context(torch.enable_grad())
        yield


@contextmanager
def one_thread() -> Iterator[None]:
    """Use the settings of `default_numerics`, and one thread in BLAS and torch.

    The order of sums then does not depend on the number of cores. More threads do not make a dance faster,
    because its arrays are small and the planner has threads of its own. It does not import torch. If torch is
    imported in the block, `torch_imported` is to be called.
    """
    with ExitStack() as block:
        block.enter_context(default_numerics())
        _one_thread_blocks.append(block)
        block.callback(_one_thread_blocks.remove, block)
        if "torch" in sys.modules:
            torch_imported()
        block.enter_context(threadpool_limits(1, user_api="blas"))
        yield


_one_thread_blocks: list[ExitStack] = []  # those in progress


def torch_imported() -> None:
    """Limit torch to one thread until the end of the outermost block of `one_thread`, if there is one."""
    import torch

    if _one_thread_blocks and torch.get_num_threads() > 1:
        _one_thread_blocks[0].callback(torch.set_num_threads, torch.get_num_threads())
        torch.set_num_threads(1)


# Blocks of frames, so that temporary arrays do not grow with the length of a song or motion.


BLOCK_FRAMES = 4096  # 68 s at 60 fps


def frame_blocks(n_frames: int, size: int = BLOCK_FRAMES) -> Iterator[slice]:
    """Consecutive slices of at most `size` frames that cover frames 0 to `n_frames` - 1."""
    for start in range(0, n_frames, size):
        yield slice(start, min(start + size, n_frames))


# Distances. `squared_distances` is 2 to 15 times faster than `scipy.spatial.distance.cdist` for many vectors.
# Use cdist where both sides are small or equal vectors must be at a distance of exactly 0.


def squared_distances(a: AnyFloats, b: AnyFloats, *, b_squares: AnyFloats | None = None) -> AnyFloats:
    """Squared Euclidean distances (N, M) of vectors (N, D) and (M, D), never below 0.

    They are computed as |a|² + |b|² - 2 a·b, with the rounding error of |a|² + |b|², also for equal vectors.
    `b_squares` (M,) are |b|², for callers that pass the same `b` many times.
    """
    if b_squares is None:
        b_squares = np.sum(b**2, axis=1)
    squared: AnyFloats = np.sum(a**2, axis=1)[:, None] + b_squares - 2.0 * a @ b.T
    return np.maximum(squared, 0.0)


def chi_square_distance(a: Floats, b: Floats) -> Floats:
    """Chi-square distance (...) of histograms (..., K) that sum to 1, from 0 (equal) to 1 (disjoint).

    It is ½ Σ_k (a_k - b_k)² / (a_k + b_k), our reading of Rhythm is a Dancer, equation 11. Bins that are
    empty in both add nothing. The arrays broadcast.
    """
    a, b = np.asarray(a, np.float64), np.asarray(b, np.float64)
    both = a + b
    distance: Floats = 0.5 * np.sum(np.square(a - b) / np.where(both > 0, both, 1.0), axis=-1)
    return distance


# Interpolation: linear at fractional frames, and cubic beyond the ends of a curve.


def frame_weights(frames: AnyFloats, n_frames: int) -> tuple[Indices, Indices, Floats]:
    """Indices of the frames before and after fractional `frames` (...), and the weight of the latter.

    Each has the shape of `frames`, which is clamped to 0 to `n_frames` - 1.
    """
    inside: Floats = np.clip(np.asarray(frames, np.float64), 0.0, n_frames - 1)
    low: Indices = np.minimum(inside.astype(np.int64), max(n_frames - 2, 0))
    high: Indices = np.minimum(low + 1, n_frames - 1)
    return low, high, inside - low


def interpolate_frames(values: AnyFloats, frames: AnyFloats) -> Floats:
    """`values` (T, ...) at fractional `frames` (F...), clamped to the first and last: (F..., ...)."""
    low, high, weight = frame_weights(frames, len(values))
    weight = weight.reshape((*weight.shape, *[1] * (values.ndim - 1)))
    return values[low] * (1 - weight) + values[high] * weight


def continued_spline(knots: Floats, values: Floats, at: Floats | float) -> Floats:
    """Values (M,) at points (M,) of the cubic spline through `values` (N,) at increasing `knots` (N,).

    Beyond the ends, they go on at the rate of the end. That rate is between half and double the slope from an
    end to the next knot. After a corner beside the end, that of the spline may even have the other sign.
    """
    spline, points = scipy.interpolate.CubicSpline(knots, values), np.asarray(at, np.float64)
    inside: Floats = spline(np.clip(points, knots[0], knots[-1]))
    beyond = np.minimum(points - knots[0], 0.0), np.maximum(points - knots[-1], 0.0)
    slopes = (np.diff(values) / np.diff(knots))[[0, -1]]
    for past, rate, slope in zip(beyond, spline(knots[[0, -1]], 1), slopes, strict=True):
        inside = inside + past * np.clip(rate, *sorted((0.5 * slope, 2.0 * slope)))
    return inside
