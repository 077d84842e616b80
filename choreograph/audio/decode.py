"""Audio files as a sample rate and an iterator of float blocks: soundfile where it is exact, else PyAV."""

from __future__ import annotations

import mmap
import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
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
_OGG_HEADER_BYTES = 27  # without the table of segments
_OGG_LAST_PAGE = 4
_FORMATS = (
    "aac,ac3,eac3,aiff,amr,ape,asf,au,avi,caf,dsf,dts,flac,flv,matroska,webm,mov,mp4,m4a,3gp,3g2,mj2,mp3,mpeg,"
    "mpegts,mpc,mpc8,ogg,rm,tak,tta,voc,w64,wav,wv,xwma"
)
# The length stated by a container is exact only to about a packet (lossy codecs pad both ends).
_LENGTH_SLACK_S = 0.5

_NOTED_S = 0.5  # of lost sound
_RATES_HZ = (2000, 6_144_000)  # of telephones, and of the finest one-bit recordings
_MAX_CHANNELS = 64
_LARGEST = 1e3  # sample: 60 dB over full scale

Blocks = Iterator[NDArray[np.float32]]  # each (S_b, channels)


@dataclass(frozen=True, eq=False)
class Decoding:
    """A file as it is decoded."""

    rate_hz: int
    n_channels: int
    blocks: Blocks
    notes: list[str]  # what was lost, a line each; complete when all blocks are read


def decode(path: Path) -> Decoding:
    """The sample rate and the blocks of an existing, non-empty file.

    Raises `FormatError` immediately if it is not audio, and while iterating if more than a little is cut off
    or damaged, or samples are far beyond full scale.
    """
    decoding = _decoding(path)
    if not _RATES_HZ[0] <= decoding.rate_hz <= _RATES_HZ[1] or decoding.n_channels > _MAX_CHANNELS:
        raise FormatError(
            f"expected a song of {_RATES_HZ[0]} to {_RATES_HZ[1]} Hz in up to {_MAX_CHANNELS} channels in "
            f"{path}, got {decoding.rate_hz} Hz in {decoding.n_channels}: a damaged header"
        )
    return replace(decoding, blocks=_checked(path, decoding.blocks))


def _checked(path: Path, blocks: Blocks) -> Blocks:
    for block in blocks:
        if not (np.abs(block) < _LARGEST).all():  # nor NaN
            raise FormatError(
                f"expected samples from -1 to 1 in {path}, got NaN, infinity or over {_LARGEST:g}: "
                "the program that wrote it failed"
            )
        yield block


def _decoding(path: Path) -> Decoding:
    import soundfile

    try:
        with open(check_regular(path, "a song"), "rb") as file:
            magic = file.read(4)
    except OSError as error:
        raise FormatError(f"expected a readable song at {path}, got: {error.strerror}") from error
    notes: list[str] = []
    is_whole = True
    if magic == b"OggS":  # soundfile reads past damaged pages as if there were none
        is_whole, has_end = _ogg_pages(path)
        if not has_end:
            notes.append("the song is cut off: what followed its end is lost")
    if is_whole and magic in _SOUNDFILE_MAGIC:
        if magic in (b"RIFF", b"RF64"):
            _check_wav_complete(path)
        try:
            # Bytes, since a name need not be text; where names are text, soundfile wants it.
            sound = soundfile.SoundFile(os.fsencode(path) if os.name == "posix" else path)
        except soundfile.LibsndfileError:
            pass  # an unusual codec in a known container: FFmpeg reads more of them
        else:
            return Decoding(sound.samplerate, sound.channels, _soundfile_blocks(path, sound), notes)
    return _av_decoding(path, notes)


def _soundfile_blocks(path: Path, sound) -> Blocks:
    import soundfile

    n_frames = 0
    with sound:
        while True:
            try:
                block = sound.read(_BLOCK_FRAMES, dtype="float32", always_2d=True)
            except soundfile.LibsndfileError as error:
                raise FormatError(_damaged(path, str(error))) from error
            if len(block) == 0:
                break
            n_frames += len(block)
            yield block
        got_s, stated_s = n_frames / sound.samplerate, sound.frames / sound.samplerate
        if got_s < stated_s - _LENGTH_SLACK_S:
            raise FormatError(_cut_off(path, got_s, stated_s))


def _ogg_pages(path: Path) -> tuple[bool, bool]:
    """Whether an Ogg file's pages follow each other, and whether the one at its end is marked as the last."""
    with open(path, "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        at, flags, following = 0, 0, dict[bytes, int]()
        while data[at : at + 4] == b"OggS" and at + _OGG_HEADER_BYTES <= len(data):
            flags, stream, number = data[at + 5], data[at + 14 : at + 18], data[at + 18 : at + 22]
            found = int.from_bytes(number, "little")
            if following.setdefault(stream, found) != found:
                return False, True
            following[stream] = found + 1
            n_segments = data[at + 26]
            at += _OGG_HEADER_BYTES + n_segments + sum(data[at + 27 : at + 27 + n_segments])
        return at >= len(data), at < len(data) or (at == len(data) and bool(flags & _OGG_LAST_PAGE))


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

    check_regular(path, "a song")
    try:
        # "file:", or a name with a colon would be taken for an address.
        options = {"format_whitelist": _FORMATS, "protocol_whitelist": "file"}
        return av.open(f"file:{path}", metadata_errors="ignore", options=options)
    except (av.FFmpegError, ValueError) as error:
        raise FormatError(
            f"expected a song in {path}, got a file that is not audio or is cut off ({_reason(error)})"
        ) from error


def _av_decoding(path: Path, notes: list[str]) -> Decoding:
    container = _opened(path)
    streams = container.streams.audio
    if not streams or not getattr(streams[0], "rate", 0):  # none where the codec is unknown
        container.close()
        raise FormatError(f"expected a song in {path}, got a {container.format.name} file without sound")
    blocks = _av_blocks(path, container, streams[0], notes)
    return Decoding(streams[0].rate, streams[0].channels, blocks, notes)


def _av_blocks(path: Path, container, stream, notes: list[str]) -> Blocks:
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
    got_s = n_frames / rate_hz
    if got_s < 0.98 * expected_s - _LENGTH_SLACK_S and container.format.name != "ogg":
        raise FormatError(_cut_off(path, got_s, expected_s))
    if got_s < expected_s - _NOTED_S:
        notes.append(f"the song is damaged: {expected_s - got_s:.1f} s of {expected_s:.1f} s are lost")
    elif n_bad > 2:  # those at the beginning refer to bytes before it
        notes.append(f"the song is damaged: {n_bad} of {n_bad + n_good} packets are lost")


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
