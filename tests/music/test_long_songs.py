"""Samples of long songs are in a temporary file: all that is found in them is the same, to the bit."""

from __future__ import annotations

import hashlib

import numpy as np
import pytest
import soundfile

import choreograph as cg
from choreograph.core import long_songs
from choreograph.core.long_songs import ScratchFile
from choreograph.core.numerics import frame_blocks
from choreograph.core.timebase import SAMPLE_RATE_HZ
from choreograph.music import song as song_module
from choreograph.music.bars import beat_evidence, track_bars
from choreograph.music.mel import log_mel, loudness
from choreograph.music.rhythm import frame_rhythm
from choreograph.music.song import as_song, cached_song, joined_samples, peak_of
from choreograph.music.song_features import energy_per_second, stops_s
from choreograph.music.spectral import spectral_features

SONG = cg.load_song(cg.example_songs()["house"], duration_s=21.0).samples[:-777]
SONG = np.concatenate(
    [SONG[: 11 * SAMPLE_RATE_HZ], np.zeros(40_000, np.float32), SONG[11 * SAMPLE_RATE_HZ :]]
)
BEATS_S = np.arange(0.31, 22.0, 0.49)


@pytest.fixture(autouse=True)
def little_memory(monkeypatch):
    monkeypatch.setattr(long_songs, "LONG_S", 10_000 / SAMPLE_RATE_HZ)
    monkeypatch.setattr(song_module, "_BLOCK_SAMPLES", 4_099)


def is_stored(samples):
    """Whether samples are in a file."""
    while samples is not None and not isinstance(samples, np.memmap):
        samples = samples.base
    return samples is not None


def stored(samples=SONG, size=30_011):
    return joined_samples(samples[part] for part in frame_blocks(len(samples), size))


@pytest.mark.parametrize("size", [997, 10_000, 30_011, len(SONG)])
def test_long_samples_are_in_a_file_and_the_same(size):
    found = stored(size=size)
    assert is_stored(found) and type(found) is np.ndarray and found.dtype == np.float32
    parts = (slice(None), slice(5, 5), slice(3, 40_001), slice(-9, None), slice(len(SONG), len(SONG) + 9))
    assert all(np.array_equal(found[part], SONG[part]) for part in (*parts, slice(1, 99, 7)))
    assert peak_of(found) == np.abs(SONG).max()
    sha256 = hashlib.sha256(SONG.tobytes()).digest()
    assert cg.Song(found, "found").samples_sha256 == cg.Song(SONG, "song").samples_sha256 == sha256


def test_short_samples_are_in_memory():
    found = joined_samples(iter([SONG[:4000], SONG[4000:9000]]))
    assert not is_stored(found) and np.array_equal(found, SONG[:9000])
    assert len(joined_samples(iter([]))) == 0


@pytest.mark.parametrize("n_written", [0, 1, 3])
def test_samples_without_room_on_disk_are_in_memory(n_written, monkeypatch):
    append, calls = ScratchFile.append, []

    def full(self, array):
        calls.append(1)
        if len(calls) > n_written:
            raise OSError("no space left on device")
        return append(self, array)

    monkeypatch.setattr(ScratchFile, "append", full)
    found = stored()
    assert not is_stored(found) and np.array_equal(found, SONG)
    assert len(calls) == n_written + 1  # it is not tried for every block


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_samples_that_are_not_finite_are_found_in_any_block(bad):
    for at in (0, 5000, len(SONG) - 1):
        damaged = SONG.copy()
        damaged[at] = bad
        with pytest.raises(cg.ParameterError, match="finite"):
            loudness(stored(damaged))


def test_features_are_those_of_an_array_to_the_bit():
    found, mel = stored(), log_mel(SONG)
    assert np.array_equal(log_mel(found), mel)
    for of in (
        loudness,
        lambda sound: spectral_features(sound, BEATS_S, cqt_frames=900),  # in blocks
        lambda sound: frame_rhythm(sound, BEATS_S),
        lambda sound: energy_per_second(sound, 23),
        lambda sound: np.concatenate(beat_evidence(sound, mel, BEATS_S), axis=1),
    ):
        assert np.array_equal(of(found), of(SONG))
    counts, others = (track_bars(sound, mel, BEATS_S) for sound in (SONG, found))
    assert np.array_equal(counts.numbers, others.numbers) and counts.confidence == others.confidence
    assert stops_s(found, counts) == stops_s(SONG, counts) != ()


def test_the_level_of_log_mel_is_that_of_scaled_samples():
    level = loudness(SONG)
    scaled = (SONG.astype(np.float64) / level).astype(np.float32)
    assert np.array_equal(log_mel(stored(), level=level), log_mel(scaled))


@pytest.mark.parametrize(
    ("name", "rate_hz", "n_channels"),
    [
        ("a.wav", 22050, 1),
        ("a.wav", 44100, 2),
        ("a.flac", 48000, 2),
        ("a.ogg", 32000, 1),
        ("a.mp3", 44100, 2),
    ],
)
@pytest.mark.parametrize("part", [(0.0, None), (1.25, 3.0), (2.0, 60.0)])
def test_songs_of_files_are_the_same_in_any_format(name, rate_hz, n_channels, part, tmp_path, monkeypatch):
    path, (start_s, duration_s) = tmp_path / name, part
    noise = np.random.default_rng(0).uniform(-0.5, 0.5, round(7.1 * rate_hz))
    sound = np.stack([noise] * n_channels, axis=1)
    sound *= np.linspace(0.5, 1.0, n_channels)
    soundfile.write(path, sound, rate_hz)
    found = as_song("a song", path, start_s=start_s, duration_s=duration_s)
    monkeypatch.setattr(long_songs, "LONG_S", 600.0)
    whole = cg.load_song(path, start_s=start_s, duration_s=duration_s)
    assert is_stored(found.samples) and not is_stored(whole.samples)
    assert np.array_equal(found.samples, whole.samples)
    assert len(found.notes) - len(whole.notes) == (duration_s == 60.0)


def test_channels_that_cancel_are_decoded_again(tmp_path):
    tone = 0.5 * np.sin(np.arange(60_000) / 9)
    soundfile.write(tmp_path / "a.wav", np.stack([tone, -tone], axis=1), 22050, subtype="FLOAT")
    found = cg.load_song(tmp_path / "a.wav")
    assert np.abs(found.samples).max() > 0.4 and "cancel" in found.notes[0]


def test_samples_that_were_forgotten_are_decoded_again(tmp_path):
    soundfile.write(tmp_path / "a.wav", SONG, 22050, subtype="FLOAT")
    song = cached_song(tmp_path / "a.wav", start_s=0.0, duration_s=None, keep=False)
    first = song.samples
    song.forget_samples()
    assert song.duration_s == len(SONG) / 22050 and song.samples is not first
    assert is_stored(song.samples) and np.array_equal(song.samples, SONG)
    part = song.part(1.0, 2.0)
    assert np.array_equal(part.samples, SONG[22050 : 3 * 22050]) and part.start_s == 1.0
