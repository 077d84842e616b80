"""The song part of page and video: exact to the sample in time and length; errors in one line."""

from __future__ import annotations

import io

import av
import numpy as np
import pytest
import soundfile
from synthetic_pages import write_seconds

from choreograph.core.errors import FormatError, ParameterError
from choreograph.view.sound import Levels, encode_mp4, song_part


def decoded(data: bytes) -> tuple[np.ndarray, int]:
    """Samples (S, C) and their rate, as decoded by a player that respects the edit list."""
    with av.open(io.BytesIO(data)) as container:
        stream = container.streams.audio[0]
        frames = [frame for frame in container.decode(stream) if frame.pts is not None and frame.pts >= 0]
        return np.concatenate([frame.to_ndarray() for frame in frames], axis=1).T, stream.rate


@pytest.mark.parametrize("rate_hz", [44100, 48000, 22050, 96000])
def test_clicks_keep_their_times(tmp_path, rate_hz):
    song = write_seconds(tmp_path / "song.wav", duration_s=4.0, rate_hz=rate_hz)
    samples, rate = decoded(encode_mp4(song_part(song, start_s=0.75, duration_s=2.5)))
    assert rate == min(rate_hz, 48000)
    assert samples.shape[1] == 2
    assert len(samples) == pytest.approx(2.5 * rate, abs=1024)
    for click_s in (0.25, 1.25, 2.25):
        at = round(click_s * rate)
        window = np.abs(samples[at - rate // 100 : at + rate // 100]).max(axis=1)
        onset_s = (np.argmax(window > 0.2) - rate // 100) / rate
        assert abs(onset_s) < 0.001


def test_part_has_exactly_the_requested_length(tmp_path):
    song = write_seconds(tmp_path / "song.wav", duration_s=1.0)
    for start_s, duration_s in ((0.0, 0.5), (0.5, 2.0), (3.0, 1.0)):
        part = song_part(song, start_s=start_s, duration_s=duration_s)
        samples = np.concatenate(list(part.blocks))
        assert samples.shape == (part.n_frames, 2) == (round(duration_s * 44100), 2)
    assert not samples.any()  # all of it after the song's end


@pytest.mark.parametrize(("channels", "kept"), [(1, 1), (2, 2), (6, 2)])
def test_channels(tmp_path, channels, kept):
    soundfile.write(tmp_path / "song.wav", np.full((4410, channels), 0.25), 44100)
    part = song_part(tmp_path / "song.wav", start_s=0.0, duration_s=0.1)
    samples = np.concatenate(list(part.blocks))
    assert samples.shape == (4410, kept)
    assert np.allclose(samples, 0.25, atol=1e-3)


def test_levels_follow_the_loudness(tmp_path):
    song = write_seconds(tmp_path / "song.wav", duration_s=3.0)
    levels = Levels(50)
    encode_mp4(levels.through(song_part(song, start_s=0.5, duration_s=2.0)))
    shown = levels.to_bytes()
    assert shown.shape == (100, 2)
    assert (shown[:, 0] >= shown[:, 1]).all()
    assert set(np.flatnonzero(shown[:, 0] > 128)) == {25, 75}


def test_the_same_part_gives_the_same_bytes(tmp_path):
    song = write_seconds(tmp_path / "song.wav", duration_s=2.0)
    first, second = (encode_mp4(song_part(song, start_s=0.1, duration_s=1.5)) for _ in range(2))
    assert first == second


def test_wrong_input(tmp_path):
    song = write_seconds(tmp_path / "song.wav", duration_s=1.0)
    (tmp_path / "empty.mp3").write_bytes(b"")
    (tmp_path / "text.mp3").write_text("no sound in here, only words " * 50)
    for name in ("missing.mp3", "empty.mp3", "text.mp3", "."):
        with pytest.raises(FormatError) as refused:
            song_part(tmp_path / name, start_s=0.0, duration_s=1.0)
        assert "\n" not in str(refused.value)
    for start_s, duration_s in ((-1.0, 1.0), (0.0, 0.0), (np.nan, 1.0), (0.0, np.inf)):
        with pytest.raises(ParameterError):
            song_part(song, start_s=start_s, duration_s=duration_s)
