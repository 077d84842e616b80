"""Sections of synthesised songs are found."""

import numpy as np
import pytest

from choreograph.features.sections import song_sections
from choreograph.synthesis.songs import render_song
from choreograph.timebase import SAMPLE_RATE_HZ

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
    sections = song_sections(mono, beats_s)
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
        sections = song_sections(noise, beats_s)
        assert len(sections) == len(sections.bounds_s) == 0
