"""Songs that are damaged, odd or hostile: what is lost is noted, and what is no song is refused in a line."""

from __future__ import annotations

import re
import struct
import zlib

import numpy as np
import pytest
import soundfile

from choreograph.core.errors import FormatError
from choreograph.core.timebase import SAMPLE_RATE_HZ
from choreograph.music.song import load_song

SECONDS = 12.0


def noise(n_channels: int = 1) -> np.ndarray:
    """Sound that no codec makes small."""
    n_frames = round(SECONDS * SAMPLE_RATE_HZ)
    return np.random.default_rng(0).normal(scale=0.1, size=(n_frames, n_channels)).astype(np.float32)


@pytest.fixture
def ogg(tmp_path):
    soundfile.write(tmp_path / "song.ogg", noise(), SAMPLE_RATE_HZ)
    return tmp_path / "song.ogg"


def refused(path) -> str:
    with pytest.raises(FormatError) as caught:
        load_song(path)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def said_of(path) -> str:
    """The notes on a song, or why it is refused."""
    try:
        return "; ".join(load_song(path).notes)
    except FormatError as error:
        return str(error)


def header(rate_hz: int, n_channels: int, n_bytes: int = 64_000) -> bytes:
    """A WAV of 16 bits of silence that says what it likes of itself."""
    block = 2 * n_channels
    chunk = struct.pack("<4sIHHIIHH", b"fmt ", 16, 1, n_channels, rate_hz, 0, block & 0xFFFF, 16)
    chunk += struct.pack("<4sI", b"data", n_bytes) + bytes(n_bytes)
    return struct.pack("<4sI4s", b"RIFF", 4 + len(chunk), b"WAVE") + chunk


def test_half_an_ogg_is_read_with_a_note(ogg):
    assert load_song(ogg).notes == ()
    ogg.write_bytes(ogg.read_bytes()[: ogg.stat().st_size // 2])
    song = load_song(ogg)
    assert 2.0 < song.duration_s < 9.0
    (note,) = song.notes
    assert note == "the file ends before the song does: the missing part is not danced"


def test_zeroed_pages_are_noted_with_how_much_is_lost(ogg):
    data = bytearray(ogg.read_bytes())
    third = len(data) // 3
    data[third : 2 * third] = bytes(third)
    ogg.write_bytes(data)
    song = load_song(ogg)
    (note,) = song.notes
    lost_s = float(note.removeprefix("the song is damaged: ").split()[0])
    assert lost_s == pytest.approx(SECONDS - song.duration_s, abs=0.3) and lost_s > 2.0


@pytest.mark.parametrize("suffix", ["flac", "mp3"])
def test_a_hole_in_a_song_is_noted_or_refused(tmp_path, suffix):
    path = tmp_path / f"song.{suffix}"
    soundfile.write(path, noise(), SAMPLE_RATE_HZ)
    data = bytearray(path.read_bytes())
    start = len(data) // 2
    data[start : start + len(data) // 16] = bytes(len(data) // 16)
    path.write_bytes(data)
    assert re.search("damaged|cut off", said_of(path))


@pytest.mark.parametrize("phases", [(1, -1), (1, 0.9, -1, -0.95), (-1, 1)])
def test_channels_that_cancel_are_mixed_in_phase(tmp_path, phases):
    soundfile.write(
        tmp_path / "a.wav", noise() * np.array(phases, np.float32), SAMPLE_RATE_HZ, subtype="FLOAT"
    )
    song = load_song(tmp_path / "a.wav")
    assert any("cancel" in note for note in song.notes) and not any("silent" in note for note in song.notes)
    expected = np.abs(phases).mean() * noise()[:, 0]
    assert min(np.abs(song.samples - expected).max(), np.abs(song.samples + expected).max()) < 1e-6


def test_stereo_is_mixed_as_ever(tmp_path):
    sound = noise(2)
    soundfile.write(tmp_path / "a.wav", sound, SAMPLE_RATE_HZ, subtype="FLOAT")
    song = load_song(tmp_path / "a.wav")
    assert song.notes == ()
    np.testing.assert_array_equal(song.samples, sound.mean(axis=1, dtype=np.float32))


@pytest.mark.parametrize("value", [1e30, -1e30, np.nan, np.inf])
def test_samples_far_beyond_full_scale_are_refused(tmp_path, value):
    sound = noise()
    sound[1000] = value
    soundfile.write(tmp_path / "a.wav", sound, SAMPLE_RATE_HZ, subtype="FLOAT")
    assert "samples" in refused(tmp_path / "a.wav")


@pytest.mark.parametrize(("rate_hz", "n_channels"), [(1, 1), (0, 1), (10**9, 1), (22050, 500), (22050, 0)])
def test_a_header_that_no_song_has_is_refused(tmp_path, rate_hz, n_channels):
    (tmp_path / "a.wav").write_bytes(header(rate_hz, n_channels))
    refused(tmp_path / "a.wav")


@pytest.mark.parametrize(
    ("kind", "endian"), [("WAV", "FILE"), ("WAV", "BIG"), ("RF64", "FILE"), ("AIFF", "FILE")]
)
def test_the_last_moment_of_a_song_is_missed_in_a_note(tmp_path, kind, endian):
    path = tmp_path / "song"
    soundfile.write(path, noise(), SAMPLE_RATE_HZ, format=kind, endian=endian)
    path.write_bytes(path.read_bytes()[:-100])
    assert load_song(path).notes == ()
    path.write_bytes(path.read_bytes()[:-6000])
    assert "the song is cut off: the last 6100 of 5292" in said_of(path)
    path.write_bytes(path.read_bytes()[:-6000])
    assert "expected 5292" in refused(path)


def test_a_song_without_frames_is_refused(tmp_path):
    (tmp_path / "a.wav").write_bytes(header(22050, 1, n_bytes=0))
    refused(tmp_path / "a.wav")


def test_a_cover_picture_without_its_song_is_refused(tmp_path):
    """What is left of a download that stopped early: tags with a picture, and not a frame of sound."""
    rows = zlib.compress((b"\0" + bytes(24)) * 8)
    chunks = ((b"IHDR", struct.pack(">IIBBBBB", 8, 8, 8, 2, 0, 0, 0)), (b"IDAT", rows), (b"IEND", b""))
    png = b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in chunks
    )
    picture = b"\0image/png\0\3\0" + png
    tags = b"APIC" + struct.pack(">I", len(picture)) + b"\0\0" + picture
    size = bytes((len(tags) >> shift) & 127 for shift in (21, 14, 7, 0))
    (tmp_path / "a.mp3").write_bytes(b"ID3\3\0\0" + size + tags)
    refused(tmp_path / "a.mp3")


def test_hours_of_sound_in_a_small_file_are_refused(tmp_path):
    soundfile.write(tmp_path / "a.flac", np.zeros(10_900 * 2000, np.int16), 2000)
    assert "take a part" in refused(tmp_path / "a.flac")
    assert load_song(tmp_path / "a.flac", start_s=20.0, duration_s=2.0).duration_s == pytest.approx(2.0)


@pytest.mark.parametrize(
    "playlist",
    [
        "ffconcat version 1.0\nfile neighbour.wav\n",
        "#EXTM3U\n#EXTINF:3,\nneighbour.wav\n",
        "#EXTM3U\n#EXT-X-TARGETDURATION:10\n#EXTINF:10,\nneighbour.wav\n#EXT-X-ENDLIST\n",
        "[playlist]\nFile1=neighbour.wav\n",
    ],
)
def test_a_playlist_never_opens_its_neighbour(tmp_path, playlist):
    soundfile.write(tmp_path / "neighbour.wav", noise(), SAMPLE_RATE_HZ)
    (tmp_path / "song.mp3").write_text(playlist)
    refused(tmp_path / "song.mp3")


def test_a_name_is_never_an_address(tmp_path, monkeypatch):
    """FFmpeg takes "concat:a|b" for two files; as a name, it is one."""
    soundfile.write(tmp_path / "a.mp3", noise(), SAMPLE_RATE_HZ)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.mp3").rename(tmp_path / "concat:a.mp3")
    assert load_song("concat:a.mp3").duration_s == pytest.approx(SECONDS, abs=0.2)
