"""Drums have an immediate onset, voices are in tune, and neither clicks."""

from __future__ import annotations

import numpy as np
import pytest

from content.songs.synthesis.mixing import ducking_gain, loudness_lufs, pan_stereo
from content.songs.synthesis.sounds import DRUMS, RATE_HZ, VARIANTS, VOICES, drum_hit, render_note


@pytest.mark.parametrize("name", DRUMS)
def test_a_hit_begins_on_its_first_samples_and_ends_softly(name):
    sound = drum_hit(name)
    assert np.abs(sound).max() == pytest.approx(1.0)
    assert np.abs(sound[: RATE_HZ // 100]).max() > 0.15, "most of it comes later than 10 ms"
    assert abs(sound[-1]) < 1e-3
    assert abs(sound.mean()) < 0.03
    assert not np.array_equal(sound, drum_hit(name, 1)[: len(sound)])
    assert VARIANTS > 1


@pytest.mark.parametrize("name", VOICES)
@pytest.mark.parametrize("midi", [45, 76])
def test_a_note_is_in_tune(name, midi):
    sound = render_note(name, midi, 0.9, 0.8)
    size = 1 << 18
    spectrum = np.abs(np.fft.rfft(sound * np.hanning(len(sound)), size)) ** 2
    hz = np.fft.rfftfreq(size, 1 / RATE_HZ)
    wanted = 440.0 * 2 ** ((midi - 69) / 12)
    near = (hz > wanted * 0.97) & (hz < wanted * 1.03)
    centroid = (hz[near] * spectrum[near]).sum() / spectrum[near].sum()
    assert 1200 * abs(np.log2(centroid / wanted)) < 12.0
    partials = np.abs(2.0 * hz / wanted % 1.0 - 0.5) > 0.4  # or halves, of FM
    assert spectrum[partials].sum() > 0.8 * spectrum[(hz > 30)].sum()


@pytest.mark.parametrize("name", VOICES)
def test_a_note_starts_and_ends_at_rest(name):
    sound = render_note(name, 60, 0.2, 0.9)
    assert abs(sound[0]) < 0.05 and abs(sound[-1]) < 1e-3
    assert np.isfinite(sound).all()
    assert 0.2 < np.abs(sound).max() < 3.0
    assert np.array_equal(sound, render_note(name, 60, 0.2, 0.9))


def test_velocity_brightens():
    def centroid(sound):
        power = np.abs(np.fft.rfft(sound)) ** 2
        return (np.fft.rfftfreq(len(sound), 1 / RATE_HZ) * power).sum() / power.sum()

    for name in ("piano", "stab", "electric piano", "brass"):
        assert centroid(render_note(name, 57, 0.5, 1.0)) > 1.05 * centroid(render_note(name, 57, 0.5, 0.25))


def test_loudness_of_a_known_tone():
    """BS.1770: a stereo sine of 997 Hz at -20 dBFS peak reads -20 LUFS (-23 in one channel)."""
    tone = 0.1 * np.sin(2 * np.pi * 997 * np.arange(5 * RATE_HZ) / RATE_HZ)
    assert loudness_lufs(np.stack([tone, tone], 1)) == pytest.approx(-20.0, abs=0.15)
    assert loudness_lufs(np.stack([tone, 0 * tone], 1)) == pytest.approx(-23.0, abs=0.15)
    assert loudness_lufs(np.zeros((RATE_HZ, 2))) == -70.0


def test_width_leaves_the_mono_sum_alone():
    track = np.random.default_rng(0).standard_normal(5000).astype(np.float32)
    left, right = pan_stereo(track, 0.0, 1.0)
    assert left + right == pytest.approx(np.sqrt(2.0) * track, abs=1e-5)
    assert np.abs(left - right).max() > 0.1


def test_ducking_dips_at_kicks_and_recovers():
    gain = ducking_gain(RATE_HZ, np.array([1000, 30000]), 0.5)
    assert gain[999] == 1.0 and gain.min() == pytest.approx(0.5, abs=0.02)
    assert gain[25000] > 0.99 and np.abs(np.diff(gain)).max() < 0.02
