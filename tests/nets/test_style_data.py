"""Training data of the style networks."""

import numpy as np
import pytest
from synthetic_style_takes import genre_song, genre_take

from choreograph.core.errors import ParameterError
from choreograph.motion.body import mirrored
from choreograph.music.rhythm import METRE, PATTERN, RHYTHM_DIM, TEMPO
from choreograph.nets.configs import style_config
from choreograph.nets.style import centred
from choreograph.nets.style_training import MelChange, StyleData, augment_mel, augment_rhythm, count_beats

RNG = np.random.default_rng(0)


def test_augmentation_changes_copies_only():
    mel, rhythm = RNG.normal(size=(4, 240, 96)).astype("f"), RNG.random((4, RHYTHM_DIM)).astype("f")
    before = mel.copy(), rhythm.copy()
    changes = MelChange.drawn(len(mel), RNG)
    for augmented, original in ((augment_mel(mel, changes), mel), (augment_rhythm(rhythm, RNG), rhythm)):
        assert augmented.shape == original.shape
        assert np.isfinite(augmented).all()
        assert not np.allclose(augmented, original)
    np.testing.assert_array_equal(before[0], mel)
    np.testing.assert_array_equal(before[1], rhythm)


def test_without_mel_the_same_is_drawn():
    data = StyleData([genre_take("a", 0), genre_take("b", 1)], [genre_song("c", 2)])
    with_mel, without = (data.batch(8, np.random.default_rng(3), with_mel=mel) for mel in (True, False))
    assert with_mel.mel.shape == (16, 240, 96) and without.mel.shape == (16, 0, 96)
    for field in ("rhythm", "body", "n_beats", "song", "genre"):
        np.testing.assert_array_equal(getattr(with_mel, field), getattr(without, field))


def test_tempo_moves_a_little_and_is_hidden_now_and_then():
    rhythm = np.zeros((2000, RHYTHM_DIM), np.float32)
    rhythm[:, TEMPO.start + 10] = rhythm[:, METRE] = rhythm[:, PATTERN] = 1.0
    out = augment_rhythm(rhythm, np.random.default_rng(0))
    peak = out[:, TEMPO].argmax(axis=1)
    hidden = ~out[:, TEMPO].any(axis=1)
    assert set(peak[~hidden]) == {9, 10, 11} and 0.1 < hidden.mean() < 0.2
    assert not out[hidden][:, METRE].any() and out[hidden][:, PATTERN].any(axis=1).all()
    assert 0.1 < np.mean(~out[:, PATTERN].any(axis=1)) < 0.2


def test_songs_without_takes_come_behind_the_pairs():
    data = StyleData([genre_take("a", 0), genre_take("b", 1)], [genre_song("c", 2)])
    batch = data.batch(8, np.random.default_rng(0))
    assert len(batch.mel) == len(batch.rhythm) == len(batch.genre) == 16
    assert len(batch.body) == len(batch.n_beats) == len(batch.song) == 8
    assert set(np.asarray(batch.genre[8:])) == {2} and set(np.asarray(batch.genre[:8])) == {0, 1}


def test_beats_are_counted_in_half_open_segments():
    beats = np.array([0.0, 1.0, 4.0, 4.5, 9.0])
    np.testing.assert_array_equal(count_beats(beats, np.array([0.0, 0.5, 20.0])), [2, 2, 0])


def test_mirroring_twice_is_the_identity():
    body = RNG.normal(size=(5, 21, 3))
    np.testing.assert_array_equal(mirrored(mirrored(body)), body)


def test_one_song_is_too_few():
    with pytest.raises(ParameterError, match="two songs"):
        StyleData([genre_take("a", 0)])


@pytest.mark.parametrize(
    "changes",
    [
        {"loss": "x"},
        {"music_inputs": "x"},
        {"steps": 0},
        {"batch_size": 1},
        {"epochs": -1},
        {"schedule": "x"},
    ],
)
def test_impossible_configurations_are_refused(changes):
    with pytest.raises(ParameterError):
        style_config("tiny", **changes)


def test_samples_as_they_are_and_by_the_length_of_the_takes():
    long, short = genre_take("a", 0, duration_s=40), genre_take("b", 1, duration_s=6)
    data = StyleData([long, short], balanced_genres=False)
    batch = data.batch(64, np.random.default_rng(0), augmented=False)
    of_short = np.asarray(batch.song) == 1
    assert 0 < of_short.mean() < 0.2  # 5 of 78 segments
    assert data.n_segments == pytest.approx(46 / 4)
    starts = np.stack([long.log_mel[30 * i : 30 * i + 240] for i in range(long.n_starts)])
    mel = np.asarray(batch.mel)[~of_short]
    assert all((starts == one).all(axis=(1, 2)).any() for one in mel)
    body = np.asarray(batch.body)[~of_short]
    np.testing.assert_array_equal(body, centred(body))


def test_more_songs_take_more_steps():
    assert style_config("tiny", n_songs=64).steps == 2 * style_config("tiny", n_songs=10).steps
