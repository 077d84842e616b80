"""Phrases of synthesised songs of known form, and which of them repeat others."""

from itertools import pairwise

import numpy as np
import pytest

from choreograph.core.counts import NO_COUNTS, make_counts, numbers_in_bar
from choreograph.music.form import Form, Sections, song_form, song_sections
from choreograph.music.spectral import SPECTRAL_DIM

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
    return song_form(features, counts, Sections(times_s[[0, -1]], np.zeros(1, np.int64)))


@pytest.mark.parametrize("letters", ["ABAB", "AABA", "AAAA", "ABACA", "ABCD"])
def test_a_phrase_repeats_the_first_one_with_its_music(letters):
    form = form_of(letters)
    assert form.labels == tuple(letters.index(letter) for letter in letters)
    assert [phrase.n_counts for phrase in form.phrases] == [N_COUNTS] * len(letters)


def test_phrases_follow_each_other_without_gaps():
    form = form_of("ABAB")
    assert form.phrases[0].start_s == 0.5 and form.phrases[-1].end_s == 0.5 + 0.5 * 64
    assert all(one.end_s == other.start_s for one, other in pairwise(form.phrases))


def test_a_song_without_bars_or_counts_has_no_phrases():
    features, times_s = planted("AB")
    without_bars = make_counts(times_s, np.zeros(len(times_s), int), 0)
    sections = song_sections(features, times_s)
    assert song_form(features, without_bars, sections) == Form.empty()
    assert (
        song_form(np.zeros((0, SPECTRAL_DIM)), NO_COUNTS, song_sections(features[:0], np.zeros(0)))
        == Form.empty()
    )
