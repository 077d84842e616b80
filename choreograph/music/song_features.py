"""`SongFeatures`, the features of a song per second, with its energy and its tempo-density."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from choreograph.core.counts import Counts
from choreograph.core.progress import one_line
from choreograph.core.timebase import NET_FPS, SAMPLE_RATE_HZ, SEGMENT_FRAMES, frame_times_s
from choreograph.music.form import Form, Sections

# `SongFeatures`, the features of a song per second that the engines use for planning.


@dataclass(frozen=True, eq=False)
class SongFeatures:
    """Features of a song, which costs receive. S is its number of seconds, rounded up.

    Examples
    --------
    >>> class AsLoud(cg.Cost):
    ...     def node(self, layer, song_features):
    ...         return np.abs(layer.liveliness - song_features.energy[layer.second])
    >>> dance = cg.dance(cg.example_songs()["house"], duration_s=8, costs=[AsLoud()])
    >>> len(dance.plan.seconds)
    8
    """

    name: str
    duration_s: float
    counts: Counts  # the beats, numbered in their bars
    style: NDArray[np.float32]  # (S, 32) embedding of the 4 s from each second
    beat_count: NDArray[np.float32]  # (S,) motion beats expected in those 4 s
    density: NDArray[np.float32]  # (S, 80) target tempo-density of those 4 s, 20 fps
    sections: Sections
    energy: NDArray[np.float32]  # (S,) loudness, 0 … 1 from 6 dB below its loud level
    opening_s: float  # the first count that is danced. Before it the first pose is held
    closing_s: float  # the last count that is danced
    onset_density: NDArray[np.float32]  # (S,) of the 4 s from each second, as a rank in the song, 0 … 1
    off_beat: float = 1.0  # share of percussion that is between the beats: see `off_beat_share`
    form: Form = field(default_factory=Form.empty)  # its phrases, and which of them repeat others

    __repr__ = one_line

    @property
    def beat_times_s(self) -> NDArray[np.float64]:
        """The beats in seconds, (Q,)."""
        return self.counts.times_s

    @property
    def n_seconds(self) -> int:
        """Number of seconds S. The last may be shorter."""
        return len(self.style)


# Energy of a song: the loudness of each second relative to the others, which dancers follow.


_SPAN_S = 5  # of the moving median, which keeps phrases and removes beats, bangs and short pauses
_SILENT_DB = 60.0  # below the loudest second. Quieter seconds are silent
_RANGE_DB = 6.0  # the break of a mastered song is 4 to 6 dB below its chorus


def energy_per_second(samples: NDArray[np.floating], n_seconds: int) -> NDArray[np.float32]:
    """Energy (S,) of each second of a song, mono at 22.05 kHz: 1 at its loud level, 0 at 6 dB below or less.

    Its loud level is the 90th percentile of the seconds with sound, so that one bang does not lower the
    energy of all other seconds. Silent seconds have energy 0.
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
    per_second: NDArray[np.float32] = np.clip(energy, 0.0, 1.0).astype(np.float32)
    return per_second


# The analytic tempo-density, a Gaussian bump on every beat of the motion or of the music.
#
# It is the baseline and fallback for the learned one (`nets.density`). Both have the same two functions, one
# curve per take at 20 fps, and one per second of music for the 4 s from there.


BUMP_S = 0.08  # standard deviation of a bump


def bumps(times_s: NDArray[np.floating], beat_times_s: NDArray[np.floating]) -> NDArray[np.float32]:
    """The density at `times_s` (T,): 1 at every beat, falling towards 0 between beats."""
    if len(beat_times_s) == 0:
        return np.zeros(len(times_s), np.float32)
    after = np.searchsorted(beat_times_s, times_s)
    nearest = [beat_times_s[np.clip(after + side, 0, len(beat_times_s) - 1)] for side in (-1, 0)]
    near = np.minimum(*(np.abs(times_s - beat) for beat in nearest))  # (T,)
    return np.exp(-0.5 * (near / BUMP_S) ** 2).astype(np.float32)


def motion_density(n_frames: int, beat_times_s: NDArray[np.floating]) -> NDArray[np.float32]:
    """Tempo-density of a take, (T,) at 20 fps, from its motion beats in seconds."""
    return bumps(frame_times_s(n_frames, NET_FPS), beat_times_s)


def music_density(n_seconds: int, beat_times_s: NDArray[np.floating]) -> NDArray[np.float32]:
    """Target tempo-density of the 4 s from each second, (S, 80) at 20 fps, from the music's beats."""
    times = np.arange(n_seconds)[:, None] + frame_times_s(SEGMENT_FRAMES, NET_FPS)  # (S, 80)
    return bumps(times.ravel(), beat_times_s).reshape(times.shape)
