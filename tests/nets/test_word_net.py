"""The motion-word network: root frame, initialisation, loss, training and storage."""

import numpy as np
import pytest
import torch
from synthetic_motions import swaying

from choreograph.core.errors import ParameterError
from choreograph.library.vocabulary import segment_words
from choreograph.motion import body as pose
from choreograph.motion import rotations as rot
from choreograph.motion.body import body_pos_m, mirrored
from choreograph.nets.configs import WORD_DIM, word_config
from choreograph.nets.training import TrainingContext
from choreograph.nets.words import (
    AugmentedWords,
    WordNet,
    WordTake,
    augmented_words,
    clips_to_root_frame,
    mean_joint_distance_m,
    train_word_net,
    word_loss,
)

pytestmark = pytest.mark.slow

FPS = 30.0


def _take(seed=0, seconds=20):
    starts = np.arange(0.5, seconds - 1, 0.5)
    body = body_pos_m(swaying(int(seconds * FPS), fps=FPS, seed=seed))
    return WordTake(f"take-{seed}", body, FPS, starts, starts + 0.5)


TAKES = [_take(seed) for seed in range(4)]


@pytest.fixture(scope="module")
def trained():
    return train_word_net(TAKES[:3], word_config("tiny"), seed=0)


@pytest.mark.parametrize("preset", ["tiny", "small", "paper"])
def test_shapes_and_gradients_of_every_size(preset):
    net = WordNet(word_config(preset))
    batch = augmented_words(TAKES, 4, np.random.default_rng(0))
    assert net(batch.words).shape == (4, WORD_DIM)
    word_loss(net, batch).backward()
    for name, parameter in net.named_parameters():
        assert parameter.grad is not None and torch.isfinite(parameter.grad).all(), name
    body = batch.words.clone().requires_grad_()  # the rollout's loss goes through to the positions
    net(body).square().sum().backward()
    assert body.grad.abs().sum() > 0


def test_words_that_are_copied_together_are_those_copied_one_by_one():
    together = augmented_words(TAKES, 40, np.random.default_rng(7))
    alone = augmented_words(TAKES, 40, np.random.default_rng(7), at_once=1)
    for name in ("words", "first", "second"):
        assert torch.equal(getattr(together, name), getattr(alone, name))


def test_the_root_frame_is_that_of_the_arrays():
    words = augmented_words(TAKES, 5, np.random.default_rng(1)).words
    wanted = pose.clips_to_root_frame(words.numpy().astype(np.float64))
    np.testing.assert_allclose(clips_to_root_frame(words).numpy(), wanted, atol=1e-5)


def test_words_are_mirrored_as_often_as_configured():
    never, always = (
        augmented_words(TAKES, 5, np.random.default_rng(1), mirrored_share=share).words.numpy()
        for share in (0.0, 1.0)
    )
    np.testing.assert_allclose(always, mirrored(never), atol=1e-6)
    assert np.abs(always - never).max() > 0.1


def test_embeddings_do_not_depend_on_where_a_word_is_danced(trained):
    words = augmented_words(TAKES, 6, np.random.default_rng(2)).words.numpy()
    moved = rot.rotate(rot.about_y(2.1), words.astype(np.float64)) + np.array([3.0, 0.0, -1.0])
    np.testing.assert_allclose(trained.embed(moved), trained.embed(words), atol=1e-4)
    np.testing.assert_allclose(trained.embed(mirrored(mirrored(words))), trained.embed(words), atol=1e-6)
    assert np.linalg.norm(trained.embed(mirrored(words)) - trained.embed(words), axis=1).min() > 0.02


def test_words_of_any_length_are_resampled_as_arrays_are(trained):
    body = TAKES[0].body_pos_m[30:48]  # 18 frames: 17 / 30 s
    words = segment_words(TAKES[0].body_pos_m, FPS, np.array([1.0, 47 / FPS])).body_pos_m
    with torch.no_grad():
        found = trained(torch.from_numpy(body[None].astype(np.float32)))
    np.testing.assert_allclose(found.numpy(), trained.embed(words), atol=1e-4)


def test_initialisation_keeps_the_distances_of_words():
    batch = augmented_words(TAKES, 150, np.random.default_rng(3))
    net = WordNet(word_config("tiny"))
    net.init_from_pca(batch.words)
    e = torch.from_numpy(net.embed(batch.words.numpy()))
    own = clips_to_root_frame(batch.words).flatten(1)
    root_mean_m = torch.cdist(own, own) / (13 * 21) ** 0.5
    torch.testing.assert_close(torch.cdist(e, e), root_mean_m, atol=2e-3, rtol=0)


def test_augmented_copies_are_similar_to_their_word_but_differ():
    batch = augmented_words(TAKES, 60, np.random.default_rng(4))
    own, first, second = (clips_to_root_frame(t) for t in (batch.words, batch.first, batch.second))
    near = (own - first).norm(dim=-1).mean(dim=(1, 2))
    far = mean_joint_distance_m(own)
    assert 0.005 < near.median() < 0.3 * far[far > 0].median()
    assert (first - second).norm(dim=-1).mean(dim=(1, 2)).min() > 0.003


def test_the_distance_of_words_is_the_mean_over_frames_and_joints():
    words = torch.zeros(2, 13, 21, 3)
    words[1, :, :7, 1] = 0.3
    torch.testing.assert_close(mean_joint_distance_m(words), torch.tensor([[0.0, 0.1], [0.1, 0.0]]))


class SyntheticNet(torch.nn.Module):
    """A known function of the words instead of a trained embedding."""

    def __init__(self, embed):
        super().__init__()
        self.config = word_config("tiny")
        self.embed = embed

    def forward(self, body):
        return self.embed(clips_to_root_frame(body).flatten(1) / (13 * 21) ** 0.5)


def test_the_loss_is_low_only_for_near_copies_and_true_distances():
    words = augmented_words(TAKES, 16, np.random.default_rng(5)).words
    same = AugmentedWords(words, words, words)
    right = word_loss(SyntheticNet(lambda e: e), same)
    assert word_loss(SyntheticNet(lambda e: 0 * e), same) > right + 1  # all the same
    assert word_loss(SyntheticNet(lambda e: 5 * e), same) > right + 1  # all too far apart
    assert word_loss(SyntheticNet(lambda e: e), AugmentedWords(words, words, words.flip(0))) > right + 1


def test_trained_embeddings_of_copies_are_nearest_to_their_words(trained):
    initial = WordNet(word_config("tiny"))
    initial.init_from_pca(augmented_words(TAKES[:3], 200, np.random.default_rng(0)).words)
    batch = augmented_words(TAKES[3:], 100, np.random.default_rng(6))  # a held-out dance
    with torch.no_grad():
        before, after = word_loss(initial, batch), word_loss(trained, batch)
    assert after < before
    words, found = batch.words.numpy(), trained.embed(batch.first.numpy())
    nearest = ((found[:, None] - trained.embed(words)[None]) ** 2).sum(-1).argmin(axis=1)
    distance_m = np.linalg.norm(words[nearest] - words, axis=-1).mean(axis=(1, 2))
    assert np.mean(distance_m < 0.02) > 0.8  # the word itself or one that looks the same


def test_training_is_deterministic_and_resumes(tmp_path):
    config = word_config("tiny", steps=6)
    whole = train_word_net(TAKES, config, seed=3)
    again = train_word_net(TAKES, config, seed=3, context=TrainingContext(folder=tmp_path))
    resumed = train_word_net(TAKES, config, seed=3, context=TrainingContext(folder=tmp_path, resume=True))
    for name, weights in whole.state_dict().items():
        torch.testing.assert_close(again.state_dict()[name], weights)
        torch.testing.assert_close(resumed.state_dict()[name], weights)
    other = train_word_net(TAKES, config, seed=4)
    assert not torch.equal(other.linear.weight, whole.linear.weight)


def test_weights_come_back_and_are_loaded_as_pretrained(trained):
    arrays, config = trained.to_arrays()
    again = WordNet.from_arrays(arrays, config)
    words = augmented_words(TAKES, 3, np.random.default_rng(7)).words.numpy()
    np.testing.assert_array_equal(again.embed(words), trained.embed(words))
    continued = train_word_net(
        TAKES, word_config("tiny", steps=1, learning_rate=0.0), seed=9, pretrained=arrays
    )
    np.testing.assert_array_equal(continued.embed(words), trained.embed(words))
    with pytest.raises(ParameterError, match="preset"):
        train_word_net(TAKES, word_config("small", steps=1), seed=0, pretrained=arrays)


def test_malformed_input_is_refused(trained):
    assert trained.embed(np.zeros((0, 13, 21, 3))).shape == (0, WORD_DIM)
    for words in (np.zeros((2, 12, 21, 3)), np.zeros((13, 21, 3)), np.full((1, 13, 21, 3), np.nan)):
        with pytest.raises(ParameterError):
            trained.embed(words)
    with pytest.raises(ParameterError, match="two motion words"):
        train_word_net([], word_config("tiny"), seed=0)
    one = WordTake("one", TAKES[0].body_pos_m, FPS, np.array([1.0]), np.array([1.5]))
    with pytest.raises(ParameterError, match="two motion words"):
        train_word_net([one], word_config("tiny"), seed=0)
    for changes in ({"same_m": 0.0}, {"contrast_weight": -1.0}, {"steps": 0}, {"batch_size": 1}, {"x": 1}):
        with pytest.raises(ParameterError):
            word_config("small", **changes)
