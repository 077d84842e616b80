"""Motion beats, the minima of joint speed, and liveliness, the size of the motion."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import AnyFloats, AnyInts, Floats, frame_blocks
from choreograph.core.timebase import NET_FPS, frames_to_seconds

# Motion beats: local minima of mean joint speed.


SMOOTHING_S = 0.03  # standard deviation that removes marker noise and keeps every visible stop
MIN_GAP_S = 0.1  # between beats, shorter than any dancer's step
MIN_PROMINENCE_M_S = 1e-3  # at any speed of the motion
MIN_PROMINENCE = 0.03  # of the median speed. Shallower minima are tremor and sampling noise


def mean_joint_speed_m_s(body_pos_m: NDArray[np.floating], fps: float) -> Floats:
    """Mean world speed of the joints in m/s, (T,), of positions (T, J, 3), with root motion."""
    pos = np.asarray(body_pos_m, np.float64)
    if pos.ndim != 3 or pos.shape[2] != 3:
        raise ParameterError(f"expected joint positions (T, J, 3), got {pos.shape}")
    if len(pos) < 2:
        return np.zeros(len(pos))
    sigma = SMOOTHING_S * fps
    radius = int(4.0 * sigma + 0.5)
    speed_m_s, reach = np.empty(len(pos)), 1 + radius
    for block in frame_blocks(len(pos)):  # with the frames beside it that it depends on
        first = max(0, block.start - reach)
        smooth = scipy.ndimage.gaussian_filter1d(
            pos[first : block.stop + reach], sigma, axis=0, mode="nearest", radius=radius
        )
        smooth = smooth[max(0, block.start - first - 1) : block.stop - first + 1]
        step_m = np.gradient(smooth, axis=0)[min(1, block.start) :][: block.stop - block.start]
        speed_m_s[block] = np.linalg.norm(step_m * fps, axis=2).mean(axis=1)
    return speed_m_s


def motion_beat_times_s(body_pos_m: NDArray[np.floating], fps: float) -> Floats:
    """Times of the motion beats in seconds, increasing (Q,), of positions (T, J, 3).

    They are best computed at 60 fps. At 20 fps, about one shallow beat in eight is missed.
    """
    speed = mean_joint_speed_m_s(body_pos_m, fps)
    return frames_to_seconds(speed_minima(speed, fps), fps)


def speed_minima(speed_m_s: NDArray[np.floating], fps: float) -> Floats:
    """Fractional frames of the motion beats of a speed curve (T,), increasing (Q,).

    They are local minima, found by scipy's find_peaks as in the paper (ChoreoGraph, section 3.1). Minima
    shallower than 3 % of the median speed are tremor and not beats (the paper states no threshold). The
    warper's kernel uses the same definition for warped motion (`choreography.graph.warp_kernels`).
    """
    speed = np.asarray(speed_m_s, np.float64)
    if len(speed) < 3:
        return np.zeros(0)
    distance = max(1, round(MIN_GAP_S * fps))
    prominence = max(MIN_PROMINENCE * float(np.median(speed)), MIN_PROMINENCE_M_S)
    frames, _ = scipy.signal.find_peaks(-speed, distance=distance, prominence=prominence)
    return frames + _vertex_offset(speed, frames)


def _vertex_offset(speed: Floats, frames: NDArray[np.integer]) -> Floats:
    """Offset in (-0.5, 0.5) of the vertex of the parabola through each minimum and its neighbours."""
    before, here, after = speed[frames - 1], speed[frames], speed[frames + 1]
    bend = before - 2 * here + after
    return np.where(bend > 1e-12, 0.5 * (before - after) / np.maximum(bend, 1e-12), 0.0).clip(-0.5, 0.5)


# Liveliness: the size of the motion in each second of a take, as a rank among the seconds of its genre.


_WIDTH_SHARE = 0.5  # weight of a standard deviation of width, relative to one of travel
_LEAST_SPREAD_M = 1e-3  # smaller differences between takes are ignored


_MOST_SIZES = 1 << 16  # of a genre that are kept: of more, evenly many


@dataclass(frozen=True, eq=False)
class GenreSizes:
    """The sizes of the recorded seconds of a genre, with which other seconds are compared.

    The size of a second grows with the travel of its joints and the width of the body. Travel is the mean of
    the joints' path lengths in the world. Width is the mean of their distances from the vertical through the
    pelvis.
    """

    scale: Floats  # (2,) of travel in metres and of width in metres
    sizes: Floats  # (Z,) in increasing order


def travel_and_width_sums(body_pos_m: AnyFloats) -> AnyFloats:
    """Travel and width × time of a take (T, 21, 3) up to every frame, (T, 2) in m and m s."""
    pos = np.asarray(body_pos_m, np.float64)
    across = (pos - pos[:, :1])[..., [0, 2]]
    per_frame = np.stack(
        [mean_joint_speed_m_s(pos, NET_FPS), np.linalg.norm(across, axis=-1).mean(axis=1)], axis=1
    )  # (T, 2)
    between = 0.5 * (per_frame[:-1] + per_frame[1:]) / NET_FPS
    return np.concatenate([np.zeros((min(1, len(pos)), 2)), np.cumsum(between, axis=0)])


def travel_and_width(
    read_sums: Callable[[AnyInts], AnyFloats],
    first_row: AnyInts,
    last_row: AnyInts,
    start: AnyFloats,
    stop: AnyFloats,
) -> AnyFloats:
    """Travel in metres, as danced in one second, and mean width in metres, (N, 2).

    `start` and `stop` (N,) are the frames at 20 fps of takes that bound each second of the dance. The takes
    have the rows `first_row` to `last_row` (N,), of which `read_sums` returns the sums.
    """
    rows = np.clip(first_row + np.stack([start, stop]), first_row, last_row)  # (2, N)
    low = rows.astype(np.int64)
    share = (rows - low)[..., None]
    sums = read_sums(np.stack([low, np.minimum(low + 1, last_row)]))  # (2, 2, N, 2)
    at = (1 - share) * sums[0] + share * sums[1]  # (2, N, 2)
    travel_m, width_m_s = (at[1] - at[0]).T
    return np.stack([travel_m, width_m_s * NET_FPS / np.maximum(rows[1] - rows[0], 1e-6)], axis=1)


def genre_sizes(sums: Sequence[AnyFloats]) -> GenreSizes:
    """The sizes of all seconds of a genre as recorded, from the sums (T, 2) of its takes."""
    measured = np.concatenate([np.zeros((0, 2)), *(_recorded(of_take) for of_take in sums)])
    spread = measured.std(axis=0) if len(measured) else np.zeros(2)
    scale = np.array([1.0, _WIDTH_SHARE]) / np.maximum(spread, _LEAST_SPREAD_M)
    sizes = np.sort(measured @ scale)
    if len(sizes) > _MOST_SIZES:
        sizes = sizes[np.linspace(0, len(sizes) - 1, _MOST_SIZES).round().astype(np.int64)]
    return GenreSizes(scale, sizes)


def _recorded(sums: AnyFloats) -> AnyFloats:
    """Travel and width of the second from each frame of a take (T, 2) on that has a second after it."""
    start = np.arange(max(0, len(sums) - NET_FPS), dtype=np.float64)
    rows = np.zeros(len(start), np.int64)
    return travel_and_width(lambda at: sums[at], rows, rows + len(sums) - 1, start, start + NET_FPS)


def liveliness_ranks(measured: AnyFloats, genre: AnyInts, sizes: Sequence[GenreSizes]) -> NDArray[np.float32]:
    """Share (N,), 0 … 1, of the recorded seconds of its genre (N,) that are smaller than each second (N, 2).

    `genre` are indices of `sizes`. Without recorded seconds, it is 0.5.
    """
    ranks = np.full(len(measured), 0.5, np.float32)
    for index in np.unique(genre):
        here, known = genre == index, sizes[index]
        if len(known.sizes):
            ranks[here] = np.searchsorted(known.sizes, measured[here] @ known.scale) / len(known.sizes)
    return ranks
