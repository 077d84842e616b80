"""A song that is played, and samples of a stream."""

from __future__ import annotations

import io
import struct
import sys
from types import SimpleNamespace

import numpy as np
import pytest
import soundfile
from synthetic_repertoire import write_clicks

from choreograph.core.errors import ChoreographError, FormatError, ParameterError
from choreograph.live.sound import PcmFormat, microphone, pcm_blocks, playing, read_wav_header


class Device:
    """A device that plays when it is told to, with a latency of 20 ms."""

    def __init__(self, rate_hz, channels, dtype, callback):
        self.rate_hz, self.channels, self.callback = rate_hz, channels, callback
        self.time, self.heard = 100.0, []
        Device.last = self

    def __enter__(self):
        return self

    def __exit__(self, *_):
        return None

    def play(self, n):
        out = np.empty((n, self.channels), np.float32)
        self.callback(out, n, SimpleNamespace(outputBufferDacTime=self.time + 0.02), None)
        self.heard.append(out)
        self.time += n / self.rate_hz


def test_the_clock_is_that_of_what_is_heard(tmp_path, monkeypatch):
    fake = SimpleNamespace(OutputStream=Device, PortAudioError=OSError)
    monkeypatch.setitem(sys.modules, "sounddevice", fake)
    song = write_clicks(tmp_path / "song.wav", duration_s=1.0)
    with playing(song) as song_s:
        device = Device.last
        assert song_s() < 0.0  # before the first samples
        for _ in range(4):
            device.play(device.rate_hz // 2)
        assert song_s() == pytest.approx(2.0 - 0.02)
    heard = np.concatenate(device.heard)
    assert np.abs(heard[: device.rate_hz]).max() > 0.1 and not heard[device.rate_hz + 64 :].any()


def test_without_the_package_or_a_device_a_line_says_so(tmp_path, monkeypatch):
    song = write_clicks(tmp_path / "song.wav", duration_s=1.0)
    monkeypatch.setitem(sys.modules, "sounddevice", None)
    with pytest.raises(ChoreographError, match=r"choreograph\[live\].*--silent"), playing(song):
        pass

    def no_device(*_, **__):
        raise OSError("no default output device")

    fake = SimpleNamespace(OutputStream=no_device, PortAudioError=OSError)
    monkeypatch.setitem(sys.modules, "sounddevice", fake)
    with pytest.raises(ChoreographError, match="expected a sound device"), playing(song):
        pass


RATE = 22050


def sine(rate_hz=RATE, duration_s=1.0):
    return 0.5 * np.sin(2 * np.pi * 440 * np.arange(round(rate_hz * duration_s)) / rate_hz)


def wav(samples, rate_hz=RATE, subtype="PCM_16", kind="WAV"):
    out = io.BytesIO()
    soundfile.write(out, samples, rate_hz, subtype=subtype, format=kind)
    return out.getvalue()


def heard(data, given=None):
    return np.concatenate([np.zeros(0, np.float32), *pcm_blocks(io.BytesIO(data), given)])


@pytest.mark.parametrize("subtype", ["PCM_U8", "PCM_16", "PCM_24", "PCM_32", "FLOAT"])
@pytest.mark.parametrize("kind", ["WAV", "WAVEX"])
def test_every_encoding_of_a_wav_file(subtype, kind):
    both = np.stack([sine(), 0.5 * sine()], axis=1)
    samples = heard(wav(both, subtype=subtype, kind=kind))
    np.testing.assert_allclose(samples, 0.75 * sine(), atol=0.01)


def test_a_format_is_stated_for_samples_without_a_header():
    data = np.round(sine(44100) * 32767).astype("<i2").repeat(2).tobytes()
    samples = heard(data, PcmFormat.parse("44100:2:s16"))
    assert len(samples) == pytest.approx(RATE, abs=300)
    middle = slice(2000, 18000)
    np.testing.assert_allclose(samples[middle], sine()[middle], atol=0.01)


@pytest.mark.parametrize(
    "text",
    [
        "", "44100", "44100:2", "44100:2:mp3", "0:2:s16", "44100:0:s16", "x:2:s16", "9" * 5000 + ":2:s16",
        "44100:" + "9" * 5000 + ":s16", "44100:2:" + "s" * 5000, "²:2:s16", "44100:2:s16:", "44100:2:s16\n",
    ],
)  # fmt: skip
def test_another_format_is_refused(text):
    with pytest.raises(ParameterError, match="44100:2:s16") as raised:
        PcmFormat.parse(text)
    assert len(str(raised.value)) < 200


@pytest.mark.filterwarnings("error")
def test_channels_with_values_of_any_size_are_added():
    values = np.array([[3e38, 3e38], [np.inf, -np.inf], [np.nan, 0.5], [0.25, 0.75]], "<f4")
    assert heard(values.tobytes(), PcmFormat(RATE, 2, "f32")).tolist() == [1.0, 0.0, 0.25, 0.5]


def test_what_is_no_number_is_silent_and_an_incomplete_sample_is_left_out():
    data = np.array([0.5, np.nan, np.inf, 3.0], "<f4").tobytes() + b"\1\2"
    assert heard(data, PcmFormat(RATE, 1, "f32")).tolist() == [0.5, 0.0, 1.0, 1.0]


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"OggS" + bytes(40),
        b"RIFF\0\0\0\0WAVE",
        wav(sine())[:30],
        wav(sine()).replace(b"fmt ", b"fmx "),
        wav(sine()).replace(struct.pack("<I", RATE), struct.pack("<I", 0)),
        b"RIFF\0\0\0\0WAVEjunk\xff\xff\xff\x7f",
    ],
)
def test_another_header_is_refused(data):
    with pytest.raises(FormatError, match="standard input: expected"):
        read_wav_header(io.BytesIO(data))


def test_the_stated_length_of_a_recording_is_not_used():
    data = bytearray(wav(sine()))
    at = data.index(b"data") + 4
    data[at : at + 4] = struct.pack("<I", 0)
    assert len(heard(bytes(data))) == RATE


class Microphone:
    """A device that records when it is told to."""

    def __init__(self, rate_hz, blocksize, channels, dtype, callback):
        self.rate_hz, self.size, self.callback = rate_hz, blocksize, callback
        Microphone.last = self

    def __enter__(self):
        return self

    def __exit__(self, *_):
        return None

    def record(self, samples):
        for start in range(0, len(samples), self.size):
            part = samples[start : start + self.size, None].astype(np.float32)
            self.callback(part, len(part), None, None)


def test_a_microphone_gives_blocks_at_the_rate_of_songs(monkeypatch):
    fake = SimpleNamespace(
        InputStream=Microphone, PortAudioError=OSError,
        query_devices=lambda kind: {"default_samplerate": 44100.0},
    )  # fmt: skip
    monkeypatch.setitem(sys.modules, "sounddevice", fake)
    with microphone() as arrived:
        Microphone.last.record(sine(44100))
        first = next(arrived)
    samples = np.concatenate([first, *arrived])  # it has ended
    assert len(samples) == RATE
    np.testing.assert_allclose(samples[2000:18000], sine()[2000:18000], atol=0.01)


def test_without_the_package_or_a_microphone_a_line_says_so(monkeypatch):
    monkeypatch.setitem(sys.modules, "sounddevice", None)
    with pytest.raises(ChoreographError, match=r"choreograph\[live\]"), microphone():
        pass

    def no_device(*_, **__):
        raise OSError("no default input device")

    fake = SimpleNamespace(query_devices=no_device, PortAudioError=OSError)
    monkeypatch.setitem(sys.modules, "sounddevice", fake)
    with pytest.raises(ChoreographError, match="expected a microphone"), microphone():
        pass
