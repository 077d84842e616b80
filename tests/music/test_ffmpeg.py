"""Songs that FFmpeg decodes: what they state of their length, parts that differ, and what is no sound."""

from __future__ import annotations

import re
import struct

import numpy as np
import pytest
from synthetic_songs import SECONDS, TONE_HZ, aac, ape, encoded, id3v2, mp3, pcm

from choreograph.core.errors import FormatError
from choreograph.core.timebase import SAMPLE_RATE_HZ
from choreograph.music.decoding import has_sound
from choreograph.music.song import load_song


@pytest.fixture
def written(tmp_path):
    def write(content: bytes):
        (tmp_path / "song").write_bytes(content)
        return tmp_path / "song"

    return write


def with_vbri(frames: bytes) -> bytes:
    """Frames of 128 kbit/s after one that states their number as the Fraunhofer encoder does."""
    n_frames = round(len(frames) / 417.96)
    header = frames[:4] + bytes(32) + b"VBRI" + struct.pack(">HHHII", 1, 0, 80, len(frames), n_frames)
    return header.ljust(417, b"\0") + frames


STATING = {
    "aiff": lambda: pcm("AIFF"),
    "wav big endian": lambda: pcm("WAV", endian="BIG"),
    "wav above 4 GB": lambda: pcm("RF64"),
    "au": lambda: pcm("AU"),
    "flac": lambda: pcm("FLAC"),
    "tta": lambda: encoded("tta", "tta"),
    "m4a": lambda: encoded("ipod", "aac"),
    "mp3 with Info": lambda: encoded("mp3", "libmp3lame"),
    "mp3 with Xing": lambda: encoded("mp3", "libmp3lame", quality=2),
    "mp3 with Xing, mono": lambda: encoded("mp3", "libmp3lame", 22050, "mono", quality=5),
    "mp3 with VBRI": lambda: with_vbri(mp3()),
    "mp3 with VBRI after a tag": lambda: id3v2(padding=700) + with_vbri(mp3()),
}


@pytest.mark.parametrize("name", STATING)
def test_half_of_a_song_that_states_its_length_is_refused(written, name):
    whole = STATING[name]()
    assert load_song(written(whole)).duration_s == pytest.approx(SECONDS, abs=0.1)
    with pytest.raises(FormatError, match="cut off"):
        load_song(written(whole[: len(whole) // 2]))


def test_the_length_that_an_mp3_states_is_named(written):
    content = encoded("mp3", "libmp3lame", quality=2)
    with pytest.raises(FormatError, match=re.escape(f"expected {SECONDS:.1f} s of sound")):
        load_song(written(content[: len(content) // 2]))


@pytest.mark.parametrize("encode", [lambda: mp3(quality=2), aac])
def test_what_is_left_of_a_song_without_a_stated_length_is_read(written, encode):
    song = load_song(written(encode()[: len(encode()) * 2 // 3]))
    assert 1.0 < song.duration_s < 0.8 * SECONDS


def test_a_part_of_another_rate_and_layout_sounds_as_it_does_alone(written):
    first, second = mp3(44100, "stereo", quality=2), mp3(22050, "mono", quality=4)
    alone = load_song(written(second)).samples
    joined = load_song(written(first + second)).samples
    assert abs(len(joined) - len(load_song(written(first)).samples) - len(alone)) < 0.05 * SAMPLE_RATE_HZ
    loudness = [np.sqrt(np.mean(samples[-SAMPLE_RATE_HZ:] ** 2)) for samples in (alone, joined)]
    assert loudness[1] == pytest.approx(loudness[0], rel=0.05)
    assert np.argmax(np.abs(np.fft.rfft(joined[-SAMPLE_RATE_HZ:]))) == TONE_HZ


def test_a_picture_after_the_sound_is_no_sound(written):
    """Of 300 kB of noise, FFmpeg takes some for frames: more than a tenth of the packets are then damaged."""
    picture = ape(np.random.default_rng(3).bytes(300_000))
    plain, tagged = (load_song(written(mp3(quality=2) + tail)) for tail in (b"", picture))
    np.testing.assert_array_equal(tagged.samples, plain.samples)
    assert tagged.notes == plain.notes


def test_headers_and_tags_between_joined_parts_are_no_damage(written):
    song = load_song(written(10 * (encoded("mp3", "libmp3lame", quality=2) + ape(bytes(500)))))
    assert song.notes == () and song.duration_s == pytest.approx(10 * SECONDS, abs=0.5)


def test_damaged_packets_of_aac_are_passed_over(written):
    content = bytearray(aac())
    for start in (20_000, 30_000):
        content[start + 2 : start + 4] = b"\xff\xff"
    assert load_song(written(bytes(content[200:]))).duration_s > 0.7 * SECONDS


def test_containers_without_a_header_of_streams_are_opened(written):
    """PyAV 14 crashed on them."""
    assert has_sound(written(encoded("flv", "libmp3lame"))) and has_sound(written(pcm("VOC", rate_hz=22050)))
