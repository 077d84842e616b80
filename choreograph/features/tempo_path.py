"""Beats of music whose tempo may change: the tempo is followed together with the beats.

librosa's tracker holds one tempo for the whole song, so it loses a ramp from 90 to 140 BPM half-way;
this one lets every interval differ a little from the one before, guided by how strongly the onsets
repeat around each instant (a dynamic programme over beat instant and interval, after Ellis, *Beat
tracking by dynamic programming*, 2007, with the interval as part of the state).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from choreograph.errors import ParameterError
from choreograph.features._kernels import beat_chain
from choreograph.features.mel import MEL_BANDS, mel_band_hz
from choreograph.features.rhythm import autocorrelations
from choreograph.timebase import MUSIC_FPS, frames_to_seconds

_SHORTEST, _LONGEST = 15, 80  # frames between beats at 60 fps: 240 to 45 BPM
_BANDS_HZ = (0.0, 120.0, 250.0, 2000.0, 11025.0)  # kick, bass, melody, percussion
_BAND_WEIGHTS = (0.4, 0.2, 0.2, 0.2)  # the kick says which of two even pulses is the beat
_LEVEL_S = 8.0  # span over which loud and quiet passages are brought to one level
_COMPRESSION = 0.6  # of the strength: a loud accent is no proof that it is the beat
_CONTEXT_S = 8.0  # music around an instant that its tempo is heard in
_HOP = 30  # frames between two such instants
_TEMPO_WEIGHT = 1.5  # of the repetition, beside the strength of onsets under the beats
_CHANGE_PENALTY = 1000.0
# Between an octave's two readings the one nearer to a step's pace wins.
_PRIOR_BPM, _PRIOR_OCTAVES = 112.0, 0.7
# How late the rise of amplitude peaks: 11 ms (spread 6) in the median over mixed songs of eleven genres
# whose beats are known to the sample; of a bare kick or click it is 1 ms late to 7 ms early.
_LAG_S = 0.011


def tempo_path_beats(log_mel: NDArray[np.floating]) -> NDArray[np.float64]:
    """Beats in seconds, (Q,), from end to end of a song; empty if nothing sounds.

    `log_mel` (T, 96) as `features.mel.log_mel` gives it. Settings were chosen on planted drum loops
    and on real songs of known dance tempo, none of them a benchmark's. Raises `ParameterError` for
    another shape.
    """
    log_mel = np.asarray(log_mel, np.float32)
    if log_mel.ndim != 2 or log_mel.shape[1] != MEL_BANDS or len(log_mel) == 0:
        raise ParameterError(f"expected log-mel (T, {MEL_BANDS}), got an array of shape {log_mel.shape}")
    strength = onset_strength(log_mel)
    if not strength.any():
        return np.zeros(0)
    frames = beat_chain(strength, _tempo_gain(strength), _HOP, _SHORTEST, _CHANGE_PENALTY)
    return np.maximum(0.0, frames_to_seconds(frames, MUSIC_FPS) - _LAG_S)


def onset_strength(log_mel: NDArray[np.floating]) -> NDArray[np.float64]:
    """Rise of amplitude in four bands, each brought to one level over 8 s, summed: (T,) at 60 fps.

    Amplitudes rather than logarithms: in a logarithm an open hat or a bass note between the beats
    rises as high as the kick on them, and the beat slips half a period.
    """
    hz = mel_band_hz()
    total = np.zeros(len(log_mel))
    for low, high, weight in zip(_BANDS_HZ, _BANDS_HZ[1:], _BAND_WEIGHTS, strict=False):
        amplitude = np.sqrt(np.exp(log_mel[:, (hz >= low) & (hz < high)]).sum(axis=1, dtype=np.float64))
        rise = np.zeros(len(log_mel))
        rise[2:] = np.maximum(0.0, amplitude[2:] - amplitude[:-2])
        rise[rise < 1e-3 * rise.max(initial=0.0)] = 0.0  # noise in a pause is no onset
        total += weight * levelled(rise)
    return levelled(total) ** _COMPRESSION


def levelled(strength: NDArray[np.floating]) -> NDArray[np.float64]:
    """Onset strength (T,) over its root mean square in the 8 s around, at least a tenth of the song's."""
    from scipy.ndimage import uniform_filter1d

    power = np.asarray(strength, np.float64) ** 2
    local = uniform_filter1d(power, round(_LEVEL_S * MUSIC_FPS), mode="nearest")
    return strength / np.sqrt(np.maximum(np.maximum(local, 0.01 * power.mean()), 1e-20))


def _tempo_gain(strength: NDArray[np.float64]) -> NDArray[np.float64]:
    """What each period earns beside the onsets, (G, P): its repetition, and how near a step's pace it is."""
    periods = np.arange(_SHORTEST, _LONGEST + 1)
    centres = np.arange(0, len(strength), _HOP)
    repetition = autocorrelations(strength[:, None], centres, _CONTEXT_S)[:, 0, periods]  # (G, P)
    octaves = np.log2(60.0 * MUSIC_FPS / periods / _PRIOR_BPM)
    return _TEMPO_WEIGHT * repetition - 0.5 * (octaves / _PRIOR_OCTAVES) ** 2
