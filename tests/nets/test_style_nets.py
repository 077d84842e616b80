"""Style networks: shapes, what they learn from synthetic pairs, and storage."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from synthetic_style_takes import genre_song, genre_take

from choreograph.core.errors import ParameterError
from choreograph.music.rhythm import RHYTHM_DIM
from choreograph.nets.configs import style_config
from choreograph.nets.style import StyleNets, centred, rotated_about_y
from choreograph.nets.style_training import StyleData, pair_loss, train_style

pytestmark = pytest.mark.slow

RNG = np.random.default_rng(0)
TAKES = [genre_take(genre, number) for genre in "ab" for number in range(4)]


@pytest.mark.parametrize("loss", ["paper", "contrastive"])
@pytest.mark.parametrize("music_inputs", ["mel", "counts", "mel+counts"])
@pytest.mark.parametrize("preset", ["paper", "small", "tiny"])
def test_every_preset_runs_forward_and_backward(preset, music_inputs, loss):
    nets = StyleNets(style_config(preset, music_inputs=music_inputs, loss=loss))
    value = pair_loss(nets, StyleData(TAKES).batch(4, np.random.default_rng(0)))
    value.backward()
    for name, parameter in nets.named_parameters():
        assert parameter.grad is not None, name
        assert torch.isfinite(parameter.grad).all(), name


def test_synthetic_styles_are_retrieved_for_held_out_songs():
    held_out = [genre_take(genre, 99) for genre in "ab"]
    nets = train_style(TAKES, style_config("tiny", steps=60), seed=0)
    for song in held_out:
        music = nets.embed_music(song.log_mel, song.rhythm, np.arange(8)).mean(axis=0)
        distance = {
            dance.genre: np.linalg.norm(
                nets.embed_motion(dance.body_pos_m, np.arange(0, 160, 20)) - music, axis=1
            )
            for dance in held_out
        }
        own = distance.pop(song.genre)
        assert own.mean() < next(iter(distance.values())).mean()


def test_a_genre_that_nobody_dances_to_is_learned_from_songs():
    """Songs of a third genre come to lie together, away from the others, without a pair of theirs."""
    songs = [genre_song("c", number) for number in range(4)]
    nets = train_style(TAKES, style_config("tiny", steps=80), seed=0, songs=songs)

    def style(song):
        return nets.embed_music(song.log_mel, song.rhythm, np.arange(8)).mean(axis=0)

    unseen = style(genre_song("c", 99))
    own = np.linalg.norm(unseen - style(songs[0]))
    others = [np.linalg.norm(unseen - style(genre_take(genre, 99))) for genre in "ab"]
    assert own < 0.5 * min(others)


def test_training_is_deterministic_and_depends_on_the_seed():
    first, again, other = (
        train_style(TAKES, style_config("tiny", steps=3), seed=seed).to_arrays()[0] for seed in (1, 1, 2)
    )
    assert all(np.array_equal(first[name], again[name]) for name in first)
    assert not np.array_equal(first["music.linear.weight"], other["music.linear.weight"])


def test_weights_come_back_and_others_are_refused():
    nets = StyleNets(style_config("tiny"))
    arrays, config = nets.to_arrays()
    back = StyleNets.from_arrays(arrays, {**config, "conv_channels": list(config["conv_channels"])})
    mel, rhythm = RNG.normal(size=(400, 96)), RNG.normal(size=(14, RHYTHM_DIM))
    starts = np.arange(7)
    styles = nets.embed_music(mel, rhythm, starts)
    np.testing.assert_array_equal(styles, back.embed_music(mel, rhythm, starts))
    np.testing.assert_allclose(np.linalg.norm(styles, axis=1), 1.0, atol=1e-5)
    assert back.predict_beat_count(styles).shape == (7,)
    with pytest.raises(ParameterError):
        StyleNets.from_arrays(arrays, {**config, "gru_width": 5})
    with pytest.raises(ParameterError, match="music_inputs"):
        StyleNets.from_arrays(arrays, {**config, "music_inputs": "mel+rhythm"})
    with pytest.raises(ParameterError):
        StyleNets.from_arrays({**arrays, "rhythm_mean": np.zeros(261, np.float32)}, config)
    with pytest.raises(ParameterError):
        StyleNets.from_arrays(arrays, {**config, "colour": 5})


def test_a_song_shorter_than_a_segment_has_a_style():
    nets = StyleNets(style_config("tiny"))
    assert nets.embed_music(np.zeros((20, 96)), np.zeros((1, RHYTHM_DIM)), np.arange(1)).shape == (1, 32)
    assert nets.embed_motion(np.zeros((3, 21, 3)), np.zeros(1, int)).shape == (1, 32)
    assert nets.embed_motion(np.zeros((3, 21, 3)), np.zeros(0, int)).shape == (0, 32)


def test_style_of_motion_ignores_position_and_heading():
    nets = StyleNets(style_config("tiny"))
    body = TAKES[0].body_pos_m + RNG.normal(0, 0.05, (240, 21, 3)).astype(np.float32)
    moved = rotated_about_y(body[None], np.array([1.3]))[0] + np.array([2.0, 0.0, -1.0], np.float32)
    starts = np.array([0, 60])
    np.testing.assert_allclose(nets.embed_motion(body, starts), nets.embed_motion(moved, starts), atol=1e-4)
    hips = centred(moved[None, :80])[0, 40, [1, 2]]
    assert hips[0, 0] > hips[1, 0]
    assert hips[0, 2] == pytest.approx(hips[1, 2], abs=1e-5)
