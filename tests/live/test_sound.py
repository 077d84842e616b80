"""Playing a song, with a sound device of the test's own: there is none where tests run."""

from __future__ import annotations

import sys
from types import SimpleNamespace

import numpy as np
import pytest
from synthetic_repertoire import write_clicks

from choreograph.core.errors import ChoreographError
from choreograph.live.sound import playing


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
