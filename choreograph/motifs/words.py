"""Motion words: a dance cut on its beats, every piece brought to 13 frames and to its own place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from choreograph.errors import ParameterError
from choreograph.motion.body import checked_body_pos_m
from choreograph.motion.pose import clips_to_root_frame
from choreograph.timebase import WORD_FRAMES, times_to_frames

Floats = NDArray[np.float64]

SHORTEST_S = 0.2  # beats closer than at 300 a minute are one: nobody moves anew so fast
NO_BEAT_S = 0.5  # a word's length where no beat is heard
_NEAR_GAPS = 8  # beats that say how far apart those before and after them would be
LONGEST_S = 1.5  # a longer gap is divided evenly: a tracker lost the beat, or the dancer stood still


@dataclass(frozen=True, eq=False)
class Words:
    """The words of one dance in their order; each begins where the one before it ends."""

    body_pos_m: Floats  # (N, 13, 21, 3) seen from their own place
    start_s: Floats  # (N,)
    end_s: Floats  # (N,)

    def __len__(self) -> int:
        return len(self.start_s)


def segment_words(body_pos_m: NDArray[np.floating], fps: float, beat_times_s: NDArray[np.floating]) -> Words:
    """Cut a dance on its beats (Rhythm is a Dancer, section 3.3).

    Parameters
    ----------
    body_pos_m : float array (T, 21, 3)   world positions at `fps`, 30 or more if there is a choice
    beat_times_s : float array (Q,)       of the music, or of the motion where there is no music

    A word lasts from beat to beat, both instants included, and is resampled to 13 frames evenly, linear
    between frames. Beats outside the motion are left out, and `word_bounds_s` says what is made of beats
    too close and too far apart. As in the paper, how long a word was is forgotten; unlike there, it is
    also moved and turned to its own place (`clips_to_root_frame`), which the paper leaves to its
    network.

    Returns as many words as there are, perhaps none. Raises `ParameterError` if a shape is wrong or a
    value is not finite.
    """
    pos = checked_body_pos_m(body_pos_m, fps)
    bounds = word_bounds_s(beat_times_s, (len(pos) - 1) / fps)
    start_s, end_s = bounds[:-1], bounds[1:]
    times = start_s[:, None] + (end_s - start_s)[:, None] * np.linspace(0.0, 1.0, WORD_FRAMES)  # (N, 13)
    body = poses_at(pos, fps, times)  # (N, 13, 21, 3)
    return Words(clips_to_root_frame(body), start_s, end_s)


def word_bounds_s(beat_times_s: NDArray[np.floating], duration_s: float) -> Floats:
    """Instants (N + 1,) at which words begin and end, of beats (Q,) in any order; fewer than two: none.

    A beat less than 0.2 s after the one before it is dropped; a gap of over 1.5 s is divided evenly.
    Raises `ParameterError` if a beat is not finite.
    """
    beats = np.asarray(beat_times_s, np.float64)
    if beats.ndim != 1 or not np.isfinite(beats).all():
        raise ParameterError(f"expected finite beat times (Q,), got an array {beats.shape}, or nan in it")
    bounds: list[float] = []
    for beat in np.sort(beats[(beats >= 0.0) & (beats <= duration_s)]):
        if not bounds:
            bounds.append(float(beat))
            continue
        gap = float(beat) - bounds[-1]
        if gap >= SHORTEST_S:
            pieces = int(np.ceil(gap / LONGEST_S))
            bounds.extend(bounds[-1] + gap * np.arange(1, pieces + 1) / pieces)
    return np.array(bounds, np.float64) if len(bounds) > 1 else np.zeros(1)


def dance_bounds_s(beat_times_s: NDArray[np.floating], duration_s: float) -> Floats:
    """Instants (N + 1,) at which the words of a whole dance begin and end, N at least 1.

    Those of `word_bounds_s`, and before and after them more, as far apart as beats are there, from the
    dance's first instant to its last. Where less than half a beat is left, the first word begins a little
    later than the dance, or the last ends a little earlier: its neighbours' speed goes on there. Without
    beats words last half a second.
    """
    inner = word_bounds_s(beat_times_s, duration_s)
    if len(inner) < 2:
        inner = np.array([0.0, min(NO_BEAT_S, duration_s)])
    gaps = np.diff(inner)
    before_s, after_s = np.median(gaps[:_NEAR_GAPS]), np.median(gaps[-_NEAR_GAPS:])
    n_before, n_after = _pieces(inner[0], before_s), _pieces(duration_s - inner[-1], after_s)
    before = np.linspace(0.0, inner[0], n_before + 1)[:-1] if n_before else inner[:0]
    after = np.linspace(inner[-1], duration_s, n_after + 1)[1:] if n_after else inner[:0]
    return np.concatenate([before, inner, after])


def _pieces(gap_s: float, beat_s: float) -> int:
    """Into how many words a gap is divided, none if it is less than half a beat."""
    return int(np.clip(round(gap_s / beat_s), gap_s // LONGEST_S, gap_s // SHORTEST_S))


def poses_at(body_pos_m: NDArray[np.floating], fps: float, times_s: NDArray[np.floating]) -> Floats:
    """Poses (..., 21, 3) of a motion (T, 21, 3) at instants (...), linear between frames, still outside."""
    pos = np.asarray(body_pos_m, np.float64)
    frames = np.clip(times_to_frames(times_s, fps), 0, len(pos) - 1)
    low = np.minimum(frames.astype(np.int64), max(len(pos) - 2, 0))
    weight = (frames - low)[..., None, None]
    return pos[low] * (1 - weight) + pos[np.minimum(low + 1, len(pos) - 1)] * weight


def word_distance_m(a: NDArray[np.floating], b: NDArray[np.floating]) -> Floats:
    """How far words (..., 13, 21, 3) are from each other as they stand: mean joint distance, (...)."""
    return np.linalg.norm(np.asarray(a, np.float64) - b, axis=-1).mean(axis=(-2, -1))
