"""Phrases of synthesised songs of known form, and which of them repeat others."""

from itertools import pairwise

import librosa
import numpy as np
import pytest

from choreograph.core.counts import NO_COUNTS, make_counts, numbers_in_bar
from choreograph.core.timebase import SAMPLE_RATE_HZ
from choreograph.evaluation.metrics.structure import repeat_f
from choreograph.music.form import (
    CountDistances,
    Form,
    Sections,
    _median,
    _merged,
    phrase_bounds_s,
    song_form,
    song_sections,
)
from choreograph.music.spectral import SPECTRAL_DIM, spectral_features
from content.songs.known_forms import HELD_OUT_FORMS
from research.song_forms import ids_of

N_COUNTS = 16  # in a phrase


def planted(letters: str, noise: float = 0.1) -> tuple[np.ndarray, np.ndarray]:
    """Random features (Q - 1, 87) of phrases, equal for equal letters up to noise, and the times (Q,)."""
    rng = np.random.default_rng(3)
    phrases = {letter: rng.normal(size=(N_COUNTS, SPECTRAL_DIM)) for letter in sorted(set(letters))}
    features = np.concatenate([phrases[letter] for letter in letters])
    features += noise * rng.normal(size=features.shape)
    return features, 0.5 + 0.5 * np.arange(len(features) + 1)


def form_of(letters: str) -> Form:
    features, times_s = planted(letters)
    counts = make_counts(times_s, numbers_in_bar(len(times_s), 4), 4)
    return song_form(features, times_s, counts, Sections(times_s[[0, -1]], np.zeros(1, np.int64)))


@pytest.mark.parametrize("letters", ["ABAB", "AABA", "AAAA", "ABACA", "ABCD"])
def test_a_phrase_repeats_the_first_one_with_its_music(letters):
    form = form_of(letters)
    assert form.labels == tuple(letters.index(letter) for letter in letters)
    assert [phrase.n_counts for phrase in form.phrases] == [N_COUNTS] * len(letters)


def test_phrases_follow_each_other_without_gaps():
    form = form_of("ABAB")
    assert form.phrases[0].start_s == 0.5 and form.phrases[-1].end_s == 0.5 + 0.5 * 64
    assert all(one.end_s == other.start_s for one, other in pairwise(form.phrases))


@pytest.mark.parametrize("missing", [1, 3])
def test_the_last_phrase_repeats_another_one_without_its_end(missing):
    features, times_s = planted("ABA")
    features, times_s = features[:-missing], times_s[:-missing]
    counts = make_counts(times_s, numbers_in_bar(len(times_s), 4), 4)
    form = song_form(features, times_s, counts, Sections(times_s[[0, -1]], np.zeros(1, np.int64)))
    assert [phrase.n_counts for phrase in form.phrases] == [N_COUNTS, N_COUNTS, N_COUNTS - missing]
    assert form.labels == (0, 1, 0)


def test_a_song_without_bars_or_counts_has_no_phrases():
    features, times_s = planted("AB")
    without_bars = make_counts(times_s, np.zeros(len(times_s), int), 0)
    sections = song_sections(features, times_s)
    assert song_form(features, times_s, without_bars, sections) == Form.empty()
    no_sections = song_sections(features[:0], np.zeros(0))
    assert song_form(features[:0], np.zeros(0), NO_COUNTS, no_sections) == Form.empty()


def test_the_last_count_is_compared_if_it_ends_in_the_song():
    counts = make_counts([0.5, 1.0, 1.5, 2.0], [1, 2, 3, 4], 4)
    assert phrase_bounds_s(counts, 3.0).tolist() == [0.5, 1.0, 1.5, 2.0, 2.5]
    assert phrase_bounds_s(counts, 2.2).tolist() == [0.5, 1.0, 1.5, 2.0]
    assert len(phrase_bounds_s(NO_COUNTS, 3.0)) == 0


def test_distances_of_a_long_song_are_those_of_its_parts():
    """1,632 counts are computed in blocks. Their median is that of the 96 counts, which are repeated."""
    features, _ = planted("ABACAB")
    away = CountDistances(features).rows(0, len(features))
    assert np.median(away) == pytest.approx(1.0, abs=1e-9) and np.allclose(away, away.T)
    long = CountDistances(np.tile(features, (17, 1)))
    wanted = np.tile(away, (17, 17))
    np.testing.assert_allclose(long.rows(370, 800, slice(2, 190)), wanted[370:800, 2:190], atol=1e-6)
    np.testing.assert_allclose(long.rows(1620, 1632), wanted[1620:], atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("song", HELD_OUT_FORMS[1:14:4], ids=lambda song: song.name)
def test_repeats_and_borders_of_held_out_songs(song):
    audio = song.render()
    mono = audio.samples.mean(axis=1)[::2]
    bounds_s = phrase_bounds_s(audio.counts, len(mono) / SAMPLE_RATE_HZ)
    features = spectral_features(mono, bounds_s)
    sections = song_sections(features[: len(audio.counts) - 1], audio.counts.times_s)
    form = song_form(features, bounds_s, audio.counts, sections)
    assert repeat_f(ids_of(form, audio.counts.times_s), audio.ids) >= 0.9
    starts_s = [phrase.start_s for phrase in form.phrases[1:]]
    np.testing.assert_allclose(starts_s, audio.borders_s)


@pytest.mark.parametrize("n_parts", [1, 2, 9, 60])
def test_neighbours_are_merged_as_librosas_segmentation_merges_them(n_parts):
    rows = np.random.default_rng(n_parts).normal(size=(60, 20))
    theirs = np.unique(librosa.segment.agglomerative(rows.T, n_parts))
    np.testing.assert_array_equal(_merged(rows, n_parts), theirs)


@pytest.mark.parametrize("shape", [(1, 1), (2, 2), (3, 3), (40, 40), (301, 301)])
@pytest.mark.parametrize("n_values", [0, 1, 3])
def test_the_median_is_that_of_numpy(shape, n_values):
    rng = np.random.default_rng(0)
    values = rng.random(shape) if n_values == 0 else rng.integers(0, n_values, shape).astype(float)
    blocks = np.array_split(values, min(3, len(values)))
    for bounds in ((0.4, 0.6), (-1.0, 5.0), (0.0, 0.1), (7.0, 8.0)):
        assert _median(lambda: blocks, *bounds) == np.median(values)
