"""Phrases that return: whether a dance returns with the phrases of its song, and differs between them.

Conventions: the phrases of a song are spans (P, 2) in seconds, in order, with labels (P,). Equal labels mean
the same music, count by count. Phrases are compared at equal shares of their length, which are equal counts
at a steady tempo. Poses are compared in the root frame, so that place and heading do not count. Pieces of
takes are those of `structure`. The form must be the true one, and not the one that the dance was planned
with. None of these metrics is from the papers. Input that does not fit raises `ParameterError`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import AnyInts, Floats, default_numerics
from choreograph.evaluation.metrics.structure import source_at
from choreograph.motion.body import checked_body_pos_m, to_root_frame

N_INSTANTS = 64  # at which two phrases are compared, four a count in a phrase of four bars of four
SAME_S = 0.25  # two moments of a take that are closer are the same figure

Labels = Sequence[str] | AnyInts


def validate(phrases_s: Floats, labels: Labels) -> None:
    """Raise `ParameterError` unless these are phrases (P, 2) in order, and a label for each.

    Examples
    --------
    >>> cg.metrics.phrase_returns.validate(np.array([[0.0, 8.0], [8.0, 16.0]]), ["A", "B"])
    >>> cg.metrics.phrase_returns.validate(np.array([[0.0, 8.0], [8.0, 8.0]]), ["A", "B"])
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
    >>> cg.metrics.phrase_returns.pose_distances_m(dance, 60.0, phrases_s).round(1)[0].tolist()
    [0.0, 0.1, 0.0]
    """
    spans = np.asarray(phrases_s, np.float64)
    validate(spans, np.arange(len(spans)))
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
    >>> cg.metrics.phrase_returns.same_shares(["a", "b", "a"], pieces_s, phrases_s)[0].tolist()
    [1.0, 0.0, 1.0]
    """
    spans = np.asarray(phrases_s, np.float64)
    validate(spans, np.arange(len(spans)))
    take, source_s = source_at(takes, pieces_s, _instants_s(spans))  # (P, I)
    same = (take[:, None] == take) & (np.abs(source_s[:, None] - source_s) <= SAME_S)
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
    >>> shared = cg.metrics.phrase_returns.shared_between_sections
    >>> [round(shared(["a", "b", "a"], pieces_s, phrases_s, labels), 1) for labels in ("ABA", "ABC")]
    [0.0, 0.4]
    """
    validate(phrases_s, labels)
    take, source_s = (x.ravel() for x in source_at(takes, pieces_s, _instants_s(np.asarray(phrases_s))))
    label = np.repeat(_numbered(labels), N_INSTANTS)
    same = (take[:, None] == take) & (np.abs(source_s[:, None] - source_s) <= SAME_S)
    return float((same & (label[:, None] != label)).any(axis=1).mean())


def return_mean(values: Floats, labels: Labels) -> float:
    """Mean of `values` (P, P) over the phrases that return, each with the first phrase of its label.

    The result is nan if no phrase returns.

    Examples
    --------
    >>> values = np.array([[0.0, 3.0, 1.0], [3.0, 0.0, 3.0], [1.0, 3.0, 0.0]])
    >>> returns = cg.metrics.phrase_returns
    >>> returns.return_mean(values, "ABA"), returns.other_mean(values, "ABA")
    (1.0, 3.0)
    """
    table, number = _checked(values, labels)
    first = np.array([number.tolist().index(label) for label in number])
    again = np.flatnonzero(first < np.arange(len(number)))
    return float(table[again, first[again]].mean()) if len(again) else float("nan")


def other_mean(values: Floats, labels: Labels) -> float:
    """Mean of `values` (P, P) over all pairs of phrases with different labels. It is nan if there are none.

    It is what `return_mean` would be by chance, of a dance that does not depend on the form.

    Examples
    --------
    >>> cg.metrics.phrase_returns.other_mean(np.array([[0.0, 3.0], [3.0, 0.0]]), "AB")
    3.0
    """
    table, number = _checked(values, labels)
    differ = number[:, None] != number
    return float(table[differ].mean()) if differ.any() else float("nan")


@default_numerics()
def evaluate(
    body_pos_m: Floats,
    fps: float,
    takes: Sequence[str],
    pieces_s: Floats,
    *,
    phrases_s: Floats,
    labels: Labels,
) -> dict[str, float]:
    """All metrics of this module by name.

    Examples
    --------
    >>> still = np.zeros((180, 21, 3))
    >>> still[:, 1, 0], still[:, 2, 0] = 0.1, -0.1
    >>> scores = cg.metrics.phrase_returns.evaluate(
    ...     still, 60.0, ["a", "b", "a"], np.array([[0, 1, 5, 6], [1, 2, 0, 1], [2, 3, 5, 6]]),
    ...     phrases_s=np.array([[0.0, 1.0], [1.0, 2.0], [2.0, 3.0]]), labels="ABA",
    ... )
    >>> scores["returned_share"], scores["returned_share_chance"]
    (1.0, 0.0)
    """
    validate(phrases_s, labels)
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


def _checked(values: Floats, labels: Labels) -> tuple[Floats, NDArray[np.int64]]:
    """Values (P, P) of pairs of phrases, and the numbers of the labels."""
    table = np.asarray(values, np.float64)
    if table.shape != (len(labels), len(labels)) or len(labels) == 0 or not np.isfinite(table).all():
        raise ParameterError(f"expected finite values ({len(labels)}, {len(labels)}), got {table.shape}")
    return table, _numbered(labels)
