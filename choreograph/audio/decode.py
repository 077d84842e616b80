"""Audio files as a sample rate and an iterator of float blocks: soundfile where it is exact, else PyAV."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from choreograph.errors import FormatError
from choreograph.files import check_regular

if TYPE_CHECKING:
    import av.container

_BLOCK_FRAMES = 1 << 18
_SOUNDFILE_MAGIC = (b"RIFF", b"RF64", b"fLaC", b"OggS", b"FORM")
_FORMATS = (
    "aac,ac3,eac3,aiff,amr,ape,asf,au,avi,caf,dsf,dts,flac,flv,matroska,webm,mov,mp4,m4a,3gp,3g2,mj2,mp3,mpeg,"
    "mpegts,mpc,mpc8,ogg,rm,tak,tta,voc,w64,wav,wv,xwma"
)
# The length stated by a container is exact only to about a packet (lossy codecs pad both ends).
_LENGTH_SLACK_S = 0.5

Blocks = Iterator[NDArray[np.float32]]  # each (S_b, channels)


def decoded_blocks(path: Path) -> tuple[int, Blocks]:
    """Sample rate in Hz and blocks (S_b, channels) of an existing, non-empty file.

    Raises `FormatError` immediately if it is not audio, and while iterating if it is cut off or damaged.
    """
    import soundfile

    try:
        with open(check_regular(path, "a song"), "rb") as file:
            magic = file.read(4)
    except OSError as error:
        raise FormatError(f"expected a readable song at {path}, got: {error.strerror}") from error
    if magic in _SOUNDFILE_MAGIC:
        if magic in (b"RIFF", b"RF64"):
            _check_wav_complete(path)
        try:
            sound = soundfile.SoundFile(path)
        except soundfile.LibsndfileError:
            pass  # an unusual codec in a known container: FFmpeg reads more of them
        else:
            return sound.samplerate, _soundfile_blocks(path, sound)
    return _av_blocks(path)


def _soundfile_blocks(path: Path, sound) -> Blocks:
    import soundfile

    with sound:
        while True:
            try:
                block = sound.read(_BLOCK_FRAMES, dtype="float32", always_2d=True)
            except soundfile.LibsndfileError as error:
                raise FormatError(_damaged(path, str(error))) from error
            if len(block) == 0:
                break
            yield block
        if sound.tell() < sound.frames - _LENGTH_SLACK_S * sound.samplerate and sound.format != "OGG":
            raise FormatError(
                _cut_off(path, sound.tell() / sound.samplerate, sound.frames / sound.samplerate)
            )


def has_sound(path: Path) -> bool:
    """Whether a video has sound; False also for a file that is none."""
    try:
        with _opened(path) as container:
            return bool(container.streams.audio)
    except FormatError:
        return False


def _opened(path: Path) -> av.container.InputContainer:
    """The container of a file; playlists, which open other files, are not among the formats."""
    import av

    try:
        return av.open(str(path), metadata_errors="ignore", options={"format_whitelist": _FORMATS})
    except (av.FFmpegError, ValueError) as error:
        raise FormatError(
            f"expected a song in {path}, got a file that is not audio or is cut off ({_reason(error)})"
        ) from error


def _av_blocks(path: Path) -> tuple[int, Blocks]:
    container = _opened(path)
    streams = container.streams.audio
    if not streams or not streams[0].rate:
        container.close()
        raise FormatError(f"expected a song in {path}, got a {container.format.name} file without sound")
    return streams[0].rate, _av_frames(path, container, streams[0])


def _av_frames(path: Path, container, stream) -> Blocks:
    import av

    rate_hz, channels = stream.rate, stream.channels
    to_float = av.AudioResampler(format="flt", layout=stream.layout, rate=rate_hz)
    pending: list[NDArray[np.float32]] = []
    n_pending = n_frames = n_bad = n_good = 0
    with container:
        try:
            for packet in container.demux(stream):
                try:
                    frames = packet.decode()
                    n_good += len(frames) > 0
                except av.error.InvalidDataError:
                    n_bad += 1  # the first frames of a cut mp3 refer to missing bytes
                    continue
                for frame in frames:
                    for converted in to_float.resample(frame):
                        samples = np.asarray(converted.to_ndarray(), np.float32)
                        pending.append(samples.reshape(-1, channels))  # (S_f, channels)
                        n_pending += len(pending[-1])
                if n_pending >= _BLOCK_FRAMES:
                    n_frames += n_pending
                    yield np.concatenate(pending)
                    pending, n_pending = [], 0
        except av.FFmpegError as error:
            raise FormatError(_damaged(path, _reason(error))) from error
        if n_bad > max(2, n_good // 10):
            raise FormatError(_damaged(path, f"{n_bad} of {n_bad + n_good} packets cannot be decoded"))
        if pending:
            n_frames += n_pending
            yield np.concatenate(pending)
        expected_s = float(stream.duration * stream.time_base) if stream.duration else 0.0
    if n_frames / rate_hz < 0.98 * expected_s - _LENGTH_SLACK_S:
        raise FormatError(_cut_off(path, n_frames / rate_hz, expected_s))


def _check_wav_complete(path: Path) -> None:
    """Decoders silently shorten a truncated WAV, but its data chunk states the full length."""
    size = os.path.getsize(path)
    with open(path, "rb") as file:
        riff = file.read(12)
        if riff[:4] != b"RIFF" or riff[8:] != b"WAVE":
            return
        while len(header := file.read(8)) == 8:
            chunk_bytes = int.from_bytes(header[4:], "little")
            if header[:4] == b"data":
                present = size - file.tell()
                streamed = chunk_bytes in (0, 0xFFFFFFFF) or chunk_bytes >= 0x7FFFF000
                if not streamed and present < chunk_bytes:
                    raise FormatError(
                        f"expected {chunk_bytes} bytes of sound in {path}, got {present}: the file is cut off"
                    )
                return
            file.seek(chunk_bytes + chunk_bytes % 2, os.SEEK_CUR)
    raise FormatError(f"expected a song in {path}, got a WAV header without sound: the file is cut off")


def _reason(error: Exception) -> str:
    return (getattr(error, "strerror", None) or str(error)).splitlines()[0]


def _damaged(path: Path, reason: str) -> str:
    return f"expected a whole song in {path}, got damaged sound ({reason}): the file may be cut off"


def _cut_off(path: Path, got_s: float, expected_s: float) -> str:
    return f"expected {expected_s:.1f} s of sound in {path}, got {got_s:.1f} s: the file is cut off"
