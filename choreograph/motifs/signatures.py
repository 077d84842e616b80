"""Signatures and motif transitions of dances (Rhythm is a Dancer, sections 3.4 and 4.3)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from choreograph.errors import ParameterError
from choreograph.histograms import chi_square_distance as chi_square_distance

Floats = NDArray[np.float64]
Indices = NDArray[np.integer]

SUM_TOLERANCE = 1e-6


def signature(motifs: Indices, n_motifs: int) -> Floats:
    """Share of every motif, (K,), in a sequence of motifs (N,); sums to 1.

    Raises `ParameterError` if the sequence is empty or has a motif outside 0 … K - 1.
    """
    sequence = checked_sequence(motifs, n_motifs)
    if len(sequence) == 0:
        raise ParameterError("expected a dance of at least one motif, got none: it has no signature")
    return np.bincount(sequence, minlength=n_motifs) / len(sequence)


def template(dances: Sequence[Indices], n_motifs: int) -> Floats:
    """A genre's signature, (K,): the mean of its dances' signatures, whatever their lengths.

    Skips dances without words. Raises `ParameterError` if none is left.
    """
    signatures = [signature(dance, n_motifs) for dance in dances if len(dance)]
    if not signatures:
        raise ParameterError("expected a dance with motion words for the template, got none")
    return np.mean(signatures, axis=0)


def transition_matrix(dances: Sequence[Indices], n_motifs: int) -> Floats:
    """Probability that motif j follows motif i, (K, K), counted over the dances; rows sum to 1.

    As in the paper, pairs of consecutive motifs are counted within a dance and not smoothed; a motif may
    follow itself. Ours: the end of a dance counts as one more transition, to all motifs in proportion to
    their frequency. Otherwise a motif that only ends a dance would be an absorbing state; with it, every
    motif of the genre can be reached from every other. A motif that occurs in no dance gets the same
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


def checked_sequence(motifs: Indices, n_motifs: int) -> NDArray[np.int64]:
    """A sequence of motifs (N,) as integers; `ParameterError` unless all lie in 0 … K - 1."""
    sequence = np.asarray(motifs)
    if sequence.ndim != 1 or (len(sequence) and not np.issubdtype(sequence.dtype, np.integer)):
        raise ParameterError(f"expected motif numbers (N,), got {sequence.dtype} of shape {sequence.shape}")
    outside = sequence[(sequence < 0) | (sequence >= n_motifs)]
    if len(outside):
        raise ParameterError(f"expected motifs 0 to {n_motifs - 1}, got motif {outside[0]}")
    return sequence.astype(np.int64)


def checked_signature(values: Floats, n_motifs: int) -> Floats:
    """A signature (K,); `ParameterError` unless its shares are 0 or more and sum to 1."""
    shares = np.asarray(values, np.float64)
    if shares.shape != (n_motifs,):
        raise ParameterError(f"expected a signature of {n_motifs} motifs, got an array {shares.shape}")
    if not (np.isfinite(shares).all() and (shares >= 0).all() and abs(shares.sum() - 1) <= SUM_TOLERANCE):
        raise ParameterError(
            f"expected shares of at least 0 that sum to 1 as signature, got a sum of {shares.sum():.6g}"
        )
    return shares
