"""Which motif comes when: drawn so that transitions and signature are the genre's, around what is pinned.

Rhythm is a Dancer, section 4.3. Equation 5 reads, component by component, p_{k+1} = |s_k - s_G| · T_j: s_k
the signature of the dance so far, s_G the one it should have, T_j the row of the transition matrix of the
motif danced last, · the product of components, the whole scaled to sum to 1. Taken by the letter, a motif
danced too often is as likely as one danced too seldom, against the text, which raises "the probability of
missing motifs"; so the part of the difference that is missing, max(s_G - s_k, 0), is our default (`need`).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np
from numpy.typing import NDArray

from choreograph.errors import ParameterError
from choreograph.motifs.signatures import checked_signature

Floats = NDArray[np.float64]

NEEDS = ("missing", "absolute")
_LEAP = 1e-9  # chance of a step that no dance has, looking ahead: for pins that leave no other way
_DEAD_END = 1e-7  # wanted motifs of so small a share of what can follow lead to a pin by leaps only


def draw_motifs(
    n_words: int,
    signature: Floats,
    transitions: Floats,
    *,
    rng: np.random.Generator,
    pins: Mapping[int, int] | None = None,
    banned: Collection[int] = (),
    need: str = "missing",
) -> NDArray[np.int64]:
    """A dance of `n_words` motifs, (N,).

    Parameters
    ----------
    signature : float array (K,)       shares wanted, s_G
    transitions : float array (K, K)   row i: what follows motif i
    pins : position -> motif           held exactly; pinning all positions re-creates a given dance
    banned : motifs that must not occur
    need : "missing" or "absolute": how equation 5's difference is read, see above

    Each motif is drawn by equation 5 times the probability that the transitions lead from it to the next
    pin in the steps that are left (backward messages, one a position), so that a gap is filled with a way
    that dancers take wherever there is one. Pinned motifs count as danced from the start: the rest of the
    signature is left to the gaps. Where no wanted motif can follow, any that can follow may; where none
    can, because pins or bans contradict the transitions, any that is allowed.

    Raises `ParameterError` if shapes disagree, the signature or a row does not sum to 1, a pin lies
    outside the dance, a pin or ban names an unknown motif, a pinned motif is banned, or all are.
    """
    n_motifs = len(np.atleast_1d(signature))
    target = checked_signature(signature, n_motifs)
    steps = _checked_transitions(transitions, n_motifs)
    if n_words < 0 or need not in NEEDS:
        raise ParameterError(
            f"expected 0 words or more and a need among {', '.join(NEEDS)}, got {n_words} and {need!r}"
        )
    pins = dict(pins or {})
    allowed = _allowed(n_motifs, pins, banned, n_words)
    ahead = _ahead(n_words, (1.0 - _LEAP) * steps + _LEAP / n_motifs, pins, allowed)
    counts = np.bincount(list(pins.values()), minlength=n_motifs).astype(np.float64)
    motifs = np.empty(n_words, np.int64)
    for position in range(n_words):
        if position in pins:
            motifs[position] = pins[position]
            continue
        follows = steps[motifs[position - 1]] if position else target
        likely = follows * ahead[position] * allowed
        wanted = likely * _need(counts, target, need)
        if wanted.sum() > _DEAD_END * likely.sum():
            chances = wanted
        else:
            chances = likely if likely.sum() > 0 else ahead[position] * allowed
        motifs[position] = rng.choice(n_motifs, p=chances / chances.sum())
        counts[motifs[position]] += 1
    return motifs


def _need(counts: Floats, target: Floats, need: str) -> Floats:
    """How much each motif is wanted, (K,), of how often each was danced (K,)."""
    missing = target - counts / max(1.0, counts.sum())
    return np.maximum(missing, 0.0) if need == "missing" else np.abs(missing)


def _ahead(n_words: int, steps: Floats, pins: Mapping[int, int], allowed: NDArray[np.bool_]) -> Floats:
    """Likelihood (N, K) that the transitions lead from each motif at a position to all later pins.

    Scaled so that the largest of a position is 1; all ones after the last pin.
    """
    n_motifs = len(steps)
    ahead = np.ones((n_words, n_motifs))
    for position in range(max(pins, default=0) - 1, -1, -1):
        if position + 1 in pins:
            way = steps[:, pins[position + 1]] * ahead[position + 1, pins[position + 1]]
        else:
            way = steps @ (ahead[position + 1] * allowed)
        ahead[position] = way / way.max()
    return ahead


def _allowed(
    n_motifs: int, pins: Mapping[int, int], banned: Collection[int], n_words: int
) -> NDArray[np.bool_]:
    """Which motifs may be drawn, (K,)."""
    for motif in (*pins.values(), *banned):
        if not 0 <= motif < n_motifs:
            raise ParameterError(f"expected motifs 0 to {n_motifs - 1}, got motif {motif}")
    for position, motif in pins.items():
        if not 0 <= position < n_words:
            raise ParameterError(
                f"expected pins at words 0 to {n_words - 1} of the dance, got one at word {position}"
            )
        if motif in banned:
            raise ParameterError(f"motif {motif} is pinned at word {position} and banned: give up one")
    allowed = np.ones(n_motifs, bool)
    allowed[list(banned)] = False
    if not allowed.any():
        raise ParameterError(f"expected a motif that is not banned, got all {n_motifs} banned")
    return allowed


def _checked_transitions(transitions: Floats, n_motifs: int) -> Floats:
    steps = np.asarray(transitions, np.float64)
    if steps.shape != (n_motifs, n_motifs):
        raise ParameterError(f"expected transitions ({n_motifs}, {n_motifs}), got {steps.shape}")
    if not (np.isfinite(steps).all() and (steps >= 0).all() and np.allclose(steps.sum(axis=1), 1.0)):
        raise ParameterError("expected rows of transitions of 0 or more that sum to 1, got others")
    return steps
