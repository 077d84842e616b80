"""Log-mel as it might have been recorded elsewhere: other pitch, equalisation, room, noise, voice, breaks.

Every function takes log-mel (T, 96), natural logarithm of power at 60 fps, and returns a new array; beats
stay where they are. Working on log-mel rather than on sound makes a new recording in milliseconds.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from choreograph.timebase import MUSIC_FPS

Mel = NDArray[np.float32]
Rng = np.random.Generator

NATS_PER_DB = np.log(10.0) / 10.0
_MOST_BANDS = 5.0  # of pitch shift
_EQ_KNOTS, _EQ_DB = 7, 7.0


def augmented(mel: Mel, rng: Rng) -> Mel:
    """A new recording of the music: each change is made at times."""
    for change, share in (
        (pitch_shifted, 0.6), (voiced, 0.4), (in_room, 0.4), (with_break, 0.15), (compressed, 0.5),
        (equalised, 0.7), (band_limited, 0.35), (noisy, 0.5),
    ):  # fmt: skip
        if rng.random() < share:
            mel = change(mel, rng)
    return mel


def pitch_shifted(mel: Mel, rng: Rng) -> Mel:
    """Moved by up to five bands up or down; the outermost bands are repeated."""
    n_bands = mel.shape[1]
    position = np.clip(np.arange(n_bands) - rng.uniform(-_MOST_BANDS, _MOST_BANDS), 0, n_bands - 1)
    low = np.minimum(position.astype(np.int64), n_bands - 2)
    share = (position - low).astype(np.float32)
    return mel[:, low] * (1 - share) + mel[:, low + 1] * share


def equalised(mel: Mel, rng: Rng) -> Mel:
    """A smooth random response over the bands."""
    knots = rng.normal(0.0, _EQ_DB * NATS_PER_DB, _EQ_KNOTS)
    response = np.interp(np.linspace(0, _EQ_KNOTS - 1, mel.shape[1]), np.arange(_EQ_KNOTS), knots)
    return mel + response.astype(np.float32)


def band_limited(mel: Mel, rng: Rng) -> Mel:
    """Highs cut as by a codec or an old recording, or lows as by a small loudspeaker."""
    n_bands = mel.shape[1]
    if rng.random() < 0.7:
        beyond = np.arange(n_bands) - rng.uniform(0.45, 0.95) * n_bands
    else:
        beyond = rng.uniform(0.02, 0.15) * n_bands - np.arange(n_bands)
    return mel - (rng.uniform(0.5, 3.0) * np.maximum(0.0, beyond)).astype(np.float32)


def compressed(mel: Mel, rng: Rng) -> Mel:
    """Less, or a little more, contrast in time."""
    mean = mel.mean(axis=0)
    return mean + np.float32(rng.uniform(0.55, 1.15)) * (mel - mean)


def in_room(mel: Mel, rng: Rng) -> Mel:
    """With the tail of a room: power that decays by 60 dB in 0.3 to 2.5 s."""
    decay = 10.0 ** (-6.0 / (rng.uniform(0.3, 2.5) * MUSIC_FPS))
    power = np.exp(mel)
    tail = lfilter([1.0 - decay], [1.0, -decay], power, axis=0)
    wet = rng.uniform(0.1, 0.8)
    return np.log((1 - wet) * power + wet * tail + 1e-6).astype(np.float32)


def noisy(mel: Mel, rng: Rng) -> Mel:
    """With steady noise of a random spectrum, 0 to 30 dB below the music's loudest band."""
    slope = rng.uniform(-3.0, 3.0) * np.linspace(-1, 1, mel.shape[1])
    level = mel.mean(axis=0).max() - rng.uniform(0.0, 30.0) * NATS_PER_DB
    ripple = rng.normal(0.0, 0.3, mel.shape)
    return np.logaddexp(mel, (level + slope + ripple).astype(np.float32))


def with_break(mel: Mel, rng: Rng) -> Mel:
    """Half a second to four seconds nearly silent."""
    length = round(rng.uniform(0.5, 4.0) * MUSIC_FPS)
    start = int(rng.integers(max(1, len(mel) - length)))
    out = mel.copy()
    out[start : start + length] -= np.float32(rng.uniform(15.0, 50.0) * NATS_PER_DB)
    return out


def voiced(mel: Mel, rng: Rng) -> Mel:
    """With sounds that keep no beat, as a voice: at random times, each in a few bands, for 0.1 to 1 s."""
    n_frames, n_bands = mel.shape
    n_sounds = round(n_frames / MUSIC_FPS * rng.uniform(0.7, 3.0))
    voice = np.zeros_like(mel)  # power
    centre = rng.uniform(0.2, 0.6) * n_bands
    for start in rng.integers(n_frames, size=n_sounds):
        length = round(rng.uniform(0.1, 1.0) * MUSIC_FPS)
        age = np.arange(min(length, n_frames - start))
        rise = np.minimum(1.0, (age + 1) / rng.uniform(1.0, 5.0))
        envelope = rise * np.exp(-2.0 * age / length)
        middle, width = centre + rng.normal(0, 10.0), rng.uniform(1.0, 6.0)
        bands = np.exp(-0.5 * ((np.arange(n_bands) - middle) / width) ** 2)
        voice[start : start + len(age)] += np.outer(envelope, rng.uniform(0.3, 1.0) * bands)
    loudest = mel.mean(axis=0).max() + rng.uniform(-15.0, 12.0) * NATS_PER_DB
    return np.logaddexp(mel, np.log(voice + 1e-6) + np.float32(loudest)).astype(np.float32)
