"""Songs in any container load as mono at one rate; other files are refused in one line."""

from __future__ import annotations

from fractions import Fraction

import av
import numpy as np
import pytest
import soundfile

from choreograph.core.errors import FormatError, ParameterError
from choreograph.core.timebase import SAMPLE_RATE_HZ
from choreograph.music.song import load_song


def tone(duration_s: float, rate_hz: int, channels: int = 1) -> np.ndarray:
    mono = 0.5 * np.sin(2 * np.pi * 440 * np.arange(round(duration_s * rate_hz)) / rate_hz)
    return np.repeat(mono[:, None], channels, axis=1).astype(np.float32)


def write_av(path, sound: np.ndarray, rate_hz: int, codec: str) -> None:
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=rate_hz, layout="stereo")
        frame = av.AudioFrame.from_ndarray(np.ascontiguousarray(sound.T), "fltp", "stereo")
        frame.sample_rate, frame.time_base = rate_hz, Fraction(1, rate_hz)
        for packet in [*stream.encode(frame), *stream.encode(None)]:
            container.mux(packet)


def one_line_error(path) -> str:
    with pytest.raises(FormatError) as caught:
        load_song(path)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("suffix", ["wav", "flac", "ogg", "mp3"])
@pytest.mark.parametrize(("rate_hz", "channels"), [(8000, 1), (44100, 2), (48000, 2)])
def test_common_formats_become_mono_at_22050_hz(tmp_path, suffix, rate_hz, channels):
    path = tmp_path / f"song.{suffix}"
    soundfile.write(path, tone(5.0, rate_hz, channels), rate_hz)
    song = load_song(path)
    assert song.samples.dtype == np.float32
    assert song.samples.ndim == 1
    assert song.duration_s == pytest.approx(5.0, abs=0.15)
    middle = song.samples[2 * SAMPLE_RATE_HZ : 3 * SAMPLE_RATE_HZ]
    assert np.argmax(np.abs(np.fft.rfft(middle))) == 440  # one-second window: bins are Hz
    assert np.sqrt(np.mean(middle**2)) == pytest.approx(0.5 / np.sqrt(2), rel=0.05)


def test_m4a_goes_through_ffmpeg(tmp_path):
    path = tmp_path / "song.m4a"
    write_av(path, tone(5.0, 44100, 2), 44100, "aac")
    assert load_song(path).duration_s == pytest.approx(5.0, abs=0.1)


def test_channels_that_cancel_are_heard(tmp_path):
    sound = tone(5.0, 22050, 2) * np.array([1.0, -1.0], np.float32)
    soundfile.write(tmp_path / "a.wav", sound, 22050)
    song = load_song(tmp_path / "a.wav")
    assert [note for note in song.notes if "cancel" in note] == list(song.notes)
    either = tone(5.0, 22050, 1)[:, 0] * np.sign(song.samples[1])  # both are equally loud
    np.testing.assert_allclose(song.samples, either, atol=1e-4)


def test_the_requested_span_is_loaded(tmp_path):
    ramp = np.linspace(0, 0.9, 10 * SAMPLE_RATE_HZ, dtype=np.float32)
    soundfile.write(tmp_path / "a.wav", ramp, SAMPLE_RATE_HZ, subtype="FLOAT")
    song = load_song(tmp_path / "a.wav", start_s=2.0, duration_s=3.0)
    np.testing.assert_array_equal(song.samples, ramp[2 * SAMPLE_RATE_HZ : 5 * SAMPLE_RATE_HZ])
    with pytest.raises(ParameterError):
        load_song(tmp_path / "a.wav", start_s=11.0)
    with pytest.raises(ParameterError):
        load_song(tmp_path / "a.wav", duration_s=0.0)


def test_a_short_song_is_loaded_and_noted(tmp_path):
    soundfile.write(tmp_path / "a.wav", tone(1.0, 44100), 44100)
    song = load_song(tmp_path / "a.wav")
    assert len(song.samples) == SAMPLE_RATE_HZ
    assert any("less than" in note for note in song.notes)


def test_files_that_are_no_songs_are_refused_in_one_line(tmp_path):
    (tmp_path / "empty.mp3").write_bytes(b"")
    (tmp_path / "text.mp3").write_text("not a song\n" * 200)
    (tmp_path / "text.wav").write_text("RIFFnot a song\n" * 200)
    assert "no such file" in one_line_error(tmp_path / "absent.mp3")
    assert "folder" in one_line_error(tmp_path)
    assert "empty" in one_line_error(tmp_path / "empty.mp3")
    one_line_error(tmp_path / "text.mp3")
    one_line_error(tmp_path / "text.wav")


@pytest.mark.parametrize("suffix", ["wav", "flac", "m4a"])
def test_a_truncated_song_is_refused(tmp_path, suffix):
    path = tmp_path / f"song.{suffix}"
    if suffix == "m4a":
        write_av(path, tone(20.0, 44100, 2), 44100, "aac")
    else:
        rng = np.random.default_rng(0)
        soundfile.write(path, rng.normal(0, 0.1, 20 * 44100).astype(np.float32), 44100)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    one_line_error(path)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_samples_that_are_not_finite_are_refused(tmp_path, bad):
    sound = tone(5.0, 44100)
    sound[1000] = bad
    soundfile.write(tmp_path / "a.wav", sound, 44100, subtype="FLOAT")
    assert "NaN" in one_line_error(tmp_path / "a.wav")


def test_real_mp3s_load_without_output_on_stderr(shared_data, capfd):
    song = load_song(shared_data / "dance-with-melody" / "DANCE_C_2" / "audio.mp3")
    assert song.duration_s == pytest.approx(80.0, abs=1.0)
    assert capfd.readouterr().err == ""


def test_a_playlist_that_opens_other_files_is_no_song(tmp_path):
    soundfile.write(tmp_path / "other.wav", np.zeros(44100), 44100)
    (tmp_path / "song.mp3").write_text("ffconcat version 1.0\nfile 'other.wav'\n")
    with pytest.raises(FormatError, match="not audio"):
        load_song(tmp_path / "song.mp3")
