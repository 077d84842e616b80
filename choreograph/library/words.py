"""Motion words of a dance, and its signature and motif transitions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import AnyInts, Floats, interpolate_frames
from choreograph.core.timebase import WORD_FRAMES, times_to_frames
from choreograph.motion.body import checked_body_pos_m, clips_to_root_frame

# Motion words: a dance segmented on its beats, each word resampled to 13 frames in its root frame.


MIN_WORD_S = 0.2  # beats that are closer count as one, since movements do not change so fast
DEFAULT_WORD_S = 0.5  # length of words where there are no beats
MAX_WORD_S = 1.5  # longer gaps, in which no beat was found, are divided evenly
WORDS_AT_ONCE = 512  # of a long dance, in whole batches of a network, so that its results stay as they are
_NEAR_GAPS = 8  # gaps between beats that determine the beat period before the first and after the last beat


@dataclass(frozen=True, eq=False)
class Words:
    """The words of one dance in order. Each begins where the one before it ends."""

    body_pos_m: Floats  # (N, 13, 21, 3) each in its root frame
    start_s: Floats  # (N,)
    end_s: Floats  # (N,)

    def __len__(self) -> int:
        return len(self.start_s)


def segment_words(body_pos_m: NDArray[np.floating], fps: float, beat_times_s: NDArray[np.floating]) -> Words:
    """Segment a dance on its beats (Rhythm is a Dancer, section 3.3).

    Parameters
    ----------
    body_pos_m : float array (T, 21, 3)   world positions at `fps`, preferably 30 or more
    beat_times_s : float array (Q,)       of the music, or of the motion where there is no music

    A word lasts from beat to beat, both included, and is resampled evenly to 13 frames, linear between
    frames. Beats outside the motion are ignored. See `word_bounds_s` for beats too close or too far apart.
    As in the paper, the duration of a word is discarded. Unlike in the paper, a word is also transformed to
    its root frame (`clips_to_root_frame`). The paper leaves that to its network.

    Returns the words, which may be none. Raises `ParameterError` if a shape is wrong or a value is not
    finite.
    """
    pos = checked_body_pos_m(body_pos_m, fps)
    return words_between(pos, fps, word_bounds_s(beat_times_s, (len(pos) - 1) / fps))


def words_between(body_pos_m: Floats, fps: float, bounds_s: Floats) -> Words:
    """As `segment_words`, for the bounds (N + 1,) of `word_bounds_s` or some of them, without checks."""
    start_s, end_s = bounds_s[:-1], bounds_s[1:]
    times = start_s[:, None] + (end_s - start_s)[:, None] * np.linspace(0.0, 1.0, WORD_FRAMES)  # (N, 13)
    body = poses_at(body_pos_m, fps, times)  # (N, 13, 21, 3)
    return Words(clips_to_root_frame(body), start_s, end_s)


def word_bounds_s(beat_times_s: NDArray[np.floating], duration_s: float) -> Floats:
    """Times (N + 1,) where words begin and end, from beats (Q,) in any order. N is 0 below two beats.

    Drops a beat less than `MIN_WORD_S` after the one before it, and divides gaps of over `MAX_WORD_S`
    evenly. Raises `ParameterError` if a beat is not finite.
    """
    beats = np.asarray(beat_times_s, np.float64)
    if beats.ndim != 1 or not np.isfinite(beats).all():
        raise ParameterError(f"expected finite beat times (Q,), got shape {beats.shape} or values not finite")
    bounds: list[float] = []
    for beat in np.sort(beats[(beats >= 0.0) & (beats <= duration_s)]):
        if not bounds:
            bounds.append(float(beat))
            continue
        gap = float(beat) - bounds[-1]
        if gap >= MIN_WORD_S:
            pieces = int(np.ceil(gap / MAX_WORD_S))
            bounds.extend(bounds[-1] + gap * np.arange(1, pieces + 1) / pieces)
    return np.array(bounds, np.float64) if len(bounds) > 1 else np.zeros(1)


def dance_bounds_s(beat_times_s: NDArray[np.floating], duration_s: float) -> Floats:
    """Times (N + 1,) where the words of a whole dance begin and end, N at least 1.

    Extends `word_bounds_s` to the start and the end of the dance with the beat period found there. If less
    than half a beat remains, no word is added: the first word begins a little after the dance does, or the
    last ends a little before. Without beats, words last `DEFAULT_WORD_S`.
    """
    inner = word_bounds_s(beat_times_s, duration_s)
    if len(inner) < 2:
        inner = np.array([0.0, min(DEFAULT_WORD_S, duration_s)])
    gaps = np.diff(inner)
    before_s, after_s = np.median(gaps[:_NEAR_GAPS]), np.median(gaps[-_NEAR_GAPS:])
    n_before, n_after = _pieces(inner[0], before_s), _pieces(duration_s - inner[-1], after_s)
    before = np.linspace(0.0, inner[0], n_before + 1)[:-1] if n_before else inner[:0]
    after = np.linspace(inner[-1], duration_s, n_after + 1)[1:] if n_after else inner[:0]
    return np.concatenate([before, inner, after])


def _pieces(gap_s: float, beat_s: float) -> int:
    """Number of words in a gap, or none if it is less than half a beat."""
    return int(np.clip(round(gap_s / beat_s), gap_s // MAX_WORD_S, gap_s // MIN_WORD_S))


def poses_at(body_pos_m: NDArray[np.floating], fps: float, times_s: NDArray[np.floating]) -> Floats:
    """Poses (..., 21, 3) of a motion (T, 21, 3) at times (...), linear between frames, constant outside."""
    return interpolate_frames(np.asarray(body_pos_m, np.float64), times_to_frames(times_s, fps))


def word_distance_m(a: NDArray[np.floating], b: NDArray[np.floating]) -> Floats:
    """Mean joint distance (...) of words (..., 13, 21, 3), without alignment."""
    result: Floats = np.linalg.norm(np.asarray(a, np.float64) - b, axis=-1).mean(axis=(-2, -1))
    return result


# Signatures and motif transitions of dances (Rhythm is a Dancer, sections 3.4 and 4.3).


SUM_TOLERANCE = 1e-6


def signature(motifs: AnyInts, n_motifs: int) -> Floats:
    """Share of every motif, (K,), in a sequence of motifs (N,). The shares sum to 1.

    Raises `ParameterError` if the sequence is empty or has a motif outside 0 … K - 1.
    """
    sequence = checked_sequence(motifs, n_motifs)
    if len(sequence) == 0:
        raise ParameterError("expected a dance of at least one motif, got none: it has no signature")
    return np.bincount(sequence, minlength=n_motifs) / len(sequence)


def template(dances: Sequence[AnyInts], n_motifs: int) -> Floats:
    """A genre's signature, (K,): the mean of the signatures of its dances, independent of their lengths.

    Skips dances without words. Raises `ParameterError` if none is left.
    """
    signatures = [signature(dance, n_motifs) for dance in dances if len(dance)]
    if not signatures:
        raise ParameterError("expected a dance with motion words for the template, got none")
    result: Floats = np.mean(signatures, axis=0)
    return result


def transition_matrix(dances: Sequence[AnyInts], n_motifs: int) -> Floats:
    """Probability that motif j follows motif i, (K, K), counted over the dances. Rows sum to 1.

    As in the paper, pairs of consecutive motifs are counted within a dance and not smoothed. A motif may
    follow itself. Unlike in the paper, the end of a dance counts as one more transition, to all motifs in
    proportion to their frequency, so that every motif of the genre can be reached from every other. Otherwise
    a motif that only ends a dance would be an absorbing state. A motif that occurs in no dance gets the same
    proportions.

    Raises `ParameterError` if no dance has a motif, or one is outside 0 … K - 1.
    """
    sequences = [checked_sequence(dance, n_motifs) for dance in dances]
    all_motifs = np.concatenate(sequences) if sequences else np.zeros(0, np.int64)
    if len(all_motifs) == 0:
        raise ParameterError("expected a dance with motion words to count transitions, got none")
    frequency = signature(all_motifs, n_motifs)
    counts = np.zeros((n_motifs, n_motifs))
    for sequence in sequences:
        np.add.at(counts, (sequence[:-1], sequence[1:]), 1.0)
        counts[sequence[-1:]] += frequency
    totals = counts.sum(axis=1, keepdims=True)  # (K, 1)
    return np.where(totals > 0, counts / np.maximum(totals, 1.0), frequency)


def checked_sequence(motifs: AnyInts, n_motifs: int) -> NDArray[np.int64]:
    """A sequence of motifs (N,) as integers. Raises `ParameterError` unless all lie in 0 … K - 1."""
    sequence = np.asarray(motifs)
    if sequence.ndim != 1 or (len(sequence) and not np.issubdtype(sequence.dtype, np.integer)):
        raise ParameterError(f"expected motif numbers (N,), got {sequence.dtype} of shape {sequence.shape}")
    outside = sequence[(sequence < 0) | (sequence >= n_motifs)]
    if len(outside):
        raise ParameterError(f"expected motifs 0 to {n_motifs - 1}, got motif {outside[0]}")
    return sequence.astype(np.int64)


def checked_signature(values: Floats, n_motifs: int) -> Floats:
    """A signature (K,). Raises `ParameterError` unless its shares are 0 or more and sum to 1."""
    shares = np.asarray(values, np.float64)
    if shares.shape != (n_motifs,):
        raise ParameterError(f"expected a signature of {n_motifs} motifs, got an array {shares.shape}")
    if not (np.isfinite(shares).all() and (shares >= 0).all() and abs(shares.sum() - 1) <= SUM_TOLERANCE):
        raise ParameterError(
            f"expected shares of at least 0 that sum to 1 as signature, got a sum of {shares.sum():.6g}"
        )
    return shares
