"""Casting: which takes are wanted in which phrase of the music, so that a dance does not stay with one.

Ours, not the paper's: its cheapest path likes best to play one long take on and on.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

PHRASE_BEATS = 16  # two bars of eight counts, what a teacher calls a phrase
_PHRASE_S = (6.0, 12.0)  # a phrase lasts at least and at most this long, whatever the tracker hears
_CAST = 6  # takes in a phrase: fewer vary more, but fit the beat less
_REST = 2.0  # standard deviations of style that a take just danced falls back by
_FORGET = 0.75  # of that is left after each further phrase
_WHIM = 0.3  # standard deviations of style left to the seed


def phrase_of_seconds(beat_times_s: NDArray[np.floating], n_seconds: int) -> NDArray[np.int64]:
    """The phrase that each second of a song belongs to, (S,), from 0 without a gap.

    A phrase is 16 beats, halved or doubled until it lasts from 6 to 12 s; without beats it is 8 s.
    """
    phrase_s = 8.0
    first_s = 0.0
    if len(beat_times_s) > 1:
        phrase_s = PHRASE_BEATS * float(np.median(np.diff(beat_times_s)))
        while phrase_s > _PHRASE_S[1]:
            phrase_s /= 2
        while phrase_s < _PHRASE_S[0]:
            phrase_s *= 2
        first_s = float(beat_times_s[0])
    phrases = np.floor((np.arange(n_seconds) + 0.5 - first_s) / phrase_s).astype(np.int64)
    return np.unique(phrases, return_inverse=True)[1]


def cast_takes(
    take_loss: NDArray[np.floating], phrase: NDArray[np.integer], *, rng: np.random.Generator
) -> NDArray[np.bool_]:
    """Takes wanted in each second.

    Parameters
    ----------
    take_loss : float array (S, takes)   style loss of each take's best clip; inf for one without clips
    phrase : int array (S,)              phrase of each second, as `phrase_of_seconds` gives it

    Returns
    -------
    bool array (S, takes); in every phrase the same six (or all, if there are fewer):
    those of the nearest style, where one danced lately stands back for the others.
    """
    usable = np.isfinite(take_loss).all(axis=0)
    n_cast = min(int(usable.sum()), _CAST)
    cast = np.zeros(take_loss.shape, bool)
    if n_cast == 0:
        return cast
    spread = max(float(np.std(take_loss[:, usable])), 1e-9)
    tiredness = np.zeros(take_loss.shape[1])
    for number in range(int(phrase.max()) + 1):
        seconds = np.flatnonzero(phrase == number)
        loss = np.where(usable, take_loss[seconds].mean(axis=0) / spread, np.inf)
        loss = loss + _REST * tiredness + _WHIM * rng.normal(size=len(loss))
        chosen = np.argsort(loss, kind="stable")[:n_cast]
        cast[np.ix_(seconds, chosen)] = True
        tiredness *= _FORGET
        tiredness[chosen] += 1.0
    return cast
