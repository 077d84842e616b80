"""Songs as encoders, recorders, editors, cutters and downloads leave them: at most 1 % may be refused."""

from __future__ import annotations

import struct
from collections.abc import Callable
from functools import partial
from pathlib import Path

import av
import numpy as np
from acceptance.corpus import SaneFile, assert_read
from synthetic_songs import (
    ID3V1,
    LATIN_INFO,
    SECONDS,
    TONE_HZ,
    aac,
    ape,
    chunk,
    cover_picture,
    encoded,
    id3v2,
    id3v2_frame,
    mp3,
    pcm,
    with_chunks,
    with_stated_bytes,
    without_total_samples,
)

from choreograph.core.timebase import SAMPLE_RATE_HZ
from choreograph.music.song import load_song

JOINED = "joined"  # begins the names of files that hold two songs

Content = Callable[[], bytes]

SONGS: dict[str, tuple[str, Content]] = {  # name: suffix and content
    # WAV and its relatives
    "wav 16 bits": (".wav", lambda: pcm("WAV")),
    "wav 24 bits 96 kHz": (".wav", lambda: pcm("WAV", "PCM_24", 96000)),
    "wav 32 bits mono": (".wav", lambda: pcm("WAV", "PCM_32", 48000, 1)),
    "wav float": (".wav", lambda: pcm("WAV", "FLOAT", 48000)),
    "wav double": (".wav", lambda: pcm("WAV", "DOUBLE", 22050, 1)),
    "wav 8 bits": (".wav", lambda: pcm("WAV", "PCM_U8", 11025, 1)),
    "wav extensible six channels": (".wav", lambda: pcm("WAVEX", "PCM_24", 48000, 6)),
    "wav extensible float": (".wav", lambda: pcm("WAVEX", "FLOAT", 44100, 4)),
    "wav a-law": (".wav", lambda: pcm("WAV", "ALAW", 8000, 1)),
    "wav ima adpcm": (".wav", lambda: pcm("WAV", "IMA_ADPCM")),
    "wav ms adpcm": (".wav", lambda: pcm("WAV", "MS_ADPCM")),
    "wav gsm": (".wav", lambda: pcm("WAV", "GSM610", 8000, 1)),
    "wav of mp3": (".wav", lambda: encoded("wav", "libmp3lame")),
    "wav of variable mp3": (".wav", lambda: encoded("wav", "libmp3lame", quality=2)),
    "wav g726": (".wav", lambda: encoded("wav", "g726", 8000, "mono")),
    "wav big endian": (".wav", lambda: pcm("WAV", endian="BIG")),
    "wav rf64": (".wav", lambda: pcm("RF64")),
    "wav list before": (".wav", lambda: with_chunks(before=LATIN_INFO + chunk(b"JUNK", bytes(2000)))),
    "wav list after": (".wav", lambda: with_chunks(after=LATIN_INFO + chunk(b"id3 ", id3v2(padding=99)))),
    "wav cue and broadcast chunks": (
        ".wav",
        lambda: with_chunks(chunk(b"bext", bytes(602)), chunk(b"cue ", struct.pack("<I", 0))),
    ),
    "wav that counts its header": (
        ".wav",
        lambda: with_stated_bytes(pcm("WAV"), len(pcm("WAV")), len(pcm("WAV"))),
    ),
    "wav streamed ffffffff": (".wav", lambda: with_stated_bytes(pcm("WAV"), 0xFFFFFFFF, 0xFFFFFFFF)),
    "wav streamed 0": (".wav", lambda: with_stated_bytes(pcm("WAV"), 0, 0)),
    "wav streamed by ffmpeg": (".wav", lambda: encoded("wav", "pcm_s16le", streamed=True)),
    "wav trailing junk": (".wav", lambda: pcm("WAV") + b"\0\1junk" * 99),
    "w64": (".w64", lambda: pcm("W64")),
    "au": (".au", lambda: pcm("AU")),
    "au mu-law": (".snd", lambda: pcm("AU", "ULAW", 8000, 1)),
    "au streamed": (".au", lambda: pcm("AU")[:8] + b"\xff" * 4 + pcm("AU")[12:]),
    "aiff": (".aif", lambda: pcm("AIFF")),
    "aiff float": (".aifc", lambda: pcm("AIFF", "FLOAT")),
    "aiff little endian": (".aiff", lambda: pcm("AIFF", endian="LITTLE")),
    "caf": (".caf", lambda: pcm("CAF", "PCM_24")),
    "caf streamed": (".caf", lambda: encoded("caf", "pcm_s16le", streamed=True)),
    "caf alac": (".caf", lambda: pcm("CAF", "ALAC_16")),
    "voc": (".voc", lambda: pcm("VOC", "PCM_16", 22050, 1)),
    # without loss
    "flac": (".flac", lambda: pcm("FLAC")),
    "flac 24 bits 96 kHz": (".flac", lambda: pcm("FLAC", "PCM_24", 96000)),
    "flac without total samples": (".flac", lambda: without_total_samples(pcm("FLAC"))),
    "flac streamed": (".flac", lambda: encoded("flac", "flac", streamed=True)),
    "flac after id3": (".flac", lambda: id3v2(cover_picture(3000)) + pcm("FLAC")),
    "flac before id3v1": (".flac", lambda: pcm("FLAC") + ID3V1),
    "alac": (".m4a", lambda: encoded("ipod", "alac")),
    "wavpack": (".wv", lambda: encoded("wv", "wavpack")),
    "tta": (".tta", lambda: encoded("tta", "tta")),
    # mp3 and what is inside, before and after it
    "mp3": (".mp3", lambda: encoded("mp3", "libmp3lame")),
    "mp3 variable": (".mp3", lambda: encoded("mp3", "libmp3lame", quality=2)),
    "mp3 of soundfile": (".mp3", lambda: pcm("MP3", "MPEG_LAYER_III", 48000, bitrate_mode="VARIABLE")),
    "mp3 bare": (".mp3", mp3),
    "mp3 bare variable": (".mp3", lambda: mp3(quality=0)),
    "mp3 bare variable mono": (".mp3", lambda: mp3(48000, "mono", quality=4)),
    "mp3 bare variable 32 kHz": (".mp3", lambda: mp3(32000, quality=2)),
    "mp3 bare variable mpeg 2": (".mp3", lambda: mp3(22050, quality=5)),
    "mp3 bare variable mpeg 2.5": (".mp3", lambda: mp3(8000, "mono", quality=9)),
    "mp3 streamed variable": (".mp3", lambda: encoded("mp3", "libmp3lame", quality=3, streamed=True)),
    "mp3 large cover": (".mp3", lambda: id3v2(cover_picture(400_000)) + mp3(quality=1)),
    "mp3 padded tag": (".mp3", lambda: id3v2(padding=3_000_000) + mp3(quality=1)),
    "mp3 title in a wrong encoding": (
        ".mp3",
        lambda: id3v2(id3v2_frame(b"TIT2", b"\3Caf\xe9")) + mp3(quality=2),
    ),
    "mp3 two tags": (".mp3", lambda: id3v2(padding=50) + id3v2(cover_picture(900)) + mp3()),
    "mp3 latin tags after": (".mp3", lambda: encoded("mp3", "libmp3lame") + ID3V1),
    "mp3 ape tag after": (".mp3", lambda: mp3(quality=2) + ape(cover_picture(5000)) + ID3V1),
    "mp3 trailing zeros": (".mp3", lambda: mp3(quality=2) + bytes(20_000)),
    "mp3 trailing text": (".mp3", lambda: mp3(quality=2) + b"<html>not found</html>\r\n" * 200),
    "mp3 after 4 kB of zeros": (".mp3", lambda: bytes(4096) + mp3()),
    "mp3 after 1 kB of zeros and variable": (".mp3", lambda: bytes(1000) + mp3(quality=2)),
    "mp3 after 300 kB of zeros": (".mp3", lambda: bytes(300_000) + mp3(quality=2)),
    "mp3 after tag and zeros": (".mp3", lambda: id3v2(padding=10) + bytes(5000) + mp3(quality=2)),
    "mp3 from the middle of a frame": (".mp3", lambda: mp3(quality=2)[777:]),
    "mp3 to the middle of a frame": (".mp3", lambda: mp3(quality=2)[:-99]),
    "mp2": (".mp2", lambda: encoded("mp2", "mp2")),
    # aac and others without a container
    "aac": (".aac", aac),
    "aac mono 22 kHz": (".aac", lambda: aac(22050, "mono")),
    "aac 48 kHz six channels": (".aac", lambda: aac(48000, "5.1")),
    "aac after tag": (".aac", lambda: id3v2(padding=500) + aac()),
    "aac before tags": (".aac", lambda: aac() + ape(cover_picture(5000)) + ID3V1),
    "aac after zeros": (".aac", lambda: bytes(2000) + aac()),
    "ac3": (".ac3", lambda: encoded("ac3", "ac3", 48000)),
    "eac3": (".eac3", lambda: encoded("eac3", "eac3", 48000)),
    "amr": (".amr", lambda: encoded("amr", "libopencore_amrnb", 8000, "mono")),
    # in containers
    "m4a": (".m4a", lambda: encoded("ipod", "aac")),
    "m4a fragmented": (
        ".m4a",
        lambda: encoded("mp4", "aac", movflags="+frag_keyframe+empty_moov+delay_moov"),
    ),
    "m4a streamed": (
        ".m4a",
        lambda: encoded("mp4", "aac", streamed=True, movflags="+frag_every_frame+empty_moov"),
    ),
    "mp4 of mp3": (".mp4", lambda: encoded("mp4", "libmp3lame", quality=2)),
    "mp4 video": (".mp4", lambda: encoded("mp4", "aac", with_picture=True)),
    "mov of pcm": (".mov", lambda: encoded("mov", "pcm_s24le")),
    "3gp of amr": (".3gp", lambda: encoded("3gp", "libopencore_amrnb", 8000, "mono")),
    "ogg vorbis": (".ogg", lambda: pcm("OGG", "VORBIS")),
    "ogg opus": (".opus", lambda: pcm("OGG", "OPUS", 48000)),
    "ogg opus of ffmpeg": (".opus", lambda: encoded("ogg", "libopus", 48000)),
    "webm opus": (".webm", lambda: encoded("webm", "libopus", 48000)),
    "webm streamed": (".webm", lambda: encoded("webm", "libopus", 48000, streamed=True)),
    "matroska of variable mp3": (".mka", lambda: encoded("matroska", "libmp3lame", quality=2)),
    "matroska streamed": (".mkv", lambda: encoded("matroska", "libmp3lame", quality=2, streamed=True)),
    "wma": (".wma", lambda: encoded("asf", "wmav2")),
    "flv": (".flv", lambda: encoded("flv", "libmp3lame")),
    "flv streamed": (".flv", lambda: encoded("flv", "libmp3lame", quality=2, streamed=True)),
    "avi": (".avi", lambda: encoded("avi", "libmp3lame", with_picture=True)),
    "transport stream": (".ts", lambda: encoded("mpegts", "aac", streamed=True)),
    "program stream": (".mpg", lambda: encoded("mpeg", "mp2", streamed=True)),
    # two files in one
    "joined mp3": (".mp3", lambda: 2 * encoded("mp3", "libmp3lame", quality=2)),
    "joined bare mp3": (".mp3", lambda: mp3(quality=2) + ID3V1 + id3v2(padding=9) + mp3()),
    "joined mp3 stereo and mono": (".mp3", lambda: mp3() + mp3(layout="mono")),
    "joined mp3 mono and stereo": (".mp3", lambda: mp3(layout="mono") + mp3(quality=2)),
    "joined mp3 44 and 48 kHz": (".mp3", lambda: mp3() + mp3(48000)),
    "joined mp3 44 kHz stereo and 22 kHz mono": (".mp3", lambda: mp3() + mp3(22050, "mono", quality=4)),
    "joined tagged mp3 48 kHz and 32 kHz": (
        ".mp3",
        lambda: encoded("mp3", "libmp3lame", 48000) + encoded("mp3", "libmp3lame", 32000, "mono"),
    ),
    "joined aac stereo and mono": (".aac", lambda: aac() + aac(layout="mono")),
    "joined aac 44 and 48 kHz": (".aac", lambda: aac() + aac(48000)),
    # names
    "mp3 named wav": (".wav", lambda: mp3(quality=2)),
    "wav named mp3": (".mp3", lambda: pcm("WAV")),
    "m4a named mp3": (".mp3", lambda: encoded("ipod", "aac")),
    "aac named m4a": (".m4a", aac),
    "ogg named mp3": (".mp3", lambda: pcm("OGG", "VORBIS")),
    "mp3 without suffix": ("", mp3),
    "mp3 with another suffix": (".MP3.part 2", mp3),
    "mp3 é 音楽 %20d #1 'a' & b; [x]": (".MP3", mp3),
    "-mp3 http: a|b": (".mp3", mp3),
}


def write(name: str, folder: Path) -> Path:
    suffix, content = SONGS[name]
    path = folder / f"{name}{suffix}"
    path.write_bytes(content())
    return path


HAS_AMR = "libopencore_amrnb" in av.codecs_available  # not in every build of PyAV
FILES = [SaneFile(name, partial(write, name)) for name in SONGS if HAS_AMR or "amr" not in name]


def read(path: Path) -> None:
    """Read a song: it must have its length, the tone and no note that something is lost."""
    song = load_song(path)
    length_s = SECONDS * (2 if path.parent.name.startswith(JOINED) else 1)
    assert abs(song.duration_s - length_s) < 0.2, (path.name, song.duration_s)
    for start_s in np.arange(1.0, length_s, SECONDS):  # a second of each song
        second = song.samples[round(start_s * SAMPLE_RATE_HZ) :][:SAMPLE_RATE_HZ]
        assert np.argmax(np.abs(np.fft.rfft(second))) == TONE_HZ, path.name
    assert not [note for note in song.notes if "segment" not in note], (path.name, song.notes)


def test_songs_are_read(tmp_path):
    assert_read(FILES, read, tmp_path, n_files=60)
