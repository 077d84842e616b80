"""Clicks sound on the counts, higher on count 1, over the song and in silence, and nothing clips."""

from __future__ import annotations

from pathlib import Path

import av
import numpy as np
import pytest
import soundfile
from synthetic_motions import swaying

from choreograph.core.errors import ParameterError
from choreograph.view.sound import COUNT_HZ, COUNT_ONE_HZ, Clicks, song_part
from choreograph.view.video import write_video

BEATS_S = (0.1, 0.52, 0.93, 1.4, 1.777)
NUMBERS = (3, 1, 2, 3, 1)


@pytest.fixture(scope="module")
def songs(tmp_path_factory) -> Path:
    """Two loud songs: noise at full scale, and chords with fades."""
    folder = tmp_path_factory.mktemp("songs")
    rng = np.random.default_rng(0)
    time_s = np.arange(3 * 44100) / 44100
    soundfile.write(folder / "noise.wav", rng.uniform(-1, 1, (3 * 44100, 2)), 44100)
    chord = sum(np.sin(2 * np.pi * hz * time_s) for hz in (220.0, 277.2, 329.6)) / 3
    soundfile.write(folder / "chords.wav", chord * np.sin(3 * time_s), 44100)
    return folder


def heard(samples: np.ndarray, rate_hz: int) -> tuple[np.ndarray, np.ndarray]:
    """Times of the clicks in seconds, and whether each is the higher one."""
    mono = samples.mean(axis=1)
    time_s = np.arange(round(0.04 * rate_hz)) / rate_hz
    strength = []
    for pitch_hz in (COUNT_HZ, COUNT_ONE_HZ):
        template = np.exp(-time_s / 0.012 - 2j * np.pi * pitch_hz * time_s)
        strength.append(np.abs(np.correlate(mono, np.conj(template), mode="valid")))
    loudest = np.max(strength, axis=0)
    peaks = []
    while loudest.max() > 0.5 * max(map(np.max, strength)):
        at = int(loudest.argmax())
        peaks.append(at)
        loudest[max(0, at - rate_hz // 10) : at + rate_hz // 10] = 0.0
    peaks = np.sort(peaks)
    return peaks / rate_hz, strength[1][peaks] > strength[0][peaks]


def decoded(path: Path) -> tuple[np.ndarray, int]:
    with av.open(str(path)) as container:
        rate_hz = container.streams.audio[0].rate
        frames = [frame for frame in container.decode(audio=0) if frame.pts is not None and frame.pts >= 0]
        return np.concatenate([frame.to_ndarray() for frame in frames], axis=1).T, rate_hz


@pytest.mark.parametrize("song", ["chords.wav", None])
def test_clicks_of_a_video_are_on_the_counts(songs, tmp_path, song):
    path = tmp_path / "dance.mp4"
    write_video(
        path, swaying(60, fps=30.0), song_path=songs / song if song else None,
        clicks=Clicks(BEATS_S, NUMBERS), size=(64, 48), fps=10,
    )  # fmt: skip
    samples, rate_hz = decoded(path)
    times_s, higher = heard(samples, rate_hz)
    np.testing.assert_allclose(times_s, BEATS_S, atol=0.01)
    assert higher.tolist() == [number == 1 for number in NUMBERS]
    assert np.abs(samples).max() < 1.0


def test_a_song_at_full_scale_does_not_clip_and_clicks_stay_audible(songs):
    part = Clicks(BEATS_S).over(song_part(songs / "noise.wav", start_s=0.5, duration_s=2.0))
    samples = np.concatenate(list(part.blocks))
    assert samples.shape == (part.n_frames, 2)
    assert np.abs(samples).max() <= 0.96
    times_s, higher = heard(samples, part.rate_hz)
    np.testing.assert_allclose(times_s, BEATS_S, atol=0.01)
    assert not higher.any()


def test_clicks_are_the_same_however_the_song_comes_in_blocks(songs):
    part = song_part(songs / "chords.wav", start_s=0.0, duration_s=2.0)
    whole = np.concatenate(list(part.blocks))
    clicks = Clicks((0.0, *BEATS_S, 1.9999, 5.0))
    mixes = []
    for size in (777, len(whole)):
        blocks = (whole[i : i + size] for i in range(0, len(whole), size))
        cut = type(part)(part.rate_hz, part.n_channels, part.n_frames, blocks)
        mixes.append(np.concatenate(list(clicks.over(cut).blocks)))
    np.testing.assert_array_equal(*mixes)


def test_a_song_without_beats_keeps_its_sound(songs):
    part = song_part(songs / "chords.wav", start_s=0.0, duration_s=1.0)
    whole = np.concatenate(list(part.blocks))
    again = song_part(songs / "chords.wav", start_s=0.0, duration_s=1.0)
    np.testing.assert_allclose(np.concatenate(list(Clicks(()).over(again).blocks)), 0.5 * whole, atol=1e-7)


@pytest.mark.parametrize(
    ("times_s", "numbers", "message"),
    [
        ((1.0, 0.5), (), "increasing"),
        ((float("nan"),), (), "finite"),
        ((0.5, 1.0), (1,), "number for each of 2 clicks"),
    ],
)
def test_wrong_counts_are_refused(times_s, numbers, message):
    with pytest.raises(ParameterError, match=message):
        Clicks(times_s, numbers)
