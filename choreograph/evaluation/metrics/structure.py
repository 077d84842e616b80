"""Structure: whether a dance repeats itself, and whether it does so where its song does.

Conventions: a dance is a sequence of motifs (N,), numbered from 0, with increasing start times in seconds
(N,). It is also a sequence of pieces of takes (P,), each with its span in the dance and in its take. The
sections of a song are bounds (S + 1,) in seconds and labels (S,). Equal labels mean the same music.
Signatures and motif transitions follow Rhythm is a Dancer (sections 3.4 and 4.3). That paper compares
signatures, but does not measure how a dance follows the sections of its song. `section_agreement` is ours,
and so is `n_gram_share`: a dance whose motifs are in a random order has the same signature. `genre_share` and
`joint_distance_m` tell whether a requested genre is danced, and whether dances differ by seed.

The phrases of a song are spans (P, 2) in seconds, in order, with labels (P,). Equal labels mean the same
music, count by count. Phrases are compared at equal shares of their length, which are equal counts at a
steady tempo. Poses are compared in the root frame, so that place and heading do not count. The form must be
the true one, and not the one that the dance was planned with. None of these metrics is from the papers.

Input that does not fit raises `ParameterError`.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from choreograph.core.arguments import is_whole
from choreograph.core.errors import ParameterError
from choreograph.core.numerics import AnyInts, Floats, chi_square_distance, default_numerics
from choreograph.core.timebase import NET_FPS
from choreograph.motion.body import body_pos_at, checked_body_pos_m, to_root_frame

STEP_S = 0.25  # time step at which a take is compared with itself
SAME_S = 0.5  # two warps of one clip differ by up to this much at the same moment of the take
SOON_S = 1.0  # at half speed a take stays this long within `SAME_S` of one moment, which is no repeat


def validate(motifs: AnyInts, n_motifs: int) -> None:
    """Raise `ParameterError` unless these are motif numbers (N,) from 0 to K - 1.

    Examples
    --------
    >>> cg.metrics.structure.validate(np.array([0, 1, 1]), n_motifs=2)
    >>> cg.metrics.structure.validate(np.array([0, 1, 2]), n_motifs=2)
    Traceback (most recent call last):
        ...
    choreograph.core.errors.ParameterError: expected motifs 0 to 1, got 0 to 2
    """
    sequence = np.asarray(motifs)
    if sequence.ndim != 1 or (len(sequence) and not np.issubdtype(sequence.dtype, np.integer)):
        raise ParameterError(f"expected motif numbers (N,), got {sequence.dtype} of shape {sequence.shape}")
    if len(sequence) and not (sequence.min() >= 0 and sequence.max() < n_motifs):
        raise ParameterError(f"expected motifs 0 to {n_motifs - 1}, got {sequence.min()} to {sequence.max()}")


def signature_distance(motifs: AnyInts, template: Floats) -> float:
    """χ² distance between the motif shares of a dance and a signature (K,), 0 to 1. Lower is better.

    Rhythm is a Dancer, equation 11. The result is nan without motifs.

    Examples
    --------
    >>> genre = np.array([0.5, 0.5, 0.0])
    >>> distance = cg.metrics.structure.signature_distance
    >>> distance(np.array([0, 1, 0, 1]), genre), distance(np.array([2, 2]), genre)
    (0.0, 1.0)
    """
    validate(motifs, len(template))
    if len(motifs) == 0:
        return float("nan")
    return float(chi_square_distance(np.bincount(motifs, minlength=len(template)) / len(motifs), template))


def transition_bits(motifs: AnyInts, transitions: Floats) -> float:
    """Mean surprisal of the transitions between motifs, -log₂ of their probability (K, K), in bits.

    Rhythm is a Dancer, section 4.3. The result is 0 if every transition was certain, `inf` if one was
    impossible, and nan without a transition. Lower is more usual for the genre.

    Examples
    --------
    >>> even = np.full((4, 4), 0.25)
    >>> cg.metrics.structure.transition_bits(np.array([0, 3, 1]), even)
    2.0
    """
    bits = _bits(transitions)
    validate(motifs, len(bits))
    return float(bits[motifs[:-1], motifs[1:]].mean()) if len(motifs) > 1 else float("nan")


def transition_chance_bits(motifs: AnyInts, transitions: Floats) -> float:
    """Chance level of `transition_bits`: its mean over all orders of the same motifs.

    Examples
    --------
    >>> alternating = np.array([[0.25, 0.75], [0.75, 0.25]])
    >>> motifs = np.array([0, 1, 0, 1])
    >>> bits, chance = (
    ...     f(motifs, alternating)
    ...     for f in (cg.metrics.structure.transition_bits, cg.metrics.structure.transition_chance_bits)
    ... )
    >>> bits < chance
    True
    """
    bits = _bits(transitions)
    validate(motifs, len(bits))
    if len(motifs) < 2:
        return float("nan")
    table = bits[np.ix_(motifs, motifs)]
    return float(table[~np.eye(len(motifs), dtype=bool)].mean())


def n_gram_share(motifs: AnyInts, takes: Sequence[AnyInts], n: int) -> float:
    """Share of the runs of `n` consecutive motifs of a dance that at least one of the takes has, 0 to 1.

    `takes` are the sequences of motifs of the takes. Compare with a take that is left out, against the
    others. A dance with a much higher share copies long parts of takes. The result is nan for a dance of
    fewer than `n` motifs.

    Examples
    --------
    >>> take = np.array([0, 1, 2, 3, 4])
    >>> cg.metrics.structure.n_gram_share(np.array([2, 3, 4, 0, 1]), [take], n=2)
    0.75
    """
    runs, in_takes = _n_grams(motifs, n), _n_grams_of_takes(takes, n)
    return float(np.mean([run in in_takes for run in runs])) if runs else float("nan")


def n_gram_chance(motifs: AnyInts, takes: Sequence[AnyInts], n: int) -> float:
    """Chance level of `n_gram_share`: its mean over all orders of the same motifs.

    Examples
    --------
    >>> cg.metrics.structure.n_gram_chance(np.array([0, 1, 2]), [np.array([0, 1, 2])], n=2)
    0.3333333333333333
    """
    runs, in_takes = _n_grams(motifs, n), _n_grams_of_takes(takes, n)
    if not runs:
        return float("nan")
    has = Counter(np.asarray(motifs).tolist())
    # The orders of the dance in which its first `n` motifs are a given run.
    orders = sum(
        math.prod(math.perm(has[motif], times) for motif, times in Counter(run).items()) for run in in_takes
    )
    return orders / math.perm(len(motifs), n)


def longest_repeat(items: Sequence[int] | AnyInts) -> int:
    """Length of the longest run of items that occurs twice without overlap. 0 if none does.

    Examples
    --------
    >>> cg.metrics.structure.longest_repeat([1, 2, 3, 9, 1, 2, 3])
    3
    """
    items = np.asarray(items)
    return _longest_diagonal(items[:, None] == items) if len(items) else 0


def longest_repeat_s(takes: Sequence[str], pieces_s: Floats) -> float:
    """Seconds of the longest span in which the dance plays the same part of the same take a second time.

    `pieces_s` (P, 4) holds start and end in the dance, and start and end in the take, for each of `takes`.
    Moments of a take within `SAME_S` count as the same, so that a clip repeated at a slightly different tempo
    is found. Lower is better.

    Examples
    --------
    >>> pieces_s = np.array([[0, 4, 10, 14], [4, 8, 0, 4], [8, 12, 10, 14]])  # the third repeats the first
    >>> cg.metrics.structure.longest_repeat_s(["a", "b", "a"], pieces_s)
    4.0
    """
    rows = _checked_pieces(takes, pieces_s)
    take, source_s = source_at(takes, rows, np.arange(rows[0, 0], rows[-1, 1], STEP_S))
    same = (take[:, None] == take) & (np.abs(source_s[:, None] - source_s) <= SAME_S)
    return _longest_diagonal(same, first_lag=round(SOON_S / STEP_S) + 1) * STEP_S


def source_at(takes: Sequence[str], pieces_s: Floats, times_s: Floats) -> tuple[NDArray[np.int64], Floats]:
    """The number of the take that is danced at each of these times (...), and the time in it, in seconds.

    Examples
    --------
    >>> pieces_s = np.array([[0, 4, 10, 14], [4, 8, 0, 4]])
    >>> cg.metrics.structure.source_at(["b", "a"], pieces_s, np.array([1.0, 5.0]))
    (array([1, 0]), array([11.,  1.]))
    """
    rows = _checked_pieces(takes, pieces_s)
    piece = np.clip(np.searchsorted(rows[:, 0], times_s, side="right") - 1, 0, None)
    start, end, source_start, source_end = np.moveaxis(rows[piece], -1, 0)
    source_s = source_start + (times_s - start) / (end - start) * (source_end - source_start)
    return np.unique(list(takes), return_inverse=True)[1].astype(np.int64)[piece], source_s


def distinct_takes_per_minute(takes: Sequence[str], duration_s: float) -> float:
    """Number of different takes in the dance per minute. Higher is more varied.

    Examples
    --------
    >>> cg.metrics.structure.distinct_takes_per_minute(["a", "b", "a"], duration_s=30.0)
    4.0
    """
    if not (np.isfinite(duration_s) and duration_s > 0):
        raise ParameterError(f"expected a duration above 0 s, got {duration_s}")
    return len(set(takes)) * 60.0 / duration_s


def genre_share(genres: Sequence[str], lengths: ArrayLike, genre: str) -> float:
    """Share of the length of the parts (N,) that is of a genre, 0 to 1. Higher is better.

    Chance is the share of the genre in the repertoire, which is the same function of its takes and lengths.

    Examples
    --------
    >>> cg.metrics.structure.genre_share(["waltz", "salsa", "waltz"], [3.0, 1.0, 4.0], "waltz")
    0.875
    """
    length = np.asarray(lengths, np.float64)
    if length.shape != (len(genres),) or not np.isfinite(length).all() or (length < 0).any():
        raise ParameterError(f"expected a length of 0 or more for each of {len(genres)} parts, got {length}")
    total = float(length.sum())
    if total == 0.0:
        return float("nan")
    return float(length[np.array([name == genre for name in genres])].sum()) / total


def joint_distance_m(body_pos_m: Floats, other_pos_m: Floats, fps: float) -> float:
    """Mean distance of the joints of two dances (T, 21, 3) and (T', 21, 3) at the same time, in metres.

    It is 0 for the same dance. Each pose is first moved to heading 0 above the origin, so that the place on
    the stage does not matter. The longer dance is cut. Chance is the distance of one of the dances to the
    other, shifted in time.

    Examples
    --------
    >>> pos_m = np.random.default_rng(0).normal(size=(40, 21, 3))
    >>> moved_m = pos_m + [3.0, 0.0, 1.0]
    >>> round(cg.metrics.structure.joint_distance_m(pos_m, moved_m, 20.0), 6)
    0.0
    """
    one, other = (to_root_frame(body_pos_at(pos_m, fps, NET_FPS)) for pos_m in (body_pos_m, other_pos_m))
    n_frames = min(len(one), len(other))
    return float(np.linalg.norm(one[:n_frames] - other[:n_frames], axis=-1).mean())


def motifs_by_section(motifs: AnyInts, starts_s: Floats, section_bounds_s: Floats) -> list[AnyInts]:
    """The motifs that start in each section, S sequences.

    Examples
    --------
    >>> motifs, starts_s = np.array([7, 8, 9]), np.array([0.0, 1.0, 2.0])
    >>> cg.metrics.structure.motifs_by_section(motifs, starts_s, section_bounds_s=np.array([0.0, 2.0, 4.0]))
    [array([7, 8]), array([9])]
    """
    starts, bounds = np.asarray(starts_s, np.float64), np.asarray(section_bounds_s, np.float64)
    for name, times in (("motif starts", starts), ("section bounds", bounds)):
        if times.ndim != 1 or not np.isfinite(times).all() or (np.diff(times) <= 0).any():
            raise ParameterError(f"expected increasing, finite {name}, got an array {times.shape}")
    if len(starts) != len(motifs) or len(bounds) < 2:
        raise ParameterError(
            f"expected one start per motif and 2 or more bounds, got {len(starts)} starts for {len(motifs)} "
            f"motifs and {len(bounds)} bounds"
        )
    return np.split(np.asarray(motifs), np.searchsorted(starts, bounds))[1:-1]


def shared_motifs(sections: Sequence[AnyInts], n_motifs: int) -> Floats:
    """Similarity of the motif shares of any two sections, regardless of order: 1 - χ², (S, S) from 0 to 1.

    Examples
    --------
    >>> cg.metrics.structure.shared_motifs([np.array([0, 1]), np.array([1, 0]), np.array([2])], n_motifs=3)
    array([[1., 1., 0.],
           [1., 1., 0.],
           [0., 0., 1.]])
    """
    for section in sections:
        validate(section, n_motifs)
    shares = np.array([np.bincount(s, minlength=n_motifs) / max(1, len(s)) for s in sections])
    return 1.0 - chi_square_distance(shares[:, None], shares)


def motifs_in_step(sections: Sequence[AnyInts]) -> Floats:
    """Share of equal motifs at the same position of any two sections, (S, S) from 0 to 1.

    Positions are counted from the start of each section.

    Examples
    --------
    >>> cg.metrics.structure.motifs_in_step([np.array([0, 1]), np.array([0, 2])])
    array([[1. , 0.5],
           [0.5, 1. ]])
    """
    similarity = np.zeros((len(sections), len(sections)))
    for i, one in enumerate(sections):
        for j, other in enumerate(sections):
            n = min(len(one), len(other))
            similarity[i, j] = np.mean(one[:n] == other[:n]) if n else 0.0
    return similarity


def section_agreement(similarity: Floats, section_labels: Sequence[str] | AnyInts) -> float:
    """Similarity of sections with equal labels minus that of sections with different labels, -1 to 1.

    It is the mean of `similarity` (S, S) over pairs with equal labels, minus its mean over the other pairs.
    Higher is better. A dance that ignores the song scores 0 with any number of repeats, because 0 is the mean
    over all orders of the labels. The result is nan if all labels are different, or all are equal.

    Examples
    --------
    >>> motifs = [np.array([0, 1]), np.array([2, 3]), np.array([0, 1])]
    >>> similarity = cg.metrics.structure.motifs_in_step(motifs)
    >>> [cg.metrics.structure.section_agreement(similarity, labels) for labels in (list("ABA"), list("AAB"))]
    [1.0, -0.5]
    """
    similarity, labels = np.asarray(similarity, np.float64), np.asarray(section_labels)
    if similarity.shape != (len(labels), len(labels)) or not np.isfinite(similarity).all():
        raise ParameterError(f"expected similarities ({len(labels)}, {len(labels)}), got {similarity.shape}")
    one, other = np.triu_indices(len(labels), 1)
    pairs, equal = similarity[one, other], labels[one] == labels[other]
    if equal.all() or not equal.any():
        return float("nan")
    return float(pairs[equal].mean() - pairs[~equal].mean())


def repeat_f(found_ids: AnyInts, true_ids: AnyInts) -> float:
    """F-score of the pairs of counts that repeat each other, 0 to 1. Higher is better.

    Both arrays (Q,) have an id for each count of a song. Equal ids are the same music at the same place of
    its phrase. It equals `mir_eval.segment.pairwise` of one frame per count. The result is 1 if neither has a
    pair, and 0 if only one of them has.

    Examples
    --------
    >>> repeat_f = cg.metrics.structure.repeat_f
    >>> true_ids = np.array([0, 1, 2, 3, 0, 1, 2, 3])
    >>> repeat_f(true_ids, true_ids), repeat_f(np.array([0, 1, 2, 3, 0, 1, 4, 5]), true_ids)
    (1.0, 0.6666666666666666)
    """
    found, true = np.asarray(found_ids), np.asarray(true_ids)
    if found.ndim != 1 or found.shape != true.shape:
        raise ParameterError(f"expected ids (Q,) of the same counts, got {found.shape} and {true.shape}")
    one, other = np.triu_indices(len(true), 1)
    are_found, are_true = found[one] == found[other], true[one] == true[other]
    total = int(are_found.sum() + are_true.sum())
    return 2.0 * int((are_found & are_true).sum()) / total if total else 1.0


@default_numerics()
def evaluate(
    motifs: AnyInts,
    starts_s: Floats,
    takes: Sequence[str],
    pieces_s: Floats,
    *,
    template: Floats,
    transitions: Floats,
    section_bounds_s: Floats,
    section_labels: Sequence[str] | AnyInts,
) -> dict[str, float]:
    """All metrics of this module by name.

    Examples
    --------
    >>> scores = cg.metrics.structure.evaluate(
    ...     np.array([0, 1, 0, 1]), np.arange(4.0), ["a"], np.array([[0.0, 4.0, 0.0, 4.0]]),
    ...     template=np.array([0.5, 0.5]), transitions=np.array([[0.0, 1.0], [1.0, 0.0]]),
    ...     section_bounds_s=np.array([0.0, 2.0, 4.0]), section_labels=["A", "A"],
    ... )
    >>> scores["signature_distance"], scores["transition_bits"] == 0, scores["longest_repeat_motifs"]
    (0.0, True, 2.0)
    """
    sections = motifs_by_section(motifs, starts_s, section_bounds_s)
    rows = _checked_pieces(takes, pieces_s)
    return {
        "signature_distance": signature_distance(motifs, template),
        "transition_bits": transition_bits(motifs, transitions),
        "transition_bits_chance": transition_chance_bits(motifs, transitions),
        "section_agreement": section_agreement(shared_motifs(sections, len(template)), section_labels),
        "section_agreement_in_step": section_agreement(motifs_in_step(sections), section_labels),
        "longest_repeat_motifs": float(longest_repeat(motifs)),
        "longest_repeat_s": longest_repeat_s(takes, pieces_s),
        "distinct_takes_per_minute": distinct_takes_per_minute(takes, rows[-1, 1] - rows[0, 0]),
    }


def _n_grams(motifs: AnyInts, n: int) -> list[tuple[int, ...]]:
    """The runs of `n` consecutive motifs of a sequence (N,), in order."""
    if not is_whole(n) or n < 1:
        raise ParameterError(f"expected runs of 1 motif or more, got n = {n!r}")
    validate(motifs, int(np.max(motifs, initial=0)) + 1)
    sequence = np.asarray(motifs).tolist()
    return [tuple(sequence[first : first + n]) for first in range(len(sequence) - n + 1)]


def _n_grams_of_takes(takes: Sequence[AnyInts], n: int) -> set[tuple[int, ...]]:
    return {run for take in takes for run in _n_grams(take, n)}


def _bits(transitions: Floats) -> Floats:
    """Surprisal of every transition, (K, K)."""
    table = np.asarray(transitions, np.float64)
    if table.ndim != 2 or table.shape[0] != table.shape[1] or not ((table >= 0) & (table <= 1)).all():
        raise ParameterError(f"expected transition probabilities (K, K), got an array {table.shape}")
    with np.errstate(divide="ignore"):
        return -np.log2(table)


def _longest_diagonal(same: NDArray[np.bool_], *, first_lag: int = 1) -> int:
    """Length of the longest run in a self-similarity matrix (N, N) whose repeat starts after the run ends."""
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
        raise ParameterError(
            f"expected finite pieces ({len(takes)}, 4) in seconds, got an array {rows.shape}"
        )
    if (np.diff(rows[:, 0]) <= 0).any() or (rows[:, 1] <= rows[:, 0]).any():
        raise ParameterError("expected pieces in the order of the dance, each ending after its start")
    return rows


# Phrases that return: whether a dance returns with the phrases of its song, and differs between them.


N_INSTANTS = 64  # at which two phrases are compared, four a count in a phrase of four bars of four
SAME_FIGURE_S = 0.25  # two moments of a take that are closer are the same figure

Labels = Sequence[str] | AnyInts


def validate_phrases(phrases_s: Floats, labels: Labels) -> None:
    """Raise `ParameterError` unless these are phrases (P, 2) in order, and a label for each.

    Examples
    --------
    >>> cg.metrics.structure.validate_phrases(np.array([[0.0, 8.0], [8.0, 16.0]]), ["A", "B"])
    >>> cg.metrics.structure.validate_phrases(np.array([[0.0, 8.0], [8.0, 8.0]]), ["A", "B"])
    Traceback (most recent call last):
        ...
    choreograph.core.errors.ParameterError: expected phrases in order, each ending after its start
    """
    spans = np.asarray(phrases_s, np.float64)
    if spans.shape != (len(labels), 2) or len(labels) == 0 or not np.isfinite(spans).all():
        raise ParameterError(f"expected finite phrases ({len(labels)}, 2), got an array {spans.shape}")
    if (spans[:, 1] <= spans[:, 0]).any() or (spans[1:, 0] < spans[:-1, 1] - 1e-9).any():
        raise ParameterError("expected phrases in order, each ending after its start")


def pose_distances_m(body_pos_m: Floats, fps: float, phrases_s: Floats) -> Floats:
    """Mean distance of the joints at the same instants of any two phrases, (P, P) in metres.

    `body_pos_m` (T, 21, 3) are the body joints of the dance. Instants after the end of the dance are compared
    by its last pose.

    Examples
    --------
    >>> low, high = np.zeros((2, 60, 21, 3))
    >>> low[:, 1, 0], low[:, 2, 0], high[:] = 0.1, -0.1, low[:]  # the hips, which give the heading
    >>> high[:, 20, 1] = 2.1  # one joint of 21 is higher
    >>> dance = np.concatenate([low, high, low])
    >>> phrases_s = np.array([[0.0, 1.0], [1.0, 2.0], [2.0, 3.0]])
    >>> cg.metrics.structure.pose_distances_m(dance, 60.0, phrases_s).round(1)[0].tolist()
    [0.0, 0.1, 0.0]
    """
    spans = np.asarray(phrases_s, np.float64)
    validate_phrases(spans, np.arange(len(spans)))
    pose_m = to_root_frame(checked_body_pos_m(body_pos_m, fps))  # (T, 21, 3)
    frames = np.clip(np.rint(_instants_s(spans) * fps).astype(np.int64), 0, len(pose_m) - 1)  # (P, I)
    of_phrases = pose_m[frames]  # (P, I, 21, 3)
    return np.stack(
        [np.linalg.norm(of_phrases - one, axis=-1).mean(axis=(1, 2)) for one in of_phrases]
    )  # one row at a time, for memory


def same_shares(takes: Sequence[str], pieces_s: Floats, phrases_s: Floats) -> Floats:
    """Share of the instants at which two phrases are at the same moment of the same take, (P, P), 0 to 1.

    Examples
    --------
    >>> pieces_s = np.array([[0, 4, 10, 14], [4, 8, 0, 4], [8, 12, 10, 14]])
    >>> phrases_s = np.array([[0.0, 4.0], [4.0, 8.0], [8.0, 12.0]])
    >>> cg.metrics.structure.same_shares(["a", "b", "a"], pieces_s, phrases_s)[0].tolist()
    [1.0, 0.0, 1.0]
    """
    spans = np.asarray(phrases_s, np.float64)
    validate_phrases(spans, np.arange(len(spans)))
    take, source_s = source_at(takes, pieces_s, _instants_s(spans))  # (P, I)
    same = (take[:, None] == take) & (np.abs(source_s[:, None] - source_s) <= SAME_FIGURE_S)
    shares: Floats = same.mean(axis=2)
    return shares


def shared_between_sections(
    takes: Sequence[str], pieces_s: Floats, phrases_s: Floats, labels: Labels
) -> float:
    """Share of the instants whose moment of a take is danced in a phrase with another label, too, 0 to 1.

    It may be danced there at any place. Lower is more varied.

    Examples
    --------
    >>> pieces_s = np.array([[0, 4, 10, 14], [4, 8, 0, 4], [8, 12, 12, 16]])
    >>> phrases_s = np.array([[0.0, 4.0], [4.0, 8.0], [8.0, 12.0]])
    >>> shared = cg.metrics.structure.shared_between_sections
    >>> [round(shared(["a", "b", "a"], pieces_s, phrases_s, labels), 1) for labels in ("ABA", "ABC")]
    [0.0, 0.4]
    """
    validate_phrases(phrases_s, labels)
    take, source_s = (x.ravel() for x in source_at(takes, pieces_s, _instants_s(np.asarray(phrases_s))))
    label = np.repeat(_numbered(labels), N_INSTANTS)
    same = (take[:, None] == take) & (np.abs(source_s[:, None] - source_s) <= SAME_FIGURE_S)
    return float((same & (label[:, None] != label)).any(axis=1).mean())


def return_mean(values: Floats, labels: Labels) -> float:
    """Mean of `values` (P, P) over the phrases that return, each with the first phrase of its label.

    The result is nan if no phrase returns.

    Examples
    --------
    >>> values = np.array([[0.0, 3.0, 1.0], [3.0, 0.0, 3.0], [1.0, 3.0, 0.0]])
    >>> returns = cg.metrics.structure
    >>> returns.return_mean(values, "ABA"), returns.other_mean(values, "ABA")
    (1.0, 3.0)
    """
    table, number = _checked_pairs(values, labels)
    first = np.array([number.tolist().index(label) for label in number])
    again = np.flatnonzero(first < np.arange(len(number)))
    return float(table[again, first[again]].mean()) if len(again) else float("nan")


def other_mean(values: Floats, labels: Labels) -> float:
    """Mean of `values` (P, P) over all pairs of phrases with different labels. It is nan if there are none.

    It is what `return_mean` would be by chance, of a dance that does not depend on the form.

    Examples
    --------
    >>> cg.metrics.structure.other_mean(np.array([[0.0, 3.0], [3.0, 0.0]]), "AB")
    3.0
    """
    table, number = _checked_pairs(values, labels)
    differ = number[:, None] != number
    return float(table[differ].mean()) if differ.any() else float("nan")


@default_numerics()
def evaluate_returns(
    body_pos_m: Floats,
    fps: float,
    takes: Sequence[str],
    pieces_s: Floats,
    *,
    phrases_s: Floats,
    labels: Labels,
) -> dict[str, float]:
    """The metrics of phrases that return, by name.

    Examples
    --------
    >>> still = np.zeros((180, 21, 3))
    >>> still[:, 1, 0], still[:, 2, 0] = 0.1, -0.1
    >>> scores = cg.metrics.structure.evaluate_returns(
    ...     still, 60.0, ["a", "b", "a"], np.array([[0, 1, 5, 6], [1, 2, 0, 1], [2, 3, 5, 6]]),
    ...     phrases_s=np.array([[0.0, 1.0], [1.0, 2.0], [2.0, 3.0]]), labels="ABA",
    ... )
    >>> scores["returned_share"], scores["returned_share_chance"]
    (1.0, 0.0)
    """
    validate_phrases(phrases_s, labels)
    distances_m = pose_distances_m(body_pos_m, fps, phrases_s)
    shares = same_shares(takes, pieces_s, phrases_s)
    returned_m, others_m = return_mean(distances_m, labels), other_mean(distances_m, labels)
    return {
        "return_distance_m": returned_m,
        "other_distance_m": others_m,
        "return_distance_ratio": returned_m / others_m if others_m > 0 else float("nan"),
        "returned_share": return_mean(shares, labels),
        "returned_share_chance": other_mean(shares, labels),
        "shared_between_sections": shared_between_sections(takes, pieces_s, phrases_s, labels),
    }


def _instants_s(phrases_s: Floats) -> Floats:
    """The instants (P, I) at which phrases are compared."""
    shares = (np.arange(N_INSTANTS) + 0.5) / N_INSTANTS
    instants_s: Floats = phrases_s[:, :1] + shares * (phrases_s[:, 1:] - phrases_s[:, :1])
    return instants_s


def _numbered(labels: Labels) -> NDArray[np.int64]:
    """Labels (P,) as numbers."""
    return np.unique(list(labels), return_inverse=True)[1].astype(np.int64)


def _checked_pairs(values: Floats, labels: Labels) -> tuple[Floats, NDArray[np.int64]]:
    """Values (P, P) of pairs of phrases, and the numbers of the labels."""
    table = np.asarray(values, np.float64)
    if table.shape != (len(labels), len(labels)) or len(labels) == 0 or not np.isfinite(table).all():
        raise ParameterError(f"expected finite values ({len(labels)}, {len(labels)}), got {table.shape}")
    return table, _numbered(labels)
