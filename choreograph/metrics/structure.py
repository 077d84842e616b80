"""Structure: does a dance repeat itself, and does it do so where its song does.

Conventions: a dance is a sequence of motifs (N,), numbers from 0, each from its start in seconds, (N,)
increasing; and of pieces of takes (P,), each from when to when in the dance and in its take. Sections of a
song are bounds (S + 1,) in seconds and labels (S,): equal labels are the same music again. Signatures and
transitions are those of Rhythm is a Dancer (sections 3.4 and 4.3), which says how to compare them but not
how dances follow a song's sections; that measure is ours. What does not fit is refused with a
`ParameterError`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from choreograph.errors import ParameterError
from choreograph.histograms import chi_square_distance

Floats = NDArray[np.float64]
Indices = NDArray[np.integer]

STEP_S = 0.25  # at which takes are compared with themselves
SAME_S = 0.5  # apart in a take, and still the same moment of it: two warps of one clip
SOON_S = 1.0  # at half speed a take is so long at what counts as one moment: that is no repeat


def validate(motifs: Indices, n_motifs: int) -> None:
    """Raise `ParameterError` unless these are motifs (N,) of 0 … K - 1."""
    sequence = np.asarray(motifs)
    if sequence.ndim != 1 or (len(sequence) and not np.issubdtype(sequence.dtype, np.integer)):
        raise ParameterError(f"expected motif numbers (N,), got {sequence.dtype} of shape {sequence.shape}")
    if len(sequence) and not (sequence.min() >= 0 and sequence.max() < n_motifs):
        raise ParameterError(f"expected motifs 0 to {n_motifs - 1}, got {sequence.min()} to {sequence.max()}")


def signature_distance(motifs: Indices, template: Floats) -> float:
    """χ² between the shares of the motifs of a dance and a template (K,), 0 … 1; `nan` without motifs."""
    validate(motifs, len(template))
    if len(motifs) == 0:
        return float("nan")
    return float(chi_square_distance(np.bincount(motifs, minlength=len(template)) / len(motifs), template))


def transition_bits(motifs: Indices, transitions: Floats) -> float:
    """Mean surprise of the steps from motif to motif, -log₂ of their probability (K, K): bits a step.

    0 if every step was certain; `inf` if one was impossible; `nan` without a step.
    """
    bits = _bits(transitions)
    validate(motifs, len(bits))
    return float(bits[motifs[:-1], motifs[1:]].mean()) if len(motifs) > 1 else float("nan")


def transition_chance_bits(motifs: Indices, transitions: Floats) -> float:
    """The mean of `transition_bits` over all orders of the same motifs."""
    bits = _bits(transitions)
    validate(motifs, len(bits))
    if len(motifs) < 2:
        return float("nan")
    table = bits[np.ix_(motifs, motifs)]
    return float(table[~np.eye(len(motifs), dtype=bool)].mean())


def longest_repeat(items: Sequence[int] | Indices) -> int:
    """Length of the longest stretch of items that comes twice without overlap; 0 if none does."""
    items = np.asarray(items)
    return _longest_diagonal(items[:, None] == items) if len(items) else 0


def longest_repeat_s(takes: Sequence[str], pieces_s: Floats) -> float:
    """Seconds of the longest stretch that plays the same moments of the same take twice, straight through.

    `pieces_s` (P, 4) are start and end in the dance and start and end in the take, of each of `takes`. A
    moment is the same within `SAME_S`, so a clip repeated at a slightly other tempo is one.
    """
    rows = _checked_pieces(takes, pieces_s)
    instants_s = np.arange(rows[0, 0], rows[-1, 1], STEP_S)
    piece = np.clip(np.searchsorted(rows[:, 0], instants_s, side="right") - 1, 0, None)
    start, end, source_start, source_end = rows[piece].T
    source_s = source_start + (instants_s - start) / (end - start) * (source_end - source_start)
    take = np.unique(list(takes), return_inverse=True)[1][piece]
    same = (take[:, None] == take) & (np.abs(source_s[:, None] - source_s) <= SAME_S)
    return _longest_diagonal(same, first_lag=round(SOON_S / STEP_S) + 1) * STEP_S


def distinct_takes_per_minute(takes: Sequence[str], duration_s: float) -> float:
    """How many different takes are danced, over the dance's minutes."""
    if not (np.isfinite(duration_s) and duration_s > 0):
        raise ParameterError(f"expected a duration above 0 s, got {duration_s}")
    return len(set(takes)) * 60.0 / duration_s


def moves_of_sections(motifs: Indices, starts_s: Floats, section_bounds_s: Floats) -> list[Indices]:
    """The motifs that begin in each section, S sequences."""
    starts, bounds = np.asarray(starts_s, np.float64), np.asarray(section_bounds_s, np.float64)
    for name, times in (("starts of motifs", starts), ("bounds of sections", bounds)):
        if times.ndim != 1 or not np.isfinite(times).all() or (np.diff(times) <= 0).any():
            raise ParameterError(f"expected increasing, finite {name}, got an array {times.shape}")
    if len(starts) != len(motifs) or len(bounds) < 2:
        raise ParameterError(
            f"expected a start a motif and two bounds, got {len(starts)}, {len(motifs)}, {len(bounds)}"
        )
    return np.split(np.asarray(motifs), np.searchsorted(starts, bounds))[1:-1]


def shared_moves(sections: Sequence[Indices], n_motifs: int) -> Floats:
    """How alike the moves of any two sections are whatever their order, 1 - χ² of their shares: (S, S)."""
    for section in sections:
        validate(section, n_motifs)
    shares = np.array([np.bincount(s, minlength=n_motifs) / max(1, len(s)) for s in sections])
    return 1.0 - chi_square_distance(shares[:, None], shares)


def moves_in_step(sections: Sequence[Indices]) -> Floats:
    """Share of the moves of two sections, counted from their beginnings, that are the same: (S, S)."""
    alike = np.zeros((len(sections), len(sections)))
    for i, one in enumerate(sections):
        for j, other in enumerate(sections):
            n = min(len(one), len(other))
            alike[i, j] = np.mean(one[:n] == other[:n]) if n else 0.0
    return alike


def section_agreement(similarity: Floats, section_labels: Sequence[str] | Indices) -> float:
    """How much more alike sections of equal labels are danced than those of unlike ones, -1 … 1.

    Mean of `similarity` (S, S) over the pairs of equal labels, less its mean over the others. A dance that
    minds nothing of the song has 0, however much it repeats: that is the mean over all orders of the
    labels. `nan` if no label comes twice, or none is another.
    """
    similarity, labels = np.asarray(similarity, np.float64), np.asarray(section_labels)
    if similarity.shape != (len(labels), len(labels)) or not np.isfinite(similarity).all():
        raise ParameterError(f"expected similarities ({len(labels)}, {len(labels)}), got {similarity.shape}")
    one, other = np.triu_indices(len(labels), 1)
    pairs, equal = similarity[one, other], labels[one] == labels[other]
    if equal.all() or not equal.any():
        return float("nan")
    return float(pairs[equal].mean() - pairs[~equal].mean())


def evaluate(
    motifs: Indices,
    starts_s: Floats,
    takes: Sequence[str],
    pieces_s: Floats,
    *,
    template: Floats,
    transitions: Floats,
    section_bounds_s: Floats,
    section_labels: Sequence[str] | Indices,
) -> dict[str, float]:
    """All metrics of this module by name."""
    sections = moves_of_sections(motifs, starts_s, section_bounds_s)
    rows = _checked_pieces(takes, pieces_s)
    return {
        "signature_distance": signature_distance(motifs, template),
        "transition_bits": transition_bits(motifs, transitions),
        "transition_bits_chance": transition_chance_bits(motifs, transitions),
        "section_agreement": section_agreement(shared_moves(sections, len(template)), section_labels),
        "section_agreement_in_step": section_agreement(moves_in_step(sections), section_labels),
        "longest_repeat_motifs": float(longest_repeat(motifs)),
        "longest_repeat_s": longest_repeat_s(takes, pieces_s),
        "distinct_takes_per_minute": distinct_takes_per_minute(takes, rows[-1, 1] - rows[0, 0]),
    }


def _bits(transitions: Floats) -> Floats:
    """Surprise of every step, (K, K)."""
    table = np.asarray(transitions, np.float64)
    if table.ndim != 2 or table.shape[0] != table.shape[1] or not ((table >= 0) & (table <= 1)).all():
        raise ParameterError(f"expected probabilities (K, K) from motif to motif, got an array {table.shape}")
    with np.errstate(divide="ignore"):
        return -np.log2(table)


def _longest_diagonal(same: NDArray[np.bool_], *, first_lag: int = 1) -> int:
    """Most items in a row that are the same as those some steps later, and begin again after they end."""
    longest = 0
    for lag in range(first_lag, len(same)):
        run = np.diagonal(same, lag)
        edges = np.flatnonzero(np.diff(run.astype(np.int8), prepend=0, append=0)).reshape(-1, 2)
        if len(edges):
            longest = max(longest, min(lag, int((edges[:, 1] - edges[:, 0]).max())))
    return longest


def _checked_pieces(takes: Sequence[str], pieces_s: Floats) -> Floats:
    rows = np.asarray(pieces_s, np.float64)
    if rows.shape != (len(takes), 4) or len(rows) == 0 or not np.isfinite(rows).all():
        raise ParameterError(f"expected pieces ({len(takes)}, 4) of the takes in seconds, got {rows.shape}")
    if (np.diff(rows[:, 0]) <= 0).any() or (rows[:, 1] <= rows[:, 0]).any():
        raise ParameterError("expected pieces in the order of the dance, each ending after its start")
    return rows
