"""Bars of a song: which number each of its beats has, by what the music does there.

A linear model says how well each beat's evidence (`features.beat_evidence`) suits each of seven states: beat
1, 2, 3 of a bar of three, and 1, 2, 3, 4 of a bar of four. The best path through the states is the song's
bars: number follows number, save where the tracker has dropped or added a beat, where music begins with a
pick-up, or where the metre changes; each costs. Two in a bar is counted as four (two bars as one), six as
three (one bar as two): dancers do so, too.

The model was fitted to synthetic songs alone (`examples/papers/fit_bars.py`), so every real song is unseen.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from choreograph.counts import FROM_MUSIC, Counts
from choreograph.errors import ParameterError
from choreograph.features._bar_weights import ACCENT_WEIGHTS, CONFIDENCE, METRE_WEIGHTS
from choreograph.features.beat_evidence import beat_evidence
from choreograph.features.mel import MEL_BANDS
from choreograph.features.music_beats import checked_beat_times_s
from choreograph.timebase import SAMPLE_RATE_HZ

Floats = NDArray[np.float64]

_MIN_BEATS = 4  # one bar
STATE_METRE = np.array([3, 3, 3, 4, 4, 4, 4])
STATE_NUMBER = np.array([1, 2, 3, 1, 2, 3, 4])
_P_IRREGULAR = 1e-3  # a bar is cut short or goes on
_P_CHANGE = 1e-5  # the other metre follows a whole bar


def track_bars(
    samples: NDArray[np.floating], log_mel: NDArray[np.floating], beat_times_s: NDArray[np.floating]
) -> Counts:
    """The beats of a song numbered in their bars.

    Parameters
    ----------
    samples : float array (S,)        mono at 22.05 kHz, at any gain
    log_mel : float array (T, 96)     of the samples, as `features.mel.log_mel` returns it
    beat_times_s : float array (Q,)   increasing times inside the song

    Returns
    -------
    Counts   the beats with their numbers; metre 3 or 4, that of most beats (it may change on the way);
    confidence: probability that the bars are right, given that the beats are. Without bars (metre 0) if
    there are fewer than four beats or the song is silent

    Raises
    ------
    ParameterError   if `log_mel` is not (T, 96), or beats do not increase inside the song
    """
    log_mel = np.asarray(log_mel)
    if log_mel.ndim != 2 or log_mel.shape[1] != MEL_BANDS or len(log_mel) == 0:
        raise ParameterError(f"expected log-mel (T, {MEL_BANDS}), got an array of shape {log_mel.shape}")
    beats_s = checked_beat_times_s(np.asarray(beat_times_s), len(samples) / SAMPLE_RATE_HZ)
    if len(beats_s) < _MIN_BEATS:
        return _without_bars(beats_s)
    accents, repeats = beat_evidence(samples, log_mel, beats_s)
    if not accents.any():
        return _without_bars(beats_s)
    states, margin = best_bars(state_evidence(accents, repeats, ACCENT_WEIGHTS, METRE_WEIGHTS))
    metres = STATE_METRE[states]
    return Counts(
        beats_s,
        STATE_NUMBER[states],
        3 if (metres == 3).sum() > (metres == 4).sum() else 4,
        FROM_MUSIC,
        _confidence(margin, len(beats_s)),
    )


def _without_bars(beats_s: Floats) -> Counts:
    return Counts(beats_s, np.zeros(len(beats_s), np.int64), 0, FROM_MUSIC)


def state_evidence(accents: Floats, repeats: Floats, accent_weights: Floats, metre_weights: Floats) -> Floats:
    """Log evidence of each state at each beat, (Q, 7): beats 1, 2, 3 of three and 1, 2, 3, 4 of four."""
    for_three = repeats @ metre_weights[:-1] + metre_weights[-1]  # (Q,)
    return accents @ accent_weights + np.where(STATE_METRE == 3, for_three[:, None], -for_three[:, None])


def best_bars(evidence: Floats) -> tuple[NDArray[np.int64], float]:
    """The best path of states (Q,), and its log margin over the best that differs from it at every beat."""
    from scipy.special import softmax

    from choreograph.cached_librosa import librosa  # a second to import

    suits = softmax(evidence, axis=1).T  # (7, Q)
    transition = _transition()
    states, score = librosa.sequence.viterbi(suits, transition, return_logp=True)
    suits[states, np.arange(len(states))] = 0.0
    _, other = librosa.sequence.viterbi(suits, transition, return_logp=True)
    return states.astype(np.int64), float(np.squeeze(score - other))


def _transition() -> Floats:
    """Probabilities (7, 7) of going from state to state between two beats."""
    same_metre = STATE_METRE[:, None] == STATE_METRE
    last = STATE_NUMBER == STATE_METRE
    out = np.where(same_metre, _P_IRREGULAR, 0.0)
    out += np.where(~same_metre & last[:, None] & (STATE_NUMBER == 1), _P_CHANGE, 0.0)
    follows = same_metre & ((STATE_NUMBER % STATE_METRE + 1)[:, None] == STATE_NUMBER)
    out[follows] = 0.0
    out[follows] = 1.0 - out.sum(axis=1)
    return out


def _confidence(margin: float, n_beats: int) -> float:
    """Probability that bars are right: of noise the margin grows with the root of the number of beats."""
    offset, slope = CONFIDENCE
    return float(1.0 / (1.0 + np.exp(-(offset + slope * margin / np.sqrt(n_beats)))))
