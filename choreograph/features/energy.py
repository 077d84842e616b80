"""Energy of a song: how loud each second is among its seconds, which is what dancers follow."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from choreograph.timebase import SAMPLE_RATE_HZ

_SPAN_S = 5  # of the moving median: phrases, not beats, bangs or breaths
_SILENT_DB = 60.0  # so far below the loudest second there is no sound
_RANGE_DB = 6.0  # the break of a mastered song is 4 to 6 dB below its chorus


def energy_per_second(samples: NDArray[np.floating], n_seconds: int) -> NDArray[np.float32]:
    """Energy (S,) of each second of a song, mono at 22.05 kHz: 1 at its loud level, 0 at 6 dB below or less.

    Its loud level is the 90th percentile of the seconds with sound, so that one bang does not make everything
    else soft. Silent seconds have energy 0.
    """
    n_samples = min(len(samples), n_seconds * SAMPLE_RATE_HZ)
    power = np.zeros(n_seconds)
    for second in range(n_seconds):
        padded = np.zeros(SAMPLE_RATE_HZ)
        part = samples[second * SAMPLE_RATE_HZ : min((second + 1) * SAMPLE_RATE_HZ, n_samples)]
        padded[: len(part)] = part
        power[second] = np.square(padded).mean()
    if n_seconds > 1 and n_samples < n_seconds * SAMPLE_RATE_HZ:  # the last second is not full
        power[-1] *= SAMPLE_RATE_HZ / max(1, n_samples - (n_seconds - 1) * SAMPLE_RATE_HZ)
    if not power.any():
        return np.zeros(n_seconds, np.float32)
    level_db = 10.0 * np.log10(median_filter(power, _SPAN_S, mode="nearest") + 1e-12)
    sounding = level_db > level_db.max() - _SILENT_DB
    energy = 1.0 + (level_db - np.percentile(level_db[sounding], 90)) / _RANGE_DB
    return np.clip(energy, 0.0, 1.0).astype(np.float32)
