"""Decodes audio files to a sample rate and blocks of floats, by soundfile where it is exact, else by PyAV."""

from __future__ import annotations

import mmap
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from choreograph.core.errors import FormatError
from choreograph.core.files import check_regular

if TYPE_CHECKING:
    import av.container

# Decoding by PyAV, whose FFmpeg reads nearly every container and codec.


BLOCK_FRAMES = 1 << 18
_FORMATS = (
    "aac,ac3,eac3,aiff,amr,ape,asf,au,avi,caf,dsf,dts,flac,flv,matroska,webm,mov,mp4,m4a,3gp,3g2,mj2,mp3,mpeg,"
    "mpegts,mpc,mpc8,ogg,rm,tak,tta,voc,w64,wav,wv,xwma"
)
# Containers that state the length of their sound, by FFmpeg's names. For others, FFmpeg estimates the length
# from the size of the file and the bit rate at its beginning.
_STATE_LENGTH = "aiff,ape,asf,au,avi,caf,dsf,flac,mov,mpc,mpc8,ogg,rm,tak,tta,wv,xwma"
# An mp3 may state the length in a first frame without sound. After a header of 4 bytes and 9, 17 or 32
# others, it has a name, flags and, if the lowest flag is set, the number of frames. Some encoders write a
# VBRI header.
_MP3_LENGTH = re.compile(
    rb"\xff([\xe2-\xff])..(?:(?:.{32}|.{17}|.{9})(?:Xing|Info)...[\1\3\5\7\x09\x0b\x0d\x0f]|.{32}VBRI.{10})(.{4})",
    re.DOTALL,
)
_MP3_LARGEST_FRAME_BYTES = 2881
_NO_SOUND = re.compile(b"ID3|TAG|APETAGEX|" + _MP3_LENGTH.pattern, re.DOTALL)  # between parts of joined files
_ID3V1_BYTES = 128
_APE_FOOTER_BYTES = 32
# A stated length is exact only to about a packet (lossy codecs pad both ends).
_LENGTH_SLACK_S = 0.5
_NOTED_S = 0.5  # of lost sound

Blocks = Iterator[NDArray[np.float32]]  # each (S_b, channels)


@dataclass(frozen=True, eq=False)
class Decoding:
    """The decoding of a file."""

    rate_hz: int
    n_channels: int
    blocks: Blocks
    notes: list[str]  # what was lost, one line each, complete when all blocks are read


def damaged(path: Path, reason: str) -> FormatError:
    """The error of a song that cannot be decoded to its end."""
    return FormatError(
        f"expected a whole song in {path}, got damaged sound ({reason}): the file may be cut off"
    )


def cut_off(path: Path, got_s: float, stated_s: float) -> FormatError:
    """The error of a song that ends long before the length that it states."""
    return FormatError(
        f"expected {stated_s:.1f} s of sound in {path}, got {got_s:.1f} s: the file is cut off"
    )


def has_sound(path: Path) -> bool:
    """Whether a video has sound. False also for a file that is not a video."""
    try:
        with _opened(path) as container:
            return bool(container.streams.audio)
    except FormatError:
        return False


def ffmpeg_decoding(path: Path, notes: list[str]) -> Decoding:
    """The first sound of a container. Appends to `notes`. Raises `FormatError` if there is none."""
    container = _opened(path)
    streams = container.streams.audio
    if not streams or not getattr(streams[0], "rate", 0):  # 0 if the codec is unknown
        container.close()
        raise FormatError(f"expected a song in {path}, got a {container.format.name} file without sound")
    blocks = _blocks(path, container, streams[0], notes)
    return Decoding(streams[0].rate, streams[0].channels, blocks, notes)


def _opened(path: Path) -> av.container.InputContainer:
    """The container of a file. Playlists, which open other files, are not among the formats."""
    import av

    check_regular(path, "a song")
    # Tags in unknown encodings are no reason to refuse a song. PyAV 19 does not decode them here.
    tags: dict[str, Any] = {"metadata_errors": "ignore"} if int(av.__version__.split(".")[0]) < 19 else {}
    # Options of streams, too, would crash PyAV 14 in containers that have none before their first packet.
    limits = {"format_whitelist": _FORMATS, "protocol_whitelist": "file"}
    try:
        # "file:" is needed, since a name with a colon would be read as an address.
        container: av.container.InputContainer = av.open(f"file:{path}", container_options=limits, **tags)
        return container
    except (av.FFmpegError, ValueError) as error:
        raise FormatError(
            f"expected a song in {path}, got a file that is not audio or is cut off ({_reason(error)})"
        ) from error


def _blocks(path: Path, container: Any, stream: Any, notes: list[str]) -> Blocks:
    import av

    reader = _PacketReader(path, container, stream)
    pending: list[NDArray[np.float32]] = []
    n_pending = n_frames = 0
    with container:
        try:
            for packet in container.demux(stream):
                for samples in reader.read(packet):  # (S_f, channels)
                    pending.append(samples)
                    n_pending += len(samples)
                if n_pending >= BLOCK_FRAMES:
                    n_frames += n_pending
                    yield np.concatenate(pending)
                    pending, n_pending = [], 0
        except av.FFmpegError as error:
            raise damaged(path, _reason(error)) from error
        if pending:
            n_frames += n_pending
            yield np.concatenate(pending)
    got_s, stated_s, n_bad, n_good = n_frames / reader.rate_hz, reader.stated_s, reader.n_bad, reader.n_good
    if n_bad > max(2, n_good // 10):
        raise damaged(path, f"{n_bad} of {n_bad + n_good} packets cannot be decoded")
    if got_s < 0.98 * stated_s - _LENGTH_SLACK_S and container.format.name != "ogg":
        raise cut_off(path, got_s, stated_s)
    if got_s < stated_s - _NOTED_S:
        notes.append(f"the song is damaged: {stated_s - got_s:.1f} s of {stated_s:.1f} s are lost")
    elif n_bad > 2:  # those at the beginning refer to bytes before it
        notes.append(f"the song is damaged: {n_bad} of {n_bad + n_good} packets are lost")


class _PacketReader:
    """Decodes packets to floats (S, channels) at the rate of the stream.

    Parts of a joined file may have other rates. The number of packets that cannot be decoded and the length
    that the file states are available as well.
    """

    def __init__(self, path: Path, container: Any, stream: Any) -> None:
        self.n_good = self.n_bad = 0
        self.stated_s = 0.0  # 0 if none is stated
        # Kept here, since the attributes of the stream change with the decoded packets.
        self.rate_hz, self._n_channels = stream.rate, stream.channels
        self._resampler: Any = None
        self._kind: tuple[object, ...] = ()  # of the frames that the resampler takes
        self._path, self._tags_at = path, _tags_at(path)
        self._format = container.format.name
        if stream.duration and self._format.split(",")[0] in _STATE_LENGTH.split(","):
            self.stated_s = float(stream.duration * stream.time_base)
        self._is_first = True
        self._n_bad_at_end = 0  # junk after the sound, unless more sound follows

    def read(self, packet: Any) -> Iterator[NDArray[np.float32]]:
        """The samples of a packet, and after the last packet the remaining samples."""
        import av

        if self._is_first and self._format == "mp3":
            self.stated_s = _mp3_stated_s(self._path, packet.pos or 0, self.rate_hz)
        self._is_first = False
        if (packet.pos or 0) >= self._tags_at:
            return
        if self._format in ("mp3", "aac") and _NO_SOUND.match(bytes(packet)):
            return
        try:
            frames = packet.decode()
        except av.FFmpegError:
            self._n_bad_at_end += 1  # the first frames of a cut mp3 refer to missing bytes
            return
        if frames and packet.size:
            self.n_good += 1
            self.n_bad, self._n_bad_at_end = self.n_bad + self._n_bad_at_end, 0
        for frame in frames:
            yield from self._converted(frame)
        if not packet.size:
            yield from self._resampled(None)

    def _converted(self, frame: Any) -> Iterator[NDArray[np.float32]]:
        import av

        kind = frame.format.name, frame.layout.name, frame.sample_rate
        if kind != self._kind:
            yield from self._resampled(None)
            self._resampler = av.AudioResampler(format="flt", layout=frame.layout, rate=self.rate_hz)
            self._kind = kind
        yield from self._resampled(frame)

    def _resampled(self, frame: Any) -> Iterator[NDArray[np.float32]]:
        for resampled in self._resampler.resample(frame) if self._resampler is not None else ():
            if resampled is not None:
                samples = np.asarray(resampled.to_ndarray(), np.float32)
                samples = samples.reshape(-1, resampled.layout.nb_channels)  # (S_f, channels of the part)
                if samples.shape[1] != self._n_channels:  # FFmpeg would convert mono to stereo 3 dB quieter
                    samples = np.repeat(samples.mean(axis=1, keepdims=True), self._n_channels, axis=1)
                yield samples


def _mp3_stated_s(path: Path, sound_at: int, rate_hz: int) -> float:
    """The length stated in the frame before the first sound, or 0 if there is no such frame."""
    with open(path, "rb") as file:
        file.seek(max(0, sound_at - _MP3_LARGEST_FRAME_BYTES))
        found = _MP3_LENGTH.search(file.read(min(sound_at, _MP3_LARGEST_FRAME_BYTES)))
    if found is None:
        return 0.0
    frame_samples = 1152 if found[1][0] & 8 else 576  # MPEG 1, or 2 and 2.5
    return int.from_bytes(found[2], "big") * frame_samples / rate_hz


def _tags_at(path: Path) -> int:
    """The beginning of an APE tag after the sound, whose picture FFmpeg reads as frames, or the end."""
    with open(path, "rb") as file:
        end = size = file.seek(0, os.SEEK_END)
        file.seek(max(0, size - _ID3V1_BYTES - _APE_FOOTER_BYTES))
        tail = file.read()
    if tail[-_ID3V1_BYTES:].startswith(b"TAG"):
        tail, end = tail[:-_ID3V1_BYTES], size - _ID3V1_BYTES
    footer = tail[-_APE_FOOTER_BYTES:]
    if not footer.startswith(b"APETAGEX"):
        return size
    has_header = footer[23] & 0x80
    return end - int.from_bytes(footer[12:16], "little") - (_APE_FOOTER_BYTES if has_header else 0)


def _reason(error: Exception) -> str:
    return (getattr(error, "strerror", None) or str(error)).splitlines()[0]


# Choice of the decoder: soundfile where it is exact, else PyAV.


_SOUNDFILE_MAGIC = (b"RIFF", b"RIFX", b"RF64", b"fLaC", b"OggS", b"FORM")
_OGG_HEADER_BYTES = 27  # without the table of segments
_OGG_LAST_PAGE = 4
# Files of chunks, with the byte order of sizes and the chunk of the sound.
_CHUNKED: dict[bytes, tuple[Literal["little", "big"], bytes]] = {
    b"RIFF": ("little", b"data"),
    b"RF64": ("little", b"data"),
    b"RIFX": ("big", b"data"),
    b"FORM": ("big", b"SSND"),
}
_CHUNK_SLACK_BYTES = 4096  # some programs also count the header, or an incomplete last block
_UNKNOWN_FRAMES = 1 << 62  # libsndfile reports at least so many if a FLAC does not state its length

_RATES_HZ = (2000, 6_144_000)  # from telephones to one-bit recordings
_MAX_CHANNELS = 64
_LARGEST = 1e3  # sample: 60 dB over full scale


def decode(path: Path) -> Decoding:
    """The sample rate and the blocks of an existing, non-empty file.

    Raises `FormatError` immediately if it is not audio, and while iterating if more than a little is cut off
    or damaged, or samples are far beyond full scale.
    """
    decoding = _decoding(path)
    if not (_RATES_HZ[0] <= decoding.rate_hz <= _RATES_HZ[1] and 1 <= decoding.n_channels <= _MAX_CHANNELS):
        raise FormatError(
            f"expected a song of {_RATES_HZ[0]} to {_RATES_HZ[1]} Hz in 1 to {_MAX_CHANNELS} channels in "
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
    if magic == b"OggS":  # soundfile skips damaged pages without an error
        is_whole, has_end = _ogg_pages(path)
        if not has_end:
            notes.append("the file ends before the song does: the missing part is not danced")
    if is_whole and magic in _SOUNDFILE_MAGIC:
        if magic in _CHUNKED:
            _check_sound_chunk(path, notes)
        try:
            # Bytes, since a name need not be text. Where names are text, soundfile expects text.
            sound = soundfile.SoundFile(os.fsencode(path) if os.name == "posix" else path)
        except soundfile.LibsndfileError:
            pass  # an unusual codec in a known container: FFmpeg reads more of them
        else:
            if _states_frames(sound):
                return Decoding(sound.samplerate, sound.channels, _soundfile_blocks(path, sound), notes)
            sound.close()
    return ffmpeg_decoding(path, notes)


def _states_frames(sound: Any) -> bool:
    """Whether libsndfile reads the length from the file. It does not for a stream, or for mp3 in a WAV."""
    return 0 < sound.frames < _UNKNOWN_FRAMES and not sound.subtype.startswith("MPEG")


def _soundfile_blocks(path: Path, sound: Any) -> Blocks:
    import soundfile

    n_frames = 0
    with sound:
        while True:
            try:
                block = sound.read(BLOCK_FRAMES, dtype="float32", always_2d=True)
            except soundfile.LibsndfileError as error:
                raise damaged(path, str(error)) from error
            if len(block) == 0:
                break
            n_frames += len(block)
            yield block
        got_s, stated_s = n_frames / sound.samplerate, sound.frames / sound.samplerate
        if got_s < stated_s - _LENGTH_SLACK_S:
            raise cut_off(path, got_s, stated_s)


def _ogg_pages(path: Path) -> tuple[bool, bool]:
    """Whether the pages of an Ogg file are continuous, and whether the last one is marked as such."""
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


def _check_sound_chunk(path: Path, notes: list[str]) -> None:
    """Raise `FormatError` if much of the chunk of sound is cut off, which libsndfile does not report."""
    with open(path, "rb") as file:
        header = file.read(12)
        order, wanted = _CHUNKED[header[:4]]
        n_64_bytes = 0xFFFFFFFF  # of the sound in files above 4 GB
        while len(header := file.read(8)) == 8:
            n_bytes = int.from_bytes(header[4:], order)
            if header[:4] == wanted:
                break
            if header[:4] == b"ds64":
                n_64_bytes = int.from_bytes(file.read(16)[8:], order)
                n_bytes -= 16
            file.seek(n_bytes + n_bytes % 2, os.SEEK_CUR)
        else:
            return  # without such a chunk, the decoders report the error
        n_present = os.path.getsize(path) - file.tell()
    is_streamed = 0x7FFFF000 <= n_bytes < 0xFFFFFFFF
    n_bytes = n_64_bytes if n_bytes == 0xFFFFFFFF else n_bytes
    if is_streamed or n_bytes == 0xFFFFFFFF or n_present >= n_bytes:
        return
    if n_present < 0.98 * n_bytes:
        raise FormatError(
            f"expected {n_bytes} bytes of sound in {path}, got {n_present}: the file is cut off"
        )
    if n_present < n_bytes - _CHUNK_SLACK_BYTES:
        notes.append(f"the song is cut off: the last {n_bytes - n_present} of {n_bytes} bytes are lost")
