"""Beat tracking of music whose tempo may change: tempo and beats are tracked together.

librosa's tracker assumes one tempo for the whole song and loses a ramp from 90 to 140 BPM half-way.
Here every interval may differ a little from the one before, guided by the local autocorrelation of the
onsets: dynamic programming over beat time and interval, after Ellis, *Beat tracking by dynamic
programming*, 2007, with the interval as part of the state. Where another piece of music begins, as in a
medley, the interval may become any other at a fixed price.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from choreograph.errors import ParameterError
from choreograph.features._kernels import best_beat_sequence
from choreograph.features.mel import MEL_BANDS, mel_band_hz
from choreograph.features.onsets import autocorrelations
from choreograph.timebase import MUSIC_FPS, frames_to_seconds

_SHORTEST_PERIOD, _LONGEST_PERIOD = 15, 80  # frames between beats at 60 fps: 240 to 45 BPM
_BANDS_HZ = (0.0, 120.0, 250.0, 2000.0, 11025.0)  # kick, bass, melody, percussion
_BAND_WEIGHTS = (0.4, 0.2, 0.2, 0.2)  # the kick decides which of two even pulses is the beat
_LEVEL_S = 8.0  # span of the local level normalisation
_COMPRESSION = 0.6  # exponent of the strength: a loud accent need not be a beat
_CONTEXT_S = 8.0  # length of music that the local tempo is estimated from
_TEMPO_HOP = 30  # frames between two tempo estimates
_TEMPO_WEIGHT = 1.5  # of the autocorrelation, relative to the onset strength at the beats
_CHANGE_PENALTY = 1000.0
# Of any other tempo. Up to 75, breaks look like new music; from 600 on, new music is missed.
_NEW_TEMPO_PENALTY = 250.0
# The tempo prior decides between octaves.
_PRIOR_BPM, _PRIOR_OCTAVES = 112.0, 0.7
# Delay of the peak of the amplitude rise: 11 ms in the median (spread 6) over mixed songs of eleven genres
# whose beats are known to the sample; for a single kick or click it is between 1 ms and -7 ms.
_LAG_S = 0.011


def tempo_path_beats(log_mel: NDArray[np.floating]) -> NDArray[np.float64]:
    """Beats in seconds, (Q,), throughout a song; empty if it is silent.

    `log_mel` (T, 96) as `features.mel.log_mel` returns it. Settings were tuned on synthetic drum
    loops and on real songs of known dance tempo, none of them from a benchmark. Raises
    `ParameterError` for another shape.
    """
    log_mel = np.asarray(log_mel, np.float32)
    if log_mel.ndim != 2 or log_mel.shape[1] != MEL_BANDS or len(log_mel) == 0:
        raise ParameterError(f"expected log-mel (T, {MEL_BANDS}), got an array of shape {log_mel.shape}")
    return np.maximum(0.0, path_of(onset_strength(log_mel)) - _LAG_S)


def path_of(strength: NDArray[np.floating]) -> NDArray[np.float64]:
    """Beats in seconds, (Q,), at which a strength (T,) at 60 fps peaks; empty if it is 0 throughout."""
    level = np.asarray(strength, np.float64)
    if not level.any():
        return np.zeros(0)
    frames = best_beat_sequence(
        level, _tempo_gain(level), _TEMPO_HOP, _SHORTEST_PERIOD, _CHANGE_PENALTY, _NEW_TEMPO_PENALTY
    )
    return frames_to_seconds(frames, MUSIC_FPS)


def onset_strength(log_mel: NDArray[np.floating]) -> NDArray[np.float64]:
    """Onset strength: rise of amplitude in four bands, level-normalised over 8 s, summed: (T,) at 60 fps.

    Amplitude rather than its logarithm: in the logarithm an open hat or a bass note between the beats
    rises as much as the kick on them, and the tracker slips by half a period.
    """
    hz = mel_band_hz()
    total = np.zeros(len(log_mel))
    for low, high, weight in zip(_BANDS_HZ, _BANDS_HZ[1:], _BAND_WEIGHTS, strict=False):
        amplitude = np.sqrt(np.exp(log_mel[:, (hz >= low) & (hz < high)]).sum(axis=1, dtype=np.float64))
        rise = np.zeros(len(log_mel))
        rise[2:] = np.maximum(0.0, amplitude[2:] - amplitude[:-2])
        rise[rise < 1e-3 * rise.max(initial=0.0)] = 0.0  # noise in a pause is not an onset
        total += weight * level_normalized(rise)
    return level_normalized(total) ** _COMPRESSION


def level_normalized(strength: NDArray[np.floating]) -> NDArray[np.float64]:
    """Onset strength (T,) over its local RMS (8 s), which is floored at a tenth of the song's RMS."""
    from scipy.ndimage import uniform_filter1d

    power = np.asarray(strength, np.float64) ** 2
    local = uniform_filter1d(power, round(_LEVEL_S * MUSIC_FPS), mode="nearest")
    return strength / np.sqrt(np.maximum(np.maximum(local, 0.01 * power.mean()), 1e-20))


def _tempo_gain(strength: NDArray[np.float64]) -> NDArray[np.float64]:
    """Score of each period beside the onsets, (G, P): weighted autocorrelation plus the log tempo prior."""
    periods = np.arange(_SHORTEST_PERIOD, _LONGEST_PERIOD + 1)
    centres = np.arange(0, len(strength), _TEMPO_HOP)
    autocorrelation = autocorrelations(strength[:, None], centres, _CONTEXT_S)[:, 0, periods]  # (G, P)
    octaves = np.log2(60.0 * MUSIC_FPS / periods / _PRIOR_BPM)
    return _TEMPO_WEIGHT * autocorrelation - 0.5 * (octaves / _PRIOR_OCTAVES) ** 2
