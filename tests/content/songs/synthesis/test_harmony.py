"""Chords by name, voice leading, and motifs that fit them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from choreograph.core.errors import ParameterError
from content.songs.synthesis.song import STYLES
from content.songs.synthesis.style import (
    Motif,
    best_scale,
    chord,
    progression,
    realise_motif,
    scale_notes,
    shared_tones,
    voice_chords,
)


def test_symbols_are_read():
    assert chord("Am7").pitch_classes == (9, 0, 4, 7)
    assert chord("Bbmaj7", tonic=2).pitch_classes == (0, 4, 7, 11)
    assert chord("F#dim7").pitch_classes == (6, 9, 0, 3)


@pytest.mark.parametrize("symbol", ["H7", "Cmaj13", "", "am"])
def test_other_symbols_are_refused(symbol):
    with pytest.raises(ParameterError, match="chord symbol"):
        chord(symbol)


def test_bars_may_hold_two_chords():
    bars = progression("C Am7/Dm7", 0)
    assert [len(bar) for bar in bars] == [1, 2]


@given(
    st.integers(0, 11), st.sampled_from([text for style in STYLES.values() for text in style.progressions])
)
def test_voices_hold_every_tone_and_move_little(tonic, text):
    chords = [chord for bar in progression(text, tonic) for chord in bar] * 2
    voicings = voice_chords(chords)
    for current, notes in zip(chords, voicings, strict=True):
        assert list(notes) == sorted(notes)
        sounding = {note % 12 for note in notes}
        assert sounding <= set(current.pitch_classes)
        assert {current.pitch_classes[0], current.pitch_classes[1]} <= sounding
        assert notes[0] >= 52 and notes[-1] <= 76
    for before, after in pairwise(voicings):
        steps = [min(abs(note - old) for old in before) for note in after]
        assert max(steps) <= 7 and np.mean(steps) <= 3.0


@given(st.integers(0, 10_000), st.integers(0, 11))
def test_melodies_rest_on_chord_tones(seed, tonic):
    rng = np.random.default_rng(seed)
    motif = Motif.drawn(("x---x-x-x---....", "x-x-..x-x-------"), rng)
    rows = [
        (i, 4 if motif.rhythm[i + 1 : i + 4] == "---" else 1, c)
        for i, c in enumerate(motif.rhythm)
        if c == "x"
    ]
    home = chord("Cm7", tonic)
    scale = scale_notes("minor", tonic, 0, 127)
    notes = realise_motif(motif, rows, [home] * len(rows), scale, 72.0, varied=False, cadence=True)
    assert all(note % 12 in {n % 12 for n in scale} for note in notes)
    assert notes[-1] % 12 in home.pitch_classes[:2]
    strong = [note for note, (step, steps, _) in zip(notes, rows, strict=True) if step % 8 == 0 or steps >= 4]
    assert all(note % 12 in home.pitch_classes for note in strong)
    assert max(notes) - min(notes) <= 26


def test_the_scale_is_the_chords_own():
    def chords(text):
        return [chord for bar in progression(text, 0) for chord in bar]

    assert best_scale(chords("Am Dm7 E7 Am"), ("minor", "harmonic minor", "major")) == (
        "harmonic minor",
        9,
    )
    assert best_scale(chords("C Am7 Dm7 G7"), ("major", "minor pentatonic")) == ("major", 0)
    assert best_scale(chords("Dm7 Em7 Dm7 Em7"), ("dorian", "mixolydian"))[1] in (2, 9)
    assert (
        shared_tones(chords("C Am7"), chords("Am7 C")) == 1.0 > shared_tones(chords("C"), chords("C#")) == 0.0
    )
