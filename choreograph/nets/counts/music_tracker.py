"""Beats of a song by the network, and by the tempo path over what it hears where its phases are not sure.

The bar pointer takes the level from the phases: it keeps a salsa at 180 BPM, which a prior on tempi would
halve. Where phases agree badly with the decoded beats, as in music unlike all it was trained on, that
freedom errs by thirds and halves, and the tempo path with its prior is the better reader of the activation.
It reads the onsets beside it: of the activation alone, a rumba was heard at 4/3 of its tempo for a third of
the song.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from choreograph.audio.song import Song
from choreograph.features.bar_pointer import PointerConfig, decode_counts
from choreograph.features.tempo_path import level_normalized, onset_strength, path_of
from choreograph.nets.counts.music_model import CURVE_FPS, MusicCounts, MusicCurves
from choreograph.nets.counts.music_weights import shipped_music_counts
from choreograph.timebase import MUSIC_FPS

Floats = NDArray[np.float64]

POINTER = PointerConfig(bpm=(45.0, 240.0), grid_fps=60.0)
# Mean cosine between phases and beats, below which the tempo path is asked: fitted by
# `examples/papers/fit_music_agreement.py` to songs of genres that the networks had not heard.
LEAST_AGREEMENT = 0.75
_MIN_DURATION_S = 1.0
_SLIP_BEATS = 5  # fewer at another tempo are no passage
_SLIP_SHARE = 1 / 3  # of the song
_SAME_TEMPO_OCTAVES = 0.06
_LATE_FRAMES = 1  # onsets come 11 ms after the beat, the activation on it
_LEAST_CONTRAST = 0.1  # nats between the loudest and the quietest frame: less is silence
_DIED_AWAY = 7.0  # nats below the loudest frame, 30 dB: from the last louder one on, the beat just goes on


class NetworkBeats:
    """A `features.music_beats.BeatTracker`."""

    def __init__(self, net: MusicCounts | None = None) -> None:
        self.net = net or shipped_music_counts()

    def beats(self, song: Song, log_mel: NDArray[np.floating]) -> Floats:
        """The song's beats, (Q,) seconds; none in a song shorter than a second or silent."""
        beats_s = network_beats(log_mel, self.net)
        return beats_s[beats_s < song.duration_s]


def network_beats(log_mel: NDArray[np.floating], net: MusicCounts) -> Floats:
    """Beats in seconds, (Q,), of log-mel (T, 96); `ParameterError` for another shape."""
    curves = net.curves(log_mel)
    level = np.asarray(log_mel).max(axis=1)  # (T,)
    if len(level) < _MIN_DURATION_S * MUSIC_FPS or np.ptp(level) < _LEAST_CONTRAST:
        return np.zeros(0)
    ends = np.flatnonzero(level >= level.max() - _DIED_AWAY)[-1] * CURVE_FPS // MUSIC_FPS
    beats_s, agreement = decoded_beats(_without_phases_after(curves, int(ends)))
    return beats_s if agreement >= LEAST_AGREEMENT else activated_beats(curves, log_mel)


def _without_phases_after(curves: MusicCurves, frame: int) -> MusicCurves:
    """The curves, with phases of no concentration after a frame."""
    phases = curves.phases
    known = np.arange(len(phases.beat)) <= frame
    beat, bar = phases.beat * known[:, None], phases.bar * known[:, None, None]
    return replace(curves, phases=replace(phases, beat=beat, bar=bar))


def decoded_beats(curves: MusicCurves) -> tuple[Floats, float]:
    """Beats by the bar pointer, and the mean agreement of the phases with them, -1 … 1."""
    decoded = decode_counts(curves.phases, POINTER)
    known = curves.phases.beat.any(axis=1)
    return decoded.counts.times_s, float(decoded.beat_agreement[known].mean()) if known.any() else 0.0


def activated_beats(curves: MusicCurves, log_mel: NDArray[np.floating]) -> Floats:
    """Beats by the tempo path, with the activation beside the onsets of log-mel (T, 96)."""
    frames = np.arange(len(log_mel)) * CURVE_FPS / MUSIC_FPS
    activation = np.interp(frames, np.arange(len(curves.beat)), curves.beat)  # (T,)
    onsets = level_normalized(onset_strength(log_mel)[_LATE_FRAMES:])
    heard = level_normalized(activation)
    heard[: len(onsets)] += onsets
    return at_one_level(path_of(level_normalized(heard)))


def at_one_level(beats_s: Floats) -> Floats:
    """Beats (Q,) with passages at half of the tempo of most of the song brought to it, by beats between.

    A tracker slips there where the beat is hard to hear, as in a sparse introduction. Where more than a
    third of the song is slower, it is left: another piece of music may begin there.
    """
    periods_s = np.diff(beats_s)
    if len(periods_s) < _SLIP_BEATS:
        return beats_s
    steady = median_filter(periods_s, _SLIP_BEATS, mode="nearest")
    order = np.argsort(steady)
    half_of_the_time = np.searchsorted(np.cumsum(periods_s[order]), 0.5 * periods_s.sum())
    main_s = steady[order[half_of_the_time]]
    slipped = np.abs(np.log2(steady / main_s) - 1.0) < _SAME_TEMPO_OCTAVES
    if periods_s[slipped].sum() > _SLIP_SHARE * periods_s.sum():
        return beats_s
    between_s = 0.5 * (beats_s[:-1] + beats_s[1:])[slipped]
    return np.sort(np.concatenate([beats_s, between_s]))
