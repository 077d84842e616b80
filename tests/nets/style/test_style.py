"""Style networks: shapes, collapse, what they learn from planted pairs, and their way into a file."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from choreograph.errors import ParameterError
from choreograph.features.tempogram import RHYTHM_DIM
from choreograph.motion.body import mirrored
from choreograph.nets.style.config import STYLE_DIM, style_config
from choreograph.nets.style.data import StyleData, StyleTake, augmented_mel, augmented_rhythm, count_beats
from choreograph.nets.style.losses import contrastive_loss, style_loss
from choreograph.nets.style.model import StyleNets, centred, turned
from choreograph.nets.style.train import pair_loss, train_style

RNG = np.random.default_rng(0)


def synthetic_take(genre: str, number: int, duration_s: int = 12) -> StyleTake:
    """Genres differ in the lag their rhythm repeats at and in how fast the arms swing."""
    rng = np.random.default_rng([number, ord(genre)])
    rate_hz, lag = {"a": (0.5, 20), "b": (2.0, 45)}[genre]
    rhythm = rng.normal(0, 0.1, (2 * duration_s + 1, 3, RHYTHM_DIM // 3))
    rhythm[:, :, lag - 3 : lag + 4] += 1.0
    body = np.zeros((20 * duration_s, 21, 3), np.float32)
    body[..., 1] = 1.0
    body[:, 1, 0], body[:, 2, 0] = 0.1, -0.1  # hips
    swing = np.sin(2 * np.pi * rate_hz * np.arange(20 * duration_s) / 20 + rng.uniform(0, 6))
    body[:, 15:, 2] += 0.3 * swing[:, None]
    return StyleTake(
        f"{genre}{number}",
        f"{genre}{number}",
        genre,
        rng.normal(-4, 2, (60 * duration_s, 96)).astype(np.float32),
        rhythm.reshape(len(rhythm), -1).astype(np.float32),
        body,
        np.arange(0.0, duration_s, 0.5 / rate_hz),
    )


TAKES = [synthetic_take(genre, number) for genre in "ab" for number in range(4)]


@pytest.mark.parametrize("loss", ["paper", "contrastive"])
@pytest.mark.parametrize("music_inputs", ["mel", "mel+rhythm"])
@pytest.mark.parametrize("preset", ["paper", "small", "tiny"])
def test_every_preset_runs_forward_and_backward(preset, music_inputs, loss):
    nets = StyleNets(style_config(preset, music_inputs=music_inputs, loss=loss))
    value = pair_loss(nets, StyleData(TAKES).batch(4, np.random.default_rng(0)))
    value.backward()
    for name, parameter in nets.named_parameters():
        assert parameter.grad is not None, name
        assert torch.isfinite(parameter.grad).all(), name


def test_constant_embeddings_minimise_the_papers_loss_but_not_contrast():
    same = torch.nn.functional.normalize(torch.ones(6, STYLE_DIM), dim=1)
    apart = torch.eye(6, STYLE_DIM)
    beats = torch.full((6,), 3.0)
    weights = {"style_weight": 1.0, "beat_weight": 1.0}
    assert style_loss(same, same, beats, beats, **weights) == pytest.approx(0.0, abs=1e-5)
    assert style_loss(same, same, beats + 2, beats, **weights) == pytest.approx(2.0, abs=1e-5)
    own = torch.eye(6, dtype=torch.bool)
    masks = {"positive": own, "negative": ~own, "temperature": 0.2}
    assert contrastive_loss(same, same, **masks) == pytest.approx(np.log(6), abs=1e-4)
    assert contrastive_loss(apart, apart, **masks) < 0.01


def test_contrast_without_negatives_is_zero():
    own = torch.eye(3, dtype=torch.bool)
    value = contrastive_loss(
        torch.eye(3), torch.eye(3), positive=own, negative=torch.zeros_like(own), temperature=0.2
    )
    assert value == 0.0


def test_synthetic_styles_are_found_by_songs_never_heard():
    held_out = [synthetic_take(genre, 99) for genre in "ab"]
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


def test_training_repeats_itself_from_its_seed():
    first, again, other = (
        train_style(TAKES, style_config("tiny", steps=3), seed=seed).to_arrays()[0] for seed in (1, 1, 2)
    )
    assert all(np.array_equal(first[name], again[name]) for name in first)
    assert not np.array_equal(first["music.linear.weight"], other["music.linear.weight"])


def test_weights_survive_a_file_and_others_are_refused():
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
    with pytest.raises(ParameterError):
        StyleNets.from_arrays(arrays, {**config, "colour": 5})


def test_a_song_shorter_than_a_segment_has_a_style():
    nets = StyleNets(style_config("tiny"))
    assert nets.embed_music(np.zeros((20, 96)), np.zeros((1, RHYTHM_DIM)), np.arange(1)).shape == (1, 32)
    assert nets.embed_motion(np.zeros((3, 21, 3)), np.zeros(1, int)).shape == (1, 32)
    assert nets.embed_motion(np.zeros((3, 21, 3)), np.zeros(0, int)).shape == (0, 32)


def test_style_of_motion_ignores_place_and_heading():
    nets = StyleNets(style_config("tiny"))
    body = TAKES[0].body_pos_m + RNG.normal(0, 0.05, (240, 21, 3)).astype(np.float32)
    moved = turned(body[None], np.array([1.3]))[0] + np.array([2.0, 0.0, -1.0], np.float32)
    starts = np.array([0, 60])
    np.testing.assert_allclose(nets.embed_motion(body, starts), nets.embed_motion(moved, starts), atol=1e-4)
    hips = centred(moved[None, :80])[0, 40, [1, 2]]
    assert hips[0, 0] > hips[1, 0]
    assert hips[0, 2] == pytest.approx(hips[1, 2], abs=1e-5)


def test_mirroring_twice_is_nothing():
    body = RNG.normal(size=(5, 21, 3))
    np.testing.assert_array_equal(mirrored(mirrored(body)), body)


def test_augmentation_changes_inputs_and_leaves_the_originals():
    mel, rhythm = RNG.normal(size=(4, 240, 96)).astype("f"), RNG.random((4, RHYTHM_DIM)).astype("f")
    before = mel.copy(), rhythm.copy()
    for augmented, original in ((augmented_mel(mel, RNG), mel), (augmented_rhythm(rhythm, RNG), rhythm)):
        assert augmented.shape == original.shape
        assert np.isfinite(augmented).all()
        assert not np.allclose(augmented, original)
    np.testing.assert_array_equal(before[0], mel)
    np.testing.assert_array_equal(before[1], rhythm)


def test_beats_are_counted_in_half_open_segments():
    beats = np.array([0.0, 1.0, 4.0, 4.5, 9.0])
    np.testing.assert_array_equal(count_beats(beats, np.array([0.0, 0.5, 20.0])), [2, 2, 0])


def test_one_song_is_too_few_and_options_are_checked():
    with pytest.raises(ParameterError, match="two songs"):
        StyleData(TAKES[:1])
    for preset, changes in (
        ("huge", {}),
        ("tiny", {"colour": 1}),
        ("tiny", {"loss": "x"}),
        ("tiny", {"steps": 0}),
    ):
        with pytest.raises(ParameterError):
            style_config(preset, **changes)
