"""Songs in many formats, as encoders and other programs leave them, made in a moment."""

from __future__ import annotations

import io
import struct
from fractions import Fraction
from functools import cache

import av
import numpy as np
import soundfile

SECONDS = 3.0
TONE_HZ = 440


def sound(rate_hz: int, n_channels: int) -> np.ndarray:
    """Half a second of silence, then a tone in noise, so that a variable bit rate varies: (S, C)."""
    times_s = np.arange(round(SECONDS * rate_hz)) / rate_hz
    noise = np.random.default_rng(0).normal(scale=0.02, size=(len(times_s), n_channels))
    tone = 0.3 * np.sin(2 * np.pi * TONE_HZ * times_s)
    return ((times_s > 0.5)[:, None] * (tone[:, None] + noise)).astype(np.float32)


@cache
def pcm(
    kind: str,
    subtype: str = "PCM_16",
    rate_hz: int = 44100,
    n_channels: int = 2,
    endian: str = "FILE",
    **settings,
) -> bytes:
    """A file of soundfile's."""
    content, samples = io.BytesIO(), sound(rate_hz, n_channels)
    soundfile.write(content, samples, rate_hz, format=kind, subtype=subtype, endian=endian, **settings)
    return content.getvalue()


class Stream(io.RawIOBase):
    """What cannot be sought in, so that no length is written into a header when the song has ended."""

    def __init__(self) -> None:
        self.content = bytearray()

    def writable(self) -> bool:
        return True

    def write(self, data) -> int:
        self.content += data
        return len(data)


@cache
def encoded(
    muxer: str,
    codec: str,
    rate_hz: int = 44100,
    layout: str = "stereo",
    *,
    quality: int | None = None,  # of a variable bit rate; None: 128 kbit/s throughout
    streamed: bool = False,
    with_picture: bool = False,
    **options: str,
) -> bytes:
    """A file of FFmpeg's."""
    content = Stream() if streamed else io.BytesIO()
    rates = {"b": "128000"} if quality is None else {"flags": "+qscale", "global_quality": str(118 * quality)}
    with av.open(content, "w", format=muxer, options=options) as container:
        picture = container.add_stream("mpeg4", rate=25) if with_picture else None
        stream = container.add_stream(codec, rate=rate_hz, layout=layout, options=rates)
        samples = sound(rate_hz, len(stream.layout.channels)).T  # (C, S)
        frame = av.AudioFrame.from_ndarray(np.ascontiguousarray(samples), "fltp", layout)
        frame.sample_rate, frame.time_base = rate_hz, Fraction(1, rate_hz)
        if picture is not None:
            picture.width = picture.height = 32
            picture.pix_fmt = "yuv420p"
            shown = av.VideoFrame.from_ndarray(np.zeros((32, 32, 3), np.uint8), "rgb24")
            shown.pts, shown.time_base = 0, Fraction(1, 25)
            container.mux([*picture.encode(shown), *picture.encode(None)])
        container.mux([*stream.encode(frame), *stream.encode(None)])
    return bytes(content.content) if isinstance(content, Stream) else content.getvalue()


def mp3(rate_hz: int = 44100, layout: str = "stereo", *, quality: int | None = None) -> bytes:
    """Frames alone, without tags and without a header that states the length."""
    return encoded("mp3", "libmp3lame", rate_hz, layout, quality=quality, write_xing="0", id3v2_version="0")


def aac(rate_hz: int = 44100, layout: str = "stereo") -> bytes:
    return encoded("adts", "aac", rate_hz, layout)


def chunk(name: bytes, data: bytes) -> bytes:
    return name + struct.pack("<I", len(data)) + data + bytes(len(data) % 2)


def with_chunks(before: bytes = b"", after: bytes = b"") -> bytes:
    """A WAV with chunks before its sound and after it."""
    wav = pcm("WAV")
    data = wav.index(b"data")
    body = wav[12:data] + before + wav[data:] + after
    return b"RIFF" + struct.pack("<I", 4 + len(body)) + b"WAVE" + body


def with_stated_bytes(wav: bytes, riff: int, data: int) -> bytes:
    """A WAV that states other lengths, as programs do that write a stream."""
    at = wav.index(b"data") + 4
    return wav[:4] + struct.pack("<I", riff) + wav[8:at] + struct.pack("<I", data) + wav[at + 4 :]


def id3v2(frames: bytes = b"", padding: int = 0) -> bytes:
    n_bytes = len(frames) + padding
    size = bytes(n_bytes >> shift & 127 for shift in (21, 14, 7, 0))
    return b"ID3\3\0\0" + size + frames + bytes(padding)


def id3v2_frame(name: bytes, data: bytes) -> bytes:
    return name + struct.pack(">I", len(data)) + b"\0\0" + data


def cover_picture(n_bytes: int) -> bytes:
    """A frame with a picture, of noise as a JPEG is; bytes such as begin an mp3 frame are in it."""
    noise = np.random.default_rng(1).bytes(n_bytes - 2)
    return id3v2_frame(b"APIC", b"\0image/jpeg\0\3\0" + b"\xff\xd8" + noise)


ID3V1 = b"TAG" + "Café del Mar".encode("latin-1").ljust(30, b"\0") + bytes(94) + b"\x0c"


def ape(picture: bytes) -> bytes:
    """An APE tag, as some programs put after the sound of an mp3."""
    item = struct.pack("<II", len(picture), 2) + b"Cover Art (Front)\0" + picture
    size = struct.pack("<III", 2000, len(item) + 32, 1)
    header, footer = (b"APETAGEX" + size + struct.pack("<IQ", flags, 0) for flags in (0xA0000000, 0x80000000))
    return header + item + footer


LATIN_INFO = chunk(b"LIST", b"INFO" + chunk(b"INAM", "Café".encode("latin-1") + b"\0"))


def without_total_samples(flac: bytes) -> bytes:
    """The 36 bits after 8 + 20 bytes of STREAMINFO's rate, channels and depth are 0 where unknown."""
    packed = int.from_bytes(flac[18:26], "big") >> 36 << 36
    return flac[:18] + packed.to_bytes(8, "big") + flac[26:]
