"""Audio files as a sample rate and an iterator of float blocks: soundfile where it is exact, else PyAV."""

from __future__ import annotations

import mmap
import os
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np

from choreograph.audio.ffmpeg import BLOCK_FRAMES, Blocks, Decoding, cut_off, damaged, ffmpeg_decoding
from choreograph.errors import FormatError
from choreograph.files import check_regular

_SOUNDFILE_MAGIC = (b"RIFF", b"RIFX", b"RF64", b"fLaC", b"OggS", b"FORM")
_OGG_HEADER_BYTES = 27  # without the table of segments
_OGG_LAST_PAGE = 4
# Files of chunks: the order of the bytes in a size, and the chunk that holds the sound.
_CHUNKED: dict[bytes, tuple[Literal["little", "big"], bytes]] = {
    b"RIFF": ("little", b"data"),
    b"RF64": ("little", b"data"),
    b"RIFX": ("big", b"data"),
    b"FORM": ("big", b"SSND"),
}
_CHUNK_SLACK_BYTES = 4096  # some programs count the header, too, or a last block that is not whole
_UNKNOWN_FRAMES = 1 << 62  # libsndfile says this many or more where a FLAC leaves its length open
_LENGTH_SLACK_S = 0.5

_RATES_HZ = (2000, 6_144_000)  # of telephones, and of the finest one-bit recordings
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
    if magic == b"OggS":  # soundfile reads past damaged pages as if there were none
        is_whole, has_end = _ogg_pages(path)
        if not has_end:
            notes.append("the song is cut off: what followed its end is lost")
    if is_whole and magic in _SOUNDFILE_MAGIC:
        if magic in _CHUNKED:
            _check_sound_chunk(path, notes)
        try:
            # Bytes, since a name need not be text; where names are text, soundfile wants it.
            sound = soundfile.SoundFile(os.fsencode(path) if os.name == "posix" else path)
        except soundfile.LibsndfileError:
            pass  # an unusual codec in a known container: FFmpeg reads more of them
        else:
            if _states_frames(sound):
                return Decoding(sound.samplerate, sound.channels, _soundfile_blocks(path, sound), notes)
            sound.close()
    return ffmpeg_decoding(path, notes)


def _states_frames(sound) -> bool:
    """Whether libsndfile takes the length from the file: not of a stream, and of mp3 in a WAV it guesses."""
    return 0 < sound.frames < _UNKNOWN_FRAMES and not sound.subtype.startswith("MPEG")


def _soundfile_blocks(path: Path, sound) -> Blocks:
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


def _check_sound_chunk(path: Path, notes: list[str]) -> None:
    """Raise `FormatError` if much of the chunk of sound is cut off, which libsndfile does not say."""
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
            return  # no such chunk: the decoders say what the file lacks
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
