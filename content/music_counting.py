"""Training of the beat-tracking network on excerpts of songs at any tempo, with varied recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.signal import lfilter
from torch import Tensor
from torch.nn import functional

from choreograph.core.counts import Counts
from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats
from choreograph.core.timebase import MUSIC_FPS, seconds_to_frames
from choreograph.music.bar_pointer import METRES
from choreograph.nets.music_counts import CURVE_FPS, MusicCounts, MusicCountsConfig, levelled
from choreograph.nets.training import TrainingContext, load_pretrained, train
from content.count_networks import MusicCountsNet
from content.counted_phases import Phases, PhaseTargets, phase_loss, phases_at

# Augmentation of log-mel as other recordings: other pitch, equalisation, room, noise, voice, breaks.
#
# Every function takes log-mel (T, 96), the natural logarithm of power at 60 fps, and returns a new array.
# Beats do not move. On log-mel instead of sound, a new recording takes milliseconds.


Mel = NDArray[np.float32]
Rng = np.random.Generator

NATS_PER_DB = np.log(10.0) / 10.0
_MOST_BANDS = 5.0  # of pitch shift
_EQ_KNOTS, _EQ_DB = 7, 7.0


def augmented(mel: Mel, rng: Rng) -> Mel:
    """A new recording of the music, with each change at random."""
    for change, share in (
        (pitch_shifted, 0.6), (voiced, 0.4), (in_room, 0.4), (with_break, 0.15), (compressed, 0.5),
        (equalised, 0.7), (band_limited, 0.35), (noisy, 0.5),
    ):  # fmt: skip
        if rng.random() < share:
            mel = change(mel, rng)
    return mel


def pitch_shifted(mel: Mel, rng: Rng) -> Mel:
    """The music moved by up to five bands up or down. The outermost bands are repeated."""
    n_bands = mel.shape[1]
    position = np.clip(np.arange(n_bands) - rng.uniform(-_MOST_BANDS, _MOST_BANDS), 0, n_bands - 1)
    low = np.minimum(position.astype(np.int64), n_bands - 2)
    share = (position - low).astype(np.float32)
    result: Mel = mel[:, low] * (1 - share) + mel[:, low + 1] * share
    return result


def equalised(mel: Mel, rng: Rng) -> Mel:
    """A smooth random response over the bands."""
    knots = rng.normal(0.0, _EQ_DB * NATS_PER_DB, _EQ_KNOTS)
    response = np.interp(np.linspace(0, _EQ_KNOTS - 1, mel.shape[1]), np.arange(_EQ_KNOTS), knots)
    return mel + response.astype(np.float32)


def band_limited(mel: Mel, rng: Rng) -> Mel:
    """The music with highs cut as by a codec or an old recording, or lows as by a small loudspeaker."""
    n_bands = mel.shape[1]
    if rng.random() < 0.7:
        beyond = np.arange(n_bands) - rng.uniform(0.45, 0.95) * n_bands
    else:
        beyond = rng.uniform(0.02, 0.15) * n_bands - np.arange(n_bands)
    result: Mel = mel - (rng.uniform(0.5, 3.0) * np.maximum(0.0, beyond)).astype(np.float32)
    return result


def compressed(mel: Mel, rng: Rng) -> Mel:
    """The music with less, or a little more, contrast in time."""
    mean = mel.mean(axis=0)
    result: Mel = mean + np.float32(rng.uniform(0.55, 1.15)) * (mel - mean)
    return result


def in_room(mel: Mel, rng: Rng) -> Mel:
    """The music with the reverb of a room, whose power decays by 60 dB in 0.3 to 2.5 s."""
    decay = 10.0 ** (-6.0 / (rng.uniform(0.3, 2.5) * MUSIC_FPS))
    power = np.exp(mel)
    tail = lfilter([1.0 - decay], [1.0, -decay], power, axis=0)
    wet = rng.uniform(0.1, 0.8)
    result: Mel = np.log((1 - wet) * power + wet * tail + 1e-6).astype(np.float32)
    return result


def noisy(mel: Mel, rng: Rng) -> Mel:
    """The music with steady noise of a random spectrum, 0 to 30 dB below its loudest band."""
    slope = rng.uniform(-3.0, 3.0) * np.linspace(-1, 1, mel.shape[1])
    level = mel.mean(axis=0).max() - rng.uniform(0.0, 30.0) * NATS_PER_DB
    ripple = rng.normal(0.0, 0.3, mel.shape)
    result: Mel = np.logaddexp(mel, (level + slope + ripple).astype(np.float32))
    return result


def with_break(mel: Mel, rng: Rng) -> Mel:
    """The music with half a second to four seconds nearly silent."""
    length = round(rng.uniform(0.5, 4.0) * MUSIC_FPS)
    start = int(rng.integers(max(1, len(mel) - length)))
    out = mel.copy()
    out[start : start + length] -= np.float32(rng.uniform(15.0, 50.0) * NATS_PER_DB)
    return out


def voiced(mel: Mel, rng: Rng) -> Mel:
    """The music with sounds without a beat, like a voice, at random times in a few bands for 0.1 to 1 s."""
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
    result: Mel = np.logaddexp(mel, np.log(voice + 1e-6) + np.float32(loudest)).astype(np.float32)
    return result


# The beat-tracking network is trained on excerpts of songs at any tempo, and on their true phases.


_TEMPO_STD, _LEAST_TEMPO, _MOST_TEMPO = 0.18, 0.7, 1.4  # of the factor of tempo: its logarithm, and bounds
_BEFORE_S = 2.0  # of silence with which an excerpt may begin or end
_SILENCE = -13.8  # log-mel of silence
_WIDTH_FRAMES = 1.5  # of an activation's target to either side of the beat, at 30 fps
_MIN_COUNTS = 8


@dataclass(frozen=True, eq=False)
class CountedMel:
    """A training song."""

    log_mel: NDArray[np.floating]  # (T, 96) at 60 fps
    counts: Counts  # with bars of three or four


class MusicCountsData:
    """Any number of batches of excerpts."""

    def __init__(self, songs: Sequence[CountedMel], config: MusicCountsConfig) -> None:
        """Raises `ParameterError` unless there are songs, each of eight counts or more in one of `METRES`."""
        for song in songs:
            if len(song.counts) < _MIN_COUNTS or song.counts.metre not in METRES:
                raise ParameterError(
                    f"expected songs of {_MIN_COUNTS} counts or more in a metre of {METRES}, got "
                    f"{len(song.counts)} in {song.counts.metre}"
                )
        if not songs:
            raise ParameterError("expected songs with counts, got none")
        self.songs, self.config = list(songs), config

    def batch(
        self, rng: np.random.Generator, weights: Floats | None = None
    ) -> tuple[Tensor, Tensor, PhaseTargets]:
        """Normalised log-mel (B, T, 96) at 60 fps, and true activations (B, 2, T / 2) and phases at 30 fps.

        `weights` (N,) are the probabilities of the songs. Their sum is 1.
        """
        chosen = rng.choice(len(self.songs), self.config.batch_size, p=weights)
        mels, activations, phases = zip(*(self._excerpt(self.songs[i], rng) for i in chosen), strict=True)
        return (
            torch.from_numpy(np.stack(mels)),
            torch.from_numpy(np.stack(activations)),
            PhaseTargets.of(list(phases)),
        )

    def _excerpt(
        self, song: CountedMel, rng: np.random.Generator
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], Phases]:
        tempo = float(np.clip(np.exp(rng.normal(0.0, _TEMPO_STD)), _LEAST_TEMPO, _MOST_TEMPO))
        n_frames = 2 * seconds_to_frames(self.config.excerpt_s, CURVE_FPS)
        longest_s = len(song.log_mel) / MUSIC_FPS - tempo * self.config.excerpt_s
        start_s = rng.uniform(min(-_BEFORE_S, longest_s), max(0.0, longest_s) + _BEFORE_S)
        frames = start_s * MUSIC_FPS + tempo * np.arange(n_frames)
        mel = augmented(resampled(song.log_mel, frames), rng)
        times_s = start_s + tempo * np.arange(n_frames // 2) / CURVE_FPS
        return levelled(mel), activations(song.counts, times_s, tempo), phases_at(song.counts, times_s)


def resampled(log_mel: NDArray[np.floating], frames: NDArray[np.floating]) -> NDArray[np.float32]:
    """Log-mel (T', 96) at fractional frames (T',), silence outside."""
    inside = (frames >= 0) & (frames <= len(log_mel) - 1)
    position = np.clip(frames, 0, len(log_mel) - 1)
    low = np.minimum(position.astype(np.int64), max(len(log_mel) - 2, 0))
    high = np.minimum(low + 1, len(log_mel) - 1)
    share = (position - low).astype(np.float32)[:, None]
    mel: NDArray[np.float32] = log_mel[low].astype(np.float32) * (1 - share)
    mel += log_mel[high].astype(np.float32) * share
    mel[~inside] = _SILENCE
    return mel


def activations(counts: Counts, times_s: NDArray[np.floating], tempo: float) -> NDArray[np.float32]:
    """At times (T,), `tempo` thirtieths of a second apart: 1 on a beat, on a downbeat, else 0, as (2, T).

    A triangle falls to 0 in `_WIDTH_FRAMES` to either side, since a beat lies between frames.
    """
    rows = []
    for instants_s in (counts.times_s, counts.downbeat_times_s):
        after = np.clip(np.searchsorted(instants_s, times_s), 1, len(instants_s) - 1)
        distance_s = np.minimum(np.abs(times_s - instants_s[after - 1]), np.abs(times_s - instants_s[after]))
        rows.append(np.maximum(0.0, 1.0 - distance_s * CURVE_FPS / tempo / _WIDTH_FRAMES))
    return np.stack(rows).astype(np.float32)


# Training of the beat-tracking network.


def train_music_counts(
    songs: Sequence[CountedMel],
    config: MusicCountsConfig,
    *,
    seed: int,
    weights: NDArray[np.floating] | None = None,
    context: TrainingContext | None = None,
    pretrained: Mapping[str, NDArray[Any]] | None = None,
) -> MusicCounts:
    """Train on excerpts of songs. `weights` (N,) are their relative frequencies, equal if not given.

    Raises `ParameterError` as `MusicCountsData` does, or for pretrained weights that do not fit.
    """
    data = MusicCountsData(songs, config)
    share = None if weights is None else np.asarray(weights, np.float64) / np.sum(weights)
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        net = MusicCountsNet(config)
    if pretrained is not None:
        load_pretrained(net, "music_counts", pretrained)

    def loss(rng: np.random.Generator, device: torch.device) -> Tensor:
        mel, activation, phases = data.batch(rng, share)
        logits, vectors = net(mel.to(device))
        activated = functional.binary_cross_entropy_with_logits(logits, activation.to(device))
        pointed = phase_loss(vectors, phases.to(device), bar_weight=config.bar_weight)
        return config.activation_weight * activated + pointed

    train(
        net,
        loss,
        name="music_counts",
        n_steps=config.steps,
        learning_rate=config.learning_rate,
        weight_decay=config.weight_decay,
        seed=seed,
        configuration={**asdict(config), "songs": len(songs)},
        context=context,
    )
    return MusicCounts.from_arrays(*net.to_arrays())
