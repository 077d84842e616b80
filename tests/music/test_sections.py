"""Sections of synthesised songs are found."""

import numpy as np
import pytest

from choreograph.core.timebase import SAMPLE_RATE_HZ
from choreograph.music.form import song_sections
from choreograph.music.spectral import spectral_features
from content.songs.synthesis.song import render_song

pytestmark = pytest.mark.slow


def true_labels(song, at_s):
    bars = song.bar_times_s
    starts_s = [bars[section.first_bar] for section in song.sections]
    names = [section.name for section in song.sections]
    return np.array([names[i] for i in np.searchsorted(starts_s, at_s, side="right") - 1])


def same_label(labels):
    return (labels[:, None] == labels)[np.triu_indices(len(labels), 1)]


def pair_f(found, true):
    one, other = same_label(found), same_label(true)
    return 2 * (one & other).sum() / (one.sum() + other.sum())


@pytest.mark.parametrize(("genre", "bpm", "seed"), [("cha-cha", 118.0, 41), ("waltz", 96.0, 42)])
def test_sections_of_songs_it_was_not_tuned_on(genre, bpm, seed):
    song = render_song(genre, bpm=bpm, duration_s=110.0, seed=seed)
    mono = song.samples.mean(axis=1)[::2]
    beats_s = song.beat_times_s[song.beat_times_s < len(mono) / SAMPLE_RATE_HZ]
    sections = song_sections(spectral_features(mono, beats_s), beats_s)
    bounds_s, labels = sections.bounds_s, sections.labels
    assert len(bounds_s) == len(labels) + 1 and (np.diff(bounds_s) > 0).all()
    assert set(bounds_s) <= set(beats_s) and (labels[1:] != labels[:-1]).all()
    at_s = (beats_s[:-1] + beats_s[1:]) / 2
    found, true = labels[np.searchsorted(bounds_s, at_s, side="right") - 1], true_labels(song, at_s)
    shuffled = np.random.default_rng(0).permutation(found)
    assert pair_f(found, true) > max(pair_f(np.zeros(len(true)), true), pair_f(shuffled, true)) + 0.1


def test_a_song_of_few_beats_has_no_sections():
    noise = np.random.default_rng(0).normal(size=3 * SAMPLE_RATE_HZ)
    for beats_s in (np.zeros(0), np.arange(0.1, 2.9, 0.4)):
        sections = song_sections(spectral_features(noise, beats_s), beats_s)
        assert len(sections) == len(sections.bounds_s) == 0


def test_sections_begin_on_downbeats_and_last():
    song = render_song("house", bpm=122.0, duration_s=80.0, seed=8100)
    mono = song.samples.mean(axis=1)[::2]
    beats_s = song.beat_times_s[song.beat_times_s < len(mono) / SAMPLE_RATE_HZ]
    downbeats_s = beats_s[::4]
    sections = song_sections(spectral_features(mono, beats_s), beats_s, downbeat_times_s=downbeats_s)
    inner_s = sections.bounds_s[1:-1]
    assert set(inner_s) <= set(downbeats_s) and len(sections) >= 2
    assert np.diff(sections.bounds_s).min() >= 6.0
    true_s = song.bar_times_s[[section.first_bar for section in song.sections[1:]]]
    bar_s = np.diff(song.bar_times_s).mean()
    assert np.mean(np.abs(inner_s[:, None] - true_s).min(axis=1) <= bar_s + 1e-6) > 0.5


@pytest.fixture(scope="module")
def spliced():
    """House and waltz with a splice at 18 s."""
    return [render_song(genre, duration_s=24.0, seed=6100) for genre in ("house", "waltz")]


@pytest.fixture(scope="module")
def spliced_mono(spliced):
    return np.concatenate([song.samples.mean(axis=1)[: 36 * SAMPLE_RATE_HZ : 2] for song in spliced])


@pytest.fixture(scope="module")
def spliced_features(spliced_mono):
    """Features at beats a quarter of a second apart, and these beats."""
    beats_s = np.arange(0.2, 35.8, 0.25)
    return spectral_features(spliced_mono, beats_s), beats_s


def test_a_splice_is_a_border(spliced, spliced_mono):
    beats_s = np.concatenate(
        [song.beat_times_s[song.beat_times_s < 18] + 18 * i for i, song in enumerate(spliced)]
    )
    bars_s = np.concatenate(
        [song.bar_times_s[song.bar_times_s < 18] + 18 * i for i, song in enumerate(spliced)]
    )
    sections = song_sections(spectral_features(spliced_mono, beats_s), beats_s, downbeat_times_s=bars_s)
    border = int(np.abs(sections.bounds_s - 18).argmin())
    assert abs(sections.bounds_s[border] - 18) < 2
    assert not set(sections.labels[:border]) & set(sections.labels[border:])


def plain_and_with_change(
    features, beats_s, late_s: float, *more_s: float
) -> tuple[np.ndarray, int, np.ndarray, np.ndarray]:
    """Bounds, which of them is at a splice, bounds with changes so far from it, and those changes."""
    plain_s = song_sections(features, beats_s).bounds_s
    border = int(np.abs(plain_s[1:-1] - 18).argmin()) + 1
    away_s = np.abs(beats_s[:, None] - plain_s[border] - np.array([late_s, *more_s]))
    changes_s = beats_s[away_s.argmin(axis=0)]
    return (
        plain_s,
        border,
        song_sections(features, beats_s, change_times_s=changes_s).bounds_s,
        changes_s,
    )


@pytest.mark.parametrize(
    ("late_s", "at_change", "stays"),
    [(2.0, True, False), (3.5, True, False), (1.0, False, True), (5.0, True, True)],
)
def test_there_is_a_border_where_other_music_is_known_to_begin(spliced_features, late_s, at_change, stays):
    plain_s, border, found_s, changes_s = plain_and_with_change(*spliced_features, late_s)
    assert (np.abs(found_s - changes_s[0]).min() < 0.01) == at_change
    assert (np.abs(found_s - plain_s[border]).min() < 0.01) == stays


def test_a_border_at_one_change_is_not_moved_to_the_next(spliced_features):
    plain_s, _, found_s, _ = plain_and_with_change(*spliced_features, 0.0, 2.0)
    np.testing.assert_allclose(found_s, plain_s)
