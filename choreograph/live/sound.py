"""Sound in and out: plays a song and tells the time in it, and reads the samples of a stream.

A stream is PCM on standard input, or a microphone. Sound devices need the extra `live`.
"""

from __future__ import annotations

import re
import struct
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from choreograph.core.arguments import unexpected
from choreograph.core.errors import ChoreographError, FormatError
from choreograph.music.decoding import decode
from choreograph.music.song import resampled

# A song that is played.


_START_S = 0.5  # before the song begins


def sound_device(use: str, instead: str = "") -> Any:
    """The package `sounddevice`. Raises `ChoreographError` if it, or PortAudio, is not installed."""
    try:
        import sounddevice
    except (ImportError, OSError) as error:  # an OSError if PortAudio is missing
        raise ChoreographError(
            f"expected the extra `live` {use}, it is not installed: pip install 'choreograph[live]'{instead} "
            f"({' '.join(str(error).split())[:80]})"
        ) from error
    return sounddevice


@contextmanager
def silent() -> Iterator[Callable[[], float]]:
    """The clock of a song that is not played."""
    start_s = time.perf_counter() + _START_S
    yield lambda: time.perf_counter() - start_s


@contextmanager
def playing(song: Path) -> Iterator[Callable[[], float]]:
    """Plays a song. The clock is that of the sound device, with its latency.

    Raises `ChoreographError` without the package or a device.
    """
    sounddevice = sound_device("to play a song", ", or --silent")
    decoding = decode(song)
    samples = np.concatenate(list(decoding.blocks))[:, :2]
    position = 0
    began: list[float] = []

    def fill(out: np.ndarray, n: int, times: object, status: object) -> None:
        nonlocal position
        if not began:
            began.append(float(getattr(times, "outputBufferDacTime", 0.0)))
        part = samples[position : position + n]
        out[: len(part)] = part
        out[len(part) :] = 0.0
        position += n

    try:
        with sounddevice.OutputStream(
            decoding.rate_hz, channels=samples.shape[1], dtype="float32", callback=fill
        ) as stream:
            yield lambda: stream.time - began[0] if began else -_START_S
    except sounddevice.PortAudioError as error:
        raise ChoreographError(
            f"expected a sound device to play the song on, got: {error} (--silent plays none)"
        ) from None


# Samples of a stream.


BLOCK_S = 0.1  # of a block that is read
_ENCODINGS = {"u8": "u1", "s16": "<i2", "s24": "", "s32": "<i4", "f32": "<f4"}
_RATES_HZ, _MOST_CHANNELS = (4000, 384_000), 32
_PCM, _FLOAT, _EXTENSIBLE = 1, 3, 0xFFFE  # of the format of a WAV file
_MOST_HEADER = 1 << 20  # bytes before the samples

Blocks = Iterator[NDArray[np.float32]]


@dataclass(frozen=True)
class PcmFormat:
    """How samples of PCM are stored: interleaved and little-endian."""

    rate_hz: int
    channels: int
    encoding: str  # u8, s16, s24, s32 or f32

    @classmethod
    def parse(cls, text: str) -> PcmFormat:
        """The format of RATE:CHANNELS:ENCODING, such as 44100:2:s16. Raises `ParameterError`."""
        parts = re.fullmatch(r"(\d{1,9}):(\d{1,9}):(\w+)", text)
        if parts and parts[3] in _ENCODINGS:
            found = cls(int(parts[1]), int(parts[2]), parts[3])
            if found.is_usual:
                return found
        encodings = ", ".join(_ENCODINGS)
        raise unexpected(f"RATE:CHANNELS:ENCODING such as 44100:2:s16, with {encodings}", text)

    @property
    def is_usual(self) -> bool:
        """Whether the rate and the number of channels are those of a sound device."""
        return _RATES_HZ[0] <= self.rate_hz <= _RATES_HZ[1] and 1 <= self.channels <= _MOST_CHANNELS

    @property
    def frame_bytes(self) -> int:
        """The bytes of one sample of all channels."""
        return self.channels * (3 if self.encoding == "s24" else np.dtype(_ENCODINGS[self.encoding]).itemsize)

    def mono(self, data: bytes) -> NDArray[np.float32]:
        """Samples (S,) from -1 to 1 of bytes of whole frames, the mean of all channels."""
        values: NDArray[Any]
        if self.encoding == "s24":
            padded = np.zeros((len(data) // 3, 4), np.uint8)
            padded[:, 1:] = np.frombuffer(data, np.uint8).reshape(-1, 3)
            values = padded.view("<i4").ravel().astype(np.float32) / 2**31
        else:
            raw = np.frombuffer(data, _ENCODINGS[self.encoding])
            values = raw.astype(np.float32)
            if self.encoding == "u8":
                values = values / 128.0 - 1.0
            elif self.encoding == "f32":
                values = _finite(values)  # before channels are added, which may not be finite then
            else:
                values /= 2.0 ** (8 * raw.itemsize - 1)
        return values.reshape(-1, self.channels).mean(axis=1, dtype=np.float32)


def pcm_blocks(stream: BinaryIO, given: PcmFormat | None) -> Blocks:
    """Blocks of a tenth of a second, mono at 22.05 kHz, from PCM until the stream ends.

    Without a format, the stream begins with the header of a WAV file. The length that it states is not used,
    since a program that is still recording does not know it. Values that are not finite are silence. Raises
    `FormatError` for another header.
    """
    found = given or read_wav_header(stream)
    return resampled(_read(stream, found), found.rate_hz)


def _read(stream: BinaryIO, given: PcmFormat) -> Blocks:
    size = max(1, round(given.rate_hz * BLOCK_S)) * given.frame_bytes
    while data := stream.read(size):
        yield given.mono(data[: len(data) - len(data) % given.frame_bytes])


def _finite(block: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.clip(np.nan_to_num(block, nan=0.0), -1.0, 1.0)


def read_wav_header(stream: BinaryIO) -> PcmFormat:
    """The format of a WAV file whose samples come next in the stream. Raises `FormatError`."""
    head = stream.read(12)
    if len(head) < 12 or head[:4] not in (b"RIFF", b"RF64") or head[8:] != b"WAVE":
        raise FormatError(
            "standard input: expected the header of a WAV file, got other bytes: samples without one need "
            "their format, such as --pcm 44100:2:s16"
        )
    found, n_read = None, 0
    while len(chunk := stream.read(8)) == 8:
        name, size = chunk[:4], struct.unpack("<I", chunk[4:])[0]
        if name == b"data":
            if found is None:
                break
            return found
        n_read += size
        if n_read > _MOST_HEADER:
            break
        content = stream.read(size + size % 2)
        if name == b"fmt ":
            found = _wav_format(content)
    raise FormatError("standard input: expected samples after the header of a WAV file, got none: cut off?")


def _wav_format(content: bytes) -> PcmFormat:
    if len(content) < 16:
        raise FormatError("standard input: expected the format of a WAV file, got fewer bytes: cut off?")
    kind, channels, rate_hz, _, _, bits = struct.unpack_from("<HHIIHH", content)
    if kind == _EXTENSIBLE and len(content) >= 26:
        (kind,) = struct.unpack_from("<H", content, 24)
    names = {(_PCM, 8): "u8", (_PCM, 16): "s16", (_PCM, 24): "s24", (_PCM, 32): "s32", (_FLOAT, 32): "f32"}
    found = PcmFormat(rate_hz, channels, names.get((kind, bits), ""))
    if not found.encoding or not found.is_usual:
        raise FormatError(
            f"standard input: expected PCM of 8 to 32 bits at {_RATES_HZ[0]} to {_RATES_HZ[1]} Hz, got "
            f"format {kind}, {bits} bits, {channels} channels at {rate_hz} Hz"
        )
    return found


@contextmanager
def microphone() -> Iterator[Blocks]:
    """Blocks of the system's microphone, mono at 22.05 kHz, until the block ends.

    Raises `ChoreographError` without the package `sounddevice` or without a device.
    """
    sounddevice = sound_device("for a microphone")
    arrived: SimpleQueue[NDArray[np.float32] | None] = SimpleQueue()

    def take(block: NDArray[np.float32], n: int, times: Any, status: Any) -> None:
        arrived.put(block[:, 0].copy())

    try:
        rate_hz = float(sounddevice.query_devices(kind="input")["default_samplerate"])
        with sounddevice.InputStream(
            rate_hz, blocksize=round(rate_hz * BLOCK_S), channels=1, dtype="float32", callback=take
        ):
            yield resampled(_recorded(arrived), rate_hz)
            arrived.put(None)
    except sounddevice.PortAudioError as error:
        raise ChoreographError(f"expected a microphone for --input mic, got: {error}") from None


def _recorded(arrived: SimpleQueue[NDArray[np.float32] | None]) -> Blocks:
    while (block := arrived.get()) is not None:
        yield _finite(block)
