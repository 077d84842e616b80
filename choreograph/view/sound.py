"""The danced part of a song, encoded for the page and the video, with clicks on the counts."""

from __future__ import annotations

import io
import wave
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.core.errors import FormatError, ParameterError
from choreograph.core.progress import StepReport
from choreograph.music.decoding import decode

# AAC in MP4 was chosen with a click track in Chromium 156. These are the milliseconds between the time of a
# click in the file and the media clock when it sounded, at the start and after seeking:
#
#     WAV          0.0   0.0
#     AAC in MP4   0.0   0.0   the edit list removes the encoder delay, the sample table makes seeks exact
#     FLAC         0.0   0.0   ten times the size
#     MP3          0.0  25.1   seek positions are estimated
#     Opus in Ogg  4.8   1.7   Opus has no 44.1 kHz
#     Opus in WebM 1.6   2.7


Blocks = Iterator[NDArray[np.float32]]  # each (S_b, C)

AAC_RATES_HZ = (8000, 11025, 12000, 16000, 22050, 24000, 32000, 44100, 48000)
_BIT_RATE_PER_CHANNEL = 80_000
_SILENT_FRAMES = 1 << 16
_SILENT_RATE_HZ = 44100


@dataclass(frozen=True, eq=False)
class SongPart:
    """A span of a song as blocks of `n_frames` samples in total. It is silent after the end of the song."""

    rate_hz: int
    n_channels: int  # 1 or 2
    n_frames: int
    blocks: Blocks  # read once


def song_part(path: str | Path, *, start_s: float, duration_s: float) -> SongPart:
    """The `duration_s` seconds of a song file from `start_s`, at its native rate, in at most two channels.

    Raises `FormatError` if the file is missing, empty, not audio, or damaged. Damage is found while the
    blocks are read. Raises `ParameterError` if the start is negative or the duration not positive.
    """
    path = Path(path)
    if not (np.isfinite(start_s) and start_s >= 0):
        raise ParameterError(f"expected a start in seconds of 0 or more, got {start_s:g}")
    if not (np.isfinite(duration_s) and duration_s > 0):
        raise ParameterError(f"expected a duration in seconds above 0, got {duration_s:g}")
    if not path.is_file() or path.stat().st_size == 0:
        raise FormatError(f"expected a song at {path}, got no file or an empty one")
    decoding = decode(path)
    rate_hz, blocks = decoding.rate_hz, decoding.blocks
    n_frames = max(1, round(duration_s * rate_hz))
    first = next(blocks, None)
    if first is None:
        raise FormatError(f"expected a song in {path}, got no sound: the file may be truncated")
    n_channels = min(first.shape[1], 2)
    cut = _cut(first, blocks, round(start_s * rate_hz), n_frames, n_channels)
    return SongPart(rate_hz, n_channels, n_frames, cut)


def silent_part(duration_s: float) -> SongPart:
    """Silence in one channel, for a dance without a song."""
    n_frames = max(1, round(duration_s * _SILENT_RATE_HZ))
    return SongPart(
        _SILENT_RATE_HZ, 1, n_frames, _cut(np.zeros((0, 1), np.float32), iter(()), 0, n_frames, 1)
    )


def _cut(first: NDArray[np.float32], rest: Blocks, start: int, n_frames: int, n_channels: int) -> Blocks:
    """`n_frames` frames from `start`, with silence after the end of the song."""
    done = position = 0
    for block in chain([first], rest):
        piece = block[max(0, start - position) :][: n_frames - done]
        position += len(block)
        done += len(piece)
        if len(piece):
            yield _mixed(np.nan_to_num(piece), n_channels)
        if done == n_frames:
            return
    while done < n_frames:
        silent = min(_SILENT_FRAMES, n_frames - done)
        done += silent
        yield np.zeros((silent, n_channels), np.float32)


def _mixed(block: NDArray[np.float32], n_channels: int) -> NDArray[np.float32]:
    """One or two channels of (S_b, C). Further channels are mixed into both."""
    if block.shape[1] <= 2:
        return block
    rest = block[:, 2:].mean(axis=1, keepdims=True)
    return (0.6 * block[:, :n_channels] + 0.4 * rest).astype(np.float32)


@dataclass
class Levels:
    """Peak and RMS of the sound per bin, the waveform. They are collected while blocks are read."""

    bins_per_s: float
    _peaks: list[float] = field(default_factory=list)
    _powers: list[float] = field(default_factory=list)

    def through(self, part: SongPart, report: StepReport | None = None) -> SongPart:
        """The same part. Its levels are collected, and its progress is reported, while it is read."""
        return SongPart(part.rate_hz, part.n_channels, part.n_frames, self._measured(part, report))

    def _measured(self, part: SongPart, report: StepReport | None) -> Blocks:
        bin_frames = max(1, round(part.rate_hz / self.bins_per_s))
        self.bins_per_s = part.rate_hz / bin_frames
        left = np.zeros(0, np.float32)
        done = 0
        for block in part.blocks:
            loud = np.concatenate([left, np.abs(block).max(axis=1)])
            whole = len(loud) // bin_frames * bin_frames
            self._add(loud[:whole].reshape(-1, bin_frames))
            left = loud[whole:]
            done += len(block)
            yield block
            if report is not None:
                report(done, part.n_frames)
        if len(left):
            self._add(left[None])

    def _add(self, loud: NDArray[np.float32]) -> None:
        self._peaks.extend(loud.max(axis=1))
        self._powers.extend(np.sqrt((loud**2).mean(axis=1)))

    def to_bytes(self) -> NDArray[np.uint8]:
        """Peak and RMS (bins, 2). 255 is the loudest peak of the song."""
        levels = np.stack([self._peaks, self._powers], axis=1)  # (bins, 2)
        return np.round(255 * levels / max(float(levels.max(initial=0.0)), 1e-4)).astype(np.uint8)


def write_wav(path: Path, part: SongPart) -> None:
    """Write a WAV file of 16 bits. Raises `FormatError` if the song is damaged."""
    with wave.open(str(path), "wb") as file:
        file.setnchannels(part.n_channels)
        file.setsampwidth(2)
        file.setframerate(part.rate_hz)
        for block in part.blocks:
            file.writeframesraw((block.clip(-1.0, 1.0) * 32767.0).round().astype("<i2").tobytes())


def encode_mp4(part: SongPart) -> bytes:
    """The part as AAC in MP4. The same input gives the same bytes."""
    import av

    buffer = io.BytesIO()
    with av.open(buffer, "w", format="mp4") as container:
        for packet in aac_packets(aac_stream(container, part), part):
            container.mux(packet)
    return buffer.getvalue()


def aac_stream(container: Any, part: SongPart) -> Any:
    """A new AAC stream for the part, at its rate if AAC has it."""
    rate_hz = min(AAC_RATES_HZ, key=lambda r: (r < min(part.rate_hz, 48000), abs(r - part.rate_hz)))
    layout = "mono" if part.n_channels == 1 else "stereo"
    stream = container.add_stream("aac", rate=rate_hz, layout=layout)
    stream.bit_rate = _BIT_RATE_PER_CHANNEL * part.n_channels
    # Three times as fast as the encoder's default method, and nearer to the song at this bit rate (26 dB
    # instead of 24 dB for the built-in house song).
    stream.options = {"aac_coder": "fast"}
    return stream


def aac_packets(stream: Any, part: SongPart) -> Iterator[Any]:
    """The encoded packets of the part in order, including those of the flush."""
    import av

    layout = stream.layout.name
    resampler = av.AudioResampler(format="fltp", layout=layout, rate=stream.rate)
    position = 0
    for block in part.blocks:
        interleaved = np.ascontiguousarray(block, np.float32).reshape(1, -1)
        frame = av.AudioFrame.from_ndarray(interleaved, format="flt", layout=layout)
        frame.sample_rate, frame.pts, frame.time_base = part.rate_hz, position, Fraction(1, part.rate_hz)
        position += len(block)
        for resampled in resampler.resample(frame):
            yield from stream.encode(resampled)
    for resampled in resampler.resample(None):
        yield from stream.encode(resampled)
    yield from stream.encode(None)


# Clicks on the counts, mixed into a song.


COUNT_HZ, COUNT_ONE_HZ = 1000.0, 1500.0
_LENGTH_S, _DECAY_S = 0.06, 0.012
_CLICK_GAIN, _SONG_GAIN = 0.45, 0.5  # together below 1, so the mix does not clip


@dataclass(frozen=True)
class Clicks:
    """Times of clicks, and their counts.

    Raises `ParameterError` if times are not finite and increasing, or numbers do not match them.
    """

    times_s: Sequence[float]  # in the dance
    numbers: Sequence[int] = ()  # in the bar. Clicks on 1 are higher. Without numbers, all are equal

    def __post_init__(self) -> None:
        times_s = np.asarray(self.times_s, np.float64)
        if times_s.ndim != 1 or not np.isfinite(times_s).all() or (np.diff(times_s) <= 0).any():
            raise ParameterError("expected increasing finite times of clicks (Q,) in seconds")
        if len(self.numbers) not in (0, len(times_s)):
            raise ParameterError(
                f"expected a number for each of {len(times_s)} clicks, or none, got {len(self.numbers)}"
            )

    def over(self, part: SongPart) -> SongPart:
        """The part, half as loud, with the clicks in it."""
        return replace(part, blocks=self._mixed(part))

    def _mixed(self, part: SongPart) -> Blocks:
        starts = np.round(np.asarray(self.times_s, np.float64) * part.rate_hz).astype(np.int64)
        sounds = [click(COUNT_HZ, part.rate_hz), click(COUNT_ONE_HZ, part.rate_hz)]
        is_one = np.array(self.numbers or [0] * len(starts)) == 1
        position = 0
        for block in part.blocks:
            mix = _SONG_GAIN * block
            end = position + len(block)
            for index in np.flatnonzero((starts > position - len(sounds[0])) & (starts < end)):
                first, stop = max(starts[index], position), min(starts[index] + len(sounds[0]), end)
                sound = sounds[int(is_one[index])][first - starts[index] : stop - starts[index]]
                mix[first - position : stop - position] += sound[:, None]
            yield mix.astype(np.float32)
            position = end


def click(pitch_hz: float, rate_hz: int) -> NDArray[np.float32]:
    """A short sine (S,) that decays."""
    time_s = np.arange(round(_LENGTH_S * rate_hz)) / rate_hz
    return (_CLICK_GAIN * np.sin(2 * np.pi * pitch_hz * time_s) * np.exp(-time_s / _DECAY_S)).astype(
        np.float32
    )
