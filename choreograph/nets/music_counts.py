"""`MusicCounts`, a network for the beats and bars of songs: its inference, its weights, and beat tracking."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
import scipy
from numpy.typing import NDArray

from choreograph.core.errors import FormatError, ParameterError
from choreograph.core.files import atomic_path
from choreograph.core.numerics import Floats, frame_blocks
from choreograph.core.timebase import MUSIC_FPS
from choreograph.music.bar_pointer import METRES, PhaseCurves, PointerConfig, decode_counts
from choreograph.music.beats import level_normalized, onset_strength, path_of
from choreograph.music.mel import MEL_BANDS
from choreograph.music.song import Song
from choreograph.nets.inference import TrainedNet
from choreograph.nets.layers import Shapes, conv1d, conv2d, elu, sigmoid, trunk, trunk_shapes

# Phases in beat and bar, as the networks output them.
#
# For every frame, a network outputs a vector for the beat and one for the bar of each metre, in the form of
# `music.bar_pointer.PhaseCurves`. The direction is the phase, and the length is the concentration. A vector v
# gives a phase φ the von Mises density exp(v · u(φ)) / (2π I₀(|v|)), so the network learns its confidence
# with its phases. The vector of a metre that the take does not have should be 0, so the length of a vector
# is evidence for its metre.


N_OUTPUTS = 2 + 2 * len(METRES)  # of a network, per frame


def curves_from(outputs: NDArray[np.floating], fps: float) -> PhaseCurves:
    """Phase curves from a network's outputs (N_OUTPUTS, T)."""
    vectors = np.asarray(outputs, np.float64).reshape(1 + len(METRES), 2, -1)
    return PhaseCurves(vectors[0].T, vectors[1:].transpose(2, 0, 1), fps)


# `MusicCounts`: beats, downbeats and their phases from a song's log-mel, by a temporal convolution network.
#
# After Davies and Böck, *Temporal convolutional networks for musical audio beat tracking*, EUSIPCO 2019, and
# Böck and Davies, *Deconstruct, analyse, reconstruct*, ISMIR 2020: small convolutions over bands and frames,
# then dilated convolutions with a context of half a minute on either side. Ours: 30 fps rather than 100, an
# input without level and equalisation, and phases of beat and bar, which the bar pointer decodes.


CURVE_FPS = MUSIC_FPS // 2
N_ACTIVATIONS = 2  # of beat and downbeat
KERNEL = 5  # frames of a convolution of the trunk
_RANGE = 12.0  # nats below the loudest band of a song that are kept: 52 dB
_SCALE = 3.0  # nats: about the spread of a band


@dataclass(frozen=True)
class MusicCountsConfig:
    """Sizes and training settings of the network for counts of music, stored with its weights."""

    front_channels: tuple[int, int] = (8, 16)  # of the two convolutions over bands and frames
    width: int = 32  # channels of the trunk
    n_blocks: int = 9  # of the trunk: a context of 34 s on either side
    dropout: float = 0.1  # of the trunk
    excerpt_s: float = 30.0  # length of a training sample
    batch_size: int = 8  # samples of a step
    steps: int = 900  # of the training
    learning_rate: float = 3e-3  # at its highest
    weight_decay: float = 1e-3  # of AdamW, or 0 for Adam
    bar_weight: float = 1.0  # of the bar's phase, relative to the beat's
    activation_weight: float = 1.0  # of the activations, relative to the phases


@dataclass(frozen=True, eq=False)
class MusicCurves:
    """Outputs of the network at 30 fps. Frame i is at i / 30 s."""

    beat: NDArray[np.float32]  # (T,) probability of a beat in the frame
    downbeat: NDArray[np.float32]  # (T,)
    phases: PhaseCurves  # of beat and bar


class MusicCounts(TrainedNet):
    """The trained network `content.count_networks.MusicCountsNet`: log-mel at 60 fps to curves at 30 fps."""

    config_class = MusicCountsConfig

    @staticmethod
    def shapes(config: MusicCountsConfig) -> Shapes:
        """The shapes of all weights."""
        first, second = config.front_channels
        return trunk_shapes(second * (MEL_BANDS // 12), config.width, config.n_blocks, KERNEL) | {
            "front.0.weight": (first, 1, 5, 5), "front.0.bias": (first,),
            "front.3.weight": (second, first, 3, 3), "front.3.bias": (second,),
            "head.weight": (N_ACTIVATIONS + N_OUTPUTS, config.width, 1),
            "head.bias": (N_ACTIVATIONS + N_OUTPUTS,),
        }  # fmt: skip

    def curves(self, log_mel: NDArray[np.floating]) -> MusicCurves:
        """The curves of a whole song from its log-mel (T, 96). Raises `ParameterError` for another shape."""
        mel = np.asarray(log_mel, np.float32)
        if mel.ndim != 2 or mel.shape[1] != MEL_BANDS or len(mel) == 0:
            raise ParameterError(f"expected log-mel (T, {MEL_BANDS}), got an array of shape {mel.shape}")
        hidden = trunk(self._front(mel), self.weights, self.config.n_blocks)
        outputs = conv1d(hidden, self.weights, "head")[0].T
        beat, downbeat = sigmoid(outputs[:N_ACTIVATIONS])
        return MusicCurves(beat, downbeat, curves_from(outputs[N_ACTIVATIONS:], CURVE_FPS))

    def _front(self, mel: NDArray[np.float32]) -> NDArray[np.float32]:
        """Features (1, (T + 1) // 2, C * 8) of log-mel (T, 96), computed in blocks of frames."""
        levels, n_frames, weights = _levels(mel), (len(mel) + 1) // 2, self.weights
        out = np.empty((1, n_frames, self.config.front_channels[1] * (MEL_BANDS // 12)), np.float32)
        for block in frame_blocks(n_frames):
            # The second convolution reads a row before and after the block, and the first one two more.
            start, stop = max(0, block.start - 1), min(n_frames, block.stop + 1)
            rows = _levelled(mel[max(0, 2 * start - 2) : 2 * stop + 1], *levels)
            if stop == n_frames:
                rows = np.pad(rows, ((0, len(mel) % 2), (0, 0)), mode="edge")
            outside = (2 if start == 0 else 0, 1 if stop == n_frames else 0)
            x = np.pad(rows, (outside, (0, 0)))[None, None]
            x = _halved(elu(conv2d(x, weights, "front.0", stride=(2, 3), padding=(0, 1))))
            outside = (int(block.start == 0), int(block.stop >= n_frames))
            x = np.pad(x, ((0, 0), (0, 0), outside, (0, 0)))
            x = _halved(elu(conv2d(x, weights, "front.3", stride=(1, 1), padding=(0, 1))))  # (1, C, T_b, 8)
            out[:, block] = x.transpose(0, 2, 1, 3).reshape(1, x.shape[2], -1)
        return out


def _halved(x: NDArray[np.float32]) -> NDArray[np.float32]:
    """The larger of every two neighbouring bands of (B, C, T, bands)."""
    return np.maximum(x[..., ::2], x[..., 1::2])


def levelled(log_mel: NDArray[np.floating]) -> NDArray[np.float32]:
    """Log-mel (T, 96), normalised for gain and equalisation: 52 dB below its maximum, mean 0 in each band."""
    mel = np.asarray(log_mel, np.float32)
    return _levelled(mel, *_levels(mel))


def _levels(mel: NDArray[np.float32]) -> tuple[np.float32, NDArray[np.float32]]:
    """The least value of log-mel (T, 96) that is kept, and the mean of each band (96,) with it."""
    floor = mel.max() - np.float32(_RANGE)
    total = np.zeros(mel.shape[1], np.float32)
    for block in frame_blocks(len(mel)):  # rows are added in the order of NumPy's mean
        total = np.concatenate([total[None], np.maximum(mel[block], floor)]).sum(axis=0)
    return floor, (total / np.int64(len(mel))).astype(np.float32)


def _levelled(mel: NDArray[np.float32], floor: np.float32, mean: NDArray[np.float32]) -> NDArray[np.float32]:
    levelled_rows = np.maximum(mel, floor)
    levelled_rows -= mean
    levelled_rows /= np.float32(_SCALE)
    return levelled_rows


# Weights of `MusicCounts` in a file: `.npz` in half precision, with the configuration and the training songs.
#
# `SHIPPED` comes with the program and was trained on synthesised songs only.


SHIPPED = Path(__file__).with_name("music_counts_clean.npz")
_ABOUT, _CONFIG = "about", "config"


def write_music_counts(path: str | Path, net: MusicCounts, about: Mapping[str, Any]) -> None:
    """Write a network. `about` is JSON that describes what it was trained on."""
    arrays, config = net.to_arrays()
    stored: dict[str, Any] = {name: np.asarray(values, np.float16) for name, values in arrays.items()}
    stored |= {_ABOUT: np.array(json.dumps(dict(about))), _CONFIG: np.array(json.dumps(config))}
    with atomic_path(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **stored)


def read_music_counts(path: str | Path) -> tuple[MusicCounts, dict[str, Any]]:
    """The network of a file, and what it was trained on. Raises `FormatError` for any other file."""
    try:
        with np.load(path, allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files}
        about, config = (json.loads(str(arrays.pop(name))) for name in (_ABOUT, _CONFIG))
        weights = {name: np.asarray(values, np.float32) for name, values in arrays.items()}
        return MusicCounts.from_arrays(weights, config), about
    except (OSError, BadZipFile, KeyError, ValueError, TypeError, ParameterError) as error:
        raise FormatError(
            f"{path}: expected weights of the beat-tracking network, got: {error}: "
            "it is damaged, or another file"
        ) from error


@lru_cache(maxsize=1)
def shipped_music_counts() -> MusicCounts:
    """The network that ships with the program."""
    return read_music_counts(SHIPPED)[0]


# Beats of a song from the phases of the network, or from its activation where the phases are uncertain.
#
# The bar pointer decodes the phases. It keeps a salsa at 180 BPM, which a prior on tempi would halve. If the
# phases do not agree with the decoded beats, as in music unlike the training songs, its errors are factors of
# a half or a third. Then the tempo path, which has a prior, decodes the activation. The onsets are added to
# the activation. From the activation alone, a third of a rumba was tracked at 4/3 of its tempo.


POINTER = PointerConfig(bpm=(45.0, 240.0), grid_fps=60.0)
# Mean cosine between phases and beats below which the tempo path is used. It was fitted by
# `research/fit_music_agreement.py` to songs of genres that the networks were not trained on.
LEAST_AGREEMENT = 0.75
_MIN_DURATION_S = 1.0
_SLIP_BEATS = 5  # fewer beats at another tempo are not a passage
_SLIP_SHARE = 1 / 3  # of the song that may be at half the tempo
_SAME_TEMPO_OCTAVES = 0.06
_LATE_FRAMES = 1  # onsets come 11 ms after the beat, the activation on it
_LEAST_CONTRAST = 0.1  # nats between the loudest and the quietest frame: less is silence
_DIED_AWAY = 7.0  # nats below the loudest frame, 30 dB: after the last louder frame, the beat is extrapolated


class NetworkBeats:
    """A `music.beats.BeatTracker` that uses the network."""

    def __init__(self, net: MusicCounts | None = None) -> None:
        self.net = net or shipped_music_counts()

    def beats(self, song: Song, log_mel: NDArray[np.floating]) -> Floats:
        """The song's beats, (Q,) seconds, or none in a song shorter than a second or silent."""
        beats_s = network_beats(log_mel, self.net)
        return beats_s[beats_s < song.duration_s]


def network_beats(log_mel: NDArray[np.floating], net: MusicCounts) -> Floats:
    """Beats in seconds, (Q,), of log-mel (T, 96). Raises `ParameterError` for another shape."""
    curves = net.curves(log_mel)
    level = np.asarray(log_mel).max(axis=1)  # (T,)
    if len(level) < _MIN_DURATION_S * MUSIC_FPS or np.ptp(level) < _LEAST_CONTRAST:
        return np.zeros(0)
    ends = np.flatnonzero(level >= level.max() - _DIED_AWAY)[-1] * CURVE_FPS // MUSIC_FPS
    beats_s, agreement = decoded_beats(_without_phases_after(curves, int(ends)))
    return beats_s if agreement >= LEAST_AGREEMENT else activated_beats(curves, log_mel)


def _without_phases_after(curves: MusicCurves, frame: int) -> MusicCurves:
    """The curves, with phases of concentration 0 after a frame."""
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
    strength = level_normalized(activation)
    strength[: len(onsets)] += onsets
    return at_one_level(path_of(level_normalized(strength)))


def at_one_level(beats_s: Floats) -> Floats:
    """Beats (Q,) with beats inserted in passages at half the tempo of most of the song.

    A tracker halves the tempo where onsets are sparse, as in an introduction. If more than a third of the
    song is slower, it is not changed, since another piece of music may begin there.
    """
    periods_s = np.diff(beats_s)
    if len(periods_s) < _SLIP_BEATS:
        return beats_s
    steady = scipy.ndimage.median_filter(periods_s, _SLIP_BEATS, mode="nearest")
    order = np.argsort(steady)
    half_of_the_time = np.searchsorted(np.cumsum(periods_s[order]), 0.5 * periods_s.sum())
    main_s = steady[order[half_of_the_time]]
    slipped = np.abs(np.log2(steady / main_s) - 1.0) < _SAME_TEMPO_OCTAVES
    if periods_s[slipped].sum() > _SLIP_SHARE * periods_s.sum():
        return beats_s
    between_s = 0.5 * (beats_s[:-1] + beats_s[1:])[slipped]
    return np.sort(np.concatenate([beats_s, between_s]))
