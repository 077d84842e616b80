"""Audio input of the rollout network: rhythm per frame and spectral features per motion word."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from choreograph.audio.song import Song
from choreograph.features.frame_rhythm import FRAME_RHYTHM_FPS, frame_rhythm
from choreograph.features.spectral import spectral_features
from choreograph.progress import StepReport
from choreograph.timebase import seconds_to_frames


def rhythm_from(song: Song, beat_times_s: NDArray[np.float64], start_s: float) -> NDArray[np.float32]:
    """The four rhythmic features (T, 4) at 30 fps from a time in the song on; at least one row.

    Before the song's start the first row is repeated.
    """
    rhythm = frame_rhythm(song.samples, beat_times_s)
    first = seconds_to_frames(start_s, FRAME_RHYTHM_FPS)
    if first < 0:
        return np.concatenate([np.repeat(rhythm[:1], -first, axis=0), rhythm])
    return rhythm[min(first, len(rhythm) - 1) :]


def word_spectra(
    song: Song, bounds_s: NDArray[np.float64], *, report: StepReport | None = None
) -> NDArray[np.float32]:
    """The 87 spectral features of the music of each word, (N, 87), for word boundaries (N + 1,) in seconds.

    A word outside the song gets the features of the nearest one inside.
    """
    inside = np.unique(np.clip(bounds_s, 0.0, song.duration_s))
    if len(inside) < 2:
        inside = np.array([0.0, song.duration_s])
    rows = spectral_features(song.samples, inside, report=report)
    middles = (bounds_s[1:] + bounds_s[:-1]) / 2
    return rows[(np.searchsorted(inside, middles, side="right") - 1).clip(0, len(rows) - 1)]
